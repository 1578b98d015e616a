"""Job and answer of an external simulator (docs/how-to/external-simulators.md).

Everything is checked: sizes and shapes before memory is allocated, mesh and times against the job,
law and parameters against the request, and forces against each other.

A job is `job.json` and `mesh.vtu`; the answer is `answer.json` and its fields, files that nobody
trusts.
"""

import json
import stat
from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats
from validate.errors import RecordingError, SceneError, UsageError, ValidateError
from validate.fem.assembly.assemble import hung_masses
from validate.fem.system import System, build
from validate.files import npz_arrays
from validate.recording.formats.subprocess_decoder import decoded
from validate.scene.laws import law_kind
from validate.scene.material import Material
from validate.scene.mesh_files.vtu import CELL_TYPES, write_vtu
from validate.scene.scene import Scene, Weight
from validate.solve.external.program import plain

JOB_SCHEMA = "validate-external-job/1"


@dataclass(frozen=True)
class ExternalJob:
    """Job that was written: `document` is the JSON, `inputs` (nt, k) are those at `times` s."""

    system: System
    times: Floats
    inputs: Floats
    document: Mapping[str, Any]

    @property
    def scene(self) -> Scene:
        return self.system.scene


def write_job(
    folder: Path, scene: Scene, t: Floats, inputs: Floats, inertia: bool, tolerance: float
) -> ExternalJob:
    """Write mesh and job; raises `SceneError` for what a job does not carry."""
    mesh = scene.mesh
    if mesh.kind not in CELL_TYPES:
        raise SceneError(f"an external simulator accepts {', '.join(CELL_TYPES)}, not {mesh.kind}")
    parts = ("regions", "foundations", "membranes", "contacts", "tracked", "tools")
    odd = [name for name in parts if getattr(scene, name)]
    if odd:
        raise SceneError(
            f"a job for an external simulator cannot contain {' or '.join(odd)}; "
            "remove them from the scene"
        )
    if len(t) == 0 or t[0] < 0 or (np.diff(t) <= 0).any():
        raise SceneError(
            f"{len(t)} times for an external simulator: expected at least one, "
            "from 0 s on, increasing"
        )
    write_vtu(scene.mesh, folder / "mesh.vtu")
    digest = sha256((folder / "mesh.vtu").read_bytes()).hexdigest()
    system = build(scene)
    t, inputs = np.asarray(t, dtype=np.float64), np.asarray(inputs, dtype=np.float64)
    first = [] if t[0] == 0 else [0.0]
    document = {
        "schema": JOB_SCHEMA,
        "units": "SI",
        "mesh": {
            "file": "mesh.vtu",
            "sha256": digest,
            "kind": scene.mesh.kind,
            "nodes": len(scene.mesh.nodes),
            "cells": len(scene.mesh.cells),
        },
        "material": asked_material(scene, inertia),
        "inertia": inertia,
        "times": t.tolist(),
        "instants": [*first, *t.tolist()],
        **_parts(system, inputs, len(first)),
        "tolerance": tolerance,
    }
    (folder / "job.json").write_text(json.dumps(document, indent=1, allow_nan=False), "utf-8")
    return ExternalJob(system, t, inputs, document)


def asked_material(scene: Scene, inertia: bool) -> dict[str, Any]:
    """Law and parameters that the job turns on, each of which the answer must echo."""
    m, kind = scene.material, law_kind(scene.material.law)
    found: dict[str, Any] = {"law": m.law, "E": m.E, "nu": m.nu}
    if inertia or any(isinstance(part, Weight) for part in scene.loads):
        found["rho"] = _density(m)
    if inertia:
        found |= {"mass_damping": m.mass_damping, "stiffness_damping": m.stiffness_damping}
    if scene.masses:
        found["hung"] = sum(part.mass for part in scene.masses)
    names = (*kind.coefficients, *(("volumetric",) if kind.volumetric else ()))
    values = {name: getattr(m.coefficients, name) for name in names}
    return found | {n: list(v) if isinstance(v, tuple) else v for n, v in values.items()}


def _density(material: Material) -> float:
    if material.rho is None:
        raise SceneError(
            "an external simulator with inertia or weight needs a density; give material.rho"
        )
    return material.rho


