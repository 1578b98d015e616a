"""A measured body's recording, registered: what moves it, what is compared, at which instants."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from validate.arrays import Floats
from validate.errors import ComparisonError, RecordingError, RegistrationError, UsageError
from validate.identify.modulus import MIN_SAMPLES, load_noise
from validate.recording.readers import recognised
from validate.recording.scatter import repeats_share
from validate.recording.types import Recording, Signal
from validate.register.clock import clock_sd, interpolated
from validate.register.from_rest import noise, rested, since_rest
from validate.register.markers import MarkerObservation, Together, observe_markers, vector
from validate.register.observation import Observation, Selection
from validate.register.registered import Registered
from validate.register.signals import SignalObservation
from validate.register.two_step import fit_plane
from validate.replay.measured_cards import MeasuredBody
from validate.replay.measured_outline import observed_outline
from validate.scene.mesh import Mesh
from validate.scene.named_place import axis_of
from validate.scene.scene import Scene
from validate.scene.select import Place
from validate.scene.tracked import Prescribed

LOW, HIGH = "low", "high"
AS_SEEN, NOTED = "as seen", "noted"
Kind = Literal["weighs", "pulls", "moves", "follows"]
_TOGETHER = (Together("marker", (0, 1, 2), "displacement of the markers since rest, per axis"),)
_At = tuple[Mesh, Path]  # the body's mesh, and the experiment's folder
_AGAINST = 0.2  # of the farthest marker's way: so far back the mean of all may go
FEWEST = 3  # markers on a place that follows them


def drive_kind(recording: Recording, p: MeasuredBody) -> Kind:
    """What the load is; raises `UsageError` for a topic that is no signal in m or N."""
    if p.moved.by == "gravity":
        return "weighs"
    if p.moved.by == "markers":
        return "follows"
    if p.moved.by == NOTED:
        return "moves"
    found = recording.signals.get(p.moved.by)
    unit = found.unit if found is not None else ""
    if unit not in ("m", "N"):
        known = [f"{t} ({s.unit})" for t, s in recording.signals.items() if s.unit in ("m", "N")]
        raise UsageError(
            f"moved.by = {p.moved.by}: {'in ' + unit if unit else 'no signal of that name'}; one "
            f"of {', '.join([*known, 'markers', 'gravity', NOTED])}"
        )
    return "moves" if unit == "m" else "pulls"


def place(recording: Recording, p: MeasuredBody, scene: Scene, *, folder: Path) -> Registered:
    """Drive, force, markers and outlines at `seen.states` instants.

    Raises `ComparisonError` where nothing is left to be compared, `RegistrationError` and
    `RecordingError` as the parts do.
    """
    t, rest = _instants(recording, p)
    kind = drive_kind(recording, p)
    drive = _drive(recording, p, kind, t, rest, (scene.mesh, folder))
    compared: list[Observation] = []
    findings: tuple[str, ...] = ()
    if p.seen.force:
        compared.append(_force(recording, p, kind, drive, rest))
    if p.seen.markers:
        markers, findings = _markers(recording, p, kind, (scene.mesh, folder))
        _require_along(p, markers, kind, float(drive.y[-1, 0]))
        compared.append(markers)
    if p.seen.outline:
        outline, said = observed_outline(recording, p, scene.mesh, rest)
        compared.append(outline)
        findings = (*findings, *said)
    if not compared:
        raise ComparisonError(
            "nothing of the recording is compared: set one of seen.force, seen.markers and "
            f"seen.outline to a topic of {sorted(recording.streams)}"
        )
    return Registered(
        (drive, *compared), _selections(p, drive, kind), Selection("rest", t[:1]),
        findings=findings,
    )  # fmt: skip


def _instants(recording: Recording, p: MeasuredBody) -> tuple[Floats, float]:
    """Rest and evenly spaced times (nt,) s that all streams in use cover; images' own, where
    outlines are compared."""
    used = {p.seen.force, p.seen.markers, p.seen.outline, p.moved.by} - {None, "gravity", NOTED}
    used = {p.seen.markers if topic == "markers" else topic for topic in used} - {None}
    streams = recording.streams
    missing = sorted(str(topic) for topic in used if topic not in streams)
    if missing:
        raise UsageError(f"no stream {missing} in {recording.name}; it has {sorted(streams)}")
    times = [streams[str(topic)].t for topic in used]
    if not times:
        raise ComparisonError("nothing of the recording is used: set seen.* or moved.by")
    start, end = max(t[0] for t in times), min(t[-1] for t in times)
    if not end > start:
        raise ComparisonError(
            f"{recording.name}: the streams {sorted(map(str, used))} share no time "
            f"(latest start {start:.3f} s, earliest end {end:.3f} s); `validate align` them"
        )
    if p.seen.outline:
        own = recording.contour(p.seen.outline).t
        own = own[(own >= start) & (own <= end)]
        picked = np.unique(np.linspace(0, len(own) - 1, p.seen.states + 1).round().astype(int))
        return np.unique(own[picked]), float(own[0])
    count = 1 if p.moved.by == "gravity" else p.seen.states
    return np.append(start, np.linspace(start, end, count + 1)[1:]), float(start)


# --- what moves it --------------------------------------------------------------------------------


def _drive(
    recording: Recording, p: MeasuredBody, kind: Kind, t: Floats, rest: float, at: _At
) -> SignalObservation:
    if kind == "weighs":
        y = np.full((len(t), 1), p.moved.amount * p.moved.scale)
        y[0] = 0.0
        return SignalObservation("gravity", "drives", t, y, "m/s^2", 0.0)
    if kind == "follows":
        return _followed(recording, p, t, at)
    if p.moved.by == NOTED:
        return _noted(p, t)
    topic, unit = p.moved.by, "m" if kind == "moves" else "N"
    signal = _zeroed(recording, topic, unit, rest + p.seen.still)
    y = p.moved.scale * np.interp(t, signal.t, signal.y[:, 0])[:, None]
    y[0] = 0.0
    return SignalObservation(
        topic, "drives", t, y, unit, signal.sd, sd_t=clock_sd(recording, topic)
    )


def _noted(p: MeasuredBody, t: Floats) -> SignalObservation:
    """What was noted, evenly over the instants t (nt,) and straight between; how uncertain it is
    says `ranges.load`."""
    if len(p.moved.noted) < 2 or not np.any(np.diff(p.moved.noted)):
        raise UsageError(
            f"moved.noted = {p.moved.noted or 'none'}: two amounts or more that "
            "differ, from the first instant to the last, as 0,2mm,5mm"
        )
    at = np.linspace(t[0], t[-1], len(p.moved.noted))
    y = p.moved.scale * (np.interp(t, at, p.moved.noted) - p.moved.noted[0])
    return SignalObservation(NOTED, "drives", t, y[:, None], "m", 0.0)


def _zeroed(recording: Recording, topic: str, unit: str, until: float) -> Signal:
    """The signal from its mean at rest; its noise as declared, or more as its samples scatter."""
    s = recording.signal(topic, unit)
    early = s.y[s.t <= max(until, float(s.t[0]))]
    scatter = load_noise(s.y[:, 0]) if len(s.t) >= MIN_SAMPLES else 0.0
    sd = max(s.sd, scatter) * float(np.sqrt(1 + 1 / len(early)))
    return replace(s, y=s.y - early.mean(axis=0), sd=sd)


def prescribed(recording: Recording, p: MeasuredBody, where: Place, at: _At) -> Prescribed:
    """The place that follows its markers as a rigid body; raises `UsageError` for fewer than three
    markers, or names that are none."""
    markers = recording.marker(_topic(recording, p))
    absent = [n for n in p.moved.markers if n not in markers.names]
    if absent or len(p.moved.markers) < FEWEST:
        raise UsageError(
            f"moved.markers = {','.join(p.moved.markers) or 'none'}: "
            f"{f'{absent} are not recorded' if absent else 'three or more are needed'}; the "
            f"recording has {', '.join(markers.names)}"
        )
    observed = _registered(recording, p, at)
    places = dict(zip(observed.names, observed.x[0], strict=True))
    unseen = [n for n in p.moved.markers if n not in places]
    if unseen:
        raise RegistrationError(f"markers {unseen} on the moved place are not seen at rest")
    points = tuple((n, tuple(places[n].tolist())) for n in p.moved.markers)
    return Prescribed("moved", where, points)


def _followed(recording: Recording, p: MeasuredBody, t: Floats, at: _At) -> SignalObservation:
    """What the markers on the moved place did, one column an axis of each."""
    seen = _registered(recording, p, at)
    own = [seen.names.index(n) for n in p.moved.markers]
    moved = (seen.x[:, own] - seen.x[0, own]).reshape(len(seen.t), -1)
    y, _ = interpolated(seen.t, moved, t)
    if not np.isfinite(y).all():
        first = t[np.flatnonzero(~np.isfinite(y).all(axis=1))[0]]
        raise RegistrationError(
            f"the markers on the moved place are not all seen at t = {first:.3f} s: fill the gap, "
            "or leave one out of moved.markers"
        )
    y[0] = 0.0
    sd_t = clock_sd(recording, _topic(recording, p))
    return SignalObservation("moved", "drives", t, p.moved.scale * y, "m", seen.sd, sd_t=sd_t)


# --- what is compared -----------------------------------------------------------------------------


def _force(
    recording: Recording, p: MeasuredBody, kind: Kind, drive: SignalObservation, rest: float
) -> SignalObservation:
    """Force on the moved place against its motion; raises `ComparisonError` where that is none of
    the run's, `RegistrationError` for a force that falls as the place moves."""
    if kind != "moves":
        raise ComparisonError(
            f"seen.force = {p.seen.force}: a force is predicted where a displacement moves a "
            f"place; here the body {kind}. Set seen.force=none"
        )
    topic = str(p.seen.force)
    force = _zeroed(recording, topic, "N", rest + p.seen.still)
    t = drive.t
    y = np.interp(t, force.t, force.y[:, 0])
    far = int(np.abs(drive.y[:, 0]).argmax())
    if y[far] * drive.y[far, 0] < 0 and abs(y[far]) > 5 * force.sd:
        raise RegistrationError(
            f"'{topic}' is {y[far]:.4g} N where '{p.moved.by}' is {1e3 * drive.y[far, 0]:.3g} mm: "
            "force and motion must have one sign; turn one as it is imported, with "
            "--map force=COLUMN:UNIT:-"
        )
    return SignalObservation(
        topic, "validates", t[1:], y[1:, None], "N", force.sd, "force", "moved.force",
        clock_sd(recording, topic), repeats_share(recording),
    )  # fmt: skip


