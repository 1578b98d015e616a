"""Nominal stresses of a stretched point: observation relative to the larger stress of its row."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats
from validate.errors import ComparisonError
from validate.fem.assembly.locate import Rows
from validate.register.observation import (
    AnyDraw,
    Deviation,
    Role,
    Selection,
    Simulated,
    from_rest,
)

TRACES = ("nominal_stress", "second_stress")
_NOTHING = 0.01  # of the largest stress: below it a relative error is that of the figure's axis


@dataclass(frozen=True)
class StressObservation:
    """y (nt, c) Pa at rows t (nt,): the first and, where it was measured, the second stress.

    A residual is simulated less measured over the larger stress of its row. `sd` is the relative
    standard deviation of a row's reading, `shared` that of all rows together (a figure's axis).
    `against` (nt,) Pa is what every row is relative to; none: its own larger stress.
    """

    name: str
    role: Role
    t: Floats
    y: Floats
    sd: float
    shared: float
    quantity: str
    against: Floats | None = None

    @property
    def units(self) -> Mapping[str, str]:
        return {self.quantity: "1"}

    @property
    def traces(self) -> tuple[str, ...]:
        return TRACES[: self.y.shape[1]]

    @property
    def scale(self) -> Floats:
        """What an error of every row is relative to (nt,) Pa."""
        return np.abs(self.y).max(axis=1) if self.against is None else self.against

    @property
    def loaded(self) -> NDArray[np.bool_]:
        """Whether each row (nt,) has a stress that an error can be relative to: not at rest."""
        return np.asarray(self.scale > _NOTHING * self.scale.max())

    def deviations(self, run: Simulated, selection: Selection) -> tuple[Deviation, ...]:
        """One of all rows and stresses. Raises `ComparisonError` for a trace that is no stress."""
        found = [run.traces.get(name) for name in self.traces]
        seen = [trace for trace in found if trace is not None]
        if len(seen) < len(found):
            return ()
        if any(trace.unit != "Pa" for trace in seen):
            raise ComparisonError(
                f"{run.method}: '{self.traces[0]}' is in {seen[0].unit}, expected Pa"
            )
        at = selection.samples(self.t, run.t, self.quantity)
        loaded = self.loaded[at]
        if not loaded.any():
            return ()
        read = [selection.read(run.t, trace.y, self.t[at])[loaded] for trace in seen]
        at = at[loaded]
        off = (np.stack(read, axis=1) - self.y[at]) / self.scale[at][:, None]
        words = "simulated minus measured nominal stress over the larger measured stress of its row"
        return (
            Deviation(
                self.quantity, off.reshape(-1, 1), "1", self.sd, self.shared, words, scale=1.0,
                reference=(self.y[at] / self.scale[at][:, None]).reshape(-1, 1),
                t=np.repeat(self.t[at], off.shape[1]),
            ),
        )  # fmt: skip

    def left(self, run: Simulated) -> Floats:
        """Exact less measured stresses, flat (nt c,) Pa; 0 where the run has no such trace."""
        if self.unanswered(run):
            return np.zeros(self.y.size)
        exact = np.stack([run.traces[name].y for name in self.traces], axis=1)
        return np.asarray((from_rest(run.t, exact, self.t) - self.y).ravel())

    def anew(self, left: Floats, draw: AnyDraw) -> "StressObservation":
        """Return the rows with `left` (nt c,) Pa; readings and the figure's axis drawn.

        Noise and errors stay relative to what was measured: the terms of u_val are.
        """
        exact = self.y + left.reshape(self.y.shape)
        off = draw.white(self.sd, exact.shape) + draw.white(self.shared, (1,))
        return replace(self, y=exact + self.scale[:, None] * off, against=self.scale)

    def unanswered(self, run: Simulated) -> tuple[str, ...]:
        return tuple(name for name in self.traces if name not in run.traces)

    def rows(self) -> Rows | None:
        return None
