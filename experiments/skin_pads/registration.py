"""The recording in the scene: what drives, the force in steps of displacement, points at holds."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from validate.arrays import Floats
from validate.errors import RecordingError
from validate.pipeline.experiment.tree import Tree
from validate.recording.types import Markers, Recording
from validate.register.markers.markers import MarkerObservation, Together
from validate.register.observation import Selection
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.scene.scene import Scene

from .files import FORCE, jitter
from .skin import PADS, PulledSkin

TOGETHER = (
    Together("field.axial", (0,), "displacement of the points along the pull"),
    Together("field.lateral", (1,), "displacement of the points across the pull"),
)
_OFF = 6.0  # robust standard deviations beyond which a sample or a point is spurious
_NEAR = 11  # samples of a running median
_CLOSE = 0.1e-3  # m: an image so near to a hold is one of it
_LEAST = 3  # bins that calibrate, and that are predicted


@dataclass(frozen=True)
class ForceSteps:
    """Force by displacement: bins of samples that are not spurious, less the force at the zero."""

    t: Floats
    d: Floats
    force: Floats
    sd: float
    left_out: int


def place(recording: Recording, tree: Tree, scene: Scene) -> Registered:
    """Pads drive; force calibrates in the window "fitted" and is judged in "predicted" and at the
    "end"; the points of the images are judged where the pads had come apart by the holds."""
    p: PulledSkin = tree.settings
    svk = scene.material.law == "svk"
    curve = binned(recording, replace(p, predict_to=p.limit_svk) if svk else p)
    images = Images(recording)
    points, holds, left = images.held(p.field)
    at = np.argsort(np.concatenate([curve.t, points.t]), kind="stable")
    t = np.concatenate([curve.t, points.t])[at]
    pulled = np.concatenate([curve.d, holds])[at]
    t = t + 1e-6 * np.arange(len(t))  # two instants of one sample stay two
    moving = images.moving(pulled)
    drives = [
        SignalObservation(name, "drives", t, y[:, None], "m", 0.0)
        for name, y in zip(PADS, (moving, pulled - moving), strict=True)
    ]
    mine = np.isin(at, np.arange(len(curve.t)))
    cell = SignalObservation("force", "validates", t[mine], curve.force[:, None], FORCE,
                             curve.sd, "force", "moving.force")  # fmt: skip
    layout = {n: np.append(x, 0.0) for n, x in zip(points.names, points.x[0, :, :2], strict=True)}
    seen = MarkerObservation.of(_at(points, t[~mine]), layout, scene.mesh, together=TOGETHER,
                           name="points")  # fmt: skip
    said = (
        f"{recording.record('pairing')['images']} images are paired with force samples by pad "
        f"displacement (to {1e3 * images.pulled[-1]:.2f} mm): neither has time stamps.",
        f"Omitted as spurious: {curve.left_out} of {len(recording.signals['force'].t)} samples "
        f"of the force, {left} of {images.x.shape[1]} points.",
        f"Beyond {1e3 * images.pulled[-1]:.2f} mm no image shows the share of each pad; the "
        f"moving pad's share of {images.share:.2f} is kept (it does not affect force if the "
        "far boundary is free).",
        *(f"The pads follow {text}." for text in recording.metadata.get("pads", {}).values()),
    )
    rest, *loaded = _holds(holds, t[~mine])
    compared = (*_windows(p, curve, t[mine]), *loaded)
    return Registered((*drives, cell, seen), compared, rest, findings=said)


def _windows(p: PulledSkin, curve: ForceSteps, t: Floats) -> tuple[Selection, ...]:
    fitted = curve.d <= p.fit_to
    if fitted.sum() < _LEAST or (~fitted).sum() < _LEAST:
        raise RecordingError(
            f"{int(fitted.sum())} steps of force to {1e3 * p.fit_to:g} mm, {int((~fitted).sum())} "
            f"beyond, the pads reach {1e3 * curve.d[-1]:.3g} mm; {_LEAST} of both are needed: set "
            "fit_to"
        )
    reach = f"{1e3 * p.fit_to:g} mm"
    last = f"{1e3 * curve.d[-1]:.2f} mm"
    return (
        Selection("fitted", t[fitted], f"every step to {reach} of pad displacement", of=("force",)),
        Selection("predicted", t[~fitted], f"every step from {reach} to {last}", of=("force",)),
        Selection("end", t[-_LEAST:], f"the last {_LEAST} steps, to {last}", of=("force",)),
    )


def _holds(pulled: Floats, t: Floats) -> tuple[Selection, ...]:
    return tuple(
        Selection(f"{1e3 * d:.1f}mm", t[i : i + 1], "the image nearest to it", of=("points",))
        for i, d in enumerate(pulled)
    )


def _at(points: Markers, t: Floats) -> Markers:
    x = np.pad(points.x, [(0, 0), (0, 0), (0, 1)])
    return Markers(t, points.names, x, points.sd, "sheet")


def binned(recording: Recording, p: PulledSkin) -> ForceSteps:
    """Means of force over steps of displacement, from the zero to `predict_to`."""
    u, f = recording.signal("displacement", "m"), recording.signal("force", FORCE)
    d, force = u.y[:, 0] - float(recording.record("zero")["displacement_m"]), f.y[:, 0]
    smooth = _running_median(force)
    spread = 1.4826 * float(np.median(np.abs(force - smooth)))
    good = np.abs(force - smooth) <= _OFF * max(spread, 1e-12 * float(np.ptp(force)))
    after = np.arange(len(d)) >= int(np.argmax(d >= -p.bin / 2))  # not the settling before
    start = good & after & (np.abs(d) <= p.bin)
    if start.sum() < _LEAST or np.ptp(d[start]) == 0:
        raise RecordingError(
            f"{recording.name}: {int(start.sum())} samples within {1e3 * p.bin:g} mm of the zero "
            f"of displacement, {_LEAST} are needed; set a larger bin"
        )
    number = np.floor((d - p.bin / 2) / p.bin).astype(int)
    kept = good & after & (number >= 0) & (d <= p.predict_to + p.bin / 2)
    bins = [np.flatnonzero(kept & (number == k)) for k in range(int(number.max()) + 1)]
    bins = [b for b in bins if len(b)]
    zero = float(np.polyfit(d[start], force[start], 1)[1])
    least = min(map(len, (*bins, np.flatnonzero(start))))
    noise = jitter(force[good][:, None, None])
    t, mean, level = (np.array([a[b].mean() for b in bins]) for a in (u.t, d, force))
    return ForceSteps(t, mean, level - zero, noise * float(np.sqrt(2 / least)), int((~good).sum()))


def _running_median(y: Floats) -> Floats:
    wide = np.pad(y, _NEAR // 2, mode="edge")
    return np.median(np.lib.stride_tricks.sliding_window_view(wide, _NEAR), axis=1)


class Images:
    """Points and pads (nt, k, 2) m in the scene's frame: x from the moving pad to the fixed one,
    the origin in the middle of the marks at rest; what both pads share across the pull is off."""

    def __init__(self, recording: Recording) -> None:
        pads, self.markers = recording.marker("pads").x, recording.marker("points")
        along = pads[0, 1] - pads[0, 0]
        e = along / np.linalg.norm(along)
        R = np.array([[e[0], e[1]], [-e[1], e[0]]])
        self.pads, x = ((y - pads[0].mean(axis=0)) @ R.T for y in (pads, self.markers.x))
        drift = self.pads.mean(axis=1)[:, 1] - self.pads[0].mean(axis=0)[1]
        self.x = x - np.stack([np.zeros_like(drift), drift], axis=1)[:, None]

    @cached_property
    def pulled(self) -> Floats:
        """(nt,) m by which the pads are further apart than at rest, never less than before."""
        apart = np.diff(self.pads[..., 0], axis=1)[:, 0]
        return np.maximum.accumulate(apart - apart[0])

    @property
    def share(self) -> float:
        """The moving pad's, of the last image."""
        return float((self.pads[0, 0, 0] - self.pads[-1, 0, 0]) / self.pulled[-1])

    def moving(self, pulled: Floats) -> Floats:
        """How far the moving pad has gone when the pads are `pulled` m apart."""
        own = self.pads[0, 0, 0] - self.pads[:, 0, 0]
        beyond = np.maximum(pulled - self.pulled[-1], 0.0) * self.share
        return np.asarray(np.interp(pulled, self.pulled, own) + beyond)

    def held(self, holds: tuple[float, ...]) -> tuple[Markers, Floats, int]:
        """Rest and the images nearest to the holds m, without spurious points; displacements m of
        all of these, and how many points were left out."""
        chosen = {int(np.argmin(np.abs(self.pulled - h))) for h in holds
                  if np.abs(self.pulled - h).min() <= _CLOSE} - {0}  # fmt: skip
        if not chosen:
            raise RecordingError(
                f"no image within {1e3 * _CLOSE:g} mm of {[1e3 * h for h in holds]} mm, 0 matched; "
                f"they reach {1e3 * self.pulled[-1]:.3g} mm: set field"
            )
        good = ~spurious(self.x[0], self.x[-1] - self.x[0])
        kept, m = [0, *sorted(chosen)], self.markers
        names = tuple(n for n, ok in zip(m.names, good, strict=True) if ok)
        points = Markers(m.t[kept], names, self.x[kept][:, good], m.sd, "sheet")
        return points, self.pulled[kept], int((~good).sum())


def spurious(x: Floats, moved: Floats, near: int = 20) -> np.ndarray:
    """Which points (k,) at x (k, 2) m moved (k, 2) m otherwise than a plane through their nearest
    ones, robustly."""
    apart = np.linalg.norm(x[:, None] - x[None], axis=2)
    others = np.argsort(apart, axis=1)[:, 1 : near + 1]
    off = moved - np.median(moved[others], axis=1)
    slope = np.hstack([np.ones((len(x), 1)), x - x.mean(axis=0)])
    off = off - slope @ np.linalg.lstsq(slope, off, rcond=None)[0]
    size = np.linalg.norm(off, axis=1)
    return np.asarray(size > _OFF * max(1.4826 * float(np.median(size)), 1e-15))
