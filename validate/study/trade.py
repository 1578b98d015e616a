"""Error against time per step: every solver x element x mesh x step of a scene, in one process.

Cells run one after another on one thread: times of workers side by side would be those of their
quarrel over memory. The error is taken apart: what is left with a solver that makes none on that
mesh is the mesh's, the rest is the solver's; what the declared law costs is a pair at large strain.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np

from validate.arrays import Floats, rms
from validate.errors import ValidateError
from validate.fem.locate import barycentric_rows
from validate.fem.system import System, build
from validate.replay.options import Report
from validate.scene.scene import LawName
from validate.solve.march import march
from validate.solve.types import Run, Scheme, Stepper, StepTimes
from validate.study.convergence import Convergence, convergence
from validate.study.held import held_bytes
from validate.study.ranking import dominator
from validate.study.trade_scene import Solver, TradeScene

_FIRST, _PROBED = 4, 60  # steps that tell how long all would take, the second where it is short
_PROBE_S = 1.0
_FIELDS = 15  # times a field is formed, for its median
BUDGET_S = 8.0  # of one cell's steps: a longer one is timed, not scored
_AGAIN_S = 30.0  # of a cell that is run once more
ERROR = (
    "root mean square over the frames and points of the length of u - u_reference, the mesh's "
    "displacements read at the same points of the body on every mesh"
)


@dataclass(frozen=True)
class Cell:
    """What runs: a solver on one mesh with one step s."""

    solver: Solver
    element: str
    level: int
    dt: float


@dataclass(frozen=True)
class Row:
    """One cell, measured. Errors in m, None where `failed` says why.

    `error` is against the reference of its own law, `total` against the one at large strain;
    `mesh_error` is that of `TradeScene.best` on this mesh, `solver_error` the distance from it.
    `setup_s` is that of the solver's first dt on this mesh. `field_s`: all displacements formed
    from a state. `assembled`: matrices that set-up made.
    """

    cell: Cell
    unknowns: int = 0
    setup_s: float = 0.0
    step: StepTimes | None = None
    field_s: float = 0.0
    memory: int = 0
    assembled: str = ""
    error: float | None = None
    total: float | None = None
    mesh_error: float | None = None
    solver_error: float | None = None
    failed: str = ""

    @property
    def time_s(self) -> float | None:
        """Median seconds of a step with the displacements of all nodes."""
        return None if self.step is None else self.step.p50 + self.field_s

    @property
    def label(self) -> str:
        return f"{self.cell.solver.name}, {self.cell.element} mesh {self.cell.level}"


@dataclass(frozen=True)
class Ladder:
    """Convergence of one element over its meshes, or of one solver over its steps."""

    what: str
    sizes: tuple[float, ...]
    unit: str
    found: Convergence


@dataclass(frozen=True)
class Front:
    """Cells that nothing beats by `by`, fastest first; the beaten ones' beaters; methods off it."""

    by: str
    rows: tuple[Row, ...]
    beaten: tuple[tuple[Row, Row], ...]

    @property
    def dominated(self) -> tuple[str, ...]:
        """Solvers that are nowhere on the front."""
        on = {r.cell.solver.name for r in self.rows}
        off = dict.fromkeys(r.cell.solver.name for r, _ in self.beaten)
        return tuple(name for name in off if name not in on)


@dataclass(frozen=True)
class Trade:
    """All rows and convergences; `reference`, `gap` (no, p, d) m: the answer, and its law's share.

    `floor` m is the reference's own error (Richardson): smaller errors than it are all the same.
    """

    scene: TradeScene
    rows: tuple[Row, ...]
    ladders: tuple[Ladder, ...]
    reference: Floats
    gap: Floats
    floor: float
    law_words: str
    seconds: float
    quick: bool = False

    @property
    def moved(self) -> float:
        """Rms length m of the reference's displacements."""
        return rms(self.reference)

    @property
    def law_error(self) -> float:
        """Rms length m of what large strain changes."""
        return rms(self.gap)

    def again(self, cell: Cell) -> Row:
        """Another cell, measured against the same reference."""
        return Bench(self.scene, _AGAIN_S).row(cell, self.reference, self.gap)

    def front(self, by: str = "error") -> Front:
        """The Pareto front of `by` ("error" or "total") against time per step."""
        return front(self.rows, by, self.floor)


