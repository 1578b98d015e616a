"""Synthetic draws of a measurement from a run, with noise, registration and clock errors.

Every observation says what it `left` of a run, exact reading less measured sample (m,); these add
up: what an uncertain input does to a reading is a difference of two. `anew` takes such numbers to
an observation with other samples, noise drawn.
"""

from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats


@dataclass(frozen=True)
class Draw:
    """One draw of all that is uncertain of a recording; its random numbers are used up in order.

    `noise` is the real noise over the declared one. `late` s: how far off the drive's clock is.
    """

    rng: np.random.Generator
    noise: float = 1.0
    late: float = 0.0

    def white(self, sd: Floats | float, shape: tuple[int, ...]) -> Floats:
        """White noise of the declared `sd`, which may differ between the last components."""
        return np.asarray(self.noise * sd * self.rng.standard_normal(shape))

    def lateness(self, sd_t: float) -> float:
        """How late s a sensor's clock is, uncertain by `sd_t` s, and with it the drive's."""
        return self.late + sd_t * float(self.rng.standard_normal())


@dataclass(frozen=True)
class Exact:
    """A draw without any noise."""

    def white(self, sd: Floats | float, shape: tuple[int, ...]) -> Floats:
        return np.zeros(shape)

    def lateness(self, sd_t: float) -> float:
        return 0.0


AnyDraw = Draw | Exact


def from_rest(run_t: Floats, y: Floats, t: Floats) -> Floats:
    """What a run over run_t (nt,) s did, y (nt, m), at t (k,) s; straight from zero at 0 s."""
    if run_t[0] > 0:
        run_t, y = np.append(0.0, run_t), np.vstack([np.zeros(y.shape[1]), y])
    columns = [np.interp(t, run_t, column) for column in y.T]
    return np.stack(columns, axis=1) if columns else np.zeros((len(t), 0))


def shifted(t: Floats, y: Floats, late: float) -> Floats:
    """y (nt, m) as a clock that is `late` s off has it at t (nt,) s; NaN stays where it is."""
    if late == 0:
        return y
    moved = y.copy()
    for j in range(y.shape[1]):
        seen = np.isfinite(y[:, j])
        if seen.any():
            moved[seen, j] = np.interp(t[seen] + late, t[seen], y[seen, j])
    return moved
