"""Cell of a trade-off: one solver on one mesh, timed and stored; or a reference answer.

Cells with a solver run one after another on one thread: times of workers side by side would be
those of their quarrel over memory.
"""

import platform
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any, Literal

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import SuperLU

from validate.arrays import Floats
from validate.engine.store import key_of
from validate.errors import ComparisonError, ValidateError
from validate.fem.assembly.locate import Rows
from validate.fem.system import System, build
from validate.pipeline.ladder.default import trial_of
from validate.pipeline.ladder.ladder import Rival, Trial
from validate.pipeline.run.job import Job
from validate.scene.material import LawName
from validate.scene.scene import Scene
from validate.solve.external.program import words
from validate.solve.external.scheme import ExternalSimulator
from validate.solve.march import march
from validate.solve.types import Run, SceneSolver, Scheme, Stepper, StepTimes

_OF_A_FACTOR = 12  # bytes of an entry of L or U: a number and its row
DEFINITION = (
    "bytes of all arrays, sparse matrices and factors of the prepared solver, its scene, mesh "
    "and system; temporary memory of the set-up is not included"
)


def held_bytes(thing: Any) -> int:
    """Bytes reachable from `thing` through dataclasses, cached properties, tuples and mappings."""
    seen: set[int] = set()
    total, left = 0, [thing]
    while left:
        one = left.pop()
        one = _owner(one) if isinstance(one, np.ndarray) else one
        if id(one) in seen:
            continue
        seen.add(id(one))
        if isinstance(one, np.ndarray):
            total += one.nbytes
        elif isinstance(one, SuperLU):
            total += _OF_A_FACTOR * int(one.nnz)
        elif isinstance(one, Mapping):
            left += one.values()
        elif isinstance(one, (tuple, list)):
            left += one
        elif sparse.issparse(one):
            names = ("data", "indices", "indptr", "offsets")
            left += [getattr(one, n) for n in names if hasattr(one, n)]
        elif is_dataclass(one) and not isinstance(one, type):
            left += [getattr(one, f.name) for f in fields(one)]
            left += getattr(one, "__dict__", {}).values()  # cached properties too
        elif (type(one).__module__ or "").startswith("validate") and hasattr(one, "__dict__"):
            left += vars(one).values()
    return total


def _owner(array: np.ndarray) -> np.ndarray:
    """The array whose memory a view shows."""
    base = array.base
    return _owner(base) if isinstance(base, np.ndarray) else array


# --- External simulators on the ladder of a trade-off: each run is a separate process.

EXTERNAL = "external "  # prefix of their names
_CARRIED = ("P1", "P2", "H8")  # elements that a job carries
_SECONDS = 120.0  # of one run, start and files included


def with_simulators(trial: Trial, commands: Sequence[str]) -> Trial:
    """Return the trial with every external simulator as a solver, at the ladder's longest steps.

    Each has the linear law and, if the trial has a pair of laws, large strain. Raises `UsageError`
    for a command whose program is missing.
    """
    rivals = [r for command in commands for r in _rivals(trial, command)]
    return replace(trial, solvers=(*trial.solvers, *rivals)) if rivals else trial


def _rivals(trial: Trial, command: str) -> list[Rival]:
    words(command)
    given = shlex.split(command)
    called = Path(given[1] if len(given) > 1 else given[0]).stem
    own = tuple(e for e in trial.meshes if e in _CARRIED)
    laws: tuple[LawName, ...] = ("linear", *((trial.pair.law,) if trial.pair else ()))
    return [
        Rival(
            f"{EXTERNAL}{called}" + ("" if law == "linear" else ", large strain"),
            "external simulators", partial(_external, command, trial.dynamic), law=law,
            elements=own or ("-",), shortest=trial.steps[0],
        )
        for law in laws
    ]  # fmt: skip


def _external(command: str, moving: bool, dt: float) -> ExternalSimulator:
    return ExternalSimulator(command, inertia=moving, seconds=_SECONDS)


# -------------------------------------------------------------------------------------------------

_FIRST, _PROBED = 4, 60  # steps that tell how long all would take, the second where it is short
_PROBE_S = 1.0
_FIELDS = 15  # times a field is formed, for its median
BUDGET_S = 8.0  # of one cell's steps: a longer one is timed, not scored
AGAIN_S = 30.0  # of a cell that is run once more