def _parts(system: System, inputs: Floats, before: int) -> dict[str, Any]:
    """What is held still, drives, loads and weights, with what each is at the instants.

    Before the first time a drive is at rest, and a load has its first value: it is switched on.
    """
    scene = system.scene
    still = np.setdiff1d(system.held, np.flatnonzero(system.moves.any(axis=1)))
    drives = []
    for j, drive in enumerate(scene.drives):
        rows = np.flatnonzero(system.moves[:, j])
        y = [*[0.0] * before, *inputs[:, j].tolist()]
        drives.append(
            {"name": drive.name, **_unknowns(rows), "per_unit": system.moves[rows, j].tolist(),
             "history": y}
        )  # fmt: skip
    loads: list[dict[str, Any]] = []
    weights: list[dict[str, Any]] = []
    for j, load in enumerate(scene.loads):
        y = inputs[:, len(drives) + j].tolist()
        named = {"name": load.name, "history": [*y[:1] * before, *y]}
        if isinstance(load, Weight):
            weights.append(named | {"direction": list(load.direction)})
            continue
        forces = system.loads[:, j].reshape(-1, 3)
        nodes = np.flatnonzero(forces.any(axis=1))
        loads.append(named | {"nodes": nodes.tolist(), "forces": forces[nodes].tolist()})
    kg = hung_masses(scene)[::3]
    nodes = np.flatnonzero(kg)
    return {"held": _unknowns(still), "drives": drives, "loads": loads, "weights": weights,
            "masses": {"nodes": nodes.tolist(), "kg": kg[nodes].tolist()}}  # fmt: skip


