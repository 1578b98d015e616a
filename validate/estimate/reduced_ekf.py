"""An extended Kalman filter on few shapes and the bias of the loads, beside the plain explicit run.

Between measurements the body runs at full size and full nonlinearity; what is uncertain are r
amplitudes of U_t and of U_{t-h} along the shapes Phi, and one bias N a load (a random walk: a body
that is stiffer than the model is a body with less load). Their covariance follows central
difference linearised at rest, one scalar equation a shape:

    q' = (2 - h^2 omega^2) q - q_before + h^2 Phi^T f b      (paper 003, eq 19, in modal form)

and both U_t and U_{t-h} are corrected, so that a correction is no kick. Joseph's form throughout.

Departures: paper 003 filters node by node (`NodeEKF`), where no measurement reaches other nodes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from validate.arrays import Floats, Ints
from validate.errors import UsageError
from validate.estimate import node_ekf_kernel as kernel
from validate.estimate.explicit_walk import Walk, beyond, explicit_model, walk
from validate.estimate.innovation import Innovation, innovation_traces, nothing
from validate.estimate.measured import Measurements, Timetable, timetable
from validate.estimate.reduced_basis import Basis, modes, pod
from validate.estimate.reduced_gains import Jump, ReducedModel, Update, updates
from validate.fem.system import System
from validate.parameters import quantity
from validate.scene.scene import Scene
from validate.solve.types import NO_SURFACE, NOTHING, State, Trace


@dataclass(frozen=True)
class ReducedEKF:
    """Settings. `process` is the random walk of the shapes' amplitudes, as the rms displacement of
    the body that one of them makes: "white" for every shape alike, or "load": in one direction, the
    static response to each load (rank 1). `gains`: the exact sequence, which needs no data and is
    found before the run, or the steady gain from the start.
    """

    dt: float = quantity(2e-4, "s", "time step of the run")
    substeps: int = quantity(1, "1", "explicit steps in each; inputs are interpolated")
    basis: Literal["modes", "pod"] = quantity("modes", "1", "lowest modes, or shapes of own runs")
    shapes: int = quantity(20, "1", "how many; 5 of a POD do as well as 20 modes")
    snapshot_load: float = quantity(1.0, "N", "load of the runs that a POD takes its shapes from")
    load_walk: float = quantity(1.0, "N/s^0.5", "random walk of every load's bias")
    load_sd: float = quantity(0.0, "N", "standard deviation of the bias at rest")
    process: float = quantity(1e-6, "m/s^0.5", "random walk of the shapes, rms over the body")
    noise: Literal["white", "load"] = quantity("white", "1", "where the process noise acts")
    gains: Literal["sequence", "steady"] = quantity("sequence", "1", "exact, or the steady one")
    beyond_limit: Literal["refuse", "run"] = quantity("refuse", "1", "a step above the critical")

    def __post_init__(self) -> None:
        if not (self.dt > 0 and self.substeps >= 1):
            raise UsageError(f"dt {self.dt:g} s in {self.substeps} substeps: both must be positive")
        if min(self.load_walk, self.load_sd, self.process) < 0:
            raise UsageError("load_walk, load_sd and process are standard deviations >= 0")

    def prepare(self, system: System, measurements: Measurements) -> "ReducedStepper":
        """Raises `SceneError` for what the explicit step cannot do, `UsageError` for a basis that
        does not exist, `ComparisonError` for a steady gain that does not, or times off the steps.
        """
        steps = walk(system, explicit_model(system), self.dt, self.substeps)
        refusal = beyond(system, steps.h) if self.beyond_limit == "refuse" else ""
        times = timetable(measurements, steps.h)
        basis = modes(system, 1) if refusal else self._basis(steps)
        model = reduced_model(self, steps, basis, measurements)
        found = {} if refusal else updates(model, times, steady=self.gains == "steady")
        sensed = np.unique(measurements.H.indices).astype(np.int64)
        rows = np.ascontiguousarray(measurements.H[:, sensed].toarray())
        return ReducedStepper(
            self, steps, measurements.names, sensed, rows, times, model, found, refusal
        )

    def _basis(self, steps: Walk) -> Basis:
        if self.basis == "pod":
            basis = pod(steps, self.shapes, self.snapshot_load)
        else:
            basis = modes(steps.system, self.shapes)
        top = float(np.sqrt(basis.squares.max()))
        if steps.h * top >= 2:
            raise UsageError(
                f"{self.shapes} shapes of up to {top:.4g} 1/s: steps of {steps.h:g} s carry those "
                f"below {2 / steps.h:.4g}; take fewer shapes or smaller steps"
            )
        return basis


def reduced_model(
    settings: ReducedEKF, steps: Walk, basis: Basis, measurements: Measurements
) -> ReducedModel:
    """Central difference in modal form; noises grow with the square root of a step."""
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
    return ReducedModel(Phi, Jump(A, Q), P0, H, np.diag(measurements.sd**2))


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
class Beside:
    """U_{t-h} (N,) m, bias (l,) N, and the explicit step of the last update (0: none)."""

    before: Floats
    bias: Floats
    at: int


@dataclass(frozen=True)
class ReducedStepper:
    """A prepared `ReducedEKF`; `rows` (m, c) read measured components from the `sensed` (c,)
    unknowns; `updates` are by explicit step."""

    settings: ReducedEKF
    walk: Walk
    names: tuple[str, ...]
    sensed: Ints
    rows: Floats
    times: Timetable
    model: ReducedModel
    updates: Mapping[int, Update]
    refusal: str

    @property
    def scene(self) -> Scene:
        return self.walk.system.scene

    def rest(self) -> State:
        """U_0 = U_{-h} = 0, known."""
        zeros = np.zeros(len(self.walk.system.moves))
        bias = np.zeros(len(self.scene.loads))
        inputs = np.zeros(len(self.scene.inputs))
        return State(inputs, NOTHING, 0, NO_SURFACE, u=zeros, extra=Beside(zeros, bias, 0))

    def step(self, state: State, drives: Floats) -> State:
        """`substeps` plain explicit steps; an update where something was measured."""
        if self.refusal:
            return replace(state, failure=("refused", self.refusal))
        assert state.u is not None
        u, beside, found = state.u, state.extra, nothing(len(self.names))
        for part in range(self.walk.parts):
            loads, ends = self.walk.inputs(state.drives, drives, part)
            R = self.walk.model.force(u)
            following = self.walk.following(u, beside.before, R, loads + beside.bias, ends)
            u, beside = following, Beside(u, beside.bias, beside.at)
            number = state.k * self.walk.parts + part + 1
            z = self.times.at(number)
            if z is not None:
                u, beside, found = self._corrected(u, beside, z, number, found)
        largest = kernel.farthest(u)
        if not largest < self.walk.far:
            return replace(state, failure=("diverged", self.walk.lost(largest)))
        return State(
            drives, NOTHING, 0, NO_SURFACE, u=u, numbers=self._numbers(found, beside),
            k=state.k + 1, extra=beside,
        )  # fmt: skip

    def field(self, state: State) -> Floats:
        """Displacements (n, 3) m."""
        assert state.u is not None
        return state.u.reshape(-1, 3)

    def sd(self, state: State) -> Floats:
        """Standard deviations (n, 3) m: what the shapes span, diag(Phi P Phi^T)."""
        beside, model = state.extra, self.model
        jump = model.over(state.k * self.walk.parts - beside.at)
        P = self.updates[beside.at].P if beside.at else model.P0
        P = (jump.A @ P @ jump.A.T + jump.Q)[: model.r, : model.r]
        variances = np.maximum(((model.Phi @ P) * model.Phi).sum(axis=1), 0)
        return np.asarray(np.sqrt(variances).reshape(-1, 3))

    def traces(self, states: Sequence[State]) -> dict[str, Trace]:
        """Innovations, NIS, and `<load>.bias` N."""
        traces = innovation_traces(self.names, states)
        for load in self.scene.loads:
            name = f"{load.name}.bias"
            traces[name] = Trace(np.array([s.numbers.get(name, 0.0) for s in states]), "N")
        return traces

    def _numbers(self, found: Innovation, beside: Beside) -> Mapping[str, float]:
        loads = zip(self.scene.loads, beside.bias.tolist(), strict=True)
        return {**found.numbers(self.names), **{f"{load.name}.bias": b for load, b in loads}}

    def _corrected(
        self, u: Floats, beside: Beside, z: Floats, number: int, found: Innovation
    ) -> tuple[Floats, Beside, Innovation]:
        """The update; `found` gains this one's NIS."""
        update, r = self.updates[number], self.model.r
        y = np.where(np.isfinite(z), z - self.rows @ u[self.sensed], 0.0)
        dx = update.G @ y
        moved = self.model.Phi @ dx[: 2 * r].reshape(2, r).T
        after = Beside(beside.before + moved[:, 1], beside.bias + dx[2 * r :], number)
        nis = found.nis + float(y @ update.inverse @ y)
        return u + moved[:, 0], after, Innovation(y, update.sd, nis, found.dof + update.dof)
