"""Validation domain of a run: strain, strain rate and size of its body."""

from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats
from validate.compare.result import MethodResult
from validate.scene.mesh import Mesh
from validate.solve.types import Run

_SHARE = 0.99  # of the cells stays below the strain that is told: corners are singular
_FRAMES = 50  # frames that are looked at


@dataclass(frozen=True)
class Domain:
    """One run: principal logarithmic strain (its largest size) that 99 % of the cells stay below,
    the fastest that it grew (1/s), the smallest and largest side (m) of the box about the body.

    None where the run does not say: a material point has no size, one instant or rows without
    times no rate.
    """

    recording: str
    specimen: str
    strain: float | None
    rate: float | None
    sides: tuple[float, float] | None


def domains(
    method: MethodResult, recordings: tuple[str, ...], specimens: tuple[str, ...]
) -> tuple[Domain, ...]:
    """Of every recording that a method was run on."""
    mesh = method.scene.mesh
    sides = np.ptp(mesh.nodes, axis=0) if len(mesh.nodes) else None
    found = []
    each = zip(method.runs, method.registered, recordings, specimens, strict=False)
    for run, seen, recording, specimen in each:
        t, strain = _strains(mesh, run)
        rate = _largest(np.abs(np.diff(strain)) / np.diff(t)) if seen.timed else None
        box = None if sides is None else (float(sides.min()), float(sides.max()))
        found.append(Domain(recording, specimen, _largest(strain), rate, box))
    return tuple(found)


def _largest(values: Floats) -> float | None:
    return float(values.max()) if len(values) and np.isfinite(values).all() else None


def _strains(mesh: Mesh, run: Run) -> tuple[Floats, Floats]:
    """Times (k,) s and the strains (k,) then; empty where the run keeps neither field nor
    stretch."""
    if "stretch" in run.traces:
        return run.t, np.abs(np.log(np.maximum(run.traces["stretch"].y, np.finfo(float).tiny)))
    if not len(mesh.cells) or not len(run.u):
        return np.zeros(0), np.zeros(0)
    kept = np.unique(np.linspace(0, len(run.u) - 1, _FRAMES).astype(int))
    strains = [float(np.quantile(hencky(mesh, run.u[i]), _SHARE)) for i in kept]
    return run.t[run.at[kept]], np.array(strains)


def hencky(mesh: Mesh, u: Floats) -> Floats:
    """Largest principal logarithmic strain (e,) of every cell, by size, under u (n, d) m.

    Of the affine map that fits the cell's vertices best. Infinite for a cell turned inside out.
    """
    X, x = mesh.nodes[mesh.corners], (mesh.nodes + u)[mesh.corners]
    X, x = X - X.mean(axis=1, keepdims=True), x - x.mean(axis=1, keepdims=True)
    onto = np.einsum("eki,ekj->eij", x, X)
    F = onto @ np.linalg.inv(np.einsum("eki,ekj->eij", X, X))
    stretches = np.linalg.svd(F, compute_uv=False)
    strain = np.abs(np.log(np.maximum(stretches, np.finfo(float).tiny))).max(axis=1)
    return np.where(np.linalg.det(F) > 0, strain, np.inf)
