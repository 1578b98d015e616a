"""Measurement gating and time-stamp uncertainty of a filter.

Gate: the components y (d,) that one marker shows at one instant are tested together, y^T S^-1 y
against the quantile of chi-square with d degrees of freedom; S is that marker's block of S_yy: what
is left of S_yy when all other markers are marginalised out. Every marker is tested against the same
prior before any is used: an outlier cannot take others along, and no order matters. A look that
fails is treated as missing, whole, so gains and claims are those of a run without it.

A gate asks whether a look fits what the filter claims: one that claims too little rejects good
looks and then drifts. Hence there is none by default; what one rejected is counted beside what a
filter whose claims hold would have rejected. A tight gate (.9) rejects more than its share even
then, since the good looks that it misses leave larger errors.

Clock: what was measured at t + dt instead of t lies off by the velocity v times dt, all components
together, so R + sd_t^2 v v^T (m, m). v is the filter's own: the displacement that its model
predicts over the step, divided by the step. Every look counts as late on its own; a clock that is
off by the same time throughout is judged rightly at every look, but looks do not average it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import cho_solve, cholesky

from validate.arrays import Floats, Ints
from validate.errors import UsageError
from validate.estimate.consistency import chi_square_quantile
from validate.estimate.kalman.covariance import Claim, Recursion, noise
from validate.estimate.kalman.formulas import (
    Gain,
    Gated,
    Gaussian,
    Innovation,
    Update,
    innovation,
    kf_update,
    nothing,
)
from validate.estimate.measurements import Measurements
from validate.parameters import quantity

# --- Which settings of a filter say how noisy its model and its measurements are.


@dataclass(frozen=True)
class NoiseSettings:
    """Names of a filter's settings: of the `process`, of a `measurement` and at the `start`; ""
    where it has none."""

    process: str = ""
    measurement: str = "R"
    start: str = ""


# -------------------------------------------------------------------------------------------------


def gate_setting() -> Any:
    """Return the field of every filter for its gate."""
    return quantity(
        None, "1", "share of a marker's good samples that pass, e.g. .999; none: no gate"
    )


def clock_setting() -> Any:
    """Return the field of every filter for the clock of its measurements."""
    return quantity(None, "s", "sd of a sample's time stamp; none: that of the recording's clock")


@dataclass(frozen=True)
class Care:
    """`parts` are the components of each of the `markers`; `gate`, if any, is the share of good
    looks that pass; `sd_t` s of a look's time, and the `dt` s over which speeds are taken."""

    markers: tuple[str, ...]
    parts: tuple[Ints, ...]
    gate: float | None
    sd_t: float
    dt: float

    @cached_property
    def limits(self) -> Floats:
        """The largest y^T S^-1 y that passes, by degrees of freedom from 1."""
        most = max(len(part) for part in self.parts)
        return chi_square_quantile(self.gate or 0.0, np.arange(1, most + 1))

    @property
    def units(self) -> Mapping[str, str]:
        return dict.fromkeys(self.numbers(None), "1")

    def numbers(self, gated: Gated | None) -> Mapping[str, float]:
        """`gate.tested` and `gate.rejected` looks of a step, how many rejected ones were `expected`
        of good looks, and `gate.far.<marker>`: by how many standard deviations the rejected look of
        a marker lay off (0: none was)."""
        if self.gate is None:
            return {}
        gated = gated or Gated(np.zeros(len(self.markers)), 0, 0)
        numbers = {
            "gate.tested": float(gated.tested),
            "gate.rejected": float(gated.rejected),
            "gate.expected": (1 - self.gate) * gated.tested,
        }
        far = zip(self.markers, gated.far.tolist(), strict=True)
        return numbers | {f"gate.far.{marker}": off for marker, off in far}

    def together(self, moved: Floats) -> Floats | float:
        """sd_t^2 v v^T (m, m) m^2, zero without doubt."""
        late = self.late(moved)
        return 0.0 if late is None else np.outer(late, late)

    def late(self, moved: Floats) -> Floats | None:
        """sd_t v (m,) m of components that the model `moved` (m,) m within dt; None: no doubt."""
        return self.sd_t / self.dt * moved if self.sd_t else None

    def passed(self, z: Floats, predicted: Floats, S_yy: Floats) -> tuple[Floats, Gated | None]:
        """z (m,) m with NaN where a marker's look was rejected."""
        if self.gate is None:
            return z, None
        kept, far, tested = z.copy(), np.zeros(len(self.parts)), 0
        for j, part in enumerate(self.parts):
            i = part[np.isfinite(z[part])]
            if len(i) == 0:
                continue
            tested += 1
            y = (z - predicted)[i]
            S = S_yy[np.ix_(i, i)]
            squared = float(y @ cho_solve((cholesky((S + S.T) / 2), False), y))
            if squared > self.limits[len(i) - 1]:
                kept[i], far[j] = np.nan, np.sqrt(squared)
        return kept, Gated(far, tested, int((far > 0).sum()))

    def update(
        self, recursion: Recursion, claim: Claim, z: Floats, predicted: Floats, moved: Floats
    ) -> tuple[Gain | None, Claim, Innovation, Floats | None]:
        """What a recursion makes of a look z (m,) m: the gain (None: nothing passed), what is
        claimed then, the innovation, and `late`."""
        late = self.late(moved)
        S_yy = recursion.H @ claim.PHt + noise(recursion.R, late)
        offered = z
        z, gated = self.passed(z, predicted, S_yy)
        seen = np.isfinite(z)
        if not seen.any():
            return None, claim, gated_out(nothing(len(z)), offered, predicted, gated), late
        gain, claim = recursion.update(claim, tuple(seen.tolist()), late)
        found = innovation(z, predicted, gain)
        return gain, claim, gated_out(found, offered, predicted, gated), late

    def linear_update(
        self, prior: Gaussian, z: Floats, H: Floats, R: Floats, moved: Floats
    ) -> tuple[Update | None, Innovation]:
        """`kf_update` with care; None where nothing passed."""
        R, shown, offered = R + self.together(moved), H @ prior.x, z
        z, gated = self.passed(z, shown, H @ prior.P @ H.T + R)
        if not np.isfinite(z).any():
            return None, gated_out(nothing(len(z)), offered, shown, gated)
        update = kf_update(prior, z, H, R)
        return update, gated_out(update.innovation, offered, shown, gated)