Part = Literal["solver", "best", "declared", "large"]


@dataclass(frozen=True)
class TradeCell:
    """What runs on one mesh: the `solver` of that name with its `steps` s, each for `budget` s at
    most; or the ladder's `best` solver, or one of its pair of laws."""

    part: Part
    element: str
    level: int
    steps: tuple[float, ...]
    solver: str = ""
    budget: float = BUDGET_S
    key: str = ""

    @property
    def label(self) -> str:
        what = self.solver or ("reference" if self.part == "best" else f"{self.part} law")
        return f"{what}, {self.element} mesh {self.level}"

    @property
    def timed(self) -> bool:
        return self.part == "solver"


@dataclass(frozen=True)
class Stride:
    """One step dt s of a solver: its costs, and displacements u (no, p, d) m at the ladder's frames
    and points, None where `failed` says why. `force` (no, k, 1) N of what drives the scene and
    `pressure` (no, c, 1) Pa of its cavities, None where the solver has no such number. `field_s`:
    all displacements formed from a state. `memory` bytes; `assembled`: matrices that set-up made.
    """

    dt: float
    u: Floats | None = None
    unknowns: int = 0
    setup_s: float = 0.0
    step: StepTimes | None = None
    field_s: float = 0.0
    memory: int = 0
    assembled: str = ""
    failed: str = ""
    force: Floats | None = None
    pressure: Floats | None = None


@dataclass(frozen=True)
class Measured:
    """All steps of a cell; `setup_s` is that of the first one."""

    strides: tuple[Stride, ...]


def keyed(job: Job, cell: TradeCell) -> TradeCell:
    """Return the cell with its key.

    Times are valid on one machine. External simulators do not change the key of another solver.
    """
    machine = platform.node() if cell.timed else ""
    job = job if cell.solver.startswith(EXTERNAL) else replace(job, simulators=())
    return replace(cell, key=key_of(job, cell, machine))


def open_trial(job: Job) -> Trial:
    return with_simulators(trial_of(job.experiment(), job.quick), job.simulators)


def run_cell(trial: Trial, cell: TradeCell) -> Measured:
    """Raise what an answer to compare with ends with; a solver's failures are in its strides."""
    if cell.part == "solver":
        return _measured(trial, cell, trial.solver(cell.solver))
    scheme, law = _scheme(trial, cell)
    system = build(trial.build(cell.element, cell.level, law))
    dt = cell.steps[0]
    run = _march(trial, scheme.prepare(system), dt, 0.0)
    if not run.finished:
        raise ComparisonError(
            f"the reference run on {cell.element} mesh {cell.level} ended at step "
            f"{run.outcome.step}: {run.outcome.why}"
        )
    return Measured((_answered(Stride(dt), trial, system, run),))


def _scheme(trial: Trial, cell: TradeCell) -> tuple[Scheme, LawName]:
    dt, pair = cell.steps[0], trial.pair
    if cell.part == "best" or pair is None:
        return trial.best(dt), "linear"
    return (pair.large(dt), pair.law) if cell.part == "large" else (pair.declared(dt), "linear")


def _march(trial: Trial, stepper: Stepper, dt: float, setup: float, steps: int = 0) -> Run:
    t = trial.times(dt)
    at = np.round(trial.frames / dt).astype(np.int64) - 1
    if steps:
        t, at = t[:steps], np.array([min(steps, len(t)) - 1])
    return march("cell", stepper, t, trial.inputs(t), at, setup)


def _answered(stride: Stride, trial: Trial, system: System, run: Run) -> Stride:
    """The stride with what the run found at the ladder's frames."""
    rows = Rows.barycentric(system.scene.mesh, trial.points)
    return replace(
        stride,
        u=np.array([rows.apply(u) for u in run.u]),
        force=_at_frames(run, driving(system.scene)),
        pressure=_at_frames(run, cavity_pressures(system.scene)),
    )


def driving(scene: Scene) -> tuple[str, ...]:
    """Traces of the forces on what drives the scene: drives, moving bodies, probes."""
    names = [d.name for d in scene.drives] + [m.name for m in scene.movers]
    return tuple(f"{name}.force" for name in (*names, *(tool.name for tool in scene.tools)))


