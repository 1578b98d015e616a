"""User options of a run (values, methods, cases), and the folder of the experiment."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from validate.errors import ComparisonError, UsageError
from validate.parameters import describe, doubts, has_path, nearest_names, with_values
from validate.pipeline.experiment.experiment import Case, Experiment
from validate.pipeline.experiment.external import added_simulators
from validate.pipeline.experiment.law_solver import with_law
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.tree import valued
from validate.scene.mesh_files.abaqus_text import files_named
from validate.scene.mesh_files.third_party_meshes import SUFFIXES as FOREIGN

RECORDED = "recorded"  # the case that the experiment's own recording is
_MESHES = (".npz", *FOREIGN)
_LAYOUTS = (".fcsv", ".json")  # of landmarks, which place markers


@dataclass(frozen=True)
class Options:
    """What the user changed: values by path, methods to run (none: all), quick; `anyway`: predict
    with parameters that were not identifiable, too. `simulators` are command lines of
    external simulators that the experiment has as methods (`with_simulators`); all of them run.
    `case`: run this case alone beside the recorded one (`RECORDED`: none beside it)."""

    values: Mapping[str, str]
    methods: tuple[str, ...] = ()
    quick: bool = False
    anyway: bool = False
    simulators: tuple[str, ...] = ()
    case: str = ""


def configure(experiment: Experiment, options: Options) -> tuple[Any, dict[str, Method]]:
    """Parameters and chosen methods with the user's values; `UsageError` names the nearest."""
    known = set(experiment.methods)
    for name in options.methods:
        if name not in known:
            raise UsageError(f"unknown method '{name}'; {nearest_names(name, known)}")
    parameters = experiment.quick(experiment.parameters) if options.quick else experiment.parameters
    mine, _ = _split(options.values)
    methods = all_methods(experiment, options)
    added = added_simulators(methods, options.simulators)
    chosen = tuple(dict.fromkeys((*options.methods, *added))) if options.methods else methods
    picked = {name: methods[name] for name in chosen}
    given = with_values(parameters, mine)
    # A value of the scene that every method replaces by its own is not read
    for path, text in mine.items():
        own = [_changed(m).get(path) for m in picked.values()]
        read = (v is None or str(v) == text or str(v)[:2] in ("x ", "+ ", "- ") for v in own)
        if own and not any(read):
            followed = sorted({str(v)[3:] for v in own if str(v).startswith("as ")})
            instead = ", ".join((*followed, *(() if followed else (f"methods.NAME.{path}",))))
            raise UsageError(f"{path}: every method has a value of its own; set {instead}")
    return given, picked


def chosen_cases(experiment: Experiment, options: Options) -> tuple[Case, ...]:
    """Return the cases to run: all, or the one that is named, with every chosen method.

    Raises `UsageError` for an unknown name.
    """
    if not options.case:
        return experiment.cases
    require_case(experiment, options.case)
    chosen = [c for c in experiment.cases if c.name == options.case]
    return tuple(replace(c, methods=()) if options.methods else c for c in chosen)


def require_case(experiment: Experiment, name: str) -> None:
    """Raise `UsageError` where the experiment has no case of that name."""
    names = {c.name for c in experiment.cases}
    if name not in names | {RECORDED}:
        hint = nearest_names(name, names) if names else "the experiment has none"
        raise UsageError(f"no case '{name}' of {experiment.name}; {hint}")


def all_methods(experiment: Experiment, options: Options) -> dict[str, Method]:
    """Every method with the user's values, whether it is run or not: what identifies follows."""
    values = _split(options.values)[1]
    for path in values:
        if (name := path.partition(".")[0]) not in experiment.methods:
            near = nearest_names(name, set(experiment.methods))
            raise UsageError(f"methods.{path}: no method '{name}'; {near}")
    ours, theirs = _of_scenes(experiment, values)
    changed = dict(with_values(experiment.methods, ours))
    given: dict[str, dict[str, str]] = {}
    for path, text in theirs.items():
        name, _, inner = path.partition(".")
        if text != (changed[name].scene or {}).get(inner):
            given.setdefault(name, {})[inner] = text
    for name, texts in given.items():
        scene = {**(changed[name].scene or {}), **texts}
        scene = valued(experiment.parameters, scene, texts)
        changed[name] = replace(changed[name], scene=scene)
        if law := texts.get("material.law"):
            changed[name] = with_law(name, changed[name], law, experiment.methods)
    return changed


def _changed(method: Method) -> Mapping[str, Any]:
    """What it changes of a declared scene, by path."""
    return method.scene if isinstance(method.scene, Mapping) else {}


def _of_scenes(
    experiment: Experiment, values: Mapping[str, str]
) -> tuple[dict[str, str], dict[str, str]]:
    """Values of the methods' own fields, and those that are of a method's declared scene."""
    theirs = {}
    for path, text in values.items():
        name, _, inner = path.partition(".")
        method = experiment.methods.get(name)
        of_scene = method and (inner in _changed(method) or not has_path(method, inner))
        if of_scene and has_path(experiment.parameters, inner):
            theirs[path] = text
    return {k: v for k, v in values.items() if k not in theirs}, theirs


def doubtful(experiment: Experiment, values: Mapping[str, str]) -> tuple[str, ...]:
    """Return a line for each value that looks like one whose unit was forgotten."""
    mine, theirs = _split(values)
    ours, _ = _of_scenes(experiment, theirs)
    return (*doubts(experiment.parameters, mine), *doubts(experiment.methods, ours))


def _split(values: Mapping[str, str]) -> tuple[dict[str, str], dict[str, str]]:
    """Those of the parameters, and those of the methods without that word."""
    mine = {k: v for k, v in values.items() if not k.startswith("methods.")}
    return mine, {k[8:]: v for k, v in values.items() if k.startswith("methods.")}


def mesh_files(parameters: Any, folder: Path) -> tuple[Path, ...]:
    """Return the files of meshes and of landmarks that parameters name, beside the experiment in
    `folder` or where the program runs, as far as they can be read; with what a deck includes."""
    named = (p.default for p in describe(parameters) if isinstance(p.default, str))
    texts = [text for text in named if text.lower().endswith((*_MESHES, *_LAYOUTS))]
    paths = [p for text in texts for p in (folder / text, Path(text))]
    there = {p.resolve(): p for p in reversed(paths) if p.is_file() and os.access(p, os.R_OK)}
    return tuple(f for p in reversed(there.values()) for f in files_named(p))


def folder_of(experiment: Experiment) -> Path:
    """Return the folder of the experiment's file; `ComparisonError` when it was not loaded from
    one."""
    if experiment.path is None:
        raise ComparisonError(f"experiment '{experiment.name}' was not loaded from a file")
    return experiment.path.parent