def _markers(
    recording: Recording, p: MeasuredBody, kind: Kind, at: _At
) -> tuple[MarkerObservation, tuple[str, ...]]:
    """All markers that move nothing themselves, from where they stood at rest."""
    whole = _registered(recording, p, at)
    source, unseen, samples = rested(recording.marker(_topic(recording, p)), p.seen.still)
    driving = p.moved.markers if kind == "follows" else ()
    kept = [i for i, n in enumerate(whole.names) if n not in driving]
    if not kept:
        raise ComparisonError("every marker moves the body: none is left to be compared")
    part = replace(
        whole, names=tuple(whole.names[i] for i in kept), x=whole.x[:, kept],
        rest=whole.rest[kept], tre=whole.tre[kept],
    )  # fmt: skip
    found = since_rest(part, at[0], noise(source), samples, p.seen.stands)
    bare = [n for n in source.names if n not in whole.names]
    left = (("not seen at rest", unseen), ("not in the layout", bare))
    said = tuple(f"markers {why} are left out: {_shown(names)}" for why, names in left if names)
    return replace(found, together=_TOGETHER), said


def _require_along(p: MeasuredBody, markers: MarkerObservation, kind: Kind, amount: float) -> None:
    """Raises `RegistrationError` where the markers go against what moves the body: the frame then
    has another axis up, or is left-handed."""
    if kind == "follows":
        return
    moved = markers.x[-1] - markers.rest
    seen = moved[np.isfinite(moved).all(axis=1)]
    if not len(seen):
        return
    along = float(np.sign(amount) * (seen @ np.array(axis_of(p.moved.along))).mean())
    most = float(np.linalg.norm(seen, axis=1).max())
    if along < -_AGAINST * most and -along > 5 * markers.sd / np.sqrt(len(seen)):
        raise RegistrationError(
            f"the markers went {-1e3 * along:.3g} mm against {p.moved.along}, along which "
            f"'{p.moved.by}' moves the body (the farthest by {1e3 * most:.3g} mm): another axis is "
            "up in their frame, or the sign is the other one; set moved.along, or seen.layout"
        )


