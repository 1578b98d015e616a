"""User options of a run: values, methods, cases, laws, external simulators; the run's folder.

What a method changes of the scene's material has a law, its settings solve it. Where a user sets
another law, a static method takes a solver of that law: that of the experiment's own static method
which solves it, else linear statics or Newton's method. Others take those of their scheme.
"""

import os
import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, get_args

from validate.errors import ComparisonError, UsageError
from validate.parameters import describe, doubts, has_path, nearest_names, with_values
from validate.pipeline.experiment.experiment import Case, Experiment
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.tree import valued
from validate.scene.laws import further_laws
from validate.scene.material import LawName
from validate.scene.mesh_files.abaqus_text import files_named
from validate.scene.mesh_files.third_party_meshes import SUFFIXES as FOREIGN
from validate.solve.external.program import words
from validate.solve.external.scheme import ExternalSimulator
from validate.solve.fluid.cavities import ExactPressure, NoFluid
from validate.solve.handles import LARGE, Handles
from validate.solve.static.load_table import Tabulated
from validate.solve.static.newton import StaticNewton
from validate.solve.static.quasi_static import QuasiStatic

_SUFFIX = re.compile("_(simulator|guest)$")  # of a script; the second is a former one
_LEVELS = 20  # of statics with one input, where the experiment does not say


def external_methods(methods: dict[str, Method]) -> dict[str, Method]:
    """Return the methods that are external simulators."""
    return {name: m for name, m in methods.items() if isinstance(m.settings, ExternalSimulator)}


def added_simulators(methods: Mapping[str, Method], commands: Sequence[str]) -> tuple[str, ...]:
    """Return the names of the methods that `with_simulators` adds for these commands."""
    labels = [_label(command) for command in commands]
    return tuple(name for name, m in methods.items() if m.label in labels)


def _label(command: str) -> str:
    return f"external: {command}"


def with_simulators(experiment: Experiment, commands: Sequence[str]) -> Experiment:
    """Return the experiment with one more method for each command.

    A method has the settings of the first external simulator that the experiment declares, else
    those of its accepted method. Raises `UsageError` for a command whose program is missing.
    """
    methods = dict(experiment.methods)
    accepted = next(iter(experiment.accepted), next(iter(methods), ""))
    for command in commands:
        words(command)
        # A free name after the script: `felupe` for `python felupe_simulator.py`
        stems = [Path(word).stem for word in shlex.split(command) if not word.startswith("-")]
        last = next((s for s in stems[1:] if s), stems[0])
        name = re.sub(r"\W+", "_", _SUFFIX.sub("", last)) or "external"
        while name in methods:
            name += "_2"
        methods[name] = _as(methods, accepted, command)
    return replace(experiment, methods=methods) if commands else experiment


def _as(methods: dict[str, Method], accepted: str, command: str) -> Method:
    declared = next(iter(external_methods(methods).values()), None)
    label = _label(command)
    if declared is not None:
        return replace(declared, label=label, settings=replace(declared.settings, command=command))
    like = methods[accepted]
    handles = getattr(like.settings, "handles", None)
    moving = handles is not None and handles.inertia
    settings = ExternalSimulator(command, inertia=moving, levels=0 if moving else _LEVELS)
    return replace(like, label=label, settings=settings, markers=(), steps=None, chosen="")


_LINEAR, _LARGE = (ExactPressure, NoFluid, QuasiStatic), (StaticNewton, Tabulated)


def laws_of(method: Method) -> tuple[str, ...]:
    """Return the laws that a method may have."""
    static = isinstance(method.settings, (*_LINEAR, *_LARGE))
    handles: Handles | None = getattr(method.settings, "handles", None)
    own: tuple[LawName, ...] = get_args(LawName) if static or handles is None else handles.law
    return (*own, *further_laws()) if set(LARGE) <= set(own) else own


def with_law(name: str, method: Method, law: str, declared: Mapping[str, Method]) -> Method:
    """Return a method of which a user sets the law, with a solver of that law.

    Raises `UsageError` for a law that the method's scheme does not solve.
    """
    possible = laws_of(method)
    if law not in possible:
        raise UsageError(
            f"methods.{name}.material.law={law}: {type(method.settings).__name__} solves "
            f"{', '.join(possible)}; set the law of another method"
        )
    handles: Handles | None = getattr(method.settings, "handles", None)
    if handles is None or handles.solves(law):
        return method
    kinds = _LINEAR if law == "linear" else _LARGE
    own = [m.settings for m in declared.values() if isinstance(m.settings, kinds)]
    usual = QuasiStatic() if law == "linear" else StaticNewton("none")
    return replace(method, settings=own[0] if own else usual)


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
    for name, method in picked.items():
        if method.filters and not method.markers:
            raise UsageError(
                f"method '{name}': the filter {type(method.settings).__name__} is given no "
                'markers; name some of the recording, as Method(..., markers=("tip",))'
            )
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