def cavity_pressures(scene: Scene) -> tuple[str, ...]:
    """Traces of the pressure in every cavity."""
    return tuple(f"{cavity.name}.pressure" for cavity in scene.cavities)


def _at_frames(run: Run, names: tuple[str, ...]) -> Floats | None:
    """Traces (no, k, 1) at the frames, of a force with axes all of them; None where one lacks."""
    found = [[t for t in run.traces if t == name or t.startswith(f"{name}.")] for name in names]
    if not names or not all(found):
        return None
    columns = [run.traces[t].y[run.at] for traces in found for t in sorted(traces)]
    return np.stack(columns, axis=1)[..., None]


# --- a solver, measured ---------------------------------------------------------------------------


def _measured(trial: Trial, cell: TradeCell, solver: Rival) -> Measured:
    """On one system, so that later steps find its matrices assembled."""
    start = perf_counter()
    try:
        system = build(trial.build(cell.element, cell.level, solver.law))
    except ValidateError as error:
        return Measured(tuple(_refused(dt, error) for dt in cell.steps))
    strides: list[Stride] = []
    for dt in cell.steps:
        began = start if dt == cell.steps[0] else perf_counter()
        try:
            stride = _stride(trial, solver.make(dt), system, dt, began, cell.budget)
        except ValidateError as error:
            stride = _refused(dt, error)
        first = next((s.setup_s for s in strides if s.setup_s), stride.setup_s)
        strides.append(replace(stride, setup_s=first))
    return Measured(tuple(strides))


def _refused(dt: float, error: ValidateError) -> Stride:
    return Stride(dt, failed=" ".join(f"refused: {error}".split()))


def _stride(
    trial: Trial,
    scheme: Scheme | SceneSolver,
    system: System,
    dt: float,
    start: float,
    budget: float,
) -> Stride:
    if isinstance(scheme, SceneSolver):
        # A solver that is given all times at once: its own seconds and memory
        t, began = trial.times(dt), perf_counter()
        run = scheme.solve(system.scene, t, trial.inputs(t))
        unknowns, setup = len(system.free), run.setup_s or perf_counter() - began
        stride = Stride(dt, None, unknowns, setup, run.step_s, 0.0, run.memory, "its own")
        if not run.finished:
            return replace(stride, step=None, failed=f"{run.outcome.state}: {run.outcome.why}")
        at = np.round(trial.frames / dt).astype(np.int64) - 1
        return _answered(stride, trial, system, replace(run, at=at, u=run.u[at]))
    stepper = scheme.prepare(system)
    # The largest inputs, after a step under them where there is a table to be filled
    warmed = trial.largest_inputs
    if not trial.dynamic:
        stepper.step(stepper.rest(), warmed)
    setup = perf_counter() - start
    first = _march(trial, stepper, dt, setup, _FIRST)
    short = first.step_s is not None and first.step_s.p50 * _PROBED < _PROBE_S
    tried = _march(trial, stepper, dt, setup, _PROBED) if first.finished and short else first
    # Matrices that were asked for, of K, M and C (with the lumped masses)
    made = [name for name in ("K", "M", "C", "masses") if name in system.__dict__]
    assembled = " ".join("m" if name == "masses" else name for name in made) or "none"
    # Median seconds of forming all displacements of a state
    state, seconds = stepper.step(stepper.rest(), warmed), list[float]()
    for _ in range(0 if state.failure else _FIELDS):
        began = perf_counter()
        stepper.field(state)
        seconds.append(perf_counter() - began)
    field_s = float(np.median(seconds)) if seconds else 0.0
    stride = Stride(
        dt, None, len(system.free), setup, None, field_s, held_bytes(stepper), assembled,
    )  # fmt: skip
    if not tried.finished:
        return replace(stride, failed=f"{tried.outcome.state}: {tried.outcome.why}")
    steps = len(trial.times(dt))
    needed = steps * (tried.step_s.p50 if tried.step_s else 0.0)
    if needed > budget:
        why = f"only timed: its {steps} steps take {needed:.0f} s, more than {budget:g} s"
        return replace(stride, step=tried.step_s, failed=why)
    run = _march(trial, stepper, dt, setup)
    if not run.finished:
        why = f"{run.outcome.state} at step {run.outcome.step + 1}: {run.outcome.why}"
        return replace(stride, failed=why)
    return _answered(replace(stride, step=run.step_s), trial, system, run)
