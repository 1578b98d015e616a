"""A hand's way with a needle, made: minimum-jerk moves between stops, and a tremor.

Moves of a hand from rest to rest follow the polynomial of least jerk (Flash & Hogan (1985));
physiological tremor lies about 8 to 12 Hz.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats
from validate.errors import UsageError

#: Stops of the hand: the time s at which it arrives, depth below the surface and sideways, both in
#: units of the path's own depth. Approach, push, slide, pull, leave, enter again beside, leave.
STOPS: tuple[tuple[float, float, float], ...] = (
    (0.0, -0.5, 0.0),
    (0.4, -0.05, 0.0),
    (0.9, 1.0, 0.0),
    (1.2, 1.0, 0.35),
    (1.5, 0.6, 0.2),
    (2.0, -0.35, 0.0),
    (2.2, -0.9, -0.1),
    (2.5, -0.1, -0.45),
    (2.9, 0.7, -0.45),
    (3.2, -0.9, -0.2),
    (3.4, -0.5, 0.0),
)  # fmt: skip
DEVICE_HZ = 512.0  # of paper 000's haptic device (section 5.2)
_TREMOR = (8.0, 12.0)  # Hz
_TONES = 6


@dataclass(frozen=True)
class Hand:
    """How deep in m the needle goes, over which point `above` (d,) m of the surface, at `rate` Hz;
    `tremor` m rms along every axis, seeded, none at the ends."""

    depth: float
    above: tuple[float, ...]
    rate: float
    tremor: float
    seed: int

    def __post_init__(self) -> None:
        if not (self.depth > 0 and self.rate > 0 and self.tremor >= 0):
            raise UsageError(
                f"path {1e3 * self.depth:g} mm deep at {self.rate:g} Hz with a tremor of "
                f"{1e3 * self.tremor:g} mm: depth and rate must be above 0"
            )

    def path(self) -> tuple[Floats, Floats]:
        """t (nt,) s and the tip (nt, d) m; y is up."""
        d = len(self.above)
        arrive = np.array([s[0] for s in STOPS])
        t = np.arange(round(arrive[-1] * self.rate) + 1) / self.rate
        stops = np.zeros((len(STOPS), d))
        stops[:, 1] = [-s[1] for s in STOPS]
        stops[:, 0] = [s[2] for s in STOPS]
        if d == 3:
            stops[:, 2] = [-0.5 * s[2] for s in STOPS]
        x = np.array(self.above) + self.depth * moved(t, arrive, stops)
        return t, x + tremor(t, d, self.tremor, self.seed)


def tremor(t: Floats, d: int, rms: float, seed: int) -> Floats:
    """A hand's (nt, d) m at times t (nt,) s, `rms` m along every axis, none at the ends."""
    rng = np.random.default_rng(seed)
    tones = rng.uniform(*_TREMOR, (_TONES, d))
    phases = rng.uniform(0, 2 * np.pi, (_TONES, d))
    waves = np.sin(2 * np.pi * tones * t[:, None, None] + phases).sum(axis=1)
    fade = np.clip(np.sin(np.pi * t / t[-1]), 0, 1)[:, None] ** 0.25
    return np.asarray(rms * np.sqrt(2 / _TONES) * fade * waves)


def moved(t: Floats, arrive: Floats, stops: Floats) -> Floats:
    """Places (nt, d) at times t (nt,) between stops (k, d) reached at times `arrive` (k,)."""
    i = np.clip(np.searchsorted(arrive, t, side="right") - 1, 0, len(arrive) - 2)
    share = np.clip((t - arrive[i]) / (arrive[i + 1] - arrive[i]), 0, 1)
    smooth = share**3 * (10 - 15 * share + 6 * share**2)
    return np.asarray(stops[i] + smooth[:, None] * (stops[i + 1] - stops[i]))


def closed(above: Sequence[float], depth: float, turns: int, rate: float) -> Floats:
    """A closed path (nt, d) m: down to the surface, `turns` times about an ellipse within the body
    in a second each, and back up the same way; y is up."""
    turn = 2 * np.pi * np.arange(turns * round(rate) + 1) / round(rate)
    down = moved(np.linspace(0, 1, round(rate)), np.array([0.0, 1.0]), np.array([[-0.5], [0.2]]))
    ellipse = np.column_stack([0.2 * np.sin(turn), 0.6 - 0.4 * np.cos(turn)])
    straight = np.column_stack([np.zeros(len(down)), down])
    way = np.vstack([straight, ellipse[1:], straight[::-1][1:]])
    x = np.tile(np.array(above, dtype=np.float64), (len(way), 1))
    x[:, 0] += depth * way[:, 0]
    x[:, 1] -= depth * way[:, 1]
    return x
