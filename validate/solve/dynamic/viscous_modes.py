"""Small viscoelastic vibrations about an equilibrium at large strain, in few modes, exact in time.

M u'' + C u' + K (u - u_0) + sum of K_iso q_i = 0 and q_i' + q_i/tau_i = g_i u', with the tangent K
at the equilibrium u_0 under the loads, and K_iso what the isochoric law's relaxing stress adds to
it (`fem.laws.viscoelasticity`). On the lowest modes of K and M that is a linear system of first
order, stepped by its matrix exponential: no step is too long. The body starts at rest and
undeformed.

Departures: everything of second order about u_0 is left out, so that a beam that swings by a tenth
of its length shortens by too little; loads are constant from t = 0 on.
"""

from dataclasses import dataclass, replace
from time import perf_counter
from typing import ClassVar

import numpy as np
from scipy import sparse
from scipy.linalg import expm

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.assembly.locate import probe_rows
from validate.fem.critical import lowest
from validate.fem.large_strain.hyperelastic import Body
from validate.fem.laws.viscoelasticity import Branches, Remembered, relaxed
from validate.fem.system import build
from validate.parameters import quantity
from validate.scene.material import Prony
from validate.scene.scene import Scene
from validate.solve.handles import LARGE_DYNAMICS, Handles, require_handled
from validate.solve.march import given_traces, march, probe_traces
from validate.solve.static.newton import StaticNewton
from validate.solve.types import Outcome, Run, Trace


@dataclass(frozen=True)
class ViscousModes:
    """Settings: so many of the lowest modes about the equilibrium."""

    handles: ClassVar[Handles] = replace(LARGE_DYNAMICS, drives=False)

    modes: int = quantity(12, "1", "lowest modes kept, about the equilibrium")

    def __post_init__(self) -> None:
        if self.modes < 1:
            raise SceneError(f"{self.modes} modes: expected at least 1")

    def solve(self, scene: Scene, t: Floats, inputs: Floats) -> Run:
        """At t (nt,) s under inputs (nt, l) that stay as they are; ended as the equilibrium was
        where there is none. Raises `SceneError` for loads that change and bodies of more than one
        material."""
        require_handled(scene, self)
        if np.ptp(inputs, axis=0).any():
            raise SceneError("ViscousModes needs constant loads; use NewtonDynamics")
        if scene.regions:
            raise SceneError("ViscousModes needs one material; use NewtonDynamics")
        start = perf_counter()
        bare = replace(scene, material=replace(scene.material, prony=Prony()))
        key, last = tuple(inputs[0].tolist()), _Remembered.last
        if last and last[0].mesh is bare.mesh and last[:3] == (bare, key, self.modes):
            found: _Vibrations | Run = last[3]
        else:
            found = _about_equilibrium(bare, inputs[0], self.modes)
            if isinstance(found, _Vibrations):
                _Remembered.last = (bare, key, self.modes, found)
        if isinstance(found, Run):
            return found
        setup = perf_counter() - start
        q = _walked(found, scene.material.prony, t)
        u = found.equilibrium + np.einsum("ti,ind->tnd", q, found.shapes)
        traces = {"updates": Trace(np.zeros(len(t)), "1")} | given_traces(scene, inputs)
        if scene.probes:
            rows = probe_rows(scene.mesh, scene.probes)
            traces |= probe_traces(scene, np.array([rows.apply(frame) for frame in u]))
        return Run("", t, np.arange(len(t)), u, traces, Outcome("finished", len(t)), setup, None)


@dataclass(frozen=True)
class _Vibrations:
    """About `equilibrium` (n, 3) m: M-orthonormal `shapes` (r, n, 3), squares of frequencies (r,)
    1/s^2, damping (r, r) 1/s, K_iso (r, r) 1/s^2, and the amplitudes (r,) of the undeformed body.
    """

    equilibrium: Floats
    shapes: Floats
    squares: Floats
    damping: Floats
    isochoric: Floats
    start: Floats


class _Remembered:
    """The last body, its loads and its vibrations: what relaxes is identified by many runs on one
    body, and only this is the same in all of them."""

    last: tuple[Scene, tuple[float, ...], int, _Vibrations] | None = None


def _about_equilibrium(scene: Scene, loads: Floats, modes: int) -> _Vibrations | Run:
    """Vibrations about the equilibrium under the loads (l,), or the run that found none."""
    system, now = build(scene), np.zeros(1)
    still = march("", StaticNewton("none").prepare(system), now, loads[None], np.array([0]), 0.0)
    if not still.finished:
        return still
    u, body, free = still.u[0].ravel(), Body(relaxed(scene)), system.free
    K = body.tangent(u)
    K_iso = _taut(body, u) - K
    M = system.M
    squares, V = lowest(K[free][:, free], M[free][:, free], min(modes, len(free)))
    squares, V = squares[:modes], V[:, :modes]
    shapes = np.zeros((len(u), len(squares)))
    shapes[free] = V
    return _Vibrations(
        still.u[0],
        np.ascontiguousarray(shapes.T).reshape(len(squares), -1, 3),
        squares,
        shapes.T @ (system.C @ shapes),
        shapes.T @ (K_iso @ shapes),
        -shapes.T @ (M @ u),
    )


def _taut(body: Body, u: Floats) -> sparse.csr_array:
    """The tangent of a jump from u, with one branch that is as stiff as the relaxed law."""
    one = np.ones((1, 1, 1))
    memory = Remembered(body.isochoric(u), np.zeros((1, *body.weights.shape, 3, 3)))
    return body.after(Branches(one, one), memory, 0.0).tangent(u)


def _walked(found: _Vibrations, prony: Prony, t: Floats) -> Floats:
    """Amplitudes (nt, r) at t from the undeformed body at rest at 0 s."""
    r, k = len(found.squares), len(prony.g)
    A = np.zeros(((2 + k) * r, (2 + k) * r))
    A[:r, r : 2 * r] = np.eye(r)
    A[r : 2 * r, : 2 * r] = np.hstack([-np.diag(found.squares), -found.damping])
    for i, (g, tau) in enumerate(zip(prony.g, prony.tau, strict=True)):
        rows = slice((2 + i) * r, (3 + i) * r)
        A[r : 2 * r, rows] = -found.isochoric
        A[rows, r : 2 * r], A[rows, rows] = g * np.eye(r), -np.eye(r) / tau
    steps = np.round(np.diff(t, prepend=0.0), 12)
    over = {dt: expm(dt * A) for dt in np.unique(steps).tolist()}
    x, q = np.concatenate([found.start, np.zeros(len(A) - r)]), np.empty((len(t), r))
    for i, dt in enumerate(steps.tolist()):
        x = over[dt] @ x
        q[i] = x[:r]
    return q
