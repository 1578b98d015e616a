"""Registration of a moving body: start, time steps, loads, markers and force at every sample.

The body rests until the start, where the recording's clock is set to 0; loads and displacements
count from there. The start is a sample: where a release lies between two of them, half the interval
is the uncertainty of the clock.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.errors import ComparisonError, UsageError
from validate.identify.recorded_motion import motion_of
from validate.parameters import known
from validate.pipeline.bodies.drive import (
    Kind,
    drive_kind,
    driven,
    mover,
    observed_force,
    released_force,
    weight_beside,
    zeroed_force,
)
from validate.pipeline.bodies.markers import (
    BodyAt,
    compared_markers,
    markers_topic,
    observed_outline,
)
from validate.pipeline.experiment.tree import Tree
from validate.recording.types import Contours, Markers, Recording, Signal
from validate.register.markers.displacements import since_rest
from validate.register.markers.markers import MarkerObservation
from validate.register.observation import EVERYTHING, Observation, Selection
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.scene.scene import Load, Scene

FILM = "film"  # the label of outlines
FIRST, LATER = "first", "later"
SUDDEN: tuple[Kind, ...] = ("weighs", "releases")
_PER_PERIOD = 40  # steps in the recorded period: average acceleration is then off by 0.2 % in it
_MOST = 20_000  # steps
_FEWEST = 8  # samples of a window
_SAME = 1e-9  # s


@dataclass(frozen=True)
class Started:
    """A recording whose clock is 0 at the start, its first sample the mean of the rest before it;
    `rest` samples, `sd_t` s by which the start is uncertain, `noise` m of the markers per axis."""

    recording: Recording
    start: float
    rest: int
    sd_t: float
    noise: float


def started(recording: Recording, p: Tree) -> Started:
    """Return the recording from `motion.start`, or from where its motion is found to begin.

    Raises `UsageError` for a start outside the recording.
    """
    sudden = drive_kind(recording, p) in SUDDEN
    topic = markers_topic(recording, p) if recording.markers else None
    clock = recording.marker(topic).t if topic else next(iter(recording.signals.values())).t
    at = p.settings.motion.start
    if at is None:
        at = (
            motion_of(recording, topic).starts
            if sudden
            else float(clock[0] + p.settings.seen.still)
        )
    if not clock[0] - _SAME <= at < clock[-1]:
        raise UsageError(
            f"motion.start = {at:g} s: the recording goes from {clock[0]:g} to {clock[-1]:g} s"
        )
    start = float(clock[int(np.abs(clock - at).argmin())])
    length = p.settings.motion.length or np.inf
    cut = replace(
        recording,
        markers={n: _markers_from(m, start, length) for n, m in recording.markers.items()},
        signals={n: _signal_from(s, start, length) for n, s in recording.signals.items()},
        contours={n: _outlines_from(c, start, length) for n, c in recording.contours.items()},
        frames={},
    )  # fmt: skip
    interval = float(np.median(np.diff(clock)))
    sd_t = interval / np.sqrt(12) if sudden and p.settings.motion.start is None else 0.0
    rest = clock <= start + _SAME
    noise = _noise(recording.marker(topic), rest) if topic else 0.0
    return Started(cut, start, int(rest.sum()), sd_t, noise)


def _noise(m: Markers, rest: Any) -> float:
    """m per axis: as declared, or more as the markers scatter at rest; with few samples of rest by
    fourth differences, in which a smooth motion leaves little."""
    still = m.x[rest]
    if len(still) >= _FEWEST:
        often = np.isfinite(still).all(axis=2).sum(axis=0) >= 2
        if not often.any():
            return m.sd
        scatter = np.nanmedian(np.nanstd(still[:, often], axis=0, ddof=1))
    else:
        bend = np.abs(np.diff(m.x, n=4, axis=0))
        bend = bend[np.isfinite(bend)]
        scatter = 1.4826 * np.median(bend) / np.sqrt(70) if len(bend) else 0.0
    return max(m.sd, float(np.nan_to_num(scatter)))


def without_rest(p: Tree) -> Tree:
    """Of a recording that was cut at the start: its first sample alone is at rest."""
    return p.with_settings(seen=replace(p.settings.seen, still=0.0))


def _markers_from(m: Markers, start: float, length: float) -> Markers:
    """From the start on; the first sample is the mean of each marker until then."""
    before, kept = _parts(m.t, start, length)
    x = m.x[kept].copy()
    early = m.x[before]
    seen = np.isfinite(early).all(axis=2)
    for j in np.flatnonzero(seen.any(axis=0)):
        x[0, j] = early[seen[:, j], j].mean(axis=0)
    return replace(m, t=m.t[kept] - start, x=x)


def _outlines_from(c: Contours, start: float, length: float) -> Contours:
    """From the last one before the start on, which is taken as that at the start."""
    _, kept = _parts(c.t, start, length)
    kept[max(0, int(np.searchsorted(c.t, start + _SAME)) - 1)] = True
    t = np.maximum(c.t[kept] - start, 0.0)
    outlines = tuple(o for o, of in zip(c.outlines, kept, strict=True) if of)
    return replace(c, t=t, outlines=outlines, each=None if c.each is None else c.each[kept])


def _signal_from(s: Signal, start: float, length: float) -> Signal:
    before, kept = _parts(s.t, start, length)
    y = s.y[kept].copy()
    y[0] = s.y[before].mean(axis=0)
    return replace(s, t=s.t[kept] - start, y=y)


def _parts(t: Floats, start: float, length: float) -> tuple[Any, Any]:
    kept = (t >= start - _SAME) & (t <= start + length + _SAME)
    if kept.sum() < _FEWEST:
        raise ComparisonError(
            f"{int(kept.sum())} samples from {start:g} s on: {_FEWEST} are needed; set "
            "motion.start and motion.length"
        )
    before = t <= max(start, float(t[0])) + _SAME
    return before, kept


def steps_of(p: Tree, cut: Recording) -> Floats:
    """Times (nt,) s of the steps, from one step after the start: every sample of the markers is
    met, with 40 steps or more in the recorded period."""
    topic = markers_topic(cut, p) if cut.markers else None
    clock = cut.marker(topic).t if topic else next(iter(cut.signals.values())).t
    interval = float(np.median(np.diff(clock)))
    if p.settings.motion.dt is None:
        f = motion_of(cut, topic).frequency
        parts = max(1, int(np.ceil(interval * _PER_PERIOD * f - 1e-9)))
    else:
        parts = max(1, int(np.ceil(interval / p.settings.motion.dt - 1e-9)))
    used = {mover(p.scene).name, p.settings.seen.force, p.settings.seen.outline, topic}
    ends = [float(s.t[-1]) for name, s in cut.streams.items() if name in used]
    count = int(np.floor(min([clock[-1], *ends]) / interval + 1e-6)) * parts
    if count > _MOST:
        raise UsageError(
            f"{count} steps of {interval / parts:.3g} s: at most {_MOST}; set motion.length, or a "
            "longer motion.dt"
        )
    return np.asarray(interval / parts * np.arange(1, count + 1), dtype=np.float64)


# --- registration ---------------------------------------------------------------------------------


def place_moving(recording: Recording, p: Tree, scene: Scene, *, folder: Path) -> Registered:
    """Return loads at every step, markers, force and outlines at every sample.

    Raises `ComparisonError` where nothing is compared, `RegistrationError` as the parts do.
    """
    begun, p = started(recording, p), without_rest(p)
    t, kind = steps_of(p, begun.recording), drive_kind(recording, p)
    at = (scene.mesh, folder)
    # What loads the body at t s, as it changed since the start
    if kind == "releases":
        force, name = p.settings.scale * released_force(p, scene), mover(p.scene).name
        main = SignalObservation(name, "drives", t, np.full((len(t), 1), -force), "N", 0.0)
    else:
        main = driven(begun.recording, p, kind, np.append(0.0, t), 0.0, at)
        main = replace(main, t=t, y=main.y[1:])
    drives, weight = [main], weight_beside(p.scene)
    if weight and kind != "weighs":
        drives.append(
            SignalObservation(weight.name, "drives", t, np.zeros((len(t), 1)), "m/s^2", 0.0)
        )
    compared: list[Observation] = []
    if p.settings.seen.force:
        cell = zeroed_force(begun.recording, p, kind, 0.0)
        compared.append(observed_force(begun.recording, p, cell, cell.t, cell.y))
    if p.settings.seen.markers:
        compared.append(moving_markers(begun, p, at))
    said, film = tuple[str, ...](), tuple[Selection, ...]()
    others = tuple(o.name for o in compared)
    if p.settings.seen.outline:
        outline, said = observed_outline(begun.recording, p, scene.mesh, 0.0)
        compared.append(outline)
        taken = outline.t[(outline.t > _SAME) & (outline.t <= t[-1] + _SAME)]
        film = (Selection(FILM, taken, "every outline after the start", of=(outline.name,)),)
    if not compared:
        raise ComparisonError(
            "no stream of the motion is compared: set seen.markers, seen.force or seen.outline"
        )
    return Registered(
        (*drives, *compared), (*_windows(p, t, compared[0], others), *film), findings=said,
        sudden=kind in SUDDEN, moves=True,
    )  # fmt: skip


def moving_markers(begun: Started, p: Tree, at: BodyAt) -> MarkerObservation:
    """Every sample of the markers after the start, in the body's frame, each a quantity of its own;
    those that move the body are left out. Raises `ComparisonError` where none is left."""
    part = compared_markers(begun.recording, p, at)
    since = since_rest(part, at[0], begun.noise, begun.rest, p.settings.seen.stands)
    return replace(
        since, t=since.t[1:], x=since.x[1:], sd_t=float(np.hypot(since.sd_t, begun.sd_t))
    )


def _windows(
    p: Tree, t: Floats, first: Observation, names: tuple[str, ...]
) -> tuple[Selection, ...]:
    """Every sample of the sensors of these names; with an identified damping those it was
    identified on, and the later ones."""
    if not names:
        return ()
    if p.settings.motion.fit_window is None:
        return (replace(EVERYTHING, of=names),)
    samples = first.t[first.t <= t[-1] + _SAME]
    window = p.settings.motion.fit_window
    early = samples <= window
    if early.sum() < _FEWEST or (~early).sum() < _FEWEST:
        raise ComparisonError(
            f"motion.fit_window = {window:g} s: {int(early.sum())} samples in it and "
            f"{int((~early).sum())} after it; {_FEWEST} of each are needed"
        )
    end = f"{p.settings.motion.fit_window:g} s after the start"
    return (
        Selection(FIRST, samples[early], f"samples up to {end}", of=names),
        Selection(LATER, samples[~early], f"samples later than {end}", of=names),
    )


def preload(p: Tree, seen: Registered) -> tuple[float, ...]:
    """Inputs at which the body rests before the start: what held it, and its weight; none: all
    zero."""
    found = [0.0] * sum(d.y.shape[1] for d in seen.drives)
    if isinstance(mover(p.scene), Load) and seen.sudden:
        found[0] = -float(seen.drives[0].y[0, 0])
    if weight := weight_beside(p.scene):
        found[-1] = known(weight.value, f"loads.{weight.name}.value")
    return tuple(found) if any(found) else ()
