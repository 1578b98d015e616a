"""What an experiment over time declares: solvers and filters that follow a moving body.

The same road as `replay.experiment`, with time steps in place of loads: every method steps through
the recorded inputs (`Registered.stage`, drives m then loads N), filters also see the markers that
they are given. The twin's truth is kept apart: it scores the runs and no method sees it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, cast

import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import Exhibit
from validate.compare.verdict import Accept, Published
from validate.errors import UsageError
from validate.estimate.measured import measurements
from validate.fem.system import System
from validate.parameters import quantity
from validate.recording.types import Recording, Signal
from validate.register.observe import Hold, Registered
from validate.register.placed import placed
from validate.replay.experiment import Change, Progress, Uncertainty, unchanged
from validate.scene.mesh import Mesh
from validate.scene.scene import Scene
from validate.solve.types import Run, Stepper


@dataclass(frozen=True)
class Truth:
    """What the twin really did: displacement (nt, d) m of every probe at the steps' times.

    `u` (no, n, d) m are its fields at the output frames, where its `mesh` is the models' mesh.
    """

    probes: Mapping[str, Floats]
    u: Floats | None = None
    mesh: Mesh | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "probes", MappingProxyType(dict(self.probes)))


Cases = Mapping[str, Mapping[str, "Followed"]]


def own_time(followed: "Followed") -> Floats:
    """Recorded times (nt,) s of the run's steps: explicit runs may walk a slow recording faster."""
    return followed.run.t * followed.seen.time_scale


def truth_of(run: Run, scene: Scene) -> Truth:
    """What a twin's run says of its own probes and nodes."""
    axes = "xyz"[: scene.mesh.dimension]
    probes = {
        p.name: np.stack([run.traces[f"{p.name}.{c}"].y for c in axes], axis=1)
        for p in scene.probes
    }
    return Truth(probes, run.u, scene.mesh)


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


@dataclass(frozen=True)
class Followed:
    """One method on one case: its scene, registration and run, and the truth beside."""

    method: str
    label: str
    case: str
    scene: Scene
    seen: Registered
    run: Run
    truth: Truth

    @property
    def whole(self) -> bool:
        """Whether the run reached the last recorded time."""
        t = self.seen.stage.t
        return self.run.finished and bool(self.run.t[-1] >= t[-1] - 1e-9)

    def reference(self, probe: str) -> Floats:
        """The truth (nt, d) m at the times of the run's own steps."""
        at = np.searchsorted(self.seen.stage.t, self.run.t - 1e-9)
        return self.truth.probes[probe][at]

    @property
    def scored(self) -> tuple[str, ...]:
        """Probes of the truth that the run traced to the end."""
        if not self.whole:
            return ()
        mine = {p.name for p in self.scene.probes}
        return tuple(name for name in self.truth.probes if name in mine)


@dataclass(frozen=True)
class Follower:
    """A method: settings of a scheme, or of a filter and the markers that it is given.

    `steps`: run only so many, as a baseline that is timed and not scored. `stride` above 1: a
    longer step than the recording's.
    """

    label: str = quantity("", "1", "what reports call it")
    settings: Any = quantity(None, "1", "of the scheme or filter")
    markers: tuple[str, ...] = quantity((), "1", "markers that a filter is given")
    steps: int | None = quantity(None, "1", "steps to run; none: all")
    stride: int = quantity(1, "1", "steps of the recording that one step of this method takes")

    def prepare(self, system: System, seen: Registered, **changed: Any) -> Stepper:
        """The prepared scheme or filter, with the experiment's settings where it has them.

        Filters get what moves freely of their markers. Raises `UsageError` where a user set one of
        the experiment's own settings to something else.
        """
        settings = replace(self.settings, **self._given(changed))
        if not self.markers:
            return cast(Stepper, settings.prepare(system))
        given = measurements(seen, system.scene.mesh).of(*self.markers).moving(system.free)
        return cast(Stepper, settings.prepare(system, given))

    def _given(self, changed: Mapping[str, Any]) -> dict[str, Any]:
        defaults = {f.name: f.default for f in fields(self.settings)}
        mine = {k: v for k, v in changed.items() if k in defaults}
        for name, value in mine.items():
            own = getattr(self.settings, name)
            if own not in (defaults[name], value):
                raise UsageError(
                    f"settings.{name} = {own} of '{self.label}': the experiment sets {value}; "
                    "change its own parameter"
                )
        return mine


def followed_load(recording: Recording, scene: Scene, signal: str, unit: str) -> Registered:
    """A recording whose one input is a signal, with its markers placed by their records.

    Steps begin after t = 0, where everything is at rest.
    """
    seen = recording.signal(signal, unit)
    later = seen.t > 0
    t, y = seen.t[later], seen.y[later]
    stage = Signal(t, y, unit, seen.sd, seen.frame)
    holds = (Hold("start", 0.0, float(t[0])), Hold("end", float(y[-1, 0]), float(t[-1])))
    return Registered(stage, holds, placed(recording, scene.mesh), None, ())


@dataclass(frozen=True)
class Told:
    """What an experiment adds of its own: exhibits, and numbers by name for printed figures."""

    exhibits: tuple[Exhibit, ...] = ()
    numbers: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Tracking:
    """One experiment over time; see `Experiment` for the fields of the same name.

    `methods` maps a name to frozen settings with `label`, and optionally `steps` (run only so many:
    a baseline that is timed, not scored). `stepper` prepares a method: schemes ignore what was
    measured, filters take the markers they are given. `truth` repeats the twin. `axis` is the
    component that scores follow, `reference` the method that speeds are compared with. `tell` adds
    what this experiment shows besides, from all runs by case ("" is the recorded one) and method;
    `captions` are sentences under charts, by name.
    `remake` are prefixes of parameters that the twin reads: changing one makes the recording anew.
    """

    name: str
    title: str
    source: str
    parameters: Any
    methods: Mapping[str, Any]
    accepted: tuple[str, ...]
    accept: tuple[Accept, ...]
    load: Callable[[Any, Path], tuple[Recording, ...]]
    record: Callable[[Any, Progress], Recording]
    truth: Callable[[Any, Registered], Truth]
    build: Callable[[Recording, Any, Any], Scene]
    place: Callable[[Recording, Any, Scene], Registered]
    stepper: Callable[[Any, Any, System, Registered], Stepper]
    axis: str
    reference: str
    cases: tuple[Case, ...] = ()
    uncertainty: Uncertainty | None = None
    tell: Callable[[Any, Cases, Progress], Told] | None = None
    published: Callable[[Mapping[str, Mapping[str, float]]], tuple[Published, ...]] | None = None
    remake: tuple[str, ...] = ("twin.",)
    captions: Mapping[str, str] = field(default_factory=dict)
    frames: int = 200
    quick: Change = unchanged
    same_model: bool = False
    seed: int | None = None
    twin_notice: str = ""
    path: Path | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "methods", MappingProxyType(dict(self.methods)))
