"""Cell of a stability map: modes of one variant, every scheme and step, single precision.

Radii, measured and predicted limits, condition numbers, locking, rounding and drift; or the one
line for which the variant is refused.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy import sparse
from scipy.linalg import eigh, eigvalsh
from scipy.sparse.linalg import splu

from validate.arrays import Floats
from validate.engine.execution import Kept
from validate.errors import ComparisonError, ValidateError
from validate.fem.assembly.volume_constraints import mixed_static
from validate.fem.locking import locking_of
from validate.fem.system import System, build, mass_of
from validate.pipeline.ladder.default import body_of
from validate.pipeline.ladder.ladder import StabilityBody, Turned
from validate.pipeline.run.job import Job
from validate.scene.scene import Scene
from validate.solve.explicit.linear import ExplicitLinear
from validate.solve.schemes import steppings_for
from validate.solve.study_entries import Rates, Stepping
from validate.study.stability.plan import StabilityCell

# --- errors of single precision against double, and of energy over 1e5 steps ---------------------

STEPS = 1000  # of an explicit run in both precisions
_FORMS = (True, False)  # in positions, in velocities
DRIFT_STEPS = 100_000
_SHARE = 0.02  # of the critical step: positions lose their digits where steps are small


@dataclass(frozen=True)
class Rounding:
    """float32 less float64, relative to the largest displacement; None where it is not finite.

    Of a static solution, and of 1000 explicit steps with lumped mass at 2 % of the critical step:
    written in positions (u'' = 2 u' - u + ...), and in velocities.
    """

    static: float | None
    positions: float | None
    velocities: float | None


def rounding(system: System, limit: float) -> Rounding:
    """Of the body under its one load, switched on at t = 0; `limit` is its critical step s."""
    free = system.free
    K, f = sparse.csr_array(system.K[free][:, free]), system.loads[free, 0]
    static = _distance(*(_solved(K.astype(t), f.astype(t)) for t in (np.float32, np.float64)))
    masses, h = system.masses[free], _SHARE * limit
    runs = [
        [_stepped(K.astype(t), f.astype(t), (h * h / masses).astype(t), form) for form in _FORMS]
        for t in (np.float32, np.float64)
    ]
    return Rounding(static, _distance(runs[0][0], runs[1][0]), _distance(runs[0][1], runs[1][1]))


def _solved(K: sparse.csr_array, f: Floats) -> Floats:
    try:
        return np.asarray(splu(K.tocsc()).solve(f))
    except RuntimeError:  # singular in this precision
        return np.full(len(f), np.nan)


def _stepped(K: sparse.csr_array, f: Floats, gain: Floats, positions: bool) -> Floats:
    """Displacements (m,) after 1000 steps from rest, in the precision given; `gain` is h^2/m."""
    u, old, d = (np.zeros_like(f) for _ in range(3))
    for k in range(STEPS):
        push = gain * (f - K @ u) * f.dtype.type(0.5 if k == 0 else 1.0)
        if positions:
            u, old = 2 * u - old + push, u
        else:
            d = d + push
            u = u + d
    return u


def _distance(single: Floats, double: Floats) -> float | None:
    size = float(np.abs(double).max())
    apart = float(np.abs(single.astype(np.float64) - double).max())
    return apart / size if np.isfinite(apart) and size > 0 else None


@dataclass(frozen=True)
class Drift:
    """Energy after 1e5 undamped steps over that at the start, in both precisions.

    Of explicit schemes the energy that they keep exactly (of half steps), else strain + kinetic.
    """

    scheme: str
    dt: float
    double: float | None
    single: float | None


def drift(scheme: Stepping, h: float, omegas: Floats) -> Drift:
    """All modes (r,) 1/s, each from amplitude 1/w at rest, stepped 1e5 times by the step map."""
    rates = Rates(omegas * h, 0.0, 0.0)
    maps = scheme.maps(rates)
    # States (m, r) with the same strain energy in every mode, at rest and in balance. Two members
    # are u and its last increment, from which the half step behind has rest in it.
    x = rates.x
    q = 1 / x
    members = [q, x * x * q / 2] if maps.shape[-1] == 2 else [q, 0 * q, -x * x * q]
    start = np.stack(members)
    found = []
    for kind in (np.float64, np.float32):
        state = start.astype(kind)
        steps = np.ascontiguousarray(maps.astype(kind).transpose(1, 2, 0))
        with np.errstate(over="ignore", invalid="ignore"):  # growth ends in None
            for _ in range(DRIFT_STEPS):
                state = (steps * state).sum(axis=1)
            energy = _energy(scheme, rates.x, state.astype(np.float64))
        ratio = energy / _energy(scheme, rates.x, start)
        found.append(float(ratio) if np.isfinite(ratio) else None)
    return Drift(scheme.name, h, *found)


def _energy(scheme: Stepping, x: Floats, state: Floats) -> float:
    """Twice the energy of all modes in units of the step."""
    if len(state) == 2:
        u, d = state
        return float((d * d + x * x * u * (u - d)).sum())
    q, v = state[:2]
    stiff = x * x * (1 - x * x / 4) if scheme.explicit else x * x
    return float((v * v + stiff * q * q).sum())


# --- cell of a stability map: all modes of one variant, then every scheme and step ---------------

_REACH = 8.0  # times the predicted limit, on both sides, that the measured one is sought in
_HALVINGS = 30  # of that interval's logarithm: 4e-9 of the limit
_DRIFT_SHARE = 0.5  # of the limit
_LEAST_NU = 1e-6  # of mixed elements, whose pressure has no equation at lambda = 0


@dataclass(frozen=True)
class SchemeResult:
    """Radii at the cell's steps; limits s: `predicted` None: none, `measured` None: not found."""

    scheme: str
    radii: tuple[float, ...]
    predicted: float | None
    measured: float | None


@dataclass(frozen=True)
class Stepped:
    """`lowest`, `highest` frequency 1/s with consistent mass; condition numbers by matrix; locking
    factor (None: not for such cells); rounding; drift. `warning` on locking or "".
    """

    unknowns: int = 0
    lowest: float = 0.0
    highest: float = 0.0
    schemes: tuple[SchemeResult, ...] = ()
    conditions: Mapping[str, float] = field(default_factory=dict)
    locking: float | None = None
    rounding: Rounding | None = None
    drifts: tuple[Drift, ...] = ()
    warning: str = ""


class StabilityBench:
    """A body, and the locking factors of its meshes that were asked for."""

    def __init__(self, body: StabilityBody) -> None:
        self.body = body
        self._locking: Kept[float | None] = Kept(64)

    def locking(self, v: Turned) -> float | None:
        """Compliance under the static load over that of mixed elements; E has no part in it."""
        base = self.body.base
        alike = replace(base, nu=max(v.nu, _LEAST_NU), mesh=v.mesh, quality=v.quality)
        return self._locking.get(alike, lambda: _locking(self.body.pulled(alike)))


def open_bench(job: Job) -> StabilityBench:
    """Raise `ComparisonError` for an experiment that has nothing to be stepped."""
    body = body_of(job.experiment())
    if body is None:
        raise ComparisonError(
            "the experiment declares no density, so no scheme can step in time; set material.rho"
        )
    return StabilityBench(body)


def run_cell(bench: StabilityBench, cell: StabilityCell) -> Stepped:
    """Raise `SceneError` for a variant that cannot be."""
    base, v = bench.body, cell.variant
    system = build(base.build(v))
    modes = {mass: frequencies(system, mass) for mass in ("consistent", "lumped")}
    schemes = steppings_for(system.scene.mesh.kind)
    pulled = build(base.pulled(v))
    limit = ExplicitLinear(1.0, "lumped", "mass").stable_step(pulled)
    # Of K, of the consistent M, and of Newmark's J = 4/h^2 M + 2/h C + K at the paper's step
    free = system.free
    K, M, C = (X[free][:, free].toarray() for X in (system.K, system.M, system.C))
    matrices = {"K": K, "M": M, "J": 4 / base.dt**2 * M + 2 / base.dt * C + K}
    conditions = {}
    for name, matrix in matrices.items():
        values = eigvalsh(matrix)
        if values[0] > 0:
            conditions[name] = float(values[-1] / values[0])
    # Schemes whose map knows its state: at half their limit, or at the paper's step
    drifts = []
    for s in schemes if cell.drift else ():
        if s.name not in ("modal", "quasi_static"):
            h = _DRIFT_SHARE * s.limit(system) if s.limit else base.dt
            drifts.append(drift(s, h, modes[s.mass]))
    return Stepped(
        unknowns=len(system.free),
        lowest=float(modes["consistent"][0]),
        highest=float(modes["consistent"][-1]),
        schemes=tuple(_scheme(s, system, modes[s.mass], v, cell.steps) for s in schemes),
        conditions=conditions,
        locking=bench.locking(v),
        rounding=rounding(pulled, limit),
        drifts=tuple(drifts),
        warning="; ".join(f"{one.cause}: {one.where}" for one in locking_of(system.scene)),
    )


def frequencies(system: System, mass: Any) -> Floats:
    """All frequencies (r,) 1/s, rising."""
    free = system.free
    K, M = (X[free][:, free].toarray() for X in (system.K, mass_of(system, mass)))
    return np.sqrt(np.maximum(eigh(K, M, eigvals_only=True), 0.0))


def _scheme(
    scheme: Stepping, system: System, omegas: Floats, v: Turned, steps: tuple[float, ...]
) -> SchemeResult:
    def radius(h: float) -> float:
        return scheme.radius(h, omegas, v.mass_damping, v.stiffness_damping)

    predicted = scheme.limit(system) if scheme.limit else None
    measured = measured_limit(radius, predicted, 1 + scheme.rounding) if predicted else None
    return SchemeResult(scheme.name, tuple(radius(h) for h in steps), predicted, measured)


def measured_limit(radius: Callable[[float], float], near: float, border: float) -> float | None:
    """Return the step s at which a radius crosses `border`, by bisection around `near`; None if
    none."""
    low, high = near / _REACH, near * _REACH
    if radius(low) > border or not radius(high) > border:
        return None
    for _ in range(_HALVINGS):
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if radius(middle) > border else (middle, high)
    return low


def _locking(pulled: Scene) -> float | None:
    """None for cells that mixed elements do not know."""
    try:
        mixed = float(mixed_static(pulled).compliances[0])
    except ValidateError:
        return None
    system = build(pulled)
    f = system.loads[system.free, 0]
    return float(f @ system.factor().solve(f)) / mixed
