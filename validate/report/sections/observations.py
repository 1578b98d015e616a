"""Observations of a registered recording for sections and replays, and the displayed methods.

Nothing else in this package opens a `Registered`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats
from validate.compare.residual import Residual
from validate.compare.result import MethodResult, Result
from validate.numbers import significant
from validate.register.markers.markers import MarkerObservation
from validate.register.outlines.outlines import OutlineObservation
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.scene.meshless import AnyScene
from validate.solve.types import Run, StepTimes

_APART = 0.08  # share of the largest difference below which two methods draw one line
_SHOWN = 4  # instants that are drawn of a run through many of them
_ALONG = 0.9  # part of a drive's direction above which it moves along an axis


# --- a registered recording ----------------------------------------------------------------------


@dataclass(frozen=True)
class Held:
    """A load at which everything was measured: label such as "3mm", drive in SI `unit`, time s."""

    label: str
    drive: float
    unit: str
    t: float


def drive(registered: Registered) -> SignalObservation:
    """Return the first signal that drives."""
    return registered.drives[0]


def driven(registered: Registered, t: Floats | float) -> Floats:
    """Return the first drive (SI) at times s, interpolated."""
    return np.asarray(np.interp(t, registered.t, registered.inputs[:, 0]))


def holds(registered: Registered) -> tuple[Held, ...]:
    """Return the single instants at which everything was measured, in time; none of a run over
    time, which may begin at rest, too.

    Where there are any, the output frames of a run are at them.
    """
    loads = [s for s in registered.selections if s.t is not None and len(s.t) == 1]
    rest = [registered.rest] if loads and registered.rest is not None else []
    times = [(float(s.t[0]), s.label) for s in (*rest, *loads)
             if s.t is not None and len(s.t) == 1]  # fmt: skip
    unit = drive(registered).unit
    return tuple(Held(label, registered.stage(t), unit, t) for t, label in sorted(times))


def shown_loads(method: MethodResult) -> tuple[tuple[Held, ...], tuple[int, ...]]:
    """What is drawn of a run, and the numbers of its output frames there: its loads; where it goes
    from rest through many instants, rest and three of these, evenly; else nothing."""
    if not method.registered:
        return (), ()
    registered, run = method.registered[0], method.run
    if loads := holds(registered):
        return loads, tuple(range(len(loads)))
    rest = registered.rest
    if rest is None or rest.t is None or len(rest.t) != 1:
        return (), ()
    frames = np.unique(np.linspace(0, len(run.u) - 1, _SHOWN).round().astype(int)).tolist()
    times = run.t[run.at][frames].tolist()
    labels = [rest.label, *(f"{significant(t)}s" for t in times[1:])]
    unit, moved = drive(registered).unit, driven(registered, np.array(times)).tolist()
    held = tuple(Held(*h) for h in zip(labels, moved, [unit] * len(times), times, strict=True))
    return held, tuple(frames)


def signals(registered: Registered) -> tuple[SignalObservation, ...]:
    """Return the signals that a run's traces predict."""
    return registered.of(SignalObservation)


def outline(registered: Registered) -> OutlineObservation | None:
    """Return the first stream of outlines."""
    return next(iter(registered.of(OutlineObservation)), None)


def markers(registered: Registered) -> MarkerObservation | None:
    """Return the first set of markers."""
    return next(iter(registered.of(MarkerObservation)), None)


def where_shown(result: Result) -> dict[str, str]:
    """Return the section of the page that draws each compared quantity, by the quantity."""
    sections = {MarkerObservation: "markers", OutlineObservation: "outlines"}
    return {
        quantity: sections.get(type(observation), "curves")
        for method in result.methods
        for registered in method.registered
        for observation in registered.observations
        for quantity in observation.units
    }


def axis_label(scene: AnyScene, axis: int) -> str:
    """Return an axis of the scene's frame with its unit, and which drive moves along it."""
    along = [d.name for d in scene.drives if abs(d.direction[axis]) > _ALONG]
    return f"{'xyz'[axis]}{f' (along {along[0]})' if along else ''} / mm"


# --- the methods of a result ---------------------------------------------------------------------


def finished(result: Result) -> tuple[MethodResult, ...]:
    """Methods whose runs all reached the end, the accepted one first."""
    done = [m for m in result.methods if all(r.finished for r in m.runs)]
    return tuple(sorted(done, key=lambda m: not m.accepted))


def shown_method(result: Result) -> MethodResult | None:
    """Return the accepted method, or without one the first that finished; None when none did."""
    return next(iter(finished(result)), None)


def outline_seen(method: MethodResult) -> OutlineObservation | None:
    """Return the outlines with the wall of the method's own mesh; None without them or a whole
    run."""
    return outline(method.registered[0]) if method.registered and method.run.finished else None


def markers_seen(method: MethodResult) -> MarkerObservation | None:
    """Return the markers with the rows of the method's own mesh; None without them or a whole
    run."""
    return markers(method.registered[0]) if method.registered and method.run.finished else None


def timed(run: Run) -> StepTimes | None:
    """Return the run's step times; None when not one step succeeded: a refusal has no rate."""
    return run.step_s if len(run.t) else None


def last_residual(method: MethodResult, quantity: str) -> Residual | None:
    """Return the residual of a quantity at its last load."""
    found = [r for r in method.residuals.values() if r.quantity == quantity]
    return found[-1] if found else None


def distinct(
    lines: Sequence[tuple[MethodResult, Floats]], apart: float | None = None
) -> dict[str, MethodResult]:
    """By name the methods whose line is drawn by another's, and that other.

    Lines of one shape differ when any value does by more than `apart` (None: a share of the
    largest difference).
    """
    if apart is None:
        apart = _APART * max(_between(a, b) for _, a in lines for _, b in lines)
    kept: list[tuple[MethodResult, Floats]] = []
    on: dict[str, MethodResult] = {}
    for method, line in lines:
        other = next((m for m, drawn in kept if _between(line, drawn) <= apart), None)
        if other is None:
            kept.append((method, line))
        else:
            on[method.name] = other
    return on


def _between(one: Floats, other: Floats) -> float:
    return float(np.abs(one - other).max()) if one.shape == other.shape else float("inf")
