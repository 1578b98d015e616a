"""Registration of a measured body: drive, observations and compared instants."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from validate.arrays import Floats
from validate.errors import ComparisonError, RegistrationError, UsageError
from validate.pipeline.bodies.drive import (
    SIGNALS,
    Kind,
    along_of,
    drive_kind,
    driven,
    mover,
    observed_force,
    zeroed_force,
)
from validate.pipeline.bodies.markers import (
    compared_markers,
    leading,
    listed_names,
    markers_topic,
    observed_outline,
)
from validate.pipeline.experiment.tree import Tree
from validate.recording.types import Recording
from validate.register.markers.displacements import noise, rested, since_rest
from validate.register.markers.markers import MarkerObservation, Together
from validate.register.observation import Observation, Selection
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.scene.scene import Scene, Weight

LOW, HIGH = "low", "high"
_TOGETHER = (Together("marker", (0, 1, 2), "displacement of the markers since rest, per axis"),)
_FEWEST = 3  # instants of a window
_TIE = 1e-9
_AGAINST = 0.2  # of the farthest marker's way: so far back the mean of all may go


def place(recording: Recording, p: Tree, scene: Scene, *, folder: Path) -> Registered:
    """Drive, force, markers and outlines at `seen.states` instants.

    Raises `ComparisonError` where nothing is left to be compared, `RegistrationError` and
    `RecordingError` as the parts do.
    """
    t, rest = _instants(recording, p)
    kind = drive_kind(recording, p)
    drive = driven(recording, p, kind, t, rest, (scene.mesh, folder))
    compared: list[Observation] = []
    findings: tuple[str, ...] = ()
    if p.settings.seen.force:
        # Force on the moved place, against its motion
        topic = str(p.settings.seen.force)
        force = zeroed_force(recording, p, kind, rest + p.settings.seen.still)
        y = np.interp(drive.t, force.t, force.y[:, 0])
        far = int(np.abs(drive.y[:, 0]).argmax())
        if y[far] * drive.y[far, 0] < 0 and abs(y[far]) > 5 * force.sd:
            raise RegistrationError(
                f"'{topic}' is {y[far]:.4g} N where '{drive.name}' is {1e3 * drive.y[far, 0]:.3g} "
                f"mm: force and motion must have the same sign; reverse one at import, with --map "
                f"force=COLUMN:UNIT:-"
            )
        compared.append(observed_force(recording, p, force, drive.t, y[:, None]))
    if p.settings.seen.markers:
        # All markers that move nothing themselves, from where they stood at rest
        at = (scene.mesh, folder)
        part = compared_markers(recording, p, at)
        source, unseen, samples = rested(
            recording.marker(markers_topic(recording, p)), p.settings.seen.still
        )
        found = since_rest(part, at[0], noise(source), samples, p.settings.seen.stands)
        bare = [n for n in source.names if n not in (*part.names, *leading(p.scene))]
        left = (("not visible at rest", unseen), ("not in the layout", bare))
        findings = tuple(
            f"markers {why} are left out: {listed_names(names)}" for why, names in left if names
        )
        markers = replace(found, together=_TOGETHER)
        _require_along(p, markers, kind, float(drive.y[-1, 0]))
        compared.append(markers)
    if p.settings.seen.outline:
        outline, said = observed_outline(recording, p, scene.mesh, rest)
        compared.append(outline)
        findings = (*findings, *said)
    if not compared:
        raise ComparisonError(
            "no stream of the recording is compared: set one of seen.force, seen.markers and "
            f"seen.outline to a topic of {sorted(recording.streams)}"
        )
    still = [o.name for o in compared if not isinstance(o, SignalObservation)]
    return Registered(
        (drive, *compared), _selections(recording, p, drive, kind),
        Selection("rest", t[:1], of=(*still, drive.name)),  # a force is counted from there
        findings=findings,
    )  # fmt: skip


def _instants(recording: Recording, p: Tree) -> tuple[Floats, float]:
    """Rest and evenly spaced times (nt,) s that all streams in use cover; images' own, where
    outlines are compared."""
    seen, part = p.settings.seen, mover(p.scene)
    used = {seen.force, seen.markers, seen.outline} - {None}
    used |= {part.name} if drive_kind(recording, p) in SIGNALS and not p.settings.noted else set()
    streams = recording.streams
    missing = sorted(str(topic) for topic in used if topic not in streams)
    if missing:
        raise UsageError(f"no stream {missing} in {recording.name}; it has {sorted(streams)}")
    times = [streams[str(topic)].t for topic in used]
    if not times:
        raise ComparisonError("no stream of the recording is used: set seen.*")
    start, end = max(t[0] for t in times), min(t[-1] for t in times)
    if not end > start:
        raise ComparisonError(
            f"{recording.name}: the streams {sorted(map(str, used))} share no time "
            f"(latest start {start:.3f} s, earliest end {end:.3f} s); `validate align` them"
        )
    if p.settings.seen.outline:
        own = recording.contour(p.settings.seen.outline).t
        own = own[(own >= start) & (own <= end)]
        picked = np.unique(
            np.linspace(0, len(own) - 1, p.settings.seen.states + 1).round().astype(int)
        )
        return np.unique(own[picked]), float(own[0])
    count = 1 if isinstance(part, Weight) else p.settings.seen.states
    return np.append(start, np.linspace(start, end, count + 1)[1:]), float(start)


# --- what is compared -----------------------------------------------------------------------------


def _require_along(p: Tree, markers: MarkerObservation, kind: Kind, amount: float) -> None:
    """Raises `RegistrationError` where the markers go against what moves the body: the frame then
    has another axis up, or is left-handed."""
    if kind == "follows":
        return
    moved = markers.x[-1] - markers.rest
    seen = moved[np.isfinite(moved).all(axis=1)]
    if not len(seen):
        return
    way = along_of(p.scene)
    along = float(np.sign(amount) * (seen @ way).mean())
    most = float(np.linalg.norm(seen, axis=1).max())
    if along < -_AGAINST * most and -along > 5 * markers.sd / np.sqrt(len(seen)):
        raise RegistrationError(
            f"the markers moved {-1e3 * along:.3g} mm against "
            f"({', '.join(f'{c:g}' for c in way)}), although"
            f" '{mover(p.scene).name}' acts along it (farthest marker: {1e3 * most:.3g} "
            "mm): another axis is up in their frame, or the sign is reversed; change the direction "
            "in the scene, or seen.layout"
        )


# --- windows --------------------------------------------------------------------------------------


def _selections(
    recording: Recording, p: Tree, drive: SignalObservation, kind: Kind
) -> tuple[Selection, ...]:
    """The one state under gravity; else the instants up to `fit_to` of the largest load, on which
    an open modulus is identified, and those beyond. Loads count as they were recorded: an uncertain
    gap or compliance moves no instant from one window to the other."""
    after = drive.t[1:]
    if kind == "weighs":
        return (Selection("loaded", after, "the last instant"),)
    size = np.linalg.norm(drive.y[1:], axis=1)
    if drive.name in recording.signals:
        signal = recording.signals[drive.name]
        size = np.abs(np.interp(drive.t, signal.t, signal.y[:, 0]) - signal.y[0, 0])[1:]
    low = size <= (1 + _TIE) * p.settings.seen.fit_to * size.max()
    share = f"{100 * p.settings.seen.fit_to:g} % of the largest load"
    return (
        _window(LOW, after[low], f"instants up to {share}"),
        _window(HIGH, after[~low], f"instants beyond {share}"),
    )


def _window(label: str, t: Floats, words: str) -> Selection:
    if len(t) < _FEWEST:
        raise ComparisonError(
            f"window '{label}': {len(t)} {words}; {_FEWEST} are needed: set seen.fit_to or "
            "seen.states"
        )
    return Selection(label, t, words)
