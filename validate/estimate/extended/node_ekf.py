"""Extended Kalman filter by node as in paper 003 (steps i-iv, eqs 24-39).

Every component of every node is a filter of its own: its covariance sees the diagonal of the
tangent only, so nothing that is measured at one node reaches another. Without measurements P grows
like a^(2k), a = 2 - h^2 K_ii/M_i, which leaves the number range after 500 to 600 steps.

Departures: noise intensities are variances in m^2 (the paper's .001, .1, .001 read as mm^2);
"node" and "companion" blocks, the Joseph form and the correction of U_{t-dt} are named options.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np

from validate.arrays import Floats, Ints
from validate.errors import ComparisonError, UsageError
from validate.estimate.extended import kernels as kernel
from validate.estimate.extended.explicit_filter import (
    ExplicitFilterStepper,
    ExplicitStep,
    beyond,
    explicit_step,
)
from validate.estimate.gating import (
    Care,
    NoiseSettings,
    care_of,
    clock_setting,
    gate_setting,
    gated_out,
)
from validate.estimate.kalman.covariance import noise
from validate.estimate.kalman.formulas import Innovation
from validate.estimate.measurements import Measurements
from validate.fem.large_strain.explicit import Precision
from validate.fem.system import System
from validate.parameters import quantity
from validate.solve.handles import LARGE_DYNAMICS, Handles, require_handled
from validate.solve.types import Ending

Block = Literal["component", "node", "companion"]
_PURE = 1e-9  # how far a row's largest weight may lie from 1 to read a node
_ROWS: dict[Block, int] = {"component": 1, "companion": 3, "node": 6}


@dataclass(frozen=True)
class NodeEKF:
    """Settings. `block`: a scalar filter per component (as printed), one per node (3 x 3), or one
    per component of (U_t, U_{t-dt}) together, whose P grows like a polynomial.

    Every block takes a look's variance alone: of what a doubtful `clock` moves together it sees the
    variances, and only a gate the rest.

    `correct_previous` shifts U_{t-dt} with U_t ("companion" estimates it anyway). `overflow`: at
    variances beyond 1e300 m^2 the run stops, or they are held there and counted.
    """

    handles: ClassVar[Handles] = replace(LARGE_DYNAMICS, viscous=False)
    noise_settings: ClassVar[NoiseSettings] = NoiseSettings("Qp", "Qm", "P0")

    dt: float = quantity(2e-4, "s", "time step of the run")
    substeps: int = quantity(1, "1", "explicit steps in each; inputs are interpolated")
    P0: float = quantity(1e-9, "m2", "initial variance; the paper's .001, taken as mm2")
    Qp: float = quantity(1e-7, "m2", "process noise per explicit step; the paper's .1, mm2")
    Qm: float | None = quantity(1e-9, "m2", "measurement variance (.001 mm2); none: declared")
    block: Block = quantity("component", "1", "what is filtered together")
    covariance: Literal["printed", "joseph"] = quantity("printed", "1", "P - K H P, or Joseph's")
    correct_previous: bool = quantity(False, "1", "shift U_{t-dt} with U_t")
    overflow: Literal["stop", "hold"] = quantity("stop", "1", "what to do when P overflows")
    beyond_limit: Literal["refuse", "run"] = quantity(
        "refuse", "1", "a step above the critical step"
    )
    precision: Precision = quantity("double", "1", "of the element loops: double or single")
    gate: float | None = gate_setting()
    clock: float | None = clock_setting()

    def __post_init__(self) -> None:
        if not (self.dt > 0 and self.substeps >= 1):
            raise UsageError(f"dt {self.dt:g} s in {self.substeps} substeps: both must be positive")
        if min(self.P0, self.Qp) < 0 or (self.Qm is not None and self.Qm <= 0):
            raise UsageError("P0 and Qp must be >= 0, and Qm above 0")

    def prepare(self, system: System, measurements: Measurements) -> ExplicitFilterStepper:
        """Raise `SceneError` for what the explicit step cannot do, `ComparisonError` for
        measurements that are no components of nodes or that land between the steps."""
        require_handled(system.scene, self)
        explicit = explicit_step(system, self.dt, self.substeps, self.precision)
        free = np.zeros(len(system.moves))
        free[system.free] = 1.0
        rows, R = _components(measurements), measurements.variances(self.Qm)
        care = care_of(measurements, self.gate, self.clock, explicit.h)
        core = NodeCore(self, explicit, rows, R, free, self.Qp * free, care)
        refusal = beyond(system, explicit.h) if self.beyond_limit == "refuse" else ""
        times = measurements.timetable(explicit.h)
        return ExplicitFilterStepper(explicit, core, measurements, times, refusal, care)


@dataclass(frozen=True)
class NodeMemory:
    """U_t and U_{t-h} (N,) m, the packed covariances P of `node_ekf_kernel`, how many are held."""

    u: Floats
    before: Floats
    P: Floats
    held: int = 0


@dataclass(frozen=True)
class NodeCore:
    """`rows` (m,) are the measured unknowns, R (m,) their variances m^2; `free` (N,) is 1 where an
    unknown is free, Q (N,) m^2 its process noise."""

    settings: NodeEKF
    explicit: ExplicitStep
    rows: Ints
    R: Floats
    free: Floats
    Q: Floats
    care: Care | None

    @property
    def units(self) -> Mapping[str, str]:
        return {"covariance.held": "1"}

    def start(self) -> NodeMemory:
        """Step i: variances P0 of the free unknowns."""
        N, block = len(self.free), self.settings.block
        P = np.zeros((_ROWS[block], N // 3 if block == "node" else N))
        variances = self.settings.P0 * self.free
        P[:3] = variances.reshape(-1, 3).T if block == "node" else variances
        u = np.zeros(N)
        return NodeMemory(u, u, P)

    def predict(self, memory: NodeMemory, loads: Floats, drives: Floats) -> NodeMemory:
        """Eqs 35 and 36."""
        w = self.explicit
        u, P, count = kernel.predict(
            w.model.packed, memory.u, memory.before, memory.P, w.c2, w.c1, w.w, self.Q,
            w.loaded, w.columns, loads, w.driven, w.moves, drives,
        )  # fmt: skip
        held = kernel.clip(P) if count and self.settings.overflow == "hold" else count
        return NodeMemory(u, memory.u, P, held)

    def failure(self, memory: NodeMemory) -> tuple[Ending, str] | None:
        if not memory.held or self.settings.overflow == "hold":
            return None
        return "diverged", (
            f"{memory.held} of {memory.P.shape[1]} covariances beyond {kernel.HUGE:g} m2: "
            "nodes without measurements grow like a^(2k); overflow='hold' continues with the "
            "field, block='companion' keeps them small"
        )

    def correct(self, memory: NodeMemory, number: int, z: Floats) -> tuple[NodeMemory, Innovation]:
        """Eqs 37-39 at the measured nodes; u and P are changed in place, this step made them."""
        if self.care is None:
            return self._corrected(memory, z, self.R)
        shown, late = memory.u[self.rows], self.care.late((memory.u - memory.before)[self.rows])
        # H P H^T (m, m) m^2: only components of one node are correlated, if blocks are nodes.
        if self.settings.block == "node":
            node, axis = np.divmod(self.rows, 3)
            P = memory.P[kernel.ROW[axis[:, None], axis], node[:, None]]
            predicted = np.where(node[:, None] == node, P, 0.0)
        else:
            predicted = np.diag(memory.P[0, self.rows])
        S_yy = predicted + noise(self.R, late)
        passed, gated = self.care.passed(z, shown, S_yy)
        R = self.R if late is None else self.R + late**2
        memory, found = self._corrected(memory, passed, R)
        return memory, gated_out(found, z, shown, gated)

    def _corrected(self, memory: NodeMemory, z: Floats, R: Floats) -> tuple[NodeMemory, Innovation]:
        c, before, y, sd = self.settings, memory.before, np.empty(len(z)), np.empty(len(z))
        if c.correct_previous or c.block == "companion":
            before = before.copy()  # which is the last state's own
        nis, log_det, dof = kernel.correct(
            memory.u, before, memory.P, self.rows, z, R,
            c.covariance == "joseph", c.correct_previous, y, sd,
        )  # fmt: skip
        return NodeMemory(memory.u, before, memory.P, memory.held), Innovation(
            y, sd, nis, dof, log_det
        )

    def sd(self, memory: NodeMemory, number: int) -> Floats:
        P = memory.P
        variances = P[:3].T if self.settings.block == "node" else P[0].reshape(-1, 3)
        return np.asarray(np.sqrt(variances))

    def numbers(self, memory: NodeMemory) -> Mapping[str, float]:
        """How many covariances are held at the end of the number range."""
        return {"covariance.held": float(memory.held)}


def _components(measurements: Measurements) -> Ints:
    """The unknown (m,) that every measured component is; raises `ComparisonError` for mixtures."""
    H = measurements.H.tocsr()
    rows = np.empty(len(measurements.names), dtype=np.int64)
    for m, name in enumerate(measurements.names):
        part = slice(H.indptr[m], H.indptr[m + 1])
        best = int(np.argmax(np.abs(H.data[part]))) if H.data[part].size else -1
        if best < 0 or abs(H.data[part][best] - 1) > _PURE:
            raise ComparisonError(
                f"'{name}' is not a component of a node, so a node filter cannot use it; "
                "measure at nodes or use ReducedEKF"
            )
        rows[m] = H.indices[part][best]
    return rows
