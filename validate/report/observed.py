"""Picks that all figures share: which methods to draw, and a method's view of the measurement."""

from dataclasses import replace

import numpy as np

from validate.compare.outline import normal_distances
from validate.compare.residual import Residual
from validate.compare.result import MethodResult, Result
from validate.compare.score import rms
from validate.errors import ValidateError
from validate.fem.locate import barycentric_rows
from validate.register.observe import (
    Hold,
    MarkerObservation,
    OutlineObservation,
    Registered,
    nearest_sample,
)
from validate.register.plane import SurfaceSampler, cavity_sampler
from validate.scene.mesh import Mesh

_SAME = 1e-9  # m: a redrawn residual further from the judged one is not drawn
_APART = 0.08  # share of the largest difference below which two methods draw one line


def finished(result: Result) -> tuple[MethodResult, ...]:
    """Methods whose runs all reached the end, the accepted one first."""
    done = [m for m in result.methods if all(r.finished for r in m.runs)]
    return tuple(sorted(done, key=lambda m: not m.accepted))


def shown_method(result: Result) -> MethodResult | None:
    """The accepted method, or without one the first that finished; None when none did."""
    done = finished(result)
    return done[0] if done else None


def loaded_holds(result: Result) -> tuple[Hold, ...]:
    """The loads of the first recording after rest."""
    return result.registered[0].holds[1:] if result.registered else ()


def last_residual(method: MethodResult, quantity: str) -> Residual | None:
    """The residual of a quantity at its last load."""
    found = [r for r in method.residuals.values() if r.quantity == quantity]
    return found[-1] if found else None


def distinct(result: Result, quantity: str) -> tuple[MethodResult, ...]:
    """Finished methods whose lines for a quantity do not lie on each other at the last load."""
    pairs = [(m, last_residual(m, quantity)) for m in finished(result)]
    drawn = [(m, r) for m, r in pairs if r is not None]
    largest = max((_apart(a, b) for _, a in drawn for _, b in drawn), default=0.0)
    kept: list[tuple[MethodResult, Residual]] = []
    for method, residual in drawn:
        if all(_apart(residual, other) > _APART * largest for _, other in kept) or not kept:
            kept.append((method, residual))
    return tuple(m for m, _ in kept)


def _apart(one: Residual, other: Residual) -> float:
    if one.values.shape != other.values.shape:
        return float("inf")
    return rms(one.values - other.values)


def outline_seen(result: Result, method: MethodResult) -> OutlineObservation | None:
    """The outlines with the wall of the method's own mesh.

    None when there are none, or when the section drawn would not be the one that was judged.
    """
    first = result.registered[0].outline if result.registered else None
    if first is None or not method.run.finished:
        return None
    mesh = method.scene.mesh
    if first.wall.rows.weights.shape[1] == len(mesh.nodes):
        seen = first
    elif method.scene.cavities:
        seen = replace(first, wall=_wall_on(first.wall, mesh, method.scene.cavities[0].facets))
    else:
        return None
    return seen if _as_judged(seen, result.registered[0], method) else None


def _wall_on(wall: SurfaceSampler, mesh: Mesh, facets: str) -> SurfaceSampler:
    """The same samples of the wall, read from another mesh with the same facets."""
    own = cavity_sampler(mesh, facets, None)
    if len(own.rest) != len(wall.rest):
        return own
    return SurfaceSampler(wall.rest, own.rows, own.triangles)


def _as_judged(seen: OutlineObservation, registered: Registered, method: MethodResult) -> bool:
    hold, u = registered.holds[-1], method.run.u[len(registered.holds) - 1]
    judged = method.residuals.get(f"contour@{hold.label}")
    if judged is None:
        return False
    measured = seen.outlines[nearest_sample(seen.t, hold.t, "outlines")]
    try:
        drawn = normal_distances(seen.simulated(u), measured)
    except ValidateError:
        return False
    return bool(np.abs(drawn - judged.values[:, 0]).max() < _SAME)


def markers_seen(result: Result, method: MethodResult) -> MarkerObservation | None:
    """The markers with the rows of the method's own mesh; None when there are none."""
    first = result.registered[0].markers if result.registered else None
    if first is None or not method.run.finished:
        return None
    mesh = method.scene.mesh
    if first.rows.weights.shape[1] == len(mesh.nodes):
        return first
    return replace(first, rows=barycentric_rows(mesh, first.rest))
