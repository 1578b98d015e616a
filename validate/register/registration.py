"""Registered recording: its observations in the scene's frame, and the compared ones.

A signal with the name of an input (a drive, a load, a rigid body that moves) drives it; an input
with a value is constant. `<drive>.force` in N is predicted by the force of that drive or rigid
body. Markers are placed by the recording's own records.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self, TypeVar

import numpy as np

from validate.arrays import Floats, Ints
from validate.errors import ComparisonError, RegistrationError
from validate.recording.types import Recording
from validate.register.markers.markers import MarkerObservation
from validate.register.markers.quality import MarkerFit
from validate.register.observation import EVERYTHING, Observation, Selection, nearest_sample
from validate.register.outlines.outlines import OutlineObservation
from validate.register.signals import SignalObservation
from validate.scene.contact import RigidContact
from validate.scene.mesh import Mesh
from validate.scene.scene import Drive, Load, Pressure, Scene, Weight

O = TypeVar("O")


@dataclass(frozen=True)
class Registered:
    """All observations of a recording in the scene's frame, and the compared ones.

    `rest` is the unloaded instant, where registration and geometry can be looked at alone.
    `outside` counts samples left out because they lie beyond the law's validity. `time_scale` are
    the recorded seconds in one second of these times, where a slow recording is walked faster.
    `timed` is False where rows were recorded without times and their numbers stand for them.
    `sudden`: the loads of the first step act from 0 s on, and a shorter step does not let them
    rise. `moves`: a motion in time, drawn over it whatever windows are compared.
    Raises `ComparisonError` unless driving signals, on common times, are there.
    """

    observations: tuple[Observation, ...]
    selections: tuple[Selection, ...] = (EVERYTHING,)
    rest: Selection | None = None
    outside: int = 0
    findings: tuple[str, ...] = ()
    time_scale: float = 1.0
    timed: bool = True
    sudden: bool = False
    moves: bool = False

    def __post_init__(self) -> None:
        drives = self.drives
        if not drives:
            raise ComparisonError("no observation drives the simulation: name the driving signal")
        if any(not np.array_equal(d.t, drives[0].t) for d in drives):
            raise ComparisonError(
                f"{len(drives)} driving signals on different times; resample them onto one clock"
            )
        sd_t = max(d.sd_t for d in drives)
        selections = tuple(replace(s, sd_t=sd_t) for s in self.selections)
        object.__setattr__(self, "selections", selections)

    @property
    def drives(self) -> tuple[SignalObservation, ...]:
        """The driving signals, in the order of the scene's inputs."""
        return tuple(
            o for o in self.observations if isinstance(o, SignalObservation) and o.role == "drives"
        )

    @property
    def t(self) -> Floats:
        """Times (nt,) s of the steps."""
        return self.drives[0].t

    @property
    def inputs(self) -> Floats:
        """What every step is given (nt, k): drives in m, then loads in N, as the scene has them."""
        return np.hstack([d.y for d in self.drives])

    def shifted(self, off: tuple[float, ...]) -> "Registered":
        """With every drive off by a constant (k,), one number an input, but at rest, from where
        drives are counted."""
        at = 0
        new: dict[int, SignalObservation] = {}
        still = np.zeros(len(self.t), bool)
        if self.rest is not None and self.rest.t is not None:
            still = np.isin(self.t, self.rest.t)
        for drive in self.drives:
            wide = drive.y.shape[1]
            error = np.where(still[:, None], 0.0, np.array(off[at : at + wide]))
            new[id(drive)] = replace(drive, y=drive.y + error)
            at += wide
        observed = tuple(new.get(id(o), o) for o in self.observations)
        return replace(self, observations=observed)

    @property
    def compared(self) -> tuple[Observation, ...]:
        return tuple(o for o in self.observations if o.role != "drives")

    def of(self, kind: type[O]) -> tuple[O, ...]:
        """Return the observations of one kind that do not drive."""
        return tuple(o for o in self.compared if isinstance(o, kind))

    def frames(self, t: Floats, most: int) -> Ints:
        """Which of a run's steps at t (nt,) s keep their fields: rest and single instants, where
        there are none of these rest and `most` evenly; and those at which outlines are compared."""
        single = [s.steps(t) for s in self.selections if s.t is not None and len(s.t) == 1]
        rest = [self.rest.steps(t)] if self.rest is not None else []
        even = np.linspace(0, len(t) - 1, min(most, len(t))).round().astype(np.int64)
        outlines = {o.name for o in self.of(OutlineObservation)}
        film = [s.steps(t) for s in self.selections if s.t is not None and outlines & set(s.of)]
        return np.unique(np.concatenate([*rest, *(single or [even]), *film]))

    def stage(self, t: float) -> float:
        """Return the first input at the step nearest to t s, in its own unit."""
        return float(self.inputs[nearest_sample(self.t, t, "the drive"), 0])

    @classmethod
    def following(
        cls, recording: Recording, mesh: Mesh, signal: str, unit: str, how: MarkerFit = MarkerFit()
    ) -> Self:
        """Step through `signal` after t = 0, where everything is at rest, with the tracked markers
        placed by the recording's own records."""
        drive = SignalObservation.driving(recording, signal, unit, after_rest=True)
        return cls((drive, MarkerObservation.placed(recording, mesh, how=how)))

    @staticmethod
    def given_inputs(scene: Scene, t: Floats) -> tuple[SignalObservation, ...]:
        """Return one constant signal for every input of the scene, at times t (nt,) s.

        Raises `RegistrationError` for an input without a value.
        """
        inputs = {"drives": scene.drives, "loads": scene.loads}
        for kind, parts in inputs.items():
            for part in parts:
                if part.value is None:
                    raise RegistrationError(
                        f"input '{part.name}' has no value and no recording gives it; set "
                        f"{kind}.{part.name}.value"
                    )
        return tuple(_constant(part, t) for parts in inputs.values() for part in parts)


