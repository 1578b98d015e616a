"""Drive of a measured body: drive, indenter, load, pressure, tracked points, weight or release."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Literal

import numpy as np

from validate.arrays import Floats
from validate.errors import ComparisonError, RegistrationError, UsageError
from validate.fem.system import build
from validate.identify.modulus import MIN_SAMPLES, load_noise
from validate.parameters import known
from validate.pipeline.bodies.markers import BodyAt, leading, markers_topic, registered
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.plates.scene import taken_off
from validate.recording.merge import repeats_share
from validate.recording.types import Recording, Signal
from validate.register.clocks import clock_sd, interpolated
from validate.register.signals import SignalObservation
from validate.scene.contact import Indenter, RigidContact
from validate.scene.scene import Drive, Load, Prescribed, Pressure, Scene, Weight

Kind = Literal["weighs", "pulls", "moves", "follows", "presses", "releases"]
Mover = Drive | RigidContact | Prescribed | Load | Pressure | Weight
_KINDS: Mapping[type, Kind] = {
    Drive: "moves", RigidContact: "moves", Prescribed: "follows", Load: "pulls",
    Pressure: "presses", Weight: "weighs",
}  # fmt: skip
_UNITS: Mapping[Kind, str] = {"moves": "m", "pulls": "N", "presses": "Pa"}  # of their signals
SIGNALS = frozenset(_UNITS)
_OF_UNIT = frozenset(_UNITS.values())
_DOES: Mapping[Kind, str] = {
    "moves": "moves the body", "pulls": "loads the body", "presses": "presses on the body"
}  # fmt: skip
_ELSE: Mapping[Kind, str] = {
    "moves": ", or noted=0,2mm,5mm",
    "pulls": ", or motion.held_force, of a load that is released",
}
FEWEST = 3  # markers on a place that follows them


def mover(scene: Scene) -> Mover:
    """Return the one part of a declared scene that moves or loads the body: its weight, where
    nothing else does. Raises `UsageError` where there is none, or several."""
    weights = tuple(part for part in scene.loads if isinstance(part, Weight))
    parts: tuple[Mover, ...] = (
        *(d for d in scene.drives if d.follows is None), *scene.movers, *scene.tracked,
        *(part for part in scene.loads if not isinstance(part, Weight)),
    )  # fmt: skip
    found = parts or weights
    if still := [c.name for c in scene.contacts if c.direction is None and not parts]:
        raise UsageError(f"contacts.{still[0]} has no direction; say where it moves, as '-z'")
    if len(found) != 1:
        names = ", ".join(part.name for part in found) or "none"
        raise UsageError(
            f"the scene has {len(found)} parts that move or load the body ({names}); expected one "
            "of drives, contacts, tracked and loads (and weight beside it)"
        )
    return found[0]


def weight_beside(scene: Scene) -> Weight | None:
    """Return the weight that acts beside what moves the body."""
    weights = [part for part in scene.loads if isinstance(part, Weight)]
    return weights[0] if weights and mover(scene) is not weights[0] else None


def along_of(scene: Scene) -> Floats:
    """Return the unit vector (3,) along which the body is moved or loaded; 0 where that has
    none."""
    direction = getattr(mover(scene), "direction", None)
    return np.zeros(3) if direction is None else np.array(direction)


def pressing(scene: Scene) -> Indenter | None:
    """Return the indenter, where one presses on the body."""
    shapes = [part.shape for part in scene.movers]
    return shapes[0] if shapes and isinstance(shapes[0], Indenter) else None


def drive_kind(recording: Recording, p: Tree) -> Kind:
    """Return the kind of the load; raises `UsageError` where no signal of its name has its unit."""
    part, motion = mover(p.scene), p.settings.motion
    kind: Kind = _KINDS[type(part)]
    released = motion.held_force is not None or motion.held_displacement is not None
    if kind == "pulls" and released:
        return "releases"
    if kind not in _UNITS or (kind == "moves" and p.settings.noted):
        return kind
    found = recording.signals.get(part.name)
    if found is None or found.unit != _UNITS[kind]:
        known = [f"{t} ({s.unit})" for t, s in recording.signals.items() if s.unit in _OF_UNIT]
        why = f"unit {found.unit}" if found else "no signal of that name"
        raise UsageError(
            f"'{part.name}' {_DOES[kind]}: {why}; expected a signal in {_UNITS[kind]}, of "
            f"{', '.join(known) or 'none'}{_ELSE.get(kind, '')}"
        )
    return kind


def driven(
    recording: Recording, p: Tree, kind: Kind, t: Floats, rest: float, at: BodyAt
) -> SignalObservation:
    """What loads the body at the instants t (nt,), 0 at the first; `rest` s is where it begins."""
    part, seen = mover(p.scene), p.settings.seen
    if isinstance(part, Weight):
        amount = known(part.value, f"loads.{part.name}.value")
        y = np.full((len(t), 1), amount * p.settings.scale)
        y[0] = 0.0
        return SignalObservation(part.name, "drives", t, y, "m/s^2", 0.0)
    if kind == "follows":
        return _followed(recording, p, t, at)
    if kind == "moves" and p.settings.noted:
        return _noted(p, t)
    topic, unit = part.name, _UNITS[kind]
    signal = zeroed(recording, topic, unit, rest + seen.still)
    y = p.settings.scale * np.interp(t, signal.t, signal.y[:, 0])[:, None]
    if kind == "moves":
        indenter = pressing(p.scene)
        y = y - min(indenter.gap if indenter else 0.0, 0.0)  # it pressed already
    y[0] = 0.0
    drive = SignalObservation(
        topic, "drives", t, y, unit, signal.sd, sd_t=clock_sd(recording, topic)
    )
    if kind != "moves" or not p.settings.machine.compliance:
        return drive
    felt = seen.force and zeroed(recording, seen.force, "N", rest + seen.still)
    force = felt and SignalObservation(str(seen.force), "validates", felt.t, felt.y, "N", felt.sd)
    return taken_off(drive, p, force or None)


def _noted(p: Tree, t: Floats) -> SignalObservation:
    """What was noted, evenly over the instants t (nt,) and straight between; how uncertain it is
    says `ranges.load`."""
    noted = p.settings.noted
    if len(noted) < 2 or not np.any(np.diff(noted)):
        raise UsageError(
            f"noted = {noted}: expected at least two different displacements, from the first to "
            "the last instant, as 0,2mm,5mm"
        )
    at = np.linspace(t[0], t[-1], len(noted))
    y = p.settings.scale * (np.interp(t, at, noted) - noted[0])
    return SignalObservation(mover(p.scene).name, "drives", t, y[:, None], "m", 0.0)


def zeroed(recording: Recording, topic: str, unit: str, until: float) -> Signal:
    """Return the signal from its mean at rest; its noise as declared, or more as its samples
    scatter."""
    s = recording.signal(topic, unit)
    early = s.y[s.t <= max(until, float(s.t[0]))]
    scatter = load_noise(s.y[:, 0]) if len(s.t) >= MIN_SAMPLES else 0.0
    sd = max(s.sd, scatter) * float(np.sqrt(1 + 1 / len(early)))
    return replace(s, y=s.y - early.mean(axis=0), sd=sd)


def zeroed_force(recording: Recording, p: Tree, kind: Kind, until: float) -> Signal:
    """Return the force on the moved place from its mean until then; raises `ComparisonError` where
    no displacement moves a place."""
    if kind != "moves":
        raise ComparisonError(
            f"seen.force = {p.settings.seen.force}: a force is predicted only if a displacement "
            f"moves a place, but '{mover(p.scene).name}' is none. Set seen.force=none"
        )
    return zeroed(recording, str(p.settings.seen.force), "N", until)


def observed_force(
    recording: Recording, p: Tree, force: Signal, t: Floats, y: Floats
) -> SignalObservation:
    """Return the force y (nt, 1) N at t (nt,) s but its first sample, which is at rest."""
    topic = str(p.settings.seen.force)
    return SignalObservation(
        topic, "validates", t[1:], y[1:], "N", force.sd, "force", f"{mover(p.scene).name}.force",
        clock_sd(recording, topic), repeats_share(recording),
    )  # fmt: skip


def placed_points(recording: Recording, p: Tree, part: Prescribed, at: BodyAt) -> Prescribed:
    """What follows its markers as a rigid body, with their places; raises `UsageError` for fewer
    than three markers, or names that are none."""
    markers = recording.marker(markers_topic(recording, p))
    absent = [n for n in part.labels if n not in markers.names]
    if absent or len(part.labels) < FEWEST:
        raise UsageError(
            f"tracked.{part.name}.labels = {','.join(part.labels) or 'none'}: "
            f"{f'{absent} are not recorded' if absent else 'three or more are needed'}; the "
            f"recording has {', '.join(markers.names)}"
        )
    observed = registered(recording, p, at)
    places = dict(zip(observed.names, observed.x[0], strict=True))
    unseen = [n for n in part.labels if n not in places]
    if unseen:
        raise RegistrationError(f"markers {unseen} on the moved place are not visible at rest")
    return replace(part, points=tuple((n, tuple(places[n].tolist())) for n in part.labels))


def _followed(recording: Recording, p: Tree, t: Floats, at: BodyAt) -> SignalObservation:
    """What the markers on the moved place did, one column an axis of each."""
    seen, part = registered(recording, p, at), mover(p.scene)
    own = [seen.names.index(n) for n in leading(p.scene)]
    moved = (seen.x[:, own] - seen.x[0, own]).reshape(len(seen.t), -1)
    y, _ = interpolated(seen.t, moved, t)
    if not np.isfinite(y).all():
        first = t[np.flatnonzero(~np.isfinite(y).all(axis=1))[0]]
        raise RegistrationError(
            f"the markers on the moved place are not all visible at t = {first:.3f} s: fill the "
            f"gap, or leave one out of tracked.{part.name}.labels"
        )
    y[0] = 0.0
    sd_t = clock_sd(recording, markers_topic(recording, p))
    return SignalObservation(part.name, "drives", t, p.settings.scale * y, "m", seen.sd, sd_t=sd_t)


def released_force(p: Tree, scene: Scene) -> float:
    """N along the load that held the released place: as given, or what holds it at the given
    mean displacement by linear statics. Raises `UsageError` where both are given."""
    force, displacement = p.settings.motion.held_force, p.settings.motion.held_displacement
    if None not in (force, displacement):
        raise UsageError(
            "motion.held_force and motion.held_displacement are both set; give one of them"
        )
    if force is not None:
        return float(force)
    return float(displacement or 0.0) / _compliance(scene)


def _compliance(scene: Scene) -> float:
    """Mean displacement m of the load's place along it, per newton of it."""
    loads = tuple(part for part in scene.loads if not isinstance(part, Weight))
    linear = replace(scene, material=scene.material.of_law("linear"), loads=loads, probes=())
    system = build(linear)
    u = np.zeros(len(system.loads))
    f = system.loads[:, 0]
    u[system.free] = system.factor().solve(f[system.free])
    return float(f @ u)  # the mean over the place: the load is spread over it uniformly
