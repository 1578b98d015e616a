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

from validate.arrays import Floats
from validate.compare.exhibit import Exhibit
from validate.compare.verdict import Accept, Published
from validate.estimate.measured import measurements
from validate.fem.system import System
from validate.parameters import quantity
from validate.recording.types import Recording
from validate.register.observe import Registered
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


@dataclass(frozen=True)
class Follower:
    """A method: settings of a scheme, or of a filter and the markers that it is given.

    `steps`: run only so many, as a baseline that is timed and not scored.
    """

    label: str = quantity("", "1", "what reports call it")
    settings: Any = quantity(None, "1", "of the scheme or filter")
    markers: tuple[str, ...] = quantity((), "1", "markers that a filter is given")
    steps: int | None = quantity(None, "1", "steps to run; none: all")

    def prepare(self, system: System, seen: Registered, **changed: Any) -> Stepper:
        """The prepared scheme or filter, with `changed` settings where it has them."""
        own = {f.name for f in fields(self.settings)}
        settings = replace(self.settings, **{k: v for k, v in changed.items() if k in own})
        if not self.markers:
            return cast(Stepper, settings.prepare(system))
        given = measurements(seen, system.scene.mesh).of(*self.markers)
        return cast(Stepper, settings.prepare(system, given))


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
    what this experiment shows besides.
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
    tell: Callable[[Any, Mapping[str, Followed], Progress], Told] | None = None
    published: Callable[[Mapping[str, Mapping[str, float]]], tuple[Published, ...]] | None = None
    frames: int = 200
    quick: Change = unchanged
    same_model: bool = False
    seed: int | None = None
    twin_notice: str = ""
    path: Path | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "methods", MappingProxyType(dict(self.methods)))
