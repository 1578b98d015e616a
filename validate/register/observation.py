"""Observations in the scene's frame, their simulated counterpart in a run, and synthetic draws.

Every kind of sensor is one file beside this one: its class keeps the measured samples and says
how a run deviates from them. Comparison, filters and reports know nothing of a sensor but this.

Synthetic draws of a measurement from a run, with noise, registration and clock errors.

Every observation says what it `left` of a run, exact reading less measured sample (m,); these add
up: what an uncertain input does to a reading is a difference of two. `anew` takes such numbers to
an observation with other samples, noise drawn.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal, Protocol, runtime_checkable

import numpy as np

from validate.arrays import Floats, Ints
from validate.errors import ComparisonError
from validate.fem.assembly.locate import Rows


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


Role = Literal["drives", "calibrates", "validates"]
WITHIN = 1.0  # s: a sample further off in time is no match
_SAME = 1e-9  # s: instants that are one


class Traced(Protocol):
    """One number a step (nt,) in `unit`."""

    @property
    def y(self) -> Floats: ...

    @property
    def unit(self) -> str: ...


class Simulated(Protocol):
    """Data of a run for observations: fields u (no, n, d) m at the steps `at`, traces."""

    @property
    def method(self) -> str: ...

    @property
    def t(self) -> Floats: ...

    @property
    def at(self) -> Ints: ...

    @property
    def u(self) -> Floats: ...

    @property
    def traces(self) -> Mapping[str, Traced]: ...


@dataclass(frozen=True)
class Selection:
    """The instants t (m,) s that are compared under one label; None: every sample of a sensor.

    A hold is one instant, a window of a curve many. `words` say which, for definitions. `sd_t` s is
    the standard uncertainty of the drive's clock against the sensors'. `of` names the observations
    that are compared there; none: all.
    """

    label: str
    t: Floats | None = None
    words: str = ""
    sd_t: float = 0.0
    of: tuple[str, ...] = ()

    def instants(self, run: "Simulated") -> "Selection":
        """Itself, or for every sample the times whose fields the run kept."""
        return self if self.t is not None else replace(self, t=run.t[run.at])

    def samples(self, t: Floats, run_t: Floats, name: str) -> Ints:
        """Indices of the samples at t (nt,) s that are compared with a run over run_t s.

        Raises `ComparisonError` where an instant has no sample near it in time.
        """
        if self.t is None:
            return np.flatnonzero((t >= run_t[0] - _SAME) & (t <= run_t[-1] + _SAME))
        return nearest_samples(t, self.t, name)

    def steps(self, run_t: Floats) -> Ints:
        """Return the run's steps nearest to the instants."""
        assert self.t is not None
        return nearest_samples(run_t, self.t, "the run")

    def read(self, run_t: Floats, y: Floats, t: Floats) -> Floats:
        """Return a trace y (nt,) at the instants (its nearest steps), or interpolated at times t
        s."""
        return np.interp(t, run_t, y) if self.t is None else y[self.steps(run_t)]


EVERYTHING = Selection("all")


@dataclass(frozen=True)
class Deviation:
    """Simulated less measured of one quantity: values (k, c) in `unit`.

    `sd` is the measurement's standard deviation per component, independent between points;
    `systematic` what all points share (registration), per component. `freedom` counts the numbers
    in which noise is independent (None: all). `scale` is the largest that was measured of what has
    a zero, in `unit`, and `reference` (k, c) what was measured of it; of places, from the middle of
    them. `simulated` and `measured` are kept of scalars. `t` (k,) s are the times of the values
    where there are several. `axes` names the components where they have names.
    """

    quantity: str
    values: Floats
    unit: str
    sd: float
    systematic: float
    definition: str
    simulated: float | None = None
    measured: float | None = None
    freedom: int | None = None
    scale: float | None = None
    reference: Floats | None = None
    t: Floats | None = None
    axes: tuple[str, ...] = ()


