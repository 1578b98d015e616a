"""All runs of an experiment: methods, changed parameters and cases, each once."""

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from time import perf_counter
from types import MappingProxyType
from typing import Any, Protocol

from validate.compare.residual import Residual
from validate.compare.result import Kind
from validate.engine.execution import Report
from validate.errors import ComparisonError
from validate.fem.linear_solvers.factor import next_to_nothing, require_solvable
from validate.pipeline.calibration.calibrated import middle
from validate.pipeline.experiment.experiment import (
    Case,
    Change,
    Experiment,
    ReportAdditions,
    SolvesVariants,
    Variant,
    unchanged,
)
from validate.pipeline.experiment.method import Limited, Method
from validate.pipeline.experiment.options import (
    folder_of,
)
from validate.pipeline.run.case_solution import placed, solve
from validate.pipeline.run.method_run import MAIN, NO_TRUTH, Cases, MethodRun, Truth
from validate.pipeline.run.twin_record import kind_of_recordings, made_by, require_known
from validate.recording.types import Recording
from validate.scene.meshless import Meshless
from validate.solve.types import Run

# --- time that the runs will still take, by those that were made
#
# A guess that is shown as one: a run costs what another run of its method did, times its steps,
# times its cells to a power between that of assembly (1) and that of a factorisation in space
# (2).

_POWER = 1.3  # of the number of cells, between assembly and factorisation


class Pace:
    """Runs that are expected, each with its method and its cost beside that method's plain one.

    `since` is when the whole work began, s of `perf_counter`.
    """

    def __init__(self, since: float) -> None:
        self._left: dict[Hashable, tuple[str, float]] = {}
        self._costs: dict[str, float] = {}  # s, of a plain run
        self._since = since

    def expect(self, key: Hashable, method: str, cells: float = 1.0, steps: float = 1.0) -> None:
        """`cells` and `steps` are how many times those of the method's plain run."""
        self._left[key] = method, cells**_POWER * steps

    def cost(self, key: Hashable) -> float:
        """Of a run that is expected, beside its method's plain one; 1 of another."""
        return self._left.get(key, ("", 1.0))[1]

    @property
    def expected(self) -> int:
        """Runs that were not made yet."""
        return len(self._left)

    def took(self, key: Hashable, seconds: float) -> None:
        """One of the runs was made; one that nobody expected teaches nothing."""
        if key in self._left:
            method, cost = self._left.pop(key)
            self._costs.setdefault(method, seconds / cost)

    @property
    def progress(self) -> tuple[int, int]:
        """Milliseconds gone and those of all; 0 of 1 while nothing is known."""
        gone = perf_counter() - self._since
        if not self._costs:
            return 0, 1
        usual = sum(self._costs.values()) / len(self._costs)
        left = sum(cost * self._costs.get(m, usual) for m, cost in self._left.values())
        return round(1e3 * gone), round(1e3 * (gone + left))


# -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Varied:
    """What a method with changed parameters is asked for: its residuals, how many nodes of which
    dimension its mesh has, and the steps that it took until s."""

    residuals: Mapping[str, Residual]
    nodes: int
    dimension: int
    steps: int
    until: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "residuals", MappingProxyType(dict(self.residuals)))


@dataclass(frozen=True)
class RunWanted:
    """A run that is asked for: a method on a case, `split` and `off` as those of a `Variant`, with
    `parameters` that are changed already. `whole`: with its fields and traces."""

    case: str
    method: str
    parameters: Any = field(repr=False)
    split: int = 1
    off: tuple[float, ...] = ()
    whole: bool = False


@dataclass(frozen=True)
class RunFound:
    """What a run gave: `runs` with fields and traces only where the whole was wanted."""

    varied: Varied
    label: str
    runs: tuple[Run, ...] = ()


class Solves(Protocol):
    """Solver of the runs that an `ExperimentRuns` requests."""

    def ahead(self, runs: "ExperimentRuns", wanted: Sequence[RunWanted]) -> None:
        """Solve all that will be requested, in order; may solve it side by side."""
        ...

    def solved(self, runs: "ExperimentRuns", wanted: RunWanted) -> RunFound: ...

    def truth(self, runs: "ExperimentRuns", wanted: RunWanted) -> Truth:
        """Return the true motion of the twin, on the case and in the scene of that run."""
        ...

    def told(
        self, runs: "ExperimentRuns", cases: Cases, make: Callable[[], ReportAdditions]
    ) -> ReportAdditions:
        """What the experiment adds to these runs."""
        ...