def _registered(recording: Recording, p: MeasuredBody, at: _At) -> MarkerObservation:
    """Markers in the body's frame: their layout's, or the one they were recorded in."""
    mesh, folder = at
    topic = _topic(recording, p)
    markers, _, _ = rested(recording.marker(topic), p.seen.still)
    layout = dict(zip(markers.names, markers.x[0], strict=True))
    if p.seen.layout != AS_SEEN:
        layout = layout_of(recording, p.seen.layout, folder)
    kept = [i for i, n in enumerate(markers.names) if n in layout]
    if not kept:
        raise RegistrationError(
            f"seen.layout = {p.seen.layout} has {_shown(layout)}; the recording has "
            f"{_shown(markers.names)}: no marker's name is in both; spell them as recorded"
        )
    markers = replace(
        markers, names=tuple(markers.names[i] for i in kept), x=markers.x[:, kept],
        sd=noise(markers),
    )  # fmt: skip
    same = _side(markers.x[0]) if p.seen.layout == AS_SEEN else None
    return observe_markers(
        markers, layout, mesh, how=p.seen.registration, up=same, name=topic, stands=np.inf,
        sd_t=clock_sd(recording, topic),
    )  # fmt: skip


def _shown(names: Iterable[str]) -> str:
    found = [repr(name) for name in names]
    return ", ".join(found[:6]) + (f" and {len(found) - 6} more" if len(found) > 6 else "")