def front(rows: tuple[Row, ...], by: str, floor: float = 0.0) -> Front:
    """See `Trade.front`; rows without this error or a time are left out, errors below `floor` m
    count as equal."""
    good = [r for r in rows if getattr(r, by) is not None and r.time_s is not None]
    if by == "error":  # one law, one reference
        good = [r for r in good if r.cell.solver.law == "linear"]
    errors = [max(float(getattr(r, by)), floor) for r in good]
    times = [float(r.time_s or 0.0) for r in good]
    by_whom = [dominator(i, errors, times) for i in range(len(good))]
    free = [r for r, j in zip(good, by_whom, strict=True) if j is None]
    beaten = tuple((r, good[j]) for r, j in zip(good, by_whom, strict=True) if j is not None)
    return Front(by, tuple(sorted(free, key=lambda r: r.time_s or 0.0)), beaten)


def cells(scene: TradeScene) -> tuple[Cell, ...]:
    return tuple(
        Cell(solver, element, level, dt)
        for element, levels in scene.meshes.items()
        for level in levels
        for solver in scene.solvers
        for dt in (scene.steps if solver.stepped else scene.steps[-1:])
        if solver.takes(element, level, dt)
    )


def trade(
    scene: TradeScene,
    *,
    quick: bool = False,
    report: Report | None = None,
    budget: float = BUDGET_S,
) -> Trade:
    """Runs all cells of a scene. A cell that fails is a row with the reason."""
    start, wanted = perf_counter(), cells(scene)
    tell = report or _silent
    tell(0, len(wanted), "reference")
    bench = Bench(scene, budget)
    reference = bench.best(*scene.reference)
    gap = bench.law_gap()
    rows = []
    for i, cell in enumerate(wanted):
        tell(i, len(wanted), f"{cell.solver.name}, {cell.element} {cell.level}")
        rows.append(bench.row(cell, reference, gap))
    tell(len(wanted), len(wanted), "convergence")
    pair, found = scene.pair, tuple(bench.ladders())
    words = f"{pair.element} mesh {pair.level}, steps of {pair.dt:.3g} s"
    return Trade(
        scene, tuple(rows), found, reference, gap, found[0].found.error, words,
        perf_counter() - start, quick,
    )  # fmt: skip


