"""Round outlines: circle fit, an inclusion's pose, diameters against a rigid circle."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.optimize import least_squares

from validate.arrays import Floats, rms
from validate.errors import RegistrationError
from validate.fem.assembly.locate import Rows
from validate.recording.types import Contours, Frames, Record
from validate.register.observation import AnyDraw, Deviation, Role, Selection, Simulated
from validate.register.outlines.plane import from_image
from validate.scene.geometries.inclusion import Capsule


@dataclass(frozen=True)
class Circle:
    """Centre (2,) m, radius m; sd of each coordinate of the centre and of the radius, m."""

    centre: Floats
    radius: float
    sd_centre: float
    sd_radius: float
    rms: float


def fit_circle(points: Floats, sd: float) -> Circle:
    """Least squares of the radial distances of points (k, 2) m with noise sd m.

    Raises `RegistrationError` for fewer than 6 points or an outline far from a circle.
    """
    if len(points) < 6:
        raise RegistrationError(f"outline of {len(points)} points: a circle fit needs 6 or more")
    middle = points.mean(axis=0)
    start = np.array([*middle, np.linalg.norm(points - middle, axis=1).mean()])

    def off_circle(p: Floats) -> Floats:
        return np.asarray(np.linalg.norm(points - p[:2], axis=1) - p[2])

    found = least_squares(off_circle, start)
    x, residual = found.x, np.asarray(found.fun)
    off = rms(residual)
    if off > 0.2 * x[2]:
        raise RegistrationError(
            f"the outline is not a circle: {1e3 * off:.2f} mm rms off a radius of "
            f"{1e3 * x[2]:.2f} mm"
        )
    k = len(points)
    noise = max(sd, off)
    sds = noise * np.sqrt(2 / k), noise / np.sqrt(k)
    return Circle(x[:2], float(x[2]), float(sds[0]), float(sds[1]), off)


ENDS = ("left", "right")  # two points of the body, a diameter apart


@dataclass(frozen=True)
class RoundOutlines:
    """Contours in `frames`, whose lengths are `scale` times as long, and the circles through them.

    The outline's own standard deviation is that of its wall, alike all around and in all images: it
    enters the diameter twice over and no mean makes it less. What differs between images does.
    """

    name: str
    role: Role
    contours: Contours
    frames: Frames
    scale: float = 1.0

    @property
    def t(self) -> Floats:
        return self.contours.t

    @cached_property
    def outlines(self) -> tuple[Floats, ...]:
        return tuple(self.scale * o for o in self.contours.outlines)

    @cached_property
    def circles(self) -> tuple[Circle, ...]:
        """Least squares through every outline; `RegistrationError` for one that is no circle."""
        return tuple(fit_circle(o, self.scale * self.contours.sd) for o in self.outlines)

    @property
    def diameters(self) -> Floats:
        """(nt,) m."""
        return np.array([2 * c.radius for c in self.circles])

    @property
    def scatter(self) -> float:
        """Standard deviation m of the diameter between images; 0 of a single one."""
        return float(self.diameters.std(ddof=1)) if len(self.t) > 1 else 0.0

    @property
    def wall(self) -> float:
        """What the wall's own uncertainty makes of every diameter, m."""
        return 2 * self.scale * self.contours.sd

    @property
    def units(self) -> Mapping[str, str]:
        return {self.name: "m"}

    def left(self, run: Simulated) -> Floats:
        """Return the body's diameter less those of the circles (nt,) m."""
        return self._lengths(run)[np.clip(np.searchsorted(run.t, self.t), 0, len(run.t) - 1)] - (
            self.diameters
        )

    def anew(self, left: Floats, draw: AnyDraw) -> "RoundOutlines":
        """Outlines about their centres as wide as `left` (nt,) m has them; the wall, which all
        share, and what differs between images drawn."""
        off = draw.white(self.wall, (1,)) + draw.white(self.scatter, left.shape)
        wider = 1 + (left + off) / self.diameters
        pairs = zip(wider, self.circles, self.contours.outlines, strict=True)
        drawn = []
        for by, circle, outline in pairs:
            centre = np.asarray(circle.centre) / self.scale
            drawn.append(centre + by * (outline - centre))
        return replace(self, contours=replace(self.contours, outlines=tuple(drawn)))

    def _lengths(self, run: Simulated) -> Floats:
        """The distance (nt,) m of the two ends at the run's steps."""
        ends = np.array([[run.traces[f"{end}.{c}"].y for c in "xyz"] for end in ENDS])
        return np.asarray(np.linalg.norm(ends[1] - ends[0], axis=0))

    def deviations(self, run: Simulated, selection: Selection) -> tuple[Deviation, ...]:
        at = selection.samples(self.t, run.t, self.name)
        shown = self._lengths(run)[np.searchsorted(run.t, self.t[at])]
        seen = self.diameters[at]
        one = len(at) == 1
        words = "diameter of the body minus that of the circle through its outline, every image"
        off = (shown - seen)[:, None]
        found = Deviation(
            self.name,
            off,
            "m",
            self.scatter,
            self.wall,
            words,
            simulated=float(shown[0]) if one else None,
            measured=float(seen[0]) if one else None,
            scale=float(seen.max()),
            reference=seen[:, None],
            t=None if one else self.t[at],
        )
        return (found,)

    def unanswered(self, run: Simulated) -> tuple[str, ...]:
        return tuple(end for end in ENDS if f"{end}.x" not in run.traces)

    def rows(self) -> Rows | None:
        return None


def outlined_capsule(
    contours: Contours, rest: int, sweep: Record, allowance: float = 0.0
) -> Capsule:
    """Centre x, z and radius of outline number `rest`; height y and length from the sweep.

    Raises `RegistrationError` when the outline's centre lies further from the sweep's than 4
    standard deviations and `allowance` m: a mirrored image or a wrong pose.
    """
    circle = fit_circle(contours.outlines[rest], contours.sd)
    centre = from_image(contours.pose, circle.centre[None])[0]
    declared = np.array([_metres(sweep, f"centre_{axis}_m") for axis in "xyz"])
    off = float(np.linalg.norm((centre - declared)[[0, 2]]))
    allowed = 4 * float(np.hypot(_metres(sweep, "sd_centre_m"), circle.sd_centre)) + allowance
    if off > allowed:
        raise RegistrationError(
            f"the rest outline's centre is {1e3 * off:.2f} mm from the inclusion of the sweep "
            f"(allowed {1e3 * allowed:.2f} mm): mirrored image or wrong pose; check record "
            "'pose/outline'"
        )
    place = (float(centre[0]), float(declared[1]), float(centre[2]))
    return Capsule(place, circle.radius, _metres(sweep, "length_m"))


def _metres(record: Record, key: str) -> float:
    try:
        return float(record[key])
    except (KeyError, ValueError):
        raise RegistrationError(
            f"record 'inclusion' lacks a number '{key}'; it has {sorted(record)}"
        ) from None
