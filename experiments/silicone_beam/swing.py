"""The swing of a beam that was let go, compared marker by marker, and how it rings.

When exactly the hand let go lies between two samples and takes some milliseconds. Every run is
therefore compared from the release that fits it best, one number for all markers, searched to
`_REACH` about the last sample at rest; all else is as it was measured. Frequency and damping are
those of the mean vertical motion, found in run and measurement in the same way
(`identify.recorded_motion`) and no matter of that shift.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

from validate.arrays import Floats
from validate.errors import ComparisonError
from validate.identify.recorded_motion import Ringing
from validate.register.observation import AnyDraw, Deviation, Role, Selection, Simulated

from .recording import over

LABEL = "swing"
FREQUENCY, DAMPING = "ringing.frequency", "ringing.damping"
_REACH = 0.04  # s: how far the release is searched about the last sample of the beam held
_GRID = 33
_UP = 2
_PER_PERIOD = 4  # numbers in a period that are independent: markers and samples share one motion


def quantity_of(marker: str) -> str:
    """`Tip - 1` as `swing.tip_1`."""
    words = "".join(c if c.isalnum() else " " for c in marker.casefold()).split()
    return f"{LABEL}.{'_'.join(words)}"


@dataclass(frozen=True)
class Swing:
    """Displacements moved (nt, k, 3) m of named markers at t (nt,) s, NaN = not seen; t is 0 at the
    last sample of the beam held. Compared until `length` s; ringing is fitted from `ringing` s on.

    `sd` m per axis is the markers' noise, `shared` (k,) m what all samples of a marker share,
    per axis.
    """

    t: Floats
    names: tuple[str, ...]
    moved: Floats
    length: float
    ringing: float
    sd: float
    shared: Floats
    name: str = "swing"
    role: Role = "validates"

    @property
    def units(self) -> Mapping[str, str]:
        markers = {quantity_of(name): "1" for name in self.names}
        return markers | {FREQUENCY: "Hz", DAMPING: "1"}

    def rows(self) -> None:
        return None

    def unanswered(self, run: Simulated) -> tuple[str, ...]:
        return ()

    @property
    def compared(self) -> Floats:
        """Which samples (nt,) are compared."""
        return np.asarray(self.t <= self.length)

    @property
    def span(self) -> Floats:
        """Peak to peak (k,) m of every marker's vertical motion."""
        z = self.moved[self.compared][..., _UP]
        return over(np.nanmax, z, 0) - over(np.nanmin, z, 0)

    def deviations(self, run: Simulated, selection: Selection) -> tuple[Deviation, ...]:
        if selection.label != LABEL or any(f"{n}.x" not in run.traces for n in self.names):
            return ()
        shift, shown = self.aligned(run)
        seen = self.moved[self.compared]
        rung = self.rung(seen), self.rung(shown)
        markers = (self._marker(j, shown - seen, shift, rung[0]) for j in range(len(self.names)))
        return *(m for m in markers if m), *self._ringing(*rung)

    def aligned(self, run: Simulated) -> tuple[float, Floats]:
        """The release s that fits best, and displacements (m, k, 3) m at the compared samples."""
        curve, t = _curve(run, self.names), self.t[self.compared]
        seen = self.moved[self.compared][..., _UP]

        def off(release: float) -> float:
            there = curve(np.clip(t - release, 0.0, None))[..., _UP]
            return float(np.nanmean((there - seen) ** 2))

        tried = np.linspace(-_REACH, _REACH, _GRID)
        near = tried[int(np.argmin([off(x) for x in tried]))]
        step = tried[1] - tried[0]
        found = minimize_scalar(off, bounds=(near - step, near + step), method="bounded",
                                options={"xatol": 1e-6})  # fmt: skip
        return float(found.x), curve(np.clip(t - found.x, 0.0, None))

    def left(self, run: Simulated) -> Floats:
        """Exact displacement less measured one, flat (nt k 3,) m; 0 where a marker was not seen,
        and where nothing is compared."""
        off, there = np.zeros_like(self.moved), self.compared
        if all(f"{n}.x" in run.traces for n in self.names):
            shown = _curve(run, self.names)(self.t[there])
            off[there] = np.nan_to_num(shown - self.moved[there])
        return off.ravel()

    def anew(self, left: Floats, draw: AnyDraw) -> "Swing":
        """The markers where `left` (nt k 3,) m has them; what a marker's samples share, and noise,
        drawn."""
        exact = self.moved + left.reshape(self.moved.shape)
        shared = draw.white(1.0, (3,)) * self.shared[:, None]
        return replace(self, moved=exact + shared + draw.white(self.sd, self.moved.shape))

    def rung(self, moved: Floats) -> Ringing | None:
        """How the mean vertical motion of markers moved (m, k, 3) m rings, or None where it does
        not."""
        late = self.t[self.compared] >= self.ringing
        t, z = self.t[self.compared][late], moved[late][..., _UP].mean(axis=1)
        seen = np.isfinite(z)
        try:
            return Ringing.of(t[seen], z[seen])
        except ComparisonError:
            return None

    def _marker(
        self, j: int, off: Floats, release: float, rung: Ringing | None
    ) -> Deviation | None:
        """One marker's deviation over its peak to peak."""
        mine, span = off[:, j], float(self.span[j])
        seen = np.isfinite(mine).all(axis=1)
        mine = mine[seen]
        if not len(mine):
            return None
        words = (
            f"displacement of the marker over the first {self.length:g} s, simulated less "
            f"measured, over its measured vertical peak to peak of {1e3 * span:.2f} mm; the "
            f"release that fits best is {1e3 * release:+.1f} ms from the last sample at rest"
        )
        free = int(_PER_PERIOD * rung.periods) * 3 if rung else None
        return Deviation(quantity_of(self.names[j]), mine / span, "1", self.sd / span,
                         float(self.shared[j]) / span, words, freedom=free, scale=1.0,
                         t=self.t[self.compared][seen], axes=tuple("xyz"))  # fmt: skip

    def _ringing(self, seen: Ringing | None, shown: Ringing | None) -> tuple[Deviation, ...]:
        if seen is None or shown is None:
            return ()
        how = f"of the mean vertical motion from {self.ringing:g} s to {self.length:g} s"
        pairs = (
            (FREQUENCY, shown.frequency, seen.frequency, "Hz", seen.frequency_sd, "frequency"),
            (DAMPING, shown.damping, seen.damping, "1", seen.damping_sd, "damping ratio"),
        )
        return tuple(
            Deviation(name, np.array([[a - b]]), unit, sd, 0.0,
                      f"{word} {how}, simulated less measured", a, b)
            for name, a, b, unit, sd, word in pairs
        )  # fmt: skip


def _curve(run: Simulated, names: tuple[str, ...]) -> CubicSpline:
    """Displacements (..., k, 3) m of the run's probes over time, from rest at 0 s."""
    y = np.stack([[run.traces[f"{n}.{c}"].y for c in "xyz"] for n in names])
    y = np.concatenate([np.zeros((1, *y.shape[:2])), np.moveaxis(y, 2, 0)])
    return CubicSpline(np.concatenate([[0.0], run.t]), y, bc_type="natural")
