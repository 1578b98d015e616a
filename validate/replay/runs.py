"""The runs of an experiment: each variant on each case once, counted for the progress bar."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from time import perf_counter
from types import MappingProxyType
from typing import Any

from validate.compare.result import Kind
from validate.errors import ComparisonError
from validate.fem.fill import next_to_nothing, require_solvable
from validate.recording.types import Recording
from validate.replay.calibrated import middle
from validate.replay.experiment import Case, Change, Experiment, Variant, unchanged
from validate.replay.followed import MAIN, Followed, Truth
from validate.replay.method import Limited, Method
from validate.replay.options import Report, folder_of
from validate.replay.pace import Pace
from validate.replay.remade import kind_of_recordings, made_by, require_known
from validate.replay.solved import solve
from validate.scene.meshless import Meshless


class Road:
    """Solves each variant once on each case and counts them for the progress bar.

    `truths` are kept by case: the twin is repeated once. `calibrated` names residuals whose data
    served to identify; `remade` says that the user's own parameters made the recording. `refused`
    methods are not run, for the reason given: they are rows of the result. `cases` are run beside
    the recorded one.
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
    ) -> None:
        self.experiment, self.methods, self.parameters = experiment, methods, parameters
        self.calibrated, self.refused = calibrated, refused
        self.settings: Mapping[str, Method] = {**experiment.methods, **methods}
        self.quick = quick
        self.cases = () if quick else tuple(c for c in cases if _of_case(methods, c))
        every = tuple(c for c in experiment.cases if _of_case(methods, c))
        self.whole = set(methods) == set(experiment.methods) and self.cases == every
        self.recordings: tuple[Recording, ...] = ()
        self.remade = False
        self._true: Any = parameters
        self._report = report
        self._done: dict[tuple[Any, ...], Followed] = {}
        self._truths: dict[str, Truth] = {}
        self._finest: dict[str, float] = {}  # how many times as fine, by method
        self._pace = Pace(perf_counter() if since is None else since)
        for case in self.cases:
            for name in _of_case(methods, case):
                self._pace.expect(self._key(case.name, Variant(name), parameters), name)

    def expect(self, variants: list[Variant]) -> None:
        """Says what will be asked for on the experiment's own recordings, for the time left."""
        for v in variants:
            key = self._key(MAIN, v, self.parameters)
            finer = self.finer(v)
            self._pace.expect(key, v.method, finer**3, v.split)
            self._finest[v.method] = max(finer, self._finest.get(v.method, 1.0))

    def require_room(self, recording: Recording) -> None:
        """Raises `MemoryShortError`, before anything is solved, for a method whose finest mesh will
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
        return size(self.parameters) / size(variant.change(self.parameters))

    def start(self, shipped: tuple[Recording, ...]) -> tuple[str, ...]:
        """Takes the recordings, made anew where the user changed their twin; what to say of it."""
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

    def tell(self, what: str) -> None:
        if self._report:
            self._report(*self._pace.progress, what)

    def main(self, variant: Variant) -> Followed:
        """A variant on the experiment's own recordings."""
        changed = variant.change(self.parameters)
        return self._followed(MAIN, self.recordings, variant, changed, self._true)

    def other(self, case: Case) -> dict[str, Followed]:
        """A case: the truth's parameters changed, its recording shipped or made in memory."""
        experiment = self.experiment
        if case.shipped:
            theirs = case.change(self.parameters)
            found = experiment.load(theirs, folder_of(experiment))
            recordings, true, _ = self._made(found, theirs, case.change)
        else:
            if experiment.twin is None:
                raise ComparisonError(
                    f"case '{case.name}' has no shipped recording; declare a twin that simulates it"
                )
            true = case.change(self._true)
            recordings = (experiment.twin.made(true, self.tell),)
        return {
            name: self._followed(case.name, recordings, Variant(name), self.parameters, true)
            for name in _of_case(self.methods, case)
        }

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

    def _followed(
        self, case: str, recordings: tuple[Recording, ...], as_: Variant, parameters: Any, true: Any
    ) -> Followed:
        key = self._key(case, replace(as_, change=unchanged), parameters)
        if key not in self._done:
            start = perf_counter()
            settings = self.settings[as_.method]
            method = replace(settings, split=as_.split * settings.split)
            what = f"{as_.method} on {case}" if case else as_.method
            why = self.refused.get(as_.method, "")
            if why:  # what stands open of its parameters is not known
                parameters = middle(self.experiment, parameters)
            found = solve(
                self.experiment, recordings, as_.method, method, parameters, case,
                lambda doing: self.tell(f"{what}: {doing}"), why, as_.off,
            )  # fmt: skip
            self._done[key] = self._with_truth(found, true)
            self._pace.took(key, perf_counter() - start)
        return self._done[key]

    def _with_truth(self, followed: Followed, true: Any) -> Followed:
        twin = self.experiment.twin
        if twin is None or twin.truth is None:
            return followed
        if followed.case not in self._truths:
            self._truths[followed.case] = twin.truth(true, followed.seen)
        return replace(followed, truth=self._truths[followed.case])

    def _key(self, case: str, variant: Variant, parameters: Any) -> tuple[Any, ...]:
        settings = self.settings[variant.method]
        changed = variant.change(parameters)
        return case, variant.method, settings, variant.split, variant.off, changed


def _of_case(methods: Mapping[str, Method], case: Case) -> tuple[str, ...]:
    """The methods a case is run with: those it names, or all that are not only timed."""
    whole = [name for name, method in methods.items() if method.steps is None]
    return tuple(name for name in whole if not case.methods or name in case.methods)
