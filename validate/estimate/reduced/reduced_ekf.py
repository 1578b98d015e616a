"""Extended Kalman filter on few mode shapes and a load bias, with an explicit step.

Between measurements the body runs at full size and full nonlinearity; what is uncertain are r
amplitudes of U_t and of U_{t-h} along the shapes Phi, and one bias N a load (a random walk: a body
that is stiffer than the model is a body with less load). Their covariance follows central
difference linearised at rest, one scalar equation a shape:

    q' = (2 - h^2 omega^2) q - q_before + h^2 Phi^T f b      (paper 003, eq 19, in modal form)

and both U_t and U_{t-h} are corrected, so that a correction is no kick. Joseph's form throughout.

Departures: paper 003 filters node by node (`NodeEKF`), where no measurement reaches other nodes.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np
from scipy import sparse
from scipy.linalg import eigh
from scipy.sparse.linalg import LinearOperator, eigsh

from validate.arrays import Floats, Ints
from validate.errors import UsageError
from validate.estimate.extended.explicit_filter import (
    ExplicitFilterStepper,
    ExplicitStep,
    beyond,
    explicit_step,
)
from validate.estimate.gating import Care, NoiseSettings, care_of, clock_setting, gate_setting
from validate.estimate.kalman.covariance import Claim, Dense, Event, Recursion, events, schedule
from validate.estimate.kalman.formulas import Gain, Innovation, innovation
from validate.estimate.measurements import Measurements
from validate.estimate.reduced.reduced_kf import steady
from validate.estimate.smoother import (
    Look,
    Transition,
    look_of,
    require_exact,
    smooth_setting,
)
from validate.fem.system import System
from validate.parameters import quantity
from validate.solve.handles import LARGE_DYNAMICS, Handles, require_handled
from validate.solve.types import Ending

# --- Few shapes that carry a body's motion: its lowest modes, or those of a run of the model
# itself.
#
# Phi (N, r) is orthonormal in the lumped masses and diagonalises K: Phi^T M Phi = I, Phi^T K Phi
# = diag(omega^2), so one scalar equation a shape. Snapshots (POD) come from the model alone,
# never from a measurement (Sirovich 1987); of them the Ritz vectors are taken.

_DENSE = 400  # unknowns up to which all modes are found at once
_PERIODS = 2  # of the lowest mode: one to load, one to ring
_SNAPSHOTS = 60  # of each load's run


@dataclass(frozen=True)
class Basis:
    """Phi (N, r) 1/sqrt(kg), zero at held unknowns; squares (r,) are omega^2 1/s^2."""

    Phi: Floats
    squares: Floats


def modes(system: System, r: int) -> Basis:
    """Return the r lowest modes with lumped masses; raises `UsageError` for more than there are."""
    free = system.free
    masses, m = system.masses[free], len(free)
    if not 1 <= r <= m:
        raise UsageError(f"{r} modes of a body with {m} free unknowns: 1 to {m}")
    K = system.K[free][:, free]
    if m <= _DENSE or r > m // 2:
        scale = 1 / np.sqrt(masses)
        squares, V = eigh(scale[:, None] * K.toarray() * scale, subset_by_index=[0, r - 1])
        V = scale[:, None] * V
    else:
        solve = LinearOperator((m, m), matvec=system.factor().solve, dtype=np.float64)
        M = sparse.diags_array(masses).tocsc()
        v0 = np.random.default_rng(0).standard_normal(m)
        squares, V = eigsh(K.tocsc(), k=r, M=M, sigma=0.0, OPinv=solve, v0=v0)
    Phi = np.zeros((len(system.moves), r))
    Phi[free] = V
    return Basis(Phi, np.asarray(squares))


def pod(explicit: ExplicitStep, r: int, force: float) -> Basis:
    """Return the r strongest shapes of runs in which each load in turn ramps to `force` N and
    stays.

    Raises `UsageError` without loads, or for more shapes than snapshots.
    """
    system = explicit.system
    runs = [_snapshots(explicit, j, force) for j in range(system.loads.shape[1])]
    if not runs or not 1 <= r <= len(runs) * _SNAPSHOTS:
        raise UsageError(
            f"{r} shapes from the snapshots of {len(runs)} loads, {_SNAPSHOTS} each: a POD basis "
            "needs a load; take basis='modes'"
        )
    root = np.sqrt(system.masses)
    V = np.linalg.svd(root[:, None] * np.hstack(runs), full_matrices=False)[0][:, :r]
    V = V / root[:, None]
    squares, turn = eigh(V.T @ (system.K @ V))
    Phi = V @ turn
    Phi[system.held] = 0.0  # up to rounding they are
    return Basis(Phi, np.asarray(squares))


def _snapshots(explicit: ExplicitStep, load: int, force: float) -> Floats:
    """Displacements (N, `_SNAPSHOTS`) m of the model under one load."""
    lowest = float(np.sqrt(modes(explicit.system, 1).squares[0]))
    steps = max(_SNAPSHOTS, int(_PERIODS * 2 * np.pi / lowest / explicit.h))
    kept = frozenset(np.linspace(1, steps, _SNAPSHOTS).astype(int).tolist())
    loads, drives = np.zeros(explicit.columns.shape[1]), np.zeros(explicit.moves.shape[1])
    u = before = np.zeros(len(explicit.system.moves))
    shots = []
    for k in range(steps):
        loads[load] = force * min(_PERIODS * k / steps, 1.0)
        u, before = explicit.following(u, before, explicit.model.force(u), loads, drives), u
        if k + 1 in kept:
            shots.append(u)
    return np.array(shots).T


# -------------------------------------------------------------------------------------------------

_SETTLED = 1e-9  # change of a gain from one update to the next: with slow modes 1e-6 is too early


@dataclass(frozen=True)
class ReducedEKF:
    """Settings. `process` is the random walk of the shapes' amplitudes, as the rms displacement of
    the body that one of them makes: "white" for every shape alike, or "load": in one direction, the
    static response to each load (rank 1). `gains`: the exact sequence, which needs no data and is
    found before the run, or the steady gain from the start.
    """

    handles: ClassVar[Handles] = replace(LARGE_DYNAMICS, viscous=False)
    noise_settings: ClassVar[NoiseSettings] = NoiseSettings("load_walk", "", "load_sd")

    dt: float = quantity(2e-4, "s", "time step of the run")
    substeps: int = quantity(1, "1", "explicit steps in each; inputs are interpolated")
    basis: Literal["modes", "pod"] = quantity(
        "modes", "1", "lowest modes, or shapes from simulated runs"
    )
    shapes: int = quantity(20, "1", "number; 5 shapes of a POD are as good as 20 modes")
    snapshot_load: float = quantity(1.0, "N", "load of the runs from which a POD takes its shapes")
    load_walk: float = quantity(1.0, "N/s^0.5", "random walk of every load's bias")
    load_sd: float = quantity(0.0, "N", "standard deviation of the bias at rest")
    process: float = quantity(1e-6, "m/s^0.5", "random walk of the shapes, rms over the body")
    noise: Literal["white", "load"] = quantity("white", "1", "where the process noise acts")
    gains: Literal["sequence", "steady"] = quantity("sequence", "1", "exact, or the steady one")
    beyond_limit: Literal["refuse", "run"] = quantity(
        "refuse", "1", "a step above the critical step"
    )
    gate: float | None = gate_setting()
    clock: float | None = clock_setting()
    smooth: bool = smooth_setting()

    def __post_init__(self) -> None:
        if not (self.dt > 0 and self.substeps >= 1):
            raise UsageError(f"dt {self.dt:g} s in {self.substeps} substeps: both must be positive")
        if min(self.load_walk, self.load_sd, self.process) < 0:
            raise UsageError("load_walk, load_sd and process are standard deviations >= 0")

    def prepare(self, system: System, measurements: Measurements) -> ExplicitFilterStepper:
        """Raise `SceneError` for what the explicit step cannot do, `UsageError` for a basis that
        does not exist, `ComparisonError` for a steady gain that does not, or times off the
        steps."""
        require_handled(system.scene, self)
        require_exact(self.smooth, self.gains)
        explicit = explicit_step(system, self.dt, self.substeps)
        refusal = beyond(system, explicit.h) if self.beyond_limit == "refuse" else ""
        times = measurements.timetable(explicit.h)
        if refusal:
            basis = modes(system, 1)
        elif self.basis == "pod":
            basis = pod(explicit, self.shapes, self.snapshot_load)
        else:
            basis = modes(system, self.shapes)
        top = float(np.sqrt(basis.squares.max()))
        if not refusal and explicit.h * top >= 2:
            raise UsageError(
                f"{self.shapes} shapes of up to {top:.4g} 1/s: steps of {explicit.h:g} s are "
                f"stable for those below {2 / explicit.h:.4g}; take fewer shapes or smaller steps"
            )
        model = shapes_covariance(self, explicit, basis, measurements)
        when = {} if refusal else schedule(times)
        recursion = steady(model, when) if self.gains == "steady" and when else model
        care = care_of(measurements, self.gate, self.clock, explicit.h)
        updates = {} if care else {e.step: e for e in events(recursion, when, _SETTLED)}
        sensed = np.unique(measurements.H.indices).astype(np.int64)
        rows = np.ascontiguousarray(measurements.H[:, sensed].toarray())
        core = ShapesCore(explicit, basis.Phi, model, recursion, updates, sensed, rows, care)
        return ExplicitFilterStepper(
            explicit, core, measurements, times, refusal, care, self.smooth
        )


def shapes_covariance(
    settings: ReducedEKF, steps: ExplicitStep, basis: Basis, measurements: Measurements
) -> Dense:
    """Of (q, q_before, bias), s = 2 r + l numbers, over one explicit step: central difference in
    modal form; noises grow with the square root of a step."""
    Phi, loads, h = basis.Phi, steps.system.loads, steps.h
    r, l = Phi.shape[1], loads.shape[1]
    now, old, bias = slice(0, r), slice(r, 2 * r), slice(2 * r, 2 * r + l)
    masses = np.where(steps.c2 > 0, steps.system.masses, 0.0)  # regions' damping on the average
    c2, c1 = (float(np.average(c, weights=masses)) for c in (steps.c2, steps.c1))
    push = (c2 / 2) * h * h * (Phi.T @ loads)
    A = np.eye(2 * r + l)
    A[now, now] = np.diag(c2 - (c2 / 2) * h * h * basis.squares)
    A[now, old], A[now, bias] = -c1 * np.eye(r), push
    A[old, now], A[old, old] = np.eye(r), 0.0
    Q = np.zeros_like(A)
    Q[now, now] = settings.process**2 * h * _directions(settings, steps.system, basis)
    Q[bias, bias] = settings.load_walk**2 * h * np.eye(l)
    P0 = np.zeros_like(A)
    P0[bias, bias] = settings.load_sd**2 * np.eye(l)
    H = np.zeros((len(measurements.names), 2 * r + l))
    H[:, now] = measurements.H @ Phi
    return Dense(A, Q, H, measurements.sd**2, P0)


def _directions(settings: ReducedEKF, system: System, basis: Basis) -> Floats:
    """Covariance (r, r) of amplitudes that move the body by 1 m rms, by mass."""
    mass = float(system.masses.sum()) / system.scene.mesh.dimension
    if settings.noise == "white":
        return mass * np.eye(len(basis.squares))
    static = basis.Phi.T @ system.loads / basis.squares[:, None]
    if not static.any():
        raise UsageError("noise='load' needs a load that moves the shapes; take noise='white'")
    static = static / np.linalg.norm(static, axis=0)
    return np.asarray(mass * static @ static.T)


@dataclass(frozen=True)
class ShapesMemory:
    """U_t and U_{t-h} (N,) m, bias (l,) N, and the explicit step of the last update (0: none), with
    care also what was claimed then; the look of that update; smoothed, at output frames, P."""

    u: Floats
    before: Floats
    bias: Floats
    at: int
    claim: Claim | None = None
    taken: Look | None = None
    P: Floats | None = None


@dataclass(frozen=True)
class ShapesCore:
    """`updates` are by explicit step; `rows` (m, c) read measured components from the `sensed` (c,)
    unknowns. With `care` no update is known before: each has its gain from `recursion`."""

    explicit: ExplicitStep
    Phi: Floats
    covariance: Dense
    recursion: Recursion
    updates: Mapping[int, Event]
    sensed: Ints
    rows: Floats
    care: Care | None

    @property
    def units(self) -> Mapping[str, str]:
        return {f"{load.name}.bias": "N" for load in self.explicit.system.scene.loads}

    def start(self) -> ShapesMemory:
        zeros = np.zeros(len(self.Phi))
        claim = self.recursion.start() if self.care else None
        return ShapesMemory(zeros, zeros, np.zeros(len(self.units)), 0, claim)

    def predict(self, memory: ShapesMemory, loads: Floats, drives: Floats) -> ShapesMemory:
        u, R = memory.u, self.explicit.model.force(memory.u)
        new = self.explicit.following(u, memory.before, R, loads + memory.bias, drives)
        return ShapesMemory(new, u, memory.bias, memory.at, memory.claim)

    def failure(self, memory: ShapesMemory) -> tuple[Ending, str] | None:
        return None

    def correct(
        self, memory: ShapesMemory, number: int, z: Floats
    ) -> tuple[ShapesMemory, Innovation]:
        shown = self.rows @ memory.u[self.sensed]
        if self.care is not None:
            assert memory.claim is not None
            moved = shown - self.rows @ memory.before[self.sensed]
            claim = self.recursion.predict(memory.claim, number - memory.at)
            gain, claim, found, _ = self.care.update(self.recursion, claim, z, shown, moved)
            if gain is None:
                return replace(memory, taken=None), found
            return self._moved(memory, gain, found, number, claim), found
        gain = self.updates[number].gain
        found = innovation(z, shown, gain)
        return self._moved(memory, gain, found, number, None), found

    def _moved(
        self, memory: ShapesMemory, gain: Gain, found: Innovation, number: int, claim: Claim | None
    ) -> ShapesMemory:
        look = look_of(gain, found)
        memory = self._shifted(memory, gain.G @ look.y)
        return replace(memory, at=number, claim=claim, taken=look)

    def _shifted(self, memory: ShapesMemory, dx: Floats) -> ShapesMemory:
        r = self.Phi.shape[1]
        moved = self.Phi @ dx[: 2 * r].reshape(2, r).T
        u, before = memory.u + moved[:, 0], memory.before + moved[:, 1]
        return replace(memory, u=u, before=before, bias=memory.bias + dx[2 * r :])

    def look(self, memory: ShapesMemory) -> Look | None:
        return memory.taken

    def transition(self) -> Transition:
        return self.covariance

    def corrected(
        self, memory: ShapesMemory, number: int, e: Floats, W: Floats | None
    ) -> ShapesMemory:
        if W is None:
            return self._shifted(memory, e)
        P = self._claim(memory, number).P
        PW = P @ W
        return replace(self._shifted(memory, e), P=P - PW @ PW.T)

    def sd(self, memory: ShapesMemory, number: int) -> Floats:
        """What the shapes span, diag(Phi P Phi^T)."""
        P = self._claim(memory, number).P if memory.P is None else memory.P
        r = self.Phi.shape[1]
        variances = np.maximum(((self.Phi @ P[:r, :r]) * self.Phi).sum(axis=1), 0)
        return np.asarray(np.sqrt(variances).reshape(-1, 3))

    def _claim(self, memory: ShapesMemory, number: int) -> Claim:
        covariance = self.covariance
        claim = self.updates[memory.at].claim if memory.at in self.updates else memory.claim
        claim = claim or covariance.start()
        if number > memory.at:
            claim = covariance.predict(claim, number - memory.at)
        return claim

    def numbers(self, memory: ShapesMemory) -> Mapping[str, float]:
        """`<load>.bias` N."""
        return dict(zip(self.units, memory.bias.tolist(), strict=True))
