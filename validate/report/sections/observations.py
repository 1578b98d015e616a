"""Observations of a registered recording for sections; which effects they distinguish.

Nothing else in this package opens a `Registered`.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from textwrap import fill

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from scipy.special import chdtri

from validate.arrays import Floats, rms
from validate.compare.effects import TELLS_APART, Effect
from validate.compare.exhibit import Exhibit, Picture
from validate.compare.residual import Residual
from validate.compare.result import MethodResult, Result
from validate.numbers import at_load, significant, with_unit
from validate.register.markers.markers import MarkerObservation
from validate.register.outlines.outlines import OutlineObservation
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.report.charts.style import ACCEPTED, MEASURED, NOISE, WIDTH, draw, panels
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


# --- distinguishable effects of a recording: errors and effects against sensor noise -------------

_LOWEST = 0.02  # ratios below lie there, as a sign that points on
_LINE, _ROOM = 0.145, 0.62  # inches of a line of a model's name; of title and ticks
_NAME = 32  # letters of a model's name in one line


def discrimination(result: Result) -> Exhibit:
    """Errors over noise, and in words which effects the recording shows."""
    # The effects in what a sensor measured: a reference without noise separates everything
    residuals = [r for m in result.methods for r in m.residuals.values()]
    measured = {r.name for r in residuals if r.sd > 0}
    effects = tuple(
        replace(e, changes=tuple(c for c in e.changes if c.name in measured))
        for e in result.effects
    )
    return Exhibit(
        "discrimination",
        "Which effects this recording can distinguish",
        tuple(map(_sentence, effects)),
        pictures=over_noise(result),
    )


def _sentence(effect: Effect) -> str:
    opening = f"{effect.name.capitalize()} ({effect.doc})"
    seen = list(dict.fromkeys(name.split("@")[0] for name in effect.seen_by))
    if seen:
        return f"{opening}: this recording can distinguish it, by {_listed(seen)}."
    best = max(effect.changes, key=lambda c: c.separation, default=None)
    size = ""
    if best is not None and best.separation > 0:
        size = (
            f" (best: {best.name}, {with_unit(best.rms, best.unit, 2)}, separation "
            f"{best.separation:.1f} of {TELLS_APART:g} needed)"
        )
    if effect.would_see:
        return (
            f"{opening}: cannot be distinguished{size}; try sensors: {_listed(effect.would_see)}."
        )
    return f"{opening}: cannot be distinguished{size}; no listed sensor measures it."


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else ", ".join(names[:-1]) + " and " + names[-1]


# --- errors over noise ----------------------------------------------------------------------------


@dataclass(frozen=True)
class NoiseRow:
    """One quantity: every method's rms error over the noise of the measurement."""

    quantity: str
    noise: str
    band: tuple[float, float]
    ratios: tuple[tuple[MethodResult, float], ...]


def over_noise(result: Result) -> tuple[Picture, ...]:
    """Return the picture; none where nothing with noise was compared."""
    rows = noise_rows(result)
    if not rows:
        return ()
    names = [m for m in finished(result) if any(m is one for r in rows for one, _ in r.ratios)]
    lines = max(len(fill(m.label, _NAME).splitlines()) for m in names)
    one = (_LINE * lines + 0.05) * len(names) + _ROOM
    high = -(-len(rows) // _columns(rows)) * one + 0.35
    pixels = draw(lambda f: _fill(f, rows, names), WIDTH, high)
    over_time = all(r.load == "all" for m in finished(result) for r in m.residuals.values())
    where = at_load("all") if over_time else "at the last load"
    shown = Picture(
        "errors_over_noise",
        f"Rms error of every model {where} over the rms that measurement noise alone gives "
        f"(no unit, logarithmic; the title gives the noise). Filled: checked models; hollow: the "
        f"others. Grey: 95 % of repetitions with noise alone (chi-square with the number of "
        f"values). To the right of it, the recording shows the model's error. Where all models "
        f"are on grey, that quantity cannot distinguish them. Ratios below {_LOWEST:g} are "
        f"arrows.",
        "Dot chart: rms error over measurement noise for each quantity and model.",
        pixels,
    )
    return (shown,)


def noise_rows(result: Result) -> list[NoiseRow]:
    """Return a row for every quantity that has noise."""
    done = finished(result)
    quantities = dict.fromkeys(r.quantity for m in done for r in m.residuals.values() if r.sd > 0)
    return [_row(done, quantity) for quantity in quantities]


def _row(done: Iterable[MethodResult], quantity: str) -> NoiseRow:
    seen = [(m, r) for m in done if (r := last_residual(m, quantity)) is not None]
    ratios = tuple((m, rms(r.values) / _noise(r)) for m, r in seen)
    first = seen[0][1]
    dof = first.values.size
    low, high = (float(np.sqrt(chdtri(dof, p) / dof)) for p in (0.975, 0.025))
    return NoiseRow(quantity, with_unit(_noise(first), first.unit), (low, high), ratios)


def _noise(residual: Residual) -> float:
    """The rms (SI) that the noise of the measurement gives a perfect model."""
    c = residual.values.shape[1]
    return float(np.sqrt(c * (residual.sd**2 + residual.systematic**2)))


def _columns(rows: list[NoiseRow]) -> int:
    return min(len(rows), 2)


def _fill(figure: Figure, rows: list[NoiseRow], methods: list[MethodResult]) -> None:
    columns = _columns(rows)
    axes, lowest = panels(figure, len(rows), columns)
    for ax, row in zip(axes, rows, strict=True):
        ax.axvspan(*row.band, color=NOISE, lw=0)
        ax.axvline(1, color=MEASURED, lw=0.8)
        for method, ratio in row.ratios:
            sign = "<" if ratio < _LOWEST else "o"
            face = ACCEPTED if method.accepted else "white"
            ax.plot(max(ratio, _LOWEST), methods.index(method), sign, ms=5.5, mfc=face,
                    mec=ACCEPTED if method.accepted else MEASURED)  # fmt: skip
        ax.set_title(f"{row.quantity}\nnoise {row.noise}", loc="left", fontsize=8.5)
    for ax in lowest:
        ax.set_xlabel("rms error / rms of noise", fontsize=9)
    for ax in axes[::columns]:
        ax.tick_params(axis="y", labelsize=8)
    first = axes[0]
    names = [fill(m.label, _NAME) for m in methods]
    first.set_yticks(range(len(methods)), names)
    first.set_ylim(len(methods) - 0.5, -0.5)
    first.set_xscale("log")
    low, high = first.get_xlim()
    first.set_xlim(max(min(low, 0.09), 0.8 * _LOWEST), max(high, 11))
    first.xaxis.set_major_locator(LogLocator(numticks=5))
    first.xaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
    first.xaxis.set_minor_formatter(NullFormatter())
