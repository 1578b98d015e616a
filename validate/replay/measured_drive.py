"""What loads a measured body: a signal, markers on a place, gravity, a motion that was noted, or
the release of a place that was held."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Literal

import numpy as np

from validate.arrays import Floats
from validate.errors import ComparisonError, RegistrationError, UsageError
from validate.fem.system import build
from validate.identify.modulus import MIN_SAMPLES, load_noise
from validate.recording.scatter import repeats_share
from validate.recording.types import Recording, Signal
from validate.register.clock import clock_sd, interpolated
from validate.register.signals import SignalObservation
from validate.replay.machine_compliance import taken_off
from validate.replay.measured_cards import MeasuredBody
from validate.replay.measured_markers import BodyAt, markers_topic, registered
from validate.scene.scene import Scene
from validate.scene.select import Place
from validate.scene.tracked import Prescribed

NOTED, RELEASE = "noted", "release"
Kind = Literal["weighs", "pulls", "moves", "follows", "presses", "releases"]
_KINDS: Mapping[str, Kind] = {"m": "moves", "N": "pulls", "Pa": "presses"}  # by a signal's unit
_UNITS = {kind: unit for unit, kind in _KINDS.items()}
FEWEST = 3  # markers on a place that follows them


def drive_kind(recording: Recording, p: MeasuredBody) -> Kind:
    """What the load is; raises `UsageError` for a topic that is no signal in m, N or Pa."""
    if p.moved.by == "gravity":
        return "weighs"
    if p.moved.by == "markers":
        return "follows"
    if p.moved.by == NOTED:
        return "moves"
    if p.moved.by == RELEASE:
        return "releases"
    found = recording.signals.get(p.moved.by)
    unit = found.unit if found is not None else ""
    if unit not in _KINDS:
        known = [f"{t} ({s.unit})" for t, s in recording.signals.items() if s.unit in _KINDS]
        raise UsageError(
            f"moved.by = {p.moved.by}: {'unit ' + unit if unit else 'no signal of that name'}; "
            f"expected one of {', '.join([*known, 'markers', 'gravity', NOTED, RELEASE])}"
        )
    return _KINDS[unit]


def driven(
    recording: Recording, p: MeasuredBody, kind: Kind, t: Floats, rest: float, at: BodyAt
) -> SignalObservation:
    """What loads the body at the instants t (nt,), 0 at the first; `rest` s is where it begins."""
    if kind == "weighs":
        y = np.full((len(t), 1), p.moved.amount * p.moved.scale)
        y[0] = 0.0
        return SignalObservation("gravity", "drives", t, y, "m/s^2", 0.0)
    if kind == "follows":
        return _followed(recording, p, t, at)
    if p.moved.by == NOTED:
        return _noted(p, t)
    topic, unit = p.moved.by, _UNITS[kind]
    signal = zeroed(recording, topic, unit, rest + p.seen.still)
    y = p.moved.scale * np.interp(t, signal.t, signal.y[:, 0])[:, None]
    if kind == "moves":
        y = y - min(p.indenter.gap, 0.0)  # it pressed already
    y[0] = 0.0
    drive = SignalObservation(
        topic, "drives", t, y, unit, signal.sd, sd_t=clock_sd(recording, topic)
    )
    if kind != "moves" or not p.machine.compliance:
        return drive
    felt = p.seen.force and zeroed(recording, p.seen.force, "N", rest + p.seen.still)
    force = felt and SignalObservation(str(p.seen.force), "validates", felt.t, felt.y, "N", felt.sd)
    return taken_off(drive, p, force or None)


def _noted(p: MeasuredBody, t: Floats) -> SignalObservation:
    """What was noted, evenly over the instants t (nt,) and straight between; how uncertain it is
    says `ranges.load`."""
    if len(p.moved.noted) < 2 or not np.any(np.diff(p.moved.noted)):
        raise UsageError(
            f"moved.noted = {p.moved.noted or 'none'}: expected at least two different "
            f"displacements, from the first to the last instant, as 0,2mm,5mm"
        )
    at = np.linspace(t[0], t[-1], len(p.moved.noted))
    y = p.moved.scale * (np.interp(t, at, p.moved.noted) - p.moved.noted[0])
    return SignalObservation(NOTED, "drives", t, y[:, None], "m", 0.0)


def zeroed(recording: Recording, topic: str, unit: str, until: float) -> Signal:
    """The signal from its mean at rest; its noise as declared, or more as its samples scatter."""
    s = recording.signal(topic, unit)
    early = s.y[s.t <= max(until, float(s.t[0]))]
    scatter = load_noise(s.y[:, 0]) if len(s.t) >= MIN_SAMPLES else 0.0
    sd = max(s.sd, scatter) * float(np.sqrt(1 + 1 / len(early)))
    return replace(s, y=s.y - early.mean(axis=0), sd=sd)


def zeroed_force(recording: Recording, p: MeasuredBody, kind: Kind, until: float) -> Signal:
    """The force on the moved place from its mean until then; raises `ComparisonError` where no
    displacement moves a place."""
    if kind != "moves":
        raise ComparisonError(
            f"seen.force = {p.seen.force}: a force is predicted only if a displacement moves a "
            f"place, but moved.by = {p.moved.by} is no signal in m. Set seen.force=none"
        )
    return zeroed(recording, str(p.seen.force), "N", until)


def observed_force(
    recording: Recording, p: MeasuredBody, force: Signal, t: Floats, y: Floats
) -> SignalObservation:
    """The force y (nt, 1) N at t (nt,) s but its first sample, which is at rest."""
    topic = str(p.seen.force)
    return SignalObservation(
        topic, "validates", t[1:], y[1:], "N", force.sd, "force", "moved.force",
        clock_sd(recording, topic), repeats_share(recording),
    )  # fmt: skip


def prescribed(recording: Recording, p: MeasuredBody, where: Place, at: BodyAt) -> Prescribed:
    """The place that follows its markers as a rigid body; raises `UsageError` for fewer than three
    markers, or names that are none."""
    markers = recording.marker(markers_topic(recording, p))
    absent = [n for n in p.moved.markers if n not in markers.names]
    if absent or len(p.moved.markers) < FEWEST:
        raise UsageError(
            f"moved.markers = {','.join(p.moved.markers) or 'none'}: "
            f"{f'{absent} are not recorded' if absent else 'three or more are needed'}; the "
            f"recording has {', '.join(markers.names)}"
        )
    observed = registered(recording, p, at)
    places = dict(zip(observed.names, observed.x[0], strict=True))
    unseen = [n for n in p.moved.markers if n not in places]
    if unseen:
        raise RegistrationError(f"markers {unseen} on the moved place are not visible at rest")
    points = tuple((n, tuple(places[n].tolist())) for n in p.moved.markers)
    return Prescribed("moved", where, points)


def _followed(recording: Recording, p: MeasuredBody, t: Floats, at: BodyAt) -> SignalObservation:
    """What the markers on the moved place did, one column an axis of each."""
    seen = registered(recording, p, at)
    own = [seen.names.index(n) for n in p.moved.markers]
    moved = (seen.x[:, own] - seen.x[0, own]).reshape(len(seen.t), -1)
    y, _ = interpolated(seen.t, moved, t)
    if not np.isfinite(y).all():
        first = t[np.flatnonzero(~np.isfinite(y).all(axis=1))[0]]
        raise RegistrationError(
            f"the markers on the moved place are not all visible at t = {first:.3f} s: fill the "
            f"gap, "
            "or leave one out of moved.markers"
        )
    y[0] = 0.0
    sd_t = clock_sd(recording, markers_topic(recording, p))
    return SignalObservation("moved", "drives", t, p.moved.scale * y, "m", seen.sd, sd_t=sd_t)


def released_force(p: MeasuredBody, scene: Scene) -> float:
    """N along `moved.along` that held the released place: as given, or what holds it at the given
    mean displacement by linear statics. Raises `UsageError` where neither is given, or both."""
    force, displacement = p.motion.held_force, p.motion.held_displacement
    if (force is None) == (displacement is None):
        raise UsageError(
            "moved.by = release: set motion.held_force (as 0.2N) or motion.held_displacement (as "
            "5mm), not both"
        )
    if force is not None:
        return force
    return float(displacement or 0.0) / _compliance(scene)


def _compliance(scene: Scene) -> float:
    """Mean displacement m of the load's place along it, per newton of it."""
    loads = tuple(part for part in scene.loads if part.name == "load")
    linear = replace(scene, material=scene.material.of_law("linear"), loads=loads, probes=())
    system = build(linear)
    u = np.zeros(len(system.loads))
    f = system.loads[:, 0]
    u[system.free] = system.factor().solve(f[system.free])
    return float(f @ u)  # the mean over the place: the load is spread over it uniformly