def _unknowns(rows: Any) -> dict[str, list[int]]:
    return {"nodes": (rows // 3).tolist(), "components": (rows % 3).tolist()}


# --- The fields of an answer: `fields.npz`, or .vtu files listed in `fields.pvd`.

_HEADER_BYTES = 4096
_NUMBER_BYTES = 32  # of a number in a .vtu, as text
_LIST_BYTES = 1_000_000
_SAME = 1e-9  # of the body's size: points that are the job's
_SECONDS = 300  # of reading a series, whose files are beside the list


class NoAnswerError(ValidateError):
    """Files that are no answer to the job."""


def fields_of(folder: Path, job: ExternalJob) -> dict[str, NDArray[Any]]:
    """t (k,), u (k, n, 3) and, where given, reactions of that shape, with k at most the job's."""
    npz, pvd = folder / "fields.npz", folder / "fields.pvd"
    if pvd.exists() and not npz.exists():
        return _shaped(_series(pvd, job), pvd.name, job)
    return _shaped(_arrays(npz, job), npz.name, job)


def _series(path: Path, job: ExternalJob) -> dict[str, NDArray[Any]]:
    """Of the files beside the list, whose points are the job's nodes in their order."""
    regular(path, _LIST_BYTES)
    mesh = job.scene.mesh
    most = _NUMBER_BYTES * (4 * mesh.nodes.size + 2 * mesh.cells.size) + _LIST_BYTES
    for file in sorted(path.parent.glob("*.vtu")):
        regular(file, max(most, (path.parent / "mesh.vtu").stat().st_size))
    try:
        found = decoded("validate.scene.mesh_files.vtu", path, None, _SECONDS)
    except (RecordingError, UsageError) as error:
        raise NoAnswerError(plain(str(error))) from None
    points = found.pop("points")
    slack = _SAME * float(np.ptp(mesh.nodes, axis=0).max())
    if points.shape != mesh.nodes.shape or np.abs(points - mesh.nodes).max() > slack:
        raise NoAnswerError(
            f"{path.name}: {len(points)} points that differ from the {len(mesh.nodes)} nodes "
            "of the job's mesh; expected its nodes at rest in the same order"
        )
    return found


def _arrays(path: Path, job: ExternalJob) -> dict[str, NDArray[Any]]:
    nodes, most = job.scene.mesh.nodes.size, len(job.times)
    room = 8 * most * (2 * nodes + 1) + 3 * _HEADER_BYTES
    regular(path, room + _HEADER_BYTES)
    try:
        found = npz_arrays(path, room)
    except RecordingError as error:
        raise NoAnswerError(plain(str(error))) from None
    wanted = [name for name in ("t", "u", "reactions") if name in found]
    for name in wanted:
        if found[name].dtype.kind not in "fiu":
            kind = found[name].dtype
            raise NoAnswerError(f"fields.npz: {name} of type {kind}, expected numbers")
    return {name: found[name].astype(np.float64) for name in wanted}


def _shaped(found: dict[str, NDArray[Any]], file: str, job: ExternalJob) -> dict[str, NDArray[Any]]:
    """Raises `NoAnswerError` for arrays that are missing or of other shapes than the job's."""
    if not {"t", "u"} <= set(found):
        raise NoAnswerError(f"{file}: arrays {sorted(found)}, expected t and u")
    k = len(np.atleast_1d(found["t"]))
    for name, array in found.items():
        shape = (k,) if name == "t" else (k, *job.scene.mesh.nodes.shape)
        if array.shape != shape or k > len(job.times):
            raise NoAnswerError(f"{file}: {name} of shape {array.shape}, expected {shape}")
    return found


def regular(path: Path, most: int) -> Path:
    """Return the path of an ordinary file of so many bytes: no link, pipe or device is opened."""
    try:
        found = path.lstat()
    except OSError:
        raise NoAnswerError(f"{path.name} was not written") from None
    if not stat.S_ISREG(found.st_mode) or found.st_size > most:
        raise NoAnswerError(
            f"{path.name}: {found.st_size} bytes: expected an ordinary file of at most {most} bytes"
        )
    return path


# -------------------------------------------------------------------------------------------------

ANSWER_SCHEMA = "validate-external-answer/1"
_FORMER_SCHEMA = "validate-guest-answer/1"  # of programs for an earlier version
_STATES = ("finished", "cannot_run", "diverged", "not_converged")
_JSON_BYTES = 4_000_000
_LINES = 20  # of what it could not do
_ECHO = 1e-6  # relative difference of a parameter that is the same
_UNBALANCED = 1e-3  # of the largest force
_HUGE = 1e12  # m or N


@dataclass(frozen=True)
class ExternalAnswer:
    """Answer to a job; `state` and `why` are reported by the simulator.

    u (k, n, 3) m and reactions (k, n, 3) N or None at the finished times; seconds as reported;
    `findings` are deviations from the job, one line each.
    """

    name: str
    state: str
    why: str
    u: Floats
    reactions: Floats | None
    setup_s: float
    step_s: Floats | None
    findings: tuple[str, ...]


def read_answer(folder: Path, job: ExternalJob) -> ExternalAnswer:
    """Raise `NoAnswerError` with the reason where there is no answer to this job."""
    raw = regular(folder / "answer.json", _JSON_BYTES).read_bytes()
    try:
        said = json.loads(raw.decode("utf-8"), parse_constant=_no_number)
    except (ValueError, RecursionError) as error:
        raise NoAnswerError(f"answer.json: not valid JSON ({plain(str(error))})") from None
    known = (ANSWER_SCHEMA, _FORMER_SCHEMA)
    if not isinstance(said, dict) or said.get("schema") not in known:
        raise NoAnswerError(f"answer.json: not an object of schema '{ANSWER_SCHEMA}'")
    name = (
        f"{_text(said, 'name') or 'external simulator'} {_text(said, 'version') or '(no version)'}"
    )
    state, why = _text(said, "state"), _text(said, "reason")
    if state not in _STATES:
        raise NoAnswerError(f"answer.json: state '{state}', expected {', '.join(_STATES)}")
    if state == "cannot_run":
        nothing = np.zeros((0, *job.scene.mesh.nodes.shape))
        why = why or "no reason given"
        return ExternalAnswer(name, state, why, nothing, None, 0.0, None, _limits(said))
    if said.get("mesh_sha256") != job.document["mesh"]["sha256"]:
        raise NoAnswerError("answer.json: mesh_sha256 differs from that of the job's mesh.vtu")
    arrays = fields_of(folder, job)
    u, reactions, step = arrays["u"], arrays.get("reactions"), _times_done(arrays["t"], job, state)
    # Of every time (k,): all numbers are finite, and none beyond what can be squared and summed.
    with np.errstate(invalid="ignore"):
        sound = [np.abs(a) < _HUGE for a in (u, reactions) if a is not None]
    finite = np.all([of.all(axis=(1, 2)) for of in sound], axis=0)
    if not finite.all():
        step = int(np.argmin(finite))
        state, why = "diverged", f"no finite field at step {step}" + (f"; {why}" if why else "")
    # Set-up and steps, as it says; zero and None where it says nothing usable
    setup, each = said.get("setup_s"), said.get("step_s")
    setup = float(setup) if setup is not None and _is_time(setup) else 0.0
    seconds = None
    if isinstance(each, list) and all(map(_is_time, each)) and len(each) >= step:
        seconds = np.array(each[:step], dtype=np.float64)
    reactions = None if reactions is None else reactions[:step]
    findings = (
        *_limits(said), *echoed(job.document["material"], said.get("used")),
        *_kept_still(job, u[:step]), *_balance(job, reactions),
    )  # fmt: skip
    return ExternalAnswer(name, state, why, u[:step], reactions, setup, seconds, findings)


def echoed(asked: Mapping[str, Any], used: Any) -> tuple[str, ...]:
    """Law and parameters that were ignored or changed, a line each."""
    if not isinstance(used, dict):
        return ("does not report which law and parameters it used",)
    found = []
    for name, value in asked.items():
        if name not in used:
            found.append(f"ignored parameter {name} = {value}")
        elif not _same(value, used[name]):
            found.append(f"used {name} = {plain(str(used[name]), 60)} instead of {value}")
    return tuple(found)


def _same(asked: Any, used: Any) -> bool:
    if isinstance(asked, str):
        return bool(asked == used)
    try:
        a, b = np.array(asked, dtype=np.float64), np.array(used, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        return False
    return a.shape == b.shape and bool(np.allclose(a, b, rtol=_ECHO, atol=0.0))


def _no_number(text: str) -> float:
    raise ValueError(f"{text} is not a number in JSON")


def _text(said: Mapping[str, Any], key: str) -> str:
    value = said.get(key, "")
    return plain(value) if isinstance(value, str) else ""


def _limits(said: Mapping[str, Any]) -> tuple[str, ...]:
    former = said.get("schema") == _FORMER_SCHEMA
    found = (f"answers by the former schema '{_FORMER_SCHEMA}'; write '{ANSWER_SCHEMA}'",) * former
    lines = said.get("could_not", [])
    if not isinstance(lines, list):
        return (*found, "gives no list of what it could not do")
    return found + tuple(
        f"could not: {plain(line)}" for line in lines[:_LINES] if isinstance(line, str)
    )


def _times_done(t: Floats, job: ExternalJob, state: str) -> int:
    """How many of the job's times were done: all of them, or the first ones if it gave up."""
    asked = job.times[: len(t)]
    slack = 1e-9 * max(float(job.times[-1]), 1e-30)
    if not np.allclose(t, asked, rtol=0.0, atol=slack):
        odd = int(np.argmin(np.isclose(t, asked, rtol=0.0, atol=slack)))
        raise NoAnswerError(f"fields.npz: time {odd} is {t[odd]:g} s, requested {asked[odd]:g} s")
    if state == "finished" and len(t) < len(job.times):
        raise NoAnswerError(
            f"fields.npz: {len(t)} of {len(job.times)} times, although its state is 'finished'"
        )
    return len(t)


def _is_time(value: Any) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return 0 < value < 1e9


def _kept_still(job: ExternalJob, u: Floats) -> tuple[str, ...]:
    """Whether what is held and driven is where the job has it."""
    system = job.system
    asked = job.inputs[: len(u), : system.moves.shape[1]] @ system.moves.T
    off = np.abs(u.reshape(len(u), asked.shape[1]) - asked)[:, system.held]
    largest = max(float(np.abs(u).max(initial=0.0)), float(np.abs(asked).max(initial=0.0)))
    if off.max(initial=0.0) <= _UNBALANCED * largest:
        return ()
    return (
        f"held or driven nodes are up to {1e3 * off.max():.3g} mm away from their "
        "prescribed position",
    )


def _balance(job: ExternalJob, reactions: Floats | None) -> tuple[str, ...]:
    """In statics what supports and drives push is what loads and weight pull."""
    if reactions is None:
        return (
            "gives no reaction forces: forces of drives are unknown and the balance is not checked",
        )
    if job.document["inertia"]:
        return ()
    system, k = job.system, len(reactions)
    pulls = system.loads if system.scene.loads else np.zeros((system.moves.shape[0], 0))
    given = job.inputs[:k, system.moves.shape[1] :] @ pulls.T
    held = np.zeros(len(system.moves), dtype=bool)
    held[system.held] = True
    pushed = np.where(held, reactions.reshape(k, len(held)), 0.0)
    total = (pushed + given).reshape(k, len(held) // 3, 3).sum(axis=1)
    scale = max(float(np.abs(x).sum(axis=1).max(initial=0.0)) for x in (pushed, given))
    worst = float(np.abs(total).max(initial=0.0))
    mesh, E = system.scene.mesh, system.scene.material.E
    rounding = job.document["tolerance"] * E * float(np.ptp(mesh.nodes)) ** 2
    if worst <= max(_UNBALANCED * scale, rounding):
        return ()
    name = "weight" if any(isinstance(p, Weight) for p in system.scene.loads) else "loads"
    return (f"reactions and {name} are out of balance by {worst:.3g} N of {scale:.3g} N",)
