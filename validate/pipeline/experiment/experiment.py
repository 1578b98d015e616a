"""Declaration of an experiment. One experiment is one Python file in `experiments/`.

An experiment file is code: run only your own. A recording is data: nothing in it is executed.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import InitVar, dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from validate.compare.effects import Sensor
from validate.compare.exhibit import Exhibit
from validate.compare.overall_verdict import Expected
from validate.compare.published import Figure
from validate.compare.residual import Residual
from validate.compare.result import Kind
from validate.compare.row import RowBlock
from validate.compare.score import Score
from validate.compare.verdict import Accept
from validate.compare.view import View
from validate.display import Screen
from validate.errors import ComparisonError, UsageError
from validate.identify.budget import IdentifiedValue
from validate.pipeline.calibration.calibration import Calibrates, Calibration, Free
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.tree import (
    Built,
    CellSize,
    ScaledBody,
    Tree,
    beside,
    placed_by_names,
)
from validate.pipeline.experiment.variation import Change as Change
from validate.pipeline.experiment.variation import Shift, bound, change_of, shares, swept
from validate.pipeline.experiment.variation import unchanged as unchanged
from validate.pipeline.ladder.ladder import Ladder
from validate.pipeline.run.method_run import Cases, Truth
from validate.recording.types import Recording
from validate.register.registration import Registered
from validate.scene.meshless import AnyScene

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Variant:
    """A method with changed parameters, `split` of its steps in one of its own, and drives that are
    `off` by these amounts, one an input of the scene (none: as recorded)."""

    method: str
    change: Change = unchanged
    split: int = 1
    off: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "change", change_of(self.change))


@dataclass(frozen=True)
class Input:
    """An uncertain input: `move` takes parameters to where it is off by z standard uncertainties.

    `off` is instead one standard uncertainty of what drives, one number an input of the scene: it
    is off by a constant after rest.

    z lies within +-sqrt(3), the half-width of a uniform range. `source` says where the range comes
    from, or "assumed". `identified`: it is a share of the covariance of what was identified;
    `each`: each method is moved by itself, since each has a value of its own.
    """

    name: str
    move: Callable[[Any, float], Any]
    doc: str
    source: str
    identified: bool = False
    each: bool = False
    off: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not self.source.strip():
            raise ComparisonError(
                f"input '{self.name}' has no source; cite what its range comes from, or 'assumed'"
            )

    def by(self, z: float) -> Change:
        return lambda parameters: self.move(parameters, z)

    def at(self, method: str, z: float) -> Variant:
        """Return the method with this input off by z standard uncertainties."""
        return Variant(method, self.by(z), off=tuple(z * x for x in self.off))


@dataclass(frozen=True)
class EffectSpec:
    """A row of the error budget: from one variant to another.

    `itself` names the declared input that this effect is: its range is then no excuse for not
    seeing it.
    """

    name: str
    doc: str
    one: Variant
    other: Variant
    itself: str = ""


# Where a held plate meets the free side the displacement grows as r^0.595: the least root of
# sin^2(pi l / 2) = 1 - l^2 (Williams, J. Appl. Mech. 19 (1952) 526, clamped and free sides at 90
# degrees, incompressible), and the force converges at twice that. A compressible one has a larger
# root (0.711 at nu .3): this is the slowest.
CORNER_ORDER = 1.19


@dataclass(frozen=True)
class MeshLadder:
    """Meshes beside the nominal one: `levels` change the parameters, `size` is that of a cell (m)
    from them; two levels and more, coarser ones are cheap. Every level is similar to the nominal
    mesh: it scales the cells by one factor in every direction. `order`: the formal one of the
    error, that of its slowest part.
    """

    levels: tuple[Change, ...]
    size: Callable[[Any], float]
    order: float = 2.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "levels", tuple(map(change_of, self.levels)))


@dataclass(frozen=True)
class StepLadder:
    """Time steps beside the nominal one, so many in its place; inputs between are interpolated."""

    order: float
    splits: tuple[int, ...] = (2, 4)


@dataclass(frozen=True)
class Uncertainty:
    """Settings for u_num and u_input: meshes and steps, the inputs, and a cheap surrogate method.

    None for `mesh` or `steps`: the truth is the model's own there, or there is none. `stand_in`
    names, for a method too slow on every mesh, a faster one of the same element that takes its
    place there; the check says so. `draws`: runs with all inputs drawn at once.
    """

    mesh: MeshLadder | None = None
    inputs: tuple[Input, ...] = ()
    surrogate: str = ""
    stand_in: Mapping[str, str] = field(default_factory=dict)
    steps: StepLadder | None = None
    draws: int = 12


@dataclass(frozen=True)
class Sweep:
    """Settings that `validate study filters` tries where no `--sweep` is given."""

    path: str
    rule: str

    @property
    def text(self) -> str:
        """As `--sweep` takes it."""
        return swept(self.rule, self.path)


Variation = Input | MeshLadder | StepLadder | Free | Sweep


def vary(
    path: str | tuple[str, ...], rule: str, name: str = "", doc: str = "", source: str = "assumed"
) -> Any:
    """Return a variation by path and rule; several paths of an input move together.

        vary("material.E", "relative 3 %")                        an uncertain input
        vary("material.nu", "absolute 0.005, below 0.5")          (`pipeline.experiment.variation`)
        vary("body.cells", "x 0.5 0.75 1.3, order 2")             similar meshes, for u_num
        vary("dt", "x 0.5 0.25, order 2")                         time steps, for u_num
        vary("methods.kf.Q", "log 1e-9 1e-5")                     settings of `study filters`

    `order` is the formal one. Raises `UsageError` for a rule that is none.
    """
    paths = (path,) if isinstance(path, str) else tuple(path)
    if rule.split(" ")[0] in ("log", "linear", "of"):
        swept(rule, paths[0])
        return Sweep(paths[0], rule)
    if not rule.startswith("x "):
        words = doc or f"{paths[0]} within its standard uncertainty"
        return Input(name or paths[0], Shift(paths, rule), words, source)
    factors, order = shares(rule, paths[0])
    if paths == ("dt",):
        return StepLadder(order, tuple(round(1 / share) for share in factors))
    if paths != ("body.cells",):
        raise UsageError(f"{paths[0]}: '{rule}': factors refine body.cells, or dt")
    return MeshLadder(tuple(map(ScaledBody, factors)), CellSize(), order)


def free(
    path: str,
    low: str | float,
    high: str | float,
    on: str | tuple[str, ...] = (),
    *,
    source: str = "assumed",
    helps: str = "",
) -> Free:
    """Return a parameter that is identified where it stands open, between bounds with their unit,
    `on` residuals (a quantity, or quantity@load) that are then no evidence."""
    names = (on,) if isinstance(on, str) else tuple(on)
    return Free(path, bound(low, path), bound(high, path), source, helps, names)


@dataclass(frozen=True)
class Identified:
    """Result of an identification: parameters to use, scores, and sentences of the report.

    `headline` opens the verdict, or tells behind it what was fitted. `calibrated` names the
    residuals (a quantity, or quantity@load) whose data served: checks on them are fitted, and no
    evidence. `doubts` of what was given are
    shown as warnings. `values` are the identified values with their budgets; `inputs` and `mesh`
    stand in place of those declared, since each moves what was identified, too (None: as declared).
    """

    parameters: Any
    scores: tuple[Score, ...]
    notes: tuple[str, ...]
    headline: str = ""
    calibrated: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()
    values: tuple[IdentifiedValue, ...] = ()
    inputs: "tuple[Input, ...] | None" = None
    mesh: "MeshLadder | None" = None

    def of(self, experiment: "Experiment") -> "Experiment":
        """Return the experiment with the inputs and meshes that the identification left
        uncertain."""
        declared = experiment.uncertainty
        if declared is None:
            return experiment
        inputs = declared.inputs if self.inputs is None else self.inputs
        more = replace(declared, inputs=inputs, mesh=self.mesh or declared.mesh)
        return replace(experiment, uncertainty=more)


Residuals = Mapping[str, Residual]
#: Solves variants side by side, where there are workers, and returns the residuals of each by name.
SolvesVariants = Callable[[Sequence[Variant]], Sequence[Residuals]]


@dataclass(frozen=True)
class IdentifiedByRuns:
    """An `identify` that compares runs: `find` also gets what solves them.

    These runs are cells, as all runs of the experiment: kept, and taken up by the next one.
    """

    find: Callable[[Sequence[Recording], Any, Mapping[str, Method], SolvesVariants], Identified]


@dataclass(frozen=True)
class Case:
    """A truth that differs from the models: `change` turns the parameters into its own.

    `shipped`: its recording is a file, loaded with those parameters; else the twin makes it anew.
    `methods` are those that are run on it (none: all that step through the whole time).
    """

    name: str
    doc: str
    change: Change
    shipped: bool = False
    methods: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "change", change_of(self.change))


def _as_read(recording: Recording, parameters: Any) -> Recording:
    return recording


@dataclass(frozen=True)
class Twin:
    """Twin: function of the synthetic recording, and its truth.

    `truth` repeats the twin: it scores the runs, and no method sees it. `remake` are prefixes of
    parameters that the twin reads: changing one makes the recording anew. `read` is what `load`
    makes of a recording once read (outlines found in its images, say). `kind`: a twin of "same
    model" shares law and mesh with the judged models and can only repeat them; one of the "same
    law, finer mesh" says nothing of physics. `notice` is printed.
    """

    record: Callable[[Any, Progress], Recording]
    truth: Callable[[Any, Registered], Truth] | None = None
    remake: tuple[str, ...] = ("twin.",)
    kind: Kind = "twin"
    seed: int | None = None
    notice: str = ""
    read: Callable[[Recording, Any], Recording] = _as_read

    def made(self, parameters: Any, progress: Progress) -> Recording:
        """Return a recording in memory, as one that was loaded."""
        return self.read(self.record(parameters, progress), parameters)


@dataclass(frozen=True)
class ReportAdditions:
    """What an experiment adds of its own: exhibits, numbers by name for printed figures, and rows
    of the long table, which its `views` show."""

    exhibits: tuple[Exhibit, ...] = ()
    numbers: Mapping[str, float] = field(default_factory=dict)
    rows: tuple[RowBlock, ...] = ()


def _as_declared(experiment: Any, recordings: Sequence[Recording], parameters: Any) -> Any:
    return experiment


_FROM_HERE = Built()


def _states_nothing(recording: Recording) -> Mapping[str, float]:
    return {}


def _sets_nothing(parameters: Any, seen: Registered) -> Mapping[str, Any]:
    return {}


@dataclass(frozen=True)
class Experiment:
    """One experiment; see the fields of each part for units.

    It is declared by a `scene`, whose numbers are its parameters by path; `settings` is a dataclass
    of what no scene holds, `recording` the file from the experiment's folder: its `parameters` are
    the `Tree` of these. A method's `scene` is its changes by path: {"body.cells": (9, 9, 24)}.

    `methods` maps a name to a `Method`. `load` gets the parameters and the experiment's folder;
    `build` a recording, the parameters and a method's `scene` options; `place` registers a
    recording in that scene. `sets` are settings that the experiment itself gives every method that
    has them, from the parameters and the registered recording: a time step, say. `stated` is
    what a recording itself says of parameters, by path: it stands where none are set. `identify`
    finds parameters from the recordings, by the methods as the user set them; `calibrations` says
    which parameters that stand open (None) are identified, on which residuals. `exhibits` adds
    what this experiment shows besides, from all runs by case ("" is the recorded one) and method.
    `views` show rows of the run's long table.
    `band` is the path of the relative standard uncertainty of the force that the modulus brings.
    `axis` is the component that displacement charts follow, `reference` the method that speeds are
    compared with.
    `captions` are sentences under charts, by name; `frames` how many fields of a run are kept.
    `ladder` is how it enters the studies; what it leaves out is derived from the scene.
    `follows` is the experiment as its recordings have it (title, limits, what figures belong to);
    `locates` are parameters that only say where recordings lie, so that `follows` judges these.
    `specimen` names the one that a recording is of: repeats of one specimen count once over all
    experiments; without it all recordings are of one.
    `sweeps` are settings that `validate study filters` tries where none are asked for.
    `refine` returns the settings by path that `--refine` makes: a first answer is coarser.
    `kind` is what its recordings are where no twin makes them; `needs` names the public data set
    (`validate data`) that they come from. `expected` are the verdicts that it
    is known to have, with the reason.
    """

    name: str
    title: str
    source: str
    parameters: Any = None
    methods: Mapping[str, Method] = field(default_factory=dict)
    accepted: tuple[str, ...] = ()
    accept: tuple[Accept, ...] = ()
    load: Callable[[Any, Path], tuple[Recording, ...]] = beside
    build: Callable[[Recording, Any, Any], AnyScene] = _FROM_HERE
    place: Callable[[Recording, Any, Any], Registered] = placed_by_names
    sets: Callable[[Any, Registered], Mapping[str, Any]] = _sets_nothing
    stated: Callable[[Recording], Mapping[str, float]] = _states_nothing
    identify: (
        Callable[[Sequence[Recording], Any, Mapping[str, Method]], Identified]
        | IdentifiedByRuns
        | None
    ) = None
    calibrations: tuple[Calibration, ...] = ()
    uncertainty: Uncertainty | None = None
    twin: Twin | None = None
    cases: tuple[Case, ...] = ()
    effects: tuple[EffectSpec, ...] = ()
    sensors: tuple[Sensor, ...] = ()
    band: str = ""
    exhibits: Callable[[Any, Cases, Progress], ReportAdditions] | None = None
    views: tuple[View, ...] = ()
    published: tuple[Figure, ...] = ()
    captions: Mapping[str, str] = field(default_factory=dict)
    axis: str = "z"
    reference: str = ""
    frames: int = 200
    ladder: Ladder | None = None
    follows: Callable[[Any, Sequence[Recording], Any], Any] = _as_declared
    locates: tuple[str, ...] = ()
    specimen: Callable[[Recording], str] | None = None
    quick: Change = unchanged
    refine: Callable[[Any, Path], Mapping[str, str]] | None = None
    kind: Kind = "measured"
    needs: str = ""
    expected: tuple[Expected, ...] = ()
    sweeps: tuple[Sweep, ...] = ()
    path: Path | None = field(default=None, compare=False)
    scene: InitVar[Any] = None
    settings: InitVar[Any] = None
    recording: InitVar[str] = ""
    variations: InitVar[tuple[Variation, ...]] = ()

    def __post_init__(
        self, scene: Any, settings: Any, recording: str, variations: tuple[Variation, ...]
    ) -> None:
        if scene is not None or settings is not None:
            object.__setattr__(self, "parameters", Tree(recording, scene, settings))
        # Sorts variations into what they are: uncertain inputs, meshes, steps, calibrations
        meshes = [v for v in variations if isinstance(v, MeshLadder)]
        steps = [v for v in variations if isinstance(v, StepLadder)]
        inputs = tuple(v for v in variations if isinstance(v, Input))
        if max(len(meshes), len(steps)) > 1:
            raise UsageError(
                f"{self.name}: {len(meshes)} variations of body.cells and {len(steps)} of dt; give "
                "at most one of each, with all its factors"
            )
        if meshes or steps or inputs:
            least = self.uncertainty or Uncertainty()
            more = replace(
                least, mesh=(*meshes, least.mesh)[0], steps=(*steps, least.steps)[0],
                inputs=(*least.inputs, *inputs),
            )  # fmt: skip
            object.__setattr__(self, "uncertainty", more)
        object.__setattr__(
            self, "sweeps", (*self.sweeps, *(v for v in variations if isinstance(v, Sweep)))
        )
        opens = tuple(v for v in variations if isinstance(v, Free))
        for on in dict.fromkeys(v.on for v in opens):
            several = tuple(v for v in opens if v.on == on)
            by = Calibration(next(iter(self.accepted)), several, (Calibrates(on),))
            object.__setattr__(self, "calibrations", (*self.calibrations, by))
        # Mesh files of a declared body are found from the experiment's folder
        folder = self.path.parent if self.path else Path()
        if isinstance(self.build, Built):
            object.__setattr__(self, "build", replace(self.build, folder=folder))
        declared = self.uncertainty
        if declared and declared.mesh and isinstance(declared.mesh.size, CellSize):
            mesh = replace(declared.mesh, size=CellSize(folder))
            object.__setattr__(self, "uncertainty", replace(declared, mesh=mesh))
        object.__setattr__(self, "methods", MappingProxyType(dict(self.methods)))
        object.__setattr__(self, "quick", change_of(self.quick))

    def __repr__(self) -> str:
        return self._screen.text

    def _repr_html_(self) -> str:
        return self._screen.html

    @property
    def _screen(self) -> Screen:
        rows = tuple(
            (name, method.label, "yes" if name in self.accepted else "")
            for name, method in self.methods.items()
        )
        below = (f"source: {self.source}", f"file: {self.path or 'none'}")
        head = ("method", "what it is", "accepted")
        return Screen(f"{self.name}: {self.title}", (), head, rows, below)

    @property
    def complete(self) -> bool:
        """Whether what a kind of the library adds is there: how the recording is registered."""
        return self.place is not placed_by_names

    def at(self, path: Path) -> "Experiment":
        """Declared in that file."""
        return replace(self, path=path.resolve())

    @property
    def declared_kind(self) -> Kind:
        """What its recordings are, whether they are at hand or not."""
        if self.twin is None:
            return self.kind
        return self.twin.kind

    @property
    def same_model(self) -> bool:
        """Whether recording and models are the same model."""
        return self.twin is not None and self.twin.kind == "same model"

    @property
    def repeats(self) -> bool:
        """Whether a twin makes its recordings anew with other noise, and knows their truth."""
        return self.twin is not None and self.twin.truth is not None

    @property
    def seed(self) -> int | None:
        return self.twin.seed if self.twin else None

    @property
    def twin_notice(self) -> str:
        return self.twin.notice if self.twin else ""