class Observation(Protocol):
    """One stream of a recording, registered.

    `role`: it drives the simulation, calibrates it, or validates it. `unanswered` names what of it
    a run over the whole time says nothing about.
    """

    @property
    def name(self) -> str: ...

    @property
    def role(self) -> Role: ...

    @property
    def t(self) -> Floats: ...

    @property
    def units(self) -> Mapping[str, str]:
        """Unit of each quantity that is compared."""
        ...

    def deviations(self, run: Simulated, selection: Selection) -> tuple[Deviation, ...]: ...

    def unanswered(self, run: Simulated) -> tuple[str, ...]: ...

    def rows(self) -> Rows | None:
        """How a displacement field is read at the measured points, where a filter may be given
        them."""
        ...


@dataclass(frozen=True)
class History:
    """Measured history, and the reading of an exact sensor in a run.

    `measured` and `simulated` (nt, k, d) in `unit` at t (nt,) s are of the named quantities since
    rest; NaN = not seen. `sd` is the measurement's standard deviation per component. `each`: every
    name is a sensor of its own, which may be exchanged or loose.
    """

    name: str
    t: Floats
    names: tuple[str, ...]
    measured: Floats
    simulated: Floats
    unit: str
    sd: float
    each: bool = False

    def at(self, kept: Ints) -> "History":
        """Its samples of these indices alone."""
        return replace(
            self, t=self.t[kept], measured=self.measured[kept], simulated=self.simulated[kept]
        )


@runtime_checkable
class Drawable(Observation, Protocol):
    """An observation that can be drawn again, as a perfect model would produce it."""

    def left(self, run: Simulated) -> Floats:
        """What an exact sensor would have read of a run, less what was measured: flat (m,)."""
        ...

    def anew(self, left: Floats, draw: AnyDraw) -> Observation:
        """What would have been measured where exact readings are `left` off the samples, with
        noise, registration and clock drawn as declared."""
        ...


@runtime_checkable
class OverTime(Drawable, Protocol):
    """An observation that has a history of named quantities."""

    def history(self, run: Simulated) -> History | None:
        """None where the run says nothing of it."""
        ...


def nearest_samples(times: Floats, t: Floats, name: str) -> Ints:
    """Indices of the samples nearest to t (m,) s, the earlier of two.

    Raises `ComparisonError` for an instant without a sample within a second: nothing matches.
    """
    after = np.clip(np.searchsorted(times, t), 1, max(len(times) - 1, 1))
    before = after - 1
    after = np.minimum(after, len(times) - 1)
    index = np.where(np.abs(times[before] - t) <= np.abs(times[after] - t), before, after)
    off = np.abs(times[index] - t)
    if off.max(initial=0.0) > WITHIN:
        i = int(off.argmax())
        raise ComparisonError(
            f"{name} has no sample within {WITHIN:g} s of t = {t[i]:.3f} s (nearest {off[i]:.3f} "
            f"s away): 0 matched samples; check the clocks with `validate inspect`"
        )
    return np.asarray(index)


def nearest_sample(times: Floats, t: float, name: str) -> int:
    """Return the one of `nearest_samples`."""
    return int(nearest_samples(times, np.array([t]), name)[0])


def frame_at(run: Simulated, selection: Selection) -> Floats:
    """Return the fields (m, n, d) m at the instants; `ComparisonError` where the run kept none."""
    kept = {int(step): i for i, step in enumerate(run.at)}
    steps = selection.steps(run.t)
    if any(int(s) not in kept for s in steps):
        raise ComparisonError(
            f"{run.method}: {len(run.at)} output frames, none at '{selection.label}'"
        )
    return run.u[[kept[int(s)] for s in steps]]


def field_at(run: Simulated, t: float) -> Floats:
    """Return the field (n, d) m at t s between those that the run kept."""
    kept = run.t[run.at]
    i = int(np.clip(np.searchsorted(kept, t), 0, len(kept) - 1))
    before, start = (run.u[i - 1], kept[i - 1]) if i else (np.zeros_like(run.u[0]), 0.0)
    span = kept[i] - start
    share = min(max((t - start) / span, 0.0), 1.0) if span > 0 else 1.0
    return np.asarray(before + share * (run.u[i] - before))
