"""The extended Kalman filter node by node, as paper 003 prints it (steps i-iv, eqs 24-39).

Every component of every node is a filter of its own: its covariance sees the diagonal of the
tangent only, so nothing that is measured at one node reaches another. Without measurements P grows
like a^(2k), a = 2 - h^2 K_ii/M_i, which leaves the number range after 500 to 600 steps.

Departures: noise intensities are variances in m^2 (the paper's .001, .1, .001 read as mm^2);
"node" and "companion" blocks, the Joseph form and the correction of U_{t-dt} are named options.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from validate.arrays import Floats, Ints
from validate.errors import ComparisonError, UsageError
from validate.estimate import node_ekf_kernel as kernel
from validate.estimate.explicit_walk import ExplicitModel, Walk, beyond, explicit_model, walk
from validate.estimate.innovation import Innovation, innovation_traces, nothing
from validate.estimate.measured import Measurements, Timetable, timetable
from validate.fem.system import System
from validate.parameters import quantity
from validate.scene.scene import Scene
from validate.solve.types import NO_SURFACE, NOTHING, Ending, State, Trace

Block = Literal["component", "node", "companion"]
_PURE = 1e-9  # how far a row's largest weight may lie from 1 to read a node
_ROWS: dict[Block, int] = {"component": 1, "companion": 3, "node": 6}


@dataclass(frozen=True)
class NodeEKF:
    """Settings. `block`: a scalar filter per component (as printed), one per node (3 x 3), or one
    per component of (U_t, U_{t-dt}) together, whose P grows like a polynomial.

    `correct_previous` shifts U_{t-dt} with U_t ("companion" estimates it anyway). `overflow`: at
    variances beyond 1e300 m^2 the run stops, or they are held there and counted.
    """

    dt: float = quantity(2e-4, "s", "time step of the run")
    substeps: int = quantity(1, "1", "explicit steps in each; inputs are interpolated")
    P0: float = quantity(1e-9, "m2", "initial variance; the paper's .001, read as mm2")
    Qp: float = quantity(1e-7, "m2", "process noise per explicit step; the paper's .1, mm2")
    Qm: float | None = quantity(1e-9, "m2", "measurement variance (.001 mm2); none: declared")
    block: Block = quantity("component", "1", "what is filtered together")
    covariance: Literal["printed", "joseph"] = quantity("printed", "1", "P - K H P, or Joseph's")
    correct_previous: bool = quantity(False, "1", "shift U_{t-dt} with U_t")
    overflow: Literal["stop", "hold"] = quantity("stop", "1", "what to do when P overflows")
    beyond_limit: Literal["refuse", "run"] = quantity("refuse", "1", "a step above the critical")

    def __post_init__(self) -> None:
        if not (self.dt > 0 and self.substeps >= 1):
            raise UsageError(f"dt {self.dt:g} s in {self.substeps} substeps: both must be positive")
        if min(self.P0, self.Qp) < 0 or (self.Qm is not None and self.Qm <= 0):
            raise UsageError("P0 and Qp are variances >= 0, Qm one above 0")

    def prepare(self, system: System, measurements: Measurements) -> "NodeStepper":
        """Raises `SceneError` for what the explicit step cannot do, `ComparisonError` for
        measurements that are no components of nodes or that land between the steps."""
        steps = walk(system, explicit_model(system), self.dt, self.substeps)
        m = len(measurements.names)
        R = measurements.sd**2 if self.Qm is None else np.full(m, self.Qm)
        free = np.zeros(len(system.moves))
        free[system.free] = 1.0
        refusal = beyond(system, steps.h) if self.beyond_limit == "refuse" else ""
        rows = _components(measurements)
        times = timetable(measurements, steps.h)
        return NodeStepper(
            self, steps, measurements.names, rows, R, times, free, self.Qp * free, refusal
        )


@dataclass(frozen=True)
class Memory:
    """U_{t-h} (N,) m, the packed covariances P of `node_ekf_kernel`, and how many are held."""

    before: Floats
    P: Floats
    held: int = 0


@dataclass(frozen=True)
class NodeStepper:
    """A prepared `NodeEKF`; `rows` (m,) are the measured unknowns, R (m,) their variances m^2."""

    settings: NodeEKF
    walk: Walk
    names: tuple[str, ...]
    rows: Ints
    R: Floats
    times: Timetable
    free: Floats
    Q: Floats
    refusal: str

    @property
    def scene(self) -> Scene:
        return self.walk.system.scene

    @property
    def model(self) -> ExplicitModel:
        return self.walk.model

    def rest(self) -> State:
        """U_0 = U_{-dt} = 0 (step i), with variances P0 of the free unknowns."""
        N, block = len(self.free), self.settings.block
        P = np.zeros((_ROWS[block], N // 3 if block == "node" else N))
        variances = self.settings.P0 * self.free
        P[:3] = variances.reshape(-1, 3).T if block == "node" else variances
        inputs = np.zeros(len(self.scene.inputs))
        u = np.zeros(N)
        return State(inputs, NOTHING, 0, NO_SURFACE, u=u, extra=Memory(u, P))

    def step(self, state: State, drives: Floats) -> State:
        """`substeps` explicit steps with prediction and, where measured, update of every node."""
        if self.refusal:
            return replace(state, failure=("refused", self.refusal))
        assert state.u is not None
        u, memory, found = state.u, state.extra, nothing(len(self.names))
        memory = Memory(memory.before, memory.P.copy(), memory.held)
        for part in range(self.walk.parts):
            u, memory = self._predicted(u, memory, self.walk.inputs(state.drives, drives, part))
            if failure := self._failure(u, memory):
                return replace(state, failure=failure)
            z = self.times.at(state.k * self.walk.parts + part + 1)
            if z is not None:
                u, memory, found = self._corrected(u, memory, z, found)
        numbers = {**found.numbers(self.names), "covariance.held": float(memory.held)}
        return State(
            drives, NOTHING, 0, NO_SURFACE, u=u, numbers=numbers, k=state.k + 1, extra=memory
        )

    def field(self, state: State) -> Floats:
        """Displacements (n, 3) m."""
        assert state.u is not None
        return state.u.reshape(-1, 3)

    def sd(self, state: State) -> Floats:
        """Standard deviations (n, 3) m of the nodes."""
        P = state.extra.P
        return np.asarray(
            np.sqrt(P[:3].T if self.settings.block == "node" else P[0].reshape(-1, 3))
        )

    def traces(self, states: Sequence[State]) -> dict[str, Trace]:
        """Innovations, NIS, and how many covariances are held at the end of the number range."""
        held = np.array([s.numbers.get("covariance.held", 0.0) for s in states])
        return innovation_traces(self.names, states) | {"covariance.held": Trace(held, "1")}

    def _predicted(
        self, u: Floats, memory: Memory, inputs: tuple[Floats, Floats]
    ) -> tuple[Floats, Memory]:
        """Eqs 35 and 36; P is changed in place, the caller owns it."""
        w, P, c = self.walk, memory.P, self.settings
        if c.block == "node":
            R, K = w.model.force_and_blocks(u)
            count = kernel.spread_nodes(P, w.c2, w.w, K, self.Q)
        elif c.block == "companion":
            R, K = w.model.force_and_diagonal(u)
            count = kernel.spread_companions(P, w.c2, w.c1, w.w, K, self.Q)
        else:
            R, K = w.model.force_and_diagonal(u)
            count = kernel.spread_components(P, w.c2, w.w, K, self.Q)
        held = kernel.clip(P) if count and c.overflow == "hold" else count
        return w.following(u, memory.before, R, *inputs), Memory(u, P, held)

    def _corrected(
        self, u: Floats, memory: Memory, z: Floats, found: Innovation
    ) -> tuple[Floats, Memory, Innovation]:
        """Eqs 37-39 at the measured nodes; `found` gains this update's NIS."""
        c, P, m = self.settings, memory.P, len(z)
        y, sd, joseph = np.empty(m), np.empty(m), c.covariance == "joseph"
        before = memory.before.copy()
        dof = kernel.innovations(u, P, self.rows, z, self.R, y, sd)
        if c.block == "companion":
            nis = kernel.correct_companions(u, before, P, self.rows, z, self.R, joseph)
        else:
            update = kernel.correct_nodes if c.block == "node" else kernel.correct_components
            nis = update(u, before, P, self.rows, z, self.R, joseph, c.correct_previous)
        total = Innovation(y, sd, found.nis + nis, found.dof + dof)
        return u, Memory(before, P, memory.held), total

    def _failure(self, u: Floats, memory: Memory) -> tuple[Ending, str] | None:
        largest = kernel.farthest(u)
        if not largest < self.walk.far:
            return "diverged", self.walk.lost(largest)
        if not memory.held or self.settings.overflow == "hold":
            return None
        return "diverged", (
            f"{memory.held} of {memory.P.shape[1]} covariances beyond {kernel.HUGE:g} m2: nodes "
            "without measurements grow like a^(2k); overflow='hold' goes on with the field, "
            "block='companion' keeps them small"
        )


def _components(measurements: Measurements) -> Ints:
    """The unknown (m,) that every measured component is; raises `ComparisonError` for mixtures."""
    H = measurements.H.tocsr()
    rows = np.empty(len(measurements.names), dtype=np.int64)
    for m, name in enumerate(measurements.names):
        part = slice(H.indptr[m], H.indptr[m + 1])
        best = int(np.argmax(np.abs(H.data[part]))) if H.data[part].size else -1
        if best < 0 or abs(H.data[part][best] - 1) > _PURE:
            raise ComparisonError(
                f"'{name}' is no component of a node: a filter by nodes cannot use it; measure at "
                "nodes or take ReducedEKF"
            )
        rows[m] = H.indices[part][best]
    return rows
