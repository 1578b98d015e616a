"""Signals over time that drive a simulation or that one of its traces predicts; nominal stresses.

Curves that were read off a printed figure are as uncertain as the stress is large, and stresses
of one curve differ a hundredfold: an absolute error would be that of the last few rows alone.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from validate.arrays import Floats, rms
from validate.errors import ComparisonError, RegistrationError
from validate.fem.assembly.locate import Rows
from validate.recording.merge import repeats_share
from validate.recording.types import Recording
from validate.register.clocks import clock_sd, slopes, with_clock
from validate.register.observation import (
    AnyDraw,
    Deviation,
    History,
    Role,
    Selection,
    Simulated,
    from_rest,
    nearest_sample,
    shifted,
)


@dataclass(frozen=True)
class SignalObservation:
    """y (nt, c) in its own `unit` at t (nt,) s; the run's `trace` predicts it, where it validates.

    `quantity` is what scores call it, `sd_t` s how uncertain its clock is. `share` is a relative
    standard uncertainty that all samples have in common: how far specimens differ, say.
    """

    name: str
    role: Role
    t: Floats
    y: Floats
    unit: str
    sd: float
    quantity: str = ""
    trace: str = ""
    sd_t: float = 0.0
    share: float = 0.0

    def at(self, t: float) -> float:
        """Return the sample nearest in time; raises `ComparisonError` when none is within a
        second."""
        return float(self.y[nearest_sample(self.t, t, f"signal '{self.quantity}'"), 0])

    @property
    def units(self) -> Mapping[str, str]:
        return {self.quantity: self.unit}

    def deviations(self, run: Simulated, selection: Selection) -> tuple[Deviation, ...]:
        """One of all samples. Raises `ComparisonError` for a trace in another unit."""
        trace = run.traces.get(self.trace)
        if trace is None:
            return ()
        if trace.unit != self.unit:
            raise ComparisonError(
                f"{run.method}: trace '{self.trace}' is in {trace.unit}, '{self.name}' in "
                f"{self.unit}"
            )
        at = selection.samples(self.t, run.t, f"signal '{self.quantity}'")
        if len(at) == 0:
            return ()
        simulated, measured = selection.read(run.t, trace.y, self.t[at]), self.y[at, 0]
        words = f"{self.quantity}, {selection.words or 'simulated less measured at every sample'}"
        one = (float(simulated[0]), float(measured[0])) if len(at) == 1 else (None, None)
        off = (simulated - measured)[:, None]
        scale, common = float(np.abs(self.y[:, 0]).max()), self.share * rms(measured[:, None])
        found = Deviation(
            self.quantity, off, self.unit, self.sd, common, words, one[0], one[1], scale=scale,
            reference=measured[:, None], t=self.t[at] if len(at) > 1 else None,
        )  # fmt: skip
        sd_t = float(np.hypot(self.sd_t, selection.sd_t))
        if sd_t > 0:
            found = with_clock(found, sd_t, slopes(self.t, self.y[:, :1], at, sd_t))
        return (found,)

    def unanswered(self, run: Simulated) -> tuple[str, ...]:
        return () if self.trace in run.traces else (self.name,)

    def left(self, run: Simulated) -> Floats:
        """Exact reading less measured sample (nt,); 0 where the run has no such trace."""
        trace = run.traces.get(self.trace)
        if trace is None:
            return np.zeros(len(self.t))
        return from_rest(run.t, trace.y[:, None], self.t)[:, 0] - self.y[:, 0]

    def history(self, run: Simulated) -> History | None:
        """Its first channel; None where the run has no such trace."""
        if self.trace not in run.traces:
            return None
        y = self.y[:, :1, None]
        simulated = y + self.left(run)[:, None, None]
        return History(self.name, self.t, (self.name,), y, simulated, self.unit, self.sd)

    def anew(self, left: Floats, draw: AnyDraw) -> "SignalObservation":
        """Return the signal as measured samples with `left` (nt,) would be, clock and noise
        drawn."""
        exact = shifted(self.t, (self.y[:, 0] + left)[:, None], draw.lateness(self.sd_t))
        noisy = exact + draw.white(self.sd, exact.shape)
        return replace(self, y=np.hstack([noisy, self.y[:, 1:]]))

    def rows(self) -> Rows | None:
        return None

    @classmethod
    def driving(
        cls, recording: Recording, name: str, unit: str, *, after_rest: bool = False
    ) -> Self:
        """Return the signal that drives, in `unit`; `after_rest` begins after t = 0, where all is
        at rest."""
        s = recording.signal(name, unit)
        kept = s.t > 0 if after_rest else np.ones(len(s.t), bool)
        sd_t = clock_sd(recording, name)
        return cls(name, "drives", s.t[kept], s.y[kept], s.unit, s.sd, sd_t=sd_t)

    @classmethod
    def validating(
        cls, recording: Recording, name: str, unit: str, *, quantity: str, trace: str
    ) -> Self:
        """Return the signal that a run's `trace` must predict, scored as `quantity`; a mean of
        repeats is uncertain by their scatter."""
        s = recording.signal(name, unit)
        sd_t, share = clock_sd(recording, name), repeats_share(recording)
        return cls(name, "validates", s.t, s.y, unit, s.sd, quantity, trace, sd_t, share)


def require_rising(drive: SignalObservation, seen: SignalObservation) -> None:
    """Raise `RegistrationError` when a signal falls as the drive closes."""
    most = int(np.argmax(drive.y[:, 0]))
    least = int(np.argmin(drive.y[:, 0]))
    change = seen.at(float(drive.t[most])) - seen.at(float(drive.t[least]))
    if change < -5 * seen.sd:
        raise RegistrationError(
            f"'{seen.quantity}' falls by {-change:.4g} {seen.unit} as '{drive.name}' closes by "
            f"{1e3 * np.ptp(drive.y):.3g} mm; compression and pressure are positive: reverse its "
            f"sign"
        )


def holds_at(
    drive: SignalObservation, t: Floats, loads: tuple[float, ...], within: float
) -> tuple[Selection, ...]:
    """Return the measurement times t (nt,) s at which the drive stood at a load m, rest first.

    Raises `ComparisonError` when a load has no measurement within `within` m of it.
    """
    reached = [float(drive.y[nearest_sample(drive.t, ti, drive.name), 0]) for ti in t]
    if min(loads, default=1.0) <= 0 or len(set(loads)) != len(loads):
        shown = ", ".join(f"{1e3 * load:g}" for load in loads)
        raise ComparisonError(f"loads {shown} mm: each must be above 0 (rest) and occur once")
    holds = []
    for load in (0.0, *loads):
        off = np.abs(np.array(reached) - load)
        if off.min() > within:
            seen = ", ".join(f"{1e3 * r:.2f}" for r in reached)
            raise ComparisonError(
                f"no measurement at {1e3 * load:g} mm: 0 matched samples, '{drive.name}' was at "
                f"{seen} mm; set the loads to these values"
            )
        i = int(off.argmin())
        holds.append(Selection(f"{1e3 * load:g}mm", t[i : i + 1], "one sample at the load step"))
    return tuple(holds)


def instant(hold: Selection) -> float:
    """Return the time s of a load step."""
    assert hold.t is not None
    return float(hold.t[0])


def windows_of(
    drive: SignalObservation, windows: dict[str, tuple[float, float]]
) -> tuple[Selection, ...]:
    """Return the samples with the drive in (from, to] m, by label.

    Raises `ComparisonError` when a window holds no sample.
    """
    found = []
    for label, (low, high) in windows.items():
        inside = (drive.y[:, 0] > low) & (drive.y[:, 0] <= high)
        span = f"between {1e3 * low:g} and {1e3 * high:g} mm"
        if not inside.any():
            covered = f"{1e3 * drive.y.min():.2f}..{1e3 * drive.y.max():.2f} mm"
            raise ComparisonError(
                f"window {label}: 0 samples {span}; '{drive.name}' covers {covered}"
            )
        found.append(Selection(label, drive.t[inside], f"every sample whose drive is {span}"))
    return tuple(found)