# --- registration by names: streams drive the declared inputs of a scene or are compared ---------

_UNITS: Mapping[type, str] = {
    Drive: "m", Load: "N", Weight: "m/s^2", Pressure: "Pa", RigidContact: "m"
}  # fmt: skip


def as_declared(recording: Recording, scene: Scene, how: MarkerFit = MarkerFit()) -> Registered:
    """Return the recording registered by the names of the scene's inputs.

    Raises `RegistrationError` for an input that has no value and no signal, and where nothing of
    the recording is predicted.
    """
    parts: tuple[Any, ...] = (*scene.drives, *scene.loads, *scene.movers)
    recorded = {
        part.name: SignalObservation.driving(
            recording, _known(part.name, recording), _UNITS[type(part)], after_rest=True
        )
        for part in parts if isinstance(part, RigidContact) or part.value is None
    }  # fmt: skip
    t = next(iter(recorded.values())).t if recorded else np.ones(1)
    inputs = tuple(recorded.get(part.name) or _constant(part, t) for part in parts)
    moved: tuple[Any, ...] = (*scene.drives, *scene.movers)
    forces = [name for d in moved if (name := f"{d.name}.force") in recording.signals]
    seen: list[Observation] = [
        SignalObservation.validating(recording, name, "N", quantity=name, trace=name)
        for name in forces
    ]
    seen += [
        MarkerObservation.placed(recording, scene.mesh, topic=k, how=how) for k in recording.markers
    ]
    if not seen:
        raise RegistrationError(
            "the recording has nothing that this scene predicts: neither markers, nor a signal "
            "DRIVE.force in N; give `place`, a function that registers it"
        )
    return Registered((*inputs, *seen))


def _constant(part: Any, t: Floats) -> SignalObservation:
    y = np.full((len(t), 1), part.value)
    return SignalObservation(part.name, "drives", t, y, _UNITS[type(part)], 0.0)


def _known(name: str, recording: Recording) -> str:
    if name not in recording.signals:
        raise RegistrationError(
            f"input '{name}' has no value, and the recording no signal of this name; it has "
            f"{', '.join(recording.signals) or 'none'}: rename the input, or set its value"
        )
    return name
