"""Residuals: simulated minus measured, one small array per quantity and selection.

Everything else follows from these arrays: scores are their statistics, differences between models
are differences of residuals against the same measurement, and so are the sensitivities to the
mesh and to the inputs.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from validate.arrays import Floats, checked
from validate.errors import ComparisonError
from validate.register.observation import Deviation, Role, Selection

if TYPE_CHECKING:
    from validate.register.registration import Registered
    from validate.solve.types import Run


@dataclass(frozen=True)
class Residual:
    """Simulated minus measured, values (k, c) in `unit`, under the label `load` of a selection.

    `sd` is the measurement's standard deviation per component, independent between points;
    `systematic` the part that all points share (registration), per component. `simulated` and
    `measured` are kept for scalar quantities. `role` says whether the observation validates.
    `freedom` counts the numbers in which noise is independent; None: all of them. `scale` is the
    largest that was measured of what has a zero, `reference` (k, c) what was measured of it. `t`
    (k,) s are the times of the values where there are several; `axes` names the components.
    """

    quantity: str
    load: str
    values: Floats
    sd: float
    systematic: float
    unit: str
    definition: str
    simulated: float | None = None
    measured: float | None = None
    role: Role = "validates"
    freedom: int | None = None
    scale: float | None = None
    reference: Floats | None = None
    t: Floats | None = None
    axes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        values = checked(self.values, f"residual {self.name}", (None, None), error=ComparisonError)
        if values.size == 0:
            raise ComparisonError(f"{self.name}: 0 matched points, nothing was compared")
        if self.t is not None and self.t.shape != (len(values),):
            raise ComparisonError(
                f"{self.name}: {self.t.shape} times of {len(values)} values; expected one for each"
            )
        # In one order: sums of a stored residual are those of a fresh one, digit by digit.
        for name, array in (("values", values), ("reference", self.reference), ("t", self.t)):
            if array is not None:
                own = np.array(array, order="C")
                own.setflags(write=False)
                object.__setattr__(self, name, own)

    @property
    def name(self) -> str:
        return f"{self.quantity}@{self.load}"

    @property
    def count(self) -> int:
        return len(self.values)

    @classmethod
    def of(cls, registered: Registered, run: Run) -> tuple[Residual, ...]:
        """Return every observation at every selection, and the volume of every cavity there.

        None for a run that did not reach the last input: it has no error over the whole.
        Raises `ComparisonError` when nothing matches in time.
        """
        if not reached_end(registered, run):
            return ()
        found: list[Residual] = []
        for selection in registered.selections:
            for seen in registered.compared:
                if seen.name in (selection.of or (seen.name,)):
                    found += [_of(d, selection, seen.role) for d in seen.deviations(run, selection)]
            found += [_of(d, selection, "validates") for d in _volumes(run, selection)]
        return tuple(found)


def rest_residuals(registered: Registered, run: Run) -> tuple[Residual, ...]:
    """Return residuals of the undeformed state: errors of registration and geometry."""
    rest = registered.rest
    if rest is None or not run.finished:
        return ()
    return tuple(
        _of(d, rest, seen.role)
        for seen in registered.compared
        if seen.name in (rest.of or (seen.name,))
        for d in seen.deviations(run, rest)
        if d.unit == "m"
    )


def reached_end(registered: Registered, run: Run) -> bool:
    """Return whether a run finished at the last recorded input."""
    return run.finished and bool(run.t[-1] >= registered.t[-1] - 1e-9)


def unanswered(registered: Registered, run: Run) -> tuple[str, ...]:
    """One sentence for each observation of which a run leaves something uncompared."""
    found = []
    for seen in registered.compared:
        left = seen.unanswered(run)
        if left:
            found.append(
                f"{seen.name}: {', '.join(left)} compared with nothing, because no probe or "
                "trace of the scene has that name"
            )
    return tuple(found)


def stacked(found: Iterable[Residual]) -> dict[str, Residual]:
    """Residuals by name; repeats of one quantity over several recordings become one."""
    merged: dict[str, Residual] = {}
    for residual in found:
        other = merged.get(residual.name)
        if other is not None:
            values = np.vstack([other.values, residual.values])
            freedom = None
            if other.freedom is not None or residual.freedom is not None:
                # A residual that declares none has as many as it has numbers.
                freedom = sum(
                    r.values.size if r.freedom is None else r.freedom for r in (other, residual)
                )
            truths = [r.reference for r in (other, residual) if r.reference is not None]
            times = [r.t for r in (other, residual) if r.t is not None]
            residual = replace(
                residual, values=values, simulated=None, measured=None, freedom=freedom,
                reference=np.vstack(truths) if len(truths) == 2 else None,
                t=np.concatenate(times) if len(times) == 2 else None,
            )  # fmt: skip
        merged[residual.name] = residual
    return merged


def _of(d: Deviation, selection: Selection, role: Role) -> Residual:
    return Residual(
        d.quantity, selection.label, d.values, d.sd, d.systematic, d.unit, d.definition,
        d.simulated, d.measured, role, d.freedom, d.scale, d.reference, d.t, d.axes,
    )  # fmt: skip


def _volumes(run: Run, selection: Selection) -> list[Deviation]:
    """The fluid is incompressible: its reference volume is the one at rest, exactly."""
    found = []
    for name, trace in run.traces.items():
        if name.endswith(".volume_ratio"):
            ratio = selection.read(run.t, trace.y, run.t)
            d = Deviation(
                "volume.relative_error", (ratio - 1)[:, None], "1", 0.0, 0.0,
                "cavity volume over its rest volume minus one; reference: incompressible fluid",
            )  # fmt: skip
            if len(ratio) == 1:
                found.append(replace(d, simulated=float(ratio[0]), measured=1.0))
            else:
                found.append(replace(d, t=run.t if selection.t is None else selection.t))
    return found