class ExperimentRuns:
    """Asks for each run once and counts them for the progress bar.

    `by` solves them (none: in this process, when they are asked for). `calibrated` names residuals
    whose data served to identify; `remade` says that the user's own parameters made the recording.
    `refused` methods are not run, for the reason given: they are rows of the result. `cases` are
    run beside the recorded one.
    """

    def __init__(
        self,
        experiment: Experiment,
        methods: Mapping[str, Method],
        parameters: Any,
        report: Report | None,
        *,
        quick: bool,
        cases: Sequence[Case] = (),
        calibrated: tuple[str, ...] = (),
        since: float | None = None,
        refused: Mapping[str, str] = MappingProxyType({}),
        by: Solves | None = None,
    ) -> None:
        self.experiment, self.methods, self.parameters = experiment, methods, parameters
        self.calibrated, self.refused = calibrated, refused
        self.settings: Mapping[str, Method] = {**experiment.methods, **methods}
        self.quick = quick
        self.cases = () if quick else tuple(c for c in cases if _of_case(methods, c))
        every = tuple(c for c in experiment.cases if _of_case(methods, c))
        self.whole = set(methods) == set(experiment.methods) and self.cases == every
        self.recordings: tuple[Recording, ...] = ()
        self.remakes, self.remade = True, False
        self.pace = Pace(perf_counter() if since is None else since)
        self._true: Any = parameters
        self._report = report
        self._by = by or SolvesInTurn()
        self._of_cases: dict[str, tuple[tuple[Recording, ...], Any]] = {}
        self._finest: dict[str, float] = {}  # how many times as fine, by method
        self._fresh: dict[RunWanted, MethodRun] = {}  # solved in this process, as yet without truth
        self._whole: dict[RunWanted, MethodRun] = {}
        self._parsed: dict[int, tuple[Change, Any]] = {}

    # --- what will be asked for -------------------------------------------------------------------

    def expect(self, variants: Sequence[Variant]) -> None:
        """Says what will be asked for on the experiment's own recordings, so that the time left and
        the memory needed are known."""
        for v in variants:
            finer = self.finer(v)
            self.pace.expect(self.wanted(v), v.method, finer**3, v.split)
            self._finest[v.method] = max(finer, self._finest.get(v.method, 1.0))
        for wanted in self._of_every_case():
            self.pace.expect(wanted, wanted.method)

    def ahead(self, variants: Sequence[Variant]) -> None:
        """Has all that is expected solved, side by side where the solver can."""
        mine = dict.fromkeys(self.wanted(v) for v in variants if v.method not in self.refused)
        self._by.ahead(self, [*mine, *self._of_every_case()])

    def _of_every_case(self) -> Iterator[RunWanted]:
        for case in self.cases:
            for name in _of_case(self.methods, case):
                yield RunWanted(case.name, name, self.parameters, whole=True)

    def wanted(self, variant: Variant) -> RunWanted:
        """Return a variant on the experiment's own recordings; a method as it is is wanted
        whole."""
        changed = self._changed_by(variant)
        as_it_is = (changed, variant.split, variant.off) == (self.parameters, 1, ())
        whole = as_it_is and variant.method in self.methods
        return RunWanted(MAIN, variant.method, changed, variant.split, variant.off, whole)

    def require_room(self, recording: Recording) -> None:
        """Raise `MemoryShortError`, before anything is solved, for a method whose finest mesh will
        not fit; where the first one takes next to nothing the others are not asked."""
        for name, method in self.methods.items():
            scene = self.experiment.build(recording, self.parameters, method.scene)
            if isinstance(scene, Meshless):
                continue
            d = scene.mesh.dimension
            unknowns = self._finest.get(name, 1.0) ** d * scene.mesh.nodes.size
            if next_to_nothing(unknowns, d):
                return
            if not isinstance(method.settings, Limited):
                require_solvable(unknowns, d, name)

    def finer(self, variant: Variant) -> float:
        """How many times as fine as the experiment's own mesh, as its ladder of meshes has it."""
        uncertainty = self.experiment.uncertainty
        if uncertainty is None or uncertainty.mesh is None:
            return 1.0
        size = uncertainty.mesh.size
        return size(self.parameters) / size(self._changed_by(variant))

    def _changed_by(self, variant: Variant) -> Any:
        """The parameters of a variant, parsed once by each change."""
        change = variant.change
        if id(change) not in self._parsed:
            self._parsed[id(change)] = change, change(self.parameters)  # kept, so that its id is
        return self._parsed[id(change)][1]

    # --- recordings -------------------------------------------------------------------------------

    def start(self, shipped: tuple[Recording, ...], *, remake: bool = True) -> tuple[str, ...]:
        """Take the recordings, regenerated where the user changed their twin, unless not `remake`;
        what to say of it."""
        self.remakes = remake
        if not remake:
            self.recordings = shipped
            return ()
        self.recordings, self._true, said = self._made(shipped, self.parameters, unchanged)
        self.remade = bool(said)
        return said

    @property
    def kind(self) -> Kind:
        """What the recordings are: measured, a twin's, the judged model's own, or computed."""
        twin = self.experiment.twin
        return kind_of_recordings(
            self.recordings, twin.kind if twin else "twin", remade=self.remade
        )

    def of_case(self, name: str) -> tuple[tuple[Recording, ...], Any]:
        """Return the recordings of a case and the parameters of their truth: shipped or made in
        memory."""
        if name == MAIN:
            return self.recordings, self._true
        if name not in self._of_cases:
            (case,) = (c for c in self.experiment.cases if c.name == name)
            self._of_cases[name] = self._loaded(case)
        return self._of_cases[name]

    def _loaded(self, case: Case) -> tuple[tuple[Recording, ...], Any]:
        experiment = self.experiment
        if case.shipped:
            theirs = case.change(self.parameters)
            found = experiment.load(theirs, folder_of(experiment))
            recordings, true, _ = self._made(found, theirs, case.change)
            return recordings, true
        if experiment.twin is None:
            raise ComparisonError(
                f"case '{case.name}' has no shipped recording; declare a twin that simulates it"
            )
        true = case.change(self._true)
        return (experiment.twin.made(true, self.tell),), true

    def _made(
        self, shipped: tuple[Recording, ...], parameters: Any, change: Change
    ) -> tuple[tuple[Recording, ...], Any, tuple[str, ...]]:
        """The recordings, the parameters of their truth, and what is to be said of them."""
        twin, declared = self.experiment.twin, change(self.experiment.parameters)
        if twin is None:
            return shipped, parameters, ()
        if len(shipped) != 1:
            for recording in shipped:
                require_known(recording, parameters, declared, twin.remake)
            return shipped, parameters, ()
        recording, true, said = made_by(
            shipped[0], parameters, declared, twin.remake, lambda p: twin.made(p, self.tell)
        )
        return (recording,), true, said

    # --- runs -------------------------------------------------------------------------------------

    def tell(self, what: str) -> None:
        if self._report:
            self._report(*self.pace.progress, what)

    def main(self, method: str) -> MethodRun:
        """Return a method on the experiment's own recordings."""
        return self._followed(self.wanted(Variant(method)))

    def varied(self, variant: Variant) -> Varied:
        """Return a variant on the experiment's own recordings."""
        wanted = self.wanted(variant)
        if wanted.method in self.refused:
            return _varied(self._not_run(wanted))
        return self._by.solved(self, wanted).varied

    def residuals(self, variants: Sequence[Variant]) -> list[Mapping[str, Residual]]:
        """Of variants on the experiment's own recordings, solved side by side where the solver
        can. Raises what building and registering the first does, before anything is kept."""
        wanted = [self.wanted(v) for v in variants]
        if wanted:
            method = self.method(wanted[0])
            placed(self.experiment, self.recordings, method, wanted[0].parameters)
        self._by.ahead(self, wanted)
        return [self.varied(v).residuals for v in variants]

    def told(self, cases: Cases) -> ReportAdditions:
        """What the experiment adds of its own to its runs."""
        add = self.experiment.exhibits
        if add is None:
            return ReportAdditions()
        return self._by.told(self, cases, lambda: add(self.parameters, cases, self.tell))

    def other(self, case: Case) -> dict[str, MethodRun]:
        """Every method on a case: the truth's parameters changed."""
        return {
            name: self._followed(RunWanted(case.name, name, self.parameters, whole=True))
            for name in _of_case(self.methods, case)
        }

    def method(self, wanted: RunWanted) -> Method:
        settings = self.settings[wanted.method]
        return replace(settings, split=wanted.split * settings.split)

    def solve(self, wanted: RunWanted) -> RunFound:
        """In this process."""
        what = f"{wanted.method} on {wanted.case}" if wanted.case else wanted.method
        recordings, _ = self.of_case(wanted.case)
        found = solve(
            self.experiment, recordings, wanted.method, self.method(wanted), wanted.parameters,
            wanted.case, lambda doing: self.tell(f"{what}: {doing}"), off=wanted.off,
        )  # fmt: skip
        if wanted.whole:
            self._fresh[wanted] = found
        return RunFound(_varied(found), found.label, found.runs if wanted.whole else ())

    def true(self, wanted: RunWanted) -> Truth:
        """What the twin really did, in this process; nothing where it does not say."""
        twin = self.experiment.twin
        if twin is None or twin.truth is None:
            return NO_TRUTH
        recordings, true = self.of_case(wanted.case)
        _, seen = placed(self.experiment, recordings[:1], self.method(wanted), wanted.parameters)
        return twin.truth(true, seen[0])

    def _followed(self, wanted: RunWanted) -> MethodRun:
        if wanted not in self._whole:
            refused = wanted.method in self.refused
            self._whole[wanted] = self._not_run(wanted) if refused else self._run(wanted)
        return self._whole[wanted]

    def _run(self, wanted: RunWanted) -> MethodRun:
        """What was solved, in the scene where it was; built anew where that was elsewhere."""
        found = self._by.solved(self, wanted)
        runs = next(name for name in self.methods if name not in self.refused)
        truth = self._by.truth(self, replace(wanted, method=runs))
        if wanted in self._fresh:
            return replace(self._fresh.pop(wanted), truth=truth)
        recordings, _ = self.of_case(wanted.case)
        scenes, seen = placed(
            self.experiment, recordings, self.method(wanted), wanted.parameters, wanted.off
        )
        return MethodRun(
            wanted.method, found.label, wanted.case, scenes[0], seen, found.runs,
            found.varied.residuals, truth,
        )  # fmt: skip

    def _not_run(self, wanted: RunWanted) -> MethodRun:
        """A method that is refused; what stands open of its parameters is not known."""
        recordings, _ = self.of_case(wanted.case)
        return solve(
            self.experiment, recordings, wanted.method, self.method(wanted),
            middle(self.experiment, wanted.parameters), wanted.case,
            refused=self.refused[wanted.method],
        )  # fmt: skip


