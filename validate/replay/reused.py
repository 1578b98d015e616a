"""What a run rests on, and whether a stored one rests on the same: then it need not be made again.

Everything is held by its content: code and libraries, the machine, the experiment's file with its
helpers, meshes, recordings and every parameter. What has no hash is never taken as unchanged.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from validate.errors import RecordingError
from validate.parameters import describe
from validate.recording.types import Recording
from validate.replay.calibrated import apart
from validate.replay.experiment import Experiment
from validate.replay.find import sources_of
from validate.replay.options import Options, chosen_cases, configure, folder_of, mesh_files
from validate.replay.origins import opened
from validate.report.environment import environment
from validate.report.folder import MARK
from validate.report.made import Made, UsedFile, made
from validate.report.plain import recorded
from validate.seals import read_sealed

Json = dict[str, Any]


def rests_on(experiment: Experiment, options: Options, command: Sequence[str] = ()) -> Made:
    """What makes a run, taken before it: files may be edited while it computes."""
    path = experiment.path
    parameters, _ = configure(experiment, options)
    read = mesh_files(parameters, path.parent if path else Path())
    found = made(command, sources_of(path) if path else (), read)
    others = (r for on in apart(experiment, parameters) for r in opened(experiment, on).recordings)
    found = replace(found, files=(*found.files, *(_used(r, "calibrates") for r in others)))
    if options.quick:
        return found
    cases = [c.change(parameters) for c in chosen_cases(experiment, options) if c.shipped]
    shipped = [r for p in cases for r in experiment.load(p, folder_of(experiment))]
    return replace(found, files=(*found.files, *(_used(r, "case") for r in shipped)))


def _used(recording: Recording, role: str) -> UsedFile:
    source = recording.source
    return UsedFile(role, source.path, source.sha256, source.bytes)


def stored_run(experiment: Experiment, folder: Path) -> tuple[Json | None, str]:
    """results.json of `folder` where the experiment as declared would be computed from the same;
    else None and what differs ("" where nothing is stored).

    Raises what loading the experiment's recordings does.
    """
    if not (folder / MARK).exists():
        return None, ""
    try:
        content: Json = read_sealed(folder / MARK)
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
    if not _as_declared(experiment, found.parameters, content["parameters"]):
        yield "other parameters"


def _as_declared(experiment: Experiment, parameters: Any, stored: Json) -> bool:
    """Whether every stored value is the one that would be used now, or was identified then."""
    now = describe(parameters) + describe(experiment.methods, "methods.")
    same = {p.path for p in now} == stored.keys()
    return same and all(
        stored[p.path]["origin"] == "identified" or stored[p.path]["value"] == recorded(p.default)
        for p in now
    )