def gated_out(
    found: Innovation, offered: Floats, predicted: Floats, gated: Gated | None
) -> Innovation:
    """Return the innovation with the differences y of rejected samples too: they were measured;
    their sd stays zero."""
    y = np.where(np.isfinite(offered), offered - predicted, 0.0)
    return replace(found, y=y, gated=gated)


def care_of(
    measurements: Measurements, gate: float | None, clock: float | None, dt: float
) -> Care | None:
    """Return the care that settings ask for, steps of dt s; None where there is neither gate nor
    doubt.

    Raises `UsageError` for a gate that is no share, and for a time that is none.
    """
    if gate is not None and not 0 < gate < 1:
        raise UsageError(
            f"gate = {gate:g}: expected a share of good samples between 0 and 1, for example 0.999"
        )
    sd_t = measurements.sd_t if clock is None else clock
    if not (np.isfinite(sd_t) and sd_t >= 0):
        raise UsageError(f"clock = {sd_t:g} s: expected a standard deviation >= 0")
    if gate is None and sd_t == 0:
        return None
    owners = [name.rpartition(".")[0] for name in measurements.names]
    markers = tuple(dict.fromkeys(owners))
    parts = tuple(np.flatnonzero([owner == marker for owner in owners]) for marker in markers)
    return Care(markers, parts, gate, sd_t, dt)


def gate_numbers(care: Care | None, seen: Innovation) -> Mapping[str, float]:
    """Return the numbers of a step's gate; nothing without one."""
    return {} if care is None else care.numbers(seen.gated)


def gate_units(care: Care | None) -> Mapping[str, str]:
    return {} if care is None else care.units
