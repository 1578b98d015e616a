"""Job of an external simulator: `job.json` and `mesh.vtu` (docs/external-simulators.md)."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.assembly.loads import hung_masses
from validate.fem.system import System, build
from validate.scene.laws import law_kind
from validate.scene.material import Material
from validate.scene.mesh_files.vtu import CELL_TYPES, write_vtu
from validate.scene.scene import Scene, Weight

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
    _require_carried(scene, t)
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
    return found | {name: _plain(getattr(m.coefficients, name)) for name in names}


def _density(material: Material) -> float:
    if material.rho is None:
        raise SceneError(
            "an external simulator with inertia or weight needs a density; give material.rho"
        )
    return material.rho


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


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
    return {"held": _unknowns(still), "drives": drives, "loads": loads, "weights": weights,
            "masses": _hung(scene)}  # fmt: skip


def _hung(scene: Scene) -> dict[str, list[Any]]:
    kg = hung_masses(scene)[::3]
    nodes = np.flatnonzero(kg)
    return {"nodes": nodes.tolist(), "kg": kg[nodes].tolist()}


def _unknowns(rows: Any) -> dict[str, list[int]]:
    return {"nodes": (rows // 3).tolist(), "components": (rows % 3).tolist()}


def _require_carried(scene: Scene, t: Floats) -> None:
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
