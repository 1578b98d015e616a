"""Inputs of a run, and reuse of a stored run with the same inputs.

Everything is held by its content: code and libraries, the machine, the experiment's file with its
helpers, meshes, recordings and every parameter. What has no hash is never taken as unchanged.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

from validate.errors import RecordingError
from validate.parameters import describe
from validate.pipeline.calibration.calibrated import apart
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.find import sources_of
from validate.pipeline.experiment.options import (
    Options,
    chosen_cases,
    configure,
    folder_of,
    mesh_files,
)
from validate.pipeline.experiment.origins import opened
from validate.plugins import PlugIn, plug_ins
from validate.recording.types import Recording
from validate.report.export.table_file import stored_table
from validate.report.long_table import content_of
from validate.report.stored.environment import Made, UsedFile, environment, made
from validate.report.stored.folder import MARK
from validate.report.stored.json_values import Json, recorded
from validate.scene.laws import LAWS, law_kind

# --- Plug-ins that a run uses: those of which a class or a law is among its settings.


def plug_ins_used(*settings: Any) -> tuple[str, ...]:
    """Return `PACKAGE VERSION` of every plug-in that these settings name."""
    used = {plug_in for one in settings for plug_in in _used_by_name("", one)}
    return tuple(sorted({f"{plug_in.package} {plug_in.version}" for plug_in in used}))


def _used_by_name(name: str, value: Any) -> Iterator[PlugIn]:
    """Plug-ins of a value called `name`, and of its parts."""
    if name.rpartition(".")[2] == "law" and isinstance(value, str):
        origin = LAWS.origin(law_kind(value))
        yield from () if origin is None else (origin,)
    elif isinstance(value, Mapping):
        for key, part in value.items():
            yield from _used_by_name(str(key), part)
    elif isinstance(value, tuple):
        for part in value:
            yield from _used_by_name("", part)
    elif is_dataclass(value) and not isinstance(value, type):
        yield from (p for p in plug_ins() if _top(p.value) == _top(type(value).__module__))
        for f in fields(value):
            yield from _used_by_name(f.name, getattr(value, f.name))


def _top(module: str) -> str:
    """The package of `package.module:attribute`."""
    return module.partition(":")[0].partition(".")[0]


# -------------------------------------------------------------------------------------------------


def rests_on(experiment: Experiment, options: Options, command: Sequence[str] = ()) -> Made:
    """Return the inputs of a run, read before it: files may be edited while it computes."""
    path = experiment.path
    parameters, methods = configure(experiment, options)
    read = mesh_files(parameters, path.parent if path else Path())
    found = made(command, sources_of(path) if path else (), read)
    others = (r for on in apart(experiment, parameters) for r in opened(experiment, on).recordings)
    files = (*found.files, *(_used(r, "calibrates") for r in others))
    found = replace(found, files=files, plug_ins=plug_ins_used(parameters, methods))
    if options.quick:
        return found
    cases = [c.change(parameters) for c in chosen_cases(experiment, options) if c.shipped]
    shipped = [r for p in cases for r in experiment.load(p, folder_of(experiment))]
    return replace(found, files=(*found.files, *(_used(r, "case") for r in shipped)))


def _used(recording: Recording, role: str) -> UsedFile:
    source = recording.source
    return UsedFile(role, source.path, source.sha256, source.bytes)


def stored_run(experiment: Experiment, folder: Path) -> tuple[Json | None, str]:
    """Return checks and printed figures of the run in `folder`, as results.json has them, where the
    experiment as declared would be computed from the same; else None and what differs ("" where
    nothing is stored).

    Raises what loading the experiment's recordings does.
    """
    if not (folder / MARK).exists():
        return None, ""
    try:
        content = content_of(stored_table(folder, part=("check", "check.*", "published.*")))
        when = f"the stored run of {content['created']}"
    except RecordingError as error:
        return None, str(error)
    except KeyError:
        return None, f"{folder / MARK} cannot be read"
    try:
        differing = next(_differences(experiment, content), "")
    except (KeyError, TypeError, AttributeError):
        differing = "another form"
    return (None, f"{when} has {differing}") if differing else (content, "")


def _differences(experiment: Experiment, content: Json) -> Iterator[str]:
    now, then = rests_on(experiment, Options({})), content["made"]
    if content["quick"] or content["changed"]:
        yield "other parameters"
    if now.code_sha256 != then["code_sha256"]:
        yield "other code or libraries"
    if list(now.plug_ins) != then.get("plug_ins", []):
        yield "other plug-ins"
    if content["environment"] != environment():
        yield "another machine or environment"
    if [recorded(f) for f in now.files] != then["files"]:
        yield "other files of the experiment"
    found = opened(experiment, configure(experiment, Options({}))[0])
    hashes = [r.source.sha256 for r in found.recordings]
    if not all((*hashes, *(f.sha256 for f in now.files))):
        yield "a recording without a hash"
    if hashes != [i["sha256"] for i in content["inputs"]]:
        yield "other recordings"
    if {m["name"] for m in content["methods"]} != set(experiment.methods):
        yield "other methods"
    # Every stored value is the one that would be used now, or was identified then
    stored = content["parameters"]
    used = describe(found.parameters) + describe(experiment.methods, "methods.")
    same = {p.path for p in used} == stored.keys()
    if not (
        same
        and all(
            stored[p.path]["origin"] == "identified"
            or stored[p.path]["value"] == recorded(p.default)
            for p in used
        )
    ):
        yield "other parameters"
