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
from scipy import sparse
from scipy.linalg import solve

from validate.arrays import Floats
from validate.errors import UsageError
from validate.estimate.explicit_walk import Walk, beyond, explicit_model, walk
from validate.estimate.innovation import Innovation, innovation, innovation_traces, nothing
from validate.estimate.linear_model import LinearModel
from validate.estimate.measured import Measurements, Timetable, timetable
from validate.estimate.reduced_basis import Basis, modes, pod
from validate.estimate.small import joseph
from validate.estimate.steady import steady_claim
from validate.fem.system import System
from validate.parameters import quantity
from validate.scene.scene import Scene
from validate.solve.types import NO_SURFACE, NOTHING, State, Trace


@dataclass(frozen=True)
class ReducedEKF:
    """Settings. `process` is the random walk of the shapes' amplitudes, as the rms displacement of
    the body that one of them makes: "white" for every shape alike, or "load": in one direction, the
    static response to each load (rank 1). `gain` "steady" solves the Riccati equation once.
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
    gain: Literal["recursive", "steady"] = quantity("recursive", "1", "every update, or one")
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
        pods = self.basis == "pod" and not refusal
        basis = pod(steps, self.shapes, self.snapshot_load) if pods else modes(system, self.shapes)
        times = timetable(measurements, steps.h)
        model = reduced_model(self, steps, basis, measurements)
        gaps = np.diff([0, *sorted(times.z)])
        jumps = {int(gap): model.over(int(gap)) for gap in np.unique(gaps)}
        fixed = None
        if self.gain == "steady" and len(gaps):
            fixed = steady(jumps[int(np.median(gaps))], model)
        return ReducedStepper(
            self, steps, measurements.names, measurements.H, times, model, jumps, fixed, refusal
        )


@dataclass(frozen=True)
class Jump:
    """A transition A (s, s) over some steps and the process noise Q (s, s) gathered on the way."""

    A: Floats
    Q: Floats

    def then(self, later: "Jump") -> "Jump":
        return Jump(later.A @ self.A, later.A @ self.Q @ later.A.T + later.Q)


@dataclass(frozen=True)
class ReducedModel:
    """The state (q, q_before, bias) of s = 2 r + l numbers: one explicit step, P at rest, H (m, s)
    and R (m, m) m^2 of the measurements."""

    Phi: Floats
    one: Jump
    P0: Floats
    H: Floats
    R: Floats

    @property
    def r(self) -> int:
        return int(self.Phi.shape[1])

    def over(self, steps: int) -> Jump:
        """The transition over any number of explicit steps >= 0, by repeated squaring."""
        s = len(self.P0)
        whole, part = Jump(np.eye(s), np.zeros((s, s))), self.one
        while steps:
            whole = whole.then(part) if steps & 1 else whole
            steps, part = steps >> 1, part.then(part)
        return whole

    def gain(self, P: Floats, seen: Floats | slice = slice(None)) -> Floats:
        """G (s, seen) = P H^T (H P H^T + R)^-1."""
        H = self.H[seen]
        return np.asarray(solve(H @ P @ H.T + self.R[seen][:, seen], H @ P, assume_a="pos").T)

    def updated(self, P: Floats, G: Floats, seen: Floats | slice = slice(None)) -> Floats:
        """Joseph's form: positive for any G."""
        return joseph(P, G, self.H[seen], self.R[seen][:, seen])


def reduced_model(
    settings: ReducedEKF, steps: Walk, basis: Basis, measurements: Measurements
) -> ReducedModel:
    """Central difference in modal form; noises grow with the length of a step."""
    Phi, loads, h = basis.Phi, steps.system.loads, steps.h
    r, l = Phi.shape[1], loads.shape[1]
    now, old, bias = slice(0, r), slice(r, 2 * r), slice(2 * r, 2 * r + l)
    first = steps.system.free[0]
    c2, c1 = steps.c2[first], steps.c1[first]
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
class Steady:
    """The gain (s, m) that regular updates settle to, and P (s, s) after each."""

    G: Floats
    P: Floats


def steady(jump: Jump, model: ReducedModel) -> Steady:
    """That of updates a `jump` apart; raises `ComparisonError` where there is none."""
    s = len(model.P0)
    Q, none = (jump.Q + jump.Q.T) / 2, np.zeros((s, 0))
    P = steady_claim(LinearModel(jump.A, none, model.H, Q, model.R, np.zeros(s), model.P0)).P
    G = model.gain(P)
    return Steady(G, model.updated(P, G))


@dataclass(frozen=True)
class Beside:
    """U_{t-h} (N,) m, bias (l,) N, P (s, s) of the explicit step number `at` and that number."""

    before: Floats
    bias: Floats
    P: Floats
    at: int


@dataclass(frozen=True)
class ReducedStepper:
    """A prepared `ReducedEKF`; `jumps` are the transitions over the gaps between measurements."""

    settings: ReducedEKF
    walk: Walk
    names: tuple[str, ...]
    H: sparse.csr_array
    times: Timetable
    model: ReducedModel
    jumps: Mapping[int, Jump]
    fixed: Steady | None
    refusal: str

    @property
    def scene(self) -> Scene:
        return self.walk.system.scene

    def rest(self) -> State:
        """U_0 = U_{-h} = 0, known."""
        zeros = np.zeros(len(self.walk.system.moves))
        bias = np.zeros(len(self.scene.loads))
        inputs = np.zeros(len(self.scene.inputs))
        return State(
            inputs, NOTHING, 0, NO_SURFACE, u=zeros, extra=Beside(zeros, bias, self.model.P0, 0)
        )

    def step(self, state: State, drives: Floats) -> State:
        """`substeps` plain explicit steps; an update where something was measured."""
        if self.refusal:
            return replace(state, failure=("refused", self.refusal))
        assert state.u is not None
        u, beside, found = state.u, state.extra, nothing(len(self.names))
        for part in range(self.walk.parts):
            start = self.walk.inputs(state.drives, drives, part)
            start[len(self.scene.drives) :] += beside.bias
            end = self.walk.inputs(state.drives, drives, part + 1)
            R = self.walk.model.force(u)
            u, before = self.walk.following(u, beside.before, R, start, end), u
            beside = replace(beside, before=before)
            number = state.k * self.walk.parts + part + 1
            z = self.times.at(number)
            if z is not None:
                u, beside, found = self._corrected(u, beside, z, number, found)
        largest = float(np.abs(u).max())
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
        P = (jump.A @ beside.P @ jump.A.T + jump.Q)[: model.r, : model.r]
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
        model, r, seen = self.model, self.model.r, np.isfinite(z)
        jump = self.jumps[number - beside.at]
        P = jump.A @ beside.P @ jump.A.T + jump.Q
        this = innovation(z, self.H @ u, model.H @ P @ model.H.T + model.R)
        if self.fixed is None:
            G = model.gain(P, seen)
            P, dx = model.updated(P, G, seen), G @ this.y[seen]
        else:
            P, dx = self.fixed.P, self.fixed.G @ this.y
        before = beside.before + model.Phi @ dx[r : 2 * r]
        after = Beside(before, beside.bias + dx[2 * r :], P, number)
        total = replace(this, nis=found.nis + this.nis, dof=found.dof + this.dof)
        return u + model.Phi @ dx[:r], after, total