def solves_here(
    experiment: Experiment, recordings: tuple[Recording, ...], parameters: Any
) -> SolvesVariants:
    """Return the solver of variants of these parameters, one after the other in this process."""
    runs = ExperimentRuns(experiment, experiment.methods, parameters, None, quick=False)
    runs.start(recordings, remake=False)
    return runs.residuals


def _varied(found: MethodRun) -> Varied:
    mesh, t = found.scene.mesh, found.run.t
    until = float(t[-1]) if len(t) else 0.0
    return Varied(found.residuals, len(mesh.nodes), mesh.dimension, len(t), until)


class SolvesInTurn:
    """Solves in this process what is asked for, when it is asked for."""

    def __init__(self) -> None:
        self._solved: dict[Any, RunFound] = {}
        self._truths: dict[str, Truth] = {}

    def ahead(self, runs: ExperimentRuns, wanted: Sequence[RunWanted]) -> None:
        pass

    def solved(self, runs: ExperimentRuns, wanted: RunWanted) -> RunFound:
        if wanted not in self._solved:
            start = perf_counter()
            self._solved[wanted] = runs.solve(wanted)
            runs.pace.took(wanted, perf_counter() - start)
        return self._solved[wanted]

    def truth(self, runs: ExperimentRuns, wanted: RunWanted) -> Truth:
        if wanted.case not in self._truths:
            self._truths[wanted.case] = runs.true(wanted)
        return self._truths[wanted.case]

    def told(
        self, runs: ExperimentRuns, cases: Cases, make: Callable[[], ReportAdditions]
    ) -> ReportAdditions:
        return make()


def _of_case(methods: Mapping[str, Method], case: Case) -> tuple[str, ...]:
    """The methods a case is run with: those it names, or all that are not only timed."""
    whole = [name for name, method in methods.items() if method.steps is None]
    return tuple(name for name in whole if not case.methods or name in case.methods)