class Bench:
    """Runs cells and keeps the answers (no, p, d) m that others are compared with."""

    def __init__(self, scene: TradeScene, budget: float) -> None:
        self.scene, self.budget = scene, budget
        self._kept: tuple[tuple[str, str, int], System] | None = None
        self._setups: dict[tuple[str, str, int], float] = {}
        self._best: dict[tuple[str, int], Floats] = {}
        self._over_steps: dict[tuple[str, str, int], dict[float, Floats]] = {}

    def best(self, element: str, level: int) -> Floats:
        """The answer without solver error on that mesh."""
        key = (element, level)
        if key not in self._best:
            dt = self.scene.steps[-1]
            self._best[key] = self._answer(self.scene.best(dt), element, level, dt, "linear")
        return self._best[key]

    def law_gap(self) -> Floats:
        """What large strain changes, at frames and points: the pair's difference."""
        p, law = self.scene.pair, _LARGE
        declared = self._answer(p.declared(p.dt), p.element, p.level, p.dt, "linear")
        return self._answer(p.large(p.dt), p.element, p.level, p.dt, law) - declared

    def _answer(self, scheme: Scheme, element: str, level: int, dt: float, law: LawName) -> Floats:
        system = build(self.scene.build(element, level, law))
        run = self._march(scheme.prepare(system), dt, 0.0)
        if not run.finished:
            raise ValidateError(
                f"{self.scene.name}: the reference run on {element} mesh {level} ended at step "
                f"{run.outcome.step}: {run.outcome.why}"
            )
        return self._read(system, run)

    def _march(self, stepper: Stepper, dt: float, setup: float, steps: int = 0) -> Run:
        t = self.scene.times(dt)
        at = np.round(self.scene.frames / dt).astype(np.int64) - 1
        if steps:
            t, at = t[:steps], np.array([min(steps, len(t)) - 1])
        return march("cell", stepper, t, self.scene.inputs(t), at, setup)

    def _read(self, system: System, run: Run) -> Floats:
        rows = barycentric_rows(system.scene.mesh, self.scene.points)
        return np.array([rows.apply(u) for u in run.u])

    def row(self, cell: Cell, reference: Floats, gap: Floats) -> Row:
        """The measured cell; errors of ours are words in it."""
        try:
            return self._row(cell, reference, gap)
        except ValidateError as error:
            return Row(cell, failed=f"refused: {error}")

    def _row(self, cell: Cell, reference: Floats, gap: Floats) -> Row:
        start, system = perf_counter(), self._system(cell)
        stepper = cell.solver.make(cell.dt).prepare(system)
        warmed = self._warm(stepper, cell.dt)
        self._setups.setdefault(_body(cell), perf_counter() - start)
        setup = self._setups[_body(cell)]
        tried = self._tried(stepper, cell.dt, setup)
        row = Row(
            cell, len(system.free), setup, tried.step_s, _field_seconds(stepper, warmed),
            held_bytes(stepper), _assembled(system),
        )  # fmt: skip
        if not tried.finished:
            return replace(row, step=None, failed=f"{tried.outcome.state}: {tried.outcome.why}")
        steps = len(self.scene.times(cell.dt))
        needed = steps * (tried.step_s.p50 if tried.step_s else 0.0)
        if needed > self.budget:
            why = f"timed only: its {steps} steps take {needed:.0f} s, more than {self.budget:g} s"
            return replace(row, failed=why)
        run = self._march(stepper, cell.dt, setup)
        if not run.finished:
            why = f"{run.outcome.state} at step {run.outcome.step + 1}: {run.outcome.why}"
            return replace(row, step=None, failed=why)
        return self._scored(replace(row, step=run.step_s), self._read(system, run), reference, gap)

    def _system(self, cell: Cell) -> System:
        """A new system for every solver and mesh, the same one for its other steps."""
        if self._kept is None or self._kept[0] != _body(cell):
            scene = self.scene.build(cell.element, cell.level, cell.solver.law)
            self._kept = _body(cell), build(scene)
        return self._kept[1]

    def _tried(self, stepper: Stepper, dt: float, setup: float) -> Run:
        run = self._march(stepper, dt, setup, _FIRST)
        short = run.step_s is not None and run.step_s.p50 * _PROBED < _PROBE_S
        return self._march(stepper, dt, setup, _PROBED) if run.finished and short else run

    def _warm(self, stepper: Stepper, dt: float) -> Floats:
        """The largest inputs, after a step under them where there is a table to be filled."""
        inputs = self.scene.inputs(self.scene.times(dt))
        largest = inputs[int(np.argmax(np.abs(inputs).sum(axis=1)))]
        if not self.scene.dynamic:
            stepper.step(stepper.rest(), largest)
        return np.asarray(largest)

    def _scored(self, row: Row, u: Floats, reference: Floats, gap: Floats) -> Row:
        cell, total = row.cell, rms(u - reference - gap)
        mesh = self.best(cell.element, cell.level)
        mesh_error = rms(mesh - reference)
        if cell.solver.law != "linear":
            return replace(row, error=total, total=total, mesh_error=mesh_error)
        if cell.solver.stepped:
            key = (cell.solver.name, cell.element, cell.level)
            self._over_steps.setdefault(key, {})[cell.dt] = u
        return replace(
            row, error=rms(u - reference), total=total, mesh_error=mesh_error,
            solver_error=rms(u - mesh),
        )  # fmt: skip

    def ladders(self) -> Iterator[Ladder]:
        """The reference's element first, then the others' meshes, then steps on a middle mesh."""
        scene, (of, finest) = self.scene, self.scene.reference
        for element in sorted(scene.meshes, key=lambda e: e != of):
            levels = scene.meshes[element] + ((finest,) if element == of else ())
            falling = levels[::-1]
            sizes = tuple(scene.size(level) for level in falling)
            answers = [self.best(element, level) for level in falling]
            if len(falling) > 1:
                found = convergence(sizes, answers, scene.orders[element])
                yield Ladder(f"meshes of {element}", sizes, "m", found)
        yield from self._step_ladders()

    def _step_ladders(self) -> Iterator[Ladder]:
        element = next(iter(self.scene.meshes))
        levels, orders = self.scene.meshes[element], {s.name: s.order for s in self.scene.solvers}
        level = levels[(len(levels) - 1) // 2]
        for (name, of, on), answers in self._over_steps.items():
            if (of, on) == (element, level) and len(answers) > 1:
                dts = tuple(sorted(answers))
                found = convergence(dts, [answers[dt] for dt in dts], orders[name])
                yield Ladder(f"steps of {name}, {of} mesh {on}", dts, "s", found)


_LARGE: LawName = "neo_hooke"


def _body(cell: Cell) -> tuple[str, str, int]:
    return cell.solver.name, cell.element, cell.level


def _field_seconds(stepper: Stepper, inputs: Floats) -> float:
    """Median seconds of forming all displacements of a state."""
    state = stepper.step(stepper.rest(), inputs)
    if state.failure:
        return 0.0
    return float(np.median([_timed(lambda: stepper.field(state)) for _ in range(_FIELDS)]))


def _timed(call: Callable[[], object]) -> float:
    start = perf_counter()
    call()
    return perf_counter() - start


def _assembled(system: System) -> str:
    """Matrices that were asked for, of K, M and C (with the lumped masses)."""
    made = [name for name in ("K", "M", "C", "masses") if name in system.__dict__]
    return " ".join("m" if name == "masses" else name for name in made) or "none"


def _silent(done: int, total: int, text: str) -> None:
    pass
