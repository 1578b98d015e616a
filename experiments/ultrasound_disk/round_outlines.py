"""Diameters of round outlines in images, against those of a rigid disk."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from validate.arrays import Floats
from validate.fem.assembly.locate import Rows
from validate.recording.types import Contours, Frames
from validate.register.observation import AnyDraw, Deviation, Role, Selection, Simulated
from validate.register.outlines.sections import Circle

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
        return tuple(Circle.fit(o, self.scale * self.contours.sd) for o in self.outlines)

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
