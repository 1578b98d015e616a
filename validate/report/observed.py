"""Picks that all figures share: which methods to draw, and a method's view of the measurement."""

from validate.arrays import rms
from validate.compare.residual import Residual
from validate.compare.result import MethodResult, Result
from validate.register.observe import Hold, MarkerObservation, OutlineObservation
from validate.report.loads import at_holds
from validate.solve.types import Run, StepTimes

_APART = 0.08  # share of the largest difference below which two methods draw one line


def finished(result: Result) -> tuple[MethodResult, ...]:
    """Methods whose runs all reached the end, the accepted one first."""
    done = [m for m in result.methods if all(r.finished for r in m.runs)]
    return tuple(sorted(done, key=lambda m: not m.accepted))


def shown_method(result: Result) -> MethodResult | None:
    """The accepted method, or without one the first that finished; None when none did."""
    done = finished(result)
    return done[0] if done else None


def loaded_holds(result: Result) -> tuple[Hold, ...]:
    """The loads of the first recording after rest."""
    return result.registered[0].holds[1:] if result.registered else ()


def at_loads(method: MethodResult) -> bool:
    """The method's fields are those at the first recording's loads, not frames over time."""
    seen = method.registered[0] if method.registered else None
    return seen is not None and at_holds(seen, method.run)


def timed(run: Run) -> StepTimes | None:
    """The run's step times; None when not one step succeeded: a refusal has no rate."""
    return run.step_s if len(run.t) else None


def last_residual(method: MethodResult, quantity: str) -> Residual | None:
    """The residual of a quantity at its last load."""
    found = [r for r in method.residuals.values() if r.quantity == quantity]
    return found[-1] if found else None


def distinct(result: Result, quantity: str) -> tuple[MethodResult, ...]:
    """Finished methods whose lines for a quantity do not lie on each other at the last load."""
    pairs = [(m, last_residual(m, quantity)) for m in finished(result)]
    drawn = [(m, r) for m, r in pairs if r is not None]
    largest = max((_apart(a, b) for _, a in drawn for _, b in drawn), default=0.0)
    kept: list[tuple[MethodResult, Residual]] = []
    for method, residual in drawn:
        if all(_apart(residual, other) > _APART * largest for _, other in kept) or not kept:
            kept.append((method, residual))
    return tuple(m for m, _ in kept)


def _apart(one: Residual, other: Residual) -> float:
    if one.values.shape != other.values.shape:
        return float("inf")
    return rms(one.values - other.values)


def outline_seen(method: MethodResult) -> OutlineObservation | None:
    """The outlines with the wall of the method's own mesh; None without them or a whole run."""
    return method.registered[0].outline if method.registered and method.run.finished else None


def markers_seen(method: MethodResult) -> MarkerObservation | None:
    """The markers with the rows of the method's own mesh; None without them or a whole run."""
    return method.registered[0].markers if method.registered and method.run.finished else None