def _side(x: Floats) -> tuple[Floats, Floats] | None:
    """The normal of planar markers (k, 3) m, which are in one frame twice: it tells them from their
    mirror image. None for others, whose shape does."""
    try:
        normal = fit_plane(x).axes[:, 2]
    except RegistrationError:
        return None
    return normal, normal


def layout_of(recording: Recording, text: str, folder: Path) -> dict[str, Floats]:
    """Places (3,) m of markers in the body's frame: of the record "marker_layout", or of the points
    of a file of landmarks. Raises `RecordingError` for a file without points."""
    if text == "recorded":
        record = recording.record("marker_layout")
        return {name: vector(at, f"marker_layout '{name}'") for name, at in record.items()}
    path = folder / text
    points = recognised(path).read(path, {}).markers
    if not points:
        raise RecordingError(f"{path.name}: no points; a layout is a file of landmarks, as FCSV")
    first = next(iter(points.values()))
    return dict(zip(first.names, first.x[0], strict=True))


def _topic(recording: Recording, p: MeasuredBody) -> str:
    """The markers' topic, where it is not said the only one."""
    if p.seen.markers:
        return p.seen.markers
    if len(recording.markers) != 1:
        raise UsageError(f"seen.markers is not set; one of {sorted(recording.markers)}")
    return next(iter(recording.markers))


# --- windows --------------------------------------------------------------------------------------


def _selections(p: MeasuredBody, drive: SignalObservation, kind: Kind) -> tuple[Selection, ...]:
    """The one state under gravity; else the instants up to `fit_to` of the largest load, on which
    an open modulus is identified, and those beyond."""
    after = drive.t[1:]
    if kind == "weighs":
        return (Selection("loaded", after, "the last instant"),)
    size = np.linalg.norm(drive.y[1:], axis=1)
    low = size <= p.seen.fit_to * size.max()
    share = f"{100 * p.seen.fit_to:g} % of the largest load"
    return (
        _window(LOW, after[low], f"instants up to {share}"),
        _window(HIGH, after[~low], f"instants beyond {share}"),
    )


def _window(label: str, t: Floats, words: str) -> Selection:
    if len(t) < FEWEST:
        raise ComparisonError(
            f"window '{label}': {len(t)} {words}, {FEWEST} are needed; set seen.fit_to or "
            "seen.states"
        )
    return Selection(label, t, words)
