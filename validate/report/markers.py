"""Markers on the top face: vectors, positions and vertical rise (paper 000, figures 8 and 9)."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection
from matplotlib.figure import Figure

from validate.arrays import Floats
from validate.compare.result import MethodResult, Result
from validate.register.observe import Hold, MarkerObservation, nearest_sample
from validate.report.numbers import spaced, with_unit
from validate.report.observed import at_loads, distinct, markers_seen, shown_method
from validate.report.page import Picture, Section, section
from validate.report.style import ACCEPTED, MEASURED, Look, draw, looks

_MM = 1e3
_PLANE = [0, 2]  # the top face: x along the stage, z lateral
_UP = 1


def markers(result: Result) -> Section | None:
    """Vectors and positions at every load, rise against x; None without markers at loads."""
    judged = shown_method(result)
    seen = markers_seen(judged) if judged else None
    if seen is None or judged is None or not at_loads(judged):
        return None
    if len(result.registered[0].holds) < 2:
        return None
    holds = result.registered[0].holds
    return section(
        "markers",
        "Markers on the top face",
        _plane(seen, judged, holds),
        _rise(result, seen, holds),
    )


def _measured(seen: MarkerObservation, hold: Hold) -> Floats:
    return np.asarray(seen.x[nearest_sample(seen.t, hold.t, "markers")])


def _plane(seen: MarkerObservation, judged: MethodResult, holds: tuple[Hold, ...]) -> Picture:
    count = len(holds) - 1
    pixels = draw(lambda f: _plane_panels(f, seen, judged, holds), 3.3 * count + 0.6, 8.2)
    return Picture(
        "markers",
        "The top face from above, x along the stage, z lateral, mm. Upper row: displacement from "
        f"rest, measured (black) and {judged.label} (blue), drawn to scale. Lower row: measured "
        f"positions as circles of the declared noise ({with_unit(seen.sd, 'm')} per axis), the "
        "simulated ones as dots. About four dots in ten fall inside their circle when the "
        "model is right.",
        f"Marker displacement vectors and positions for {count} loads, measured and simulated.",
        pixels,
    )


def _plane_panels(
    figure: Figure, seen: MarkerObservation, judged: MethodResult, holds: tuple[Hold, ...]
) -> None:
    axes = figure.subplots(2, len(holds) - 1, sharex=True, sharey=True, squeeze=False)
    start = _measured(seen, holds[0])
    for i, hold in enumerate(holds[1:], start=1):
        simulated, measured = seen.simulated(judged.run.u[i]), _measured(seen, hold)
        upper, lower = axes[:, i - 1]
        _vectors(upper, start, measured - start, MEASURED, "measured")
        _vectors(upper, seen.rest, simulated - seen.rest, ACCEPTED, judged.label)
        _circles(lower, measured, seen.sd)
        lower.plot(*(_MM * simulated[:, _PLANE]).T, ".", color=ACCEPTED, ms=4.5, label=judged.label)
        upper.set_title(spaced(hold.label))
        lower.set_xlabel("x along the stage / mm")
        for ax in (upper, lower):
            ax.set_aspect("equal")
    for ax in axes[:, 0]:
        ax.set_ylabel("z lateral / mm")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2)


def _vectors(ax: Axes, start: Floats, moved: Floats, colour: str, label: str) -> None:
    x, d = _MM * start[:, _PLANE], _MM * moved[:, _PLANE]
    ax.quiver(
        *x.T, *d.T, angles="xy", scale_units="xy", scale=1, color=colour, label=label,
        width=0.005, headwidth=3.5, headlength=4, zorder=3 if colour == ACCEPTED else 2,
    )  # fmt: skip


def _circles(ax: Axes, centres: Floats, sd: float) -> None:
    there = _MM * centres[np.isfinite(centres).all(axis=1)][:, _PLANE]
    size = np.full(len(there), 2 * _MM * sd)
    ax.add_collection(
        EllipseCollection(
            size, size, np.zeros(len(there)), units="xy", offsets=there,
            transOffset=ax.transData, facecolors="none", edgecolors=MEASURED, linewidths=0.9,
        )
    )  # fmt: skip
    ax.plot(*there.T, ",", color="none")


def _rise(result: Result, seen: MarkerObservation, holds: tuple[Hold, ...]) -> Picture:
    styles = looks(result)
    drawn = [(m, styles[m.name]) for m in distinct(result, "marker.vertical")]
    pixels = draw(
        lambda f: _rise_panels(f, result, seen, holds, drawn), 3.3 * (len(holds) - 1) + 0.6, 3.9
    )
    names = ", ".join(m.label for m, _ in drawn)
    return Picture(
        "marker_rise",
        "Vertical rise of the markers from rest against their x, mm. Bars: ± 1 standard deviation "
        "of a measured rise (√2 times the declared noise). Each model's line joins the mean of "
        "markers of equal rank in x; the rise tells slipping from bonded plates best.",
        f"Vertical rise of the markers against x for each load: measured and {names}.",
        pixels,
    )


def _rise_panels(
    figure: Figure,
    result: Result,
    seen: MarkerObservation,
    holds: tuple[Hold, ...],
    drawn: list[tuple[MethodResult, Look]],
) -> None:
    axes = figure.subplots(1, len(holds) - 1, sharex=True, sharey=True, squeeze=False)[0]
    x, start = _MM * seen.rest[:, 0], _measured(seen, holds[0])[:, _UP]
    for i, (ax, hold) in enumerate(zip(axes, holds[1:], strict=True), start=1):
        rise = _MM * (_measured(seen, hold)[:, _UP] - start)
        ax.errorbar(x, rise, np.sqrt(2) * _MM * seen.sd, fmt=".", color=MEASURED, ecolor="#A0A0A0",
                    ms=4, lw=0.8, label="measured")  # fmt: skip
        for method, look in drawn:
            own = markers_seen(method)
            if own is not None:
                there, mean = _banded(x, _MM * own.rows.apply(method.run.u[i])[:, _UP])
                ax.plot(there, mean, color=look.colour, ls=look.dash, lw=look.width,
                        marker=look.point, ms=4, label=method.label)  # fmt: skip
        ax.set_title(spaced(hold.label))
        ax.set_xlabel("x along the stage / mm")
    axes[0].set_ylabel("vertical rise / mm")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)


def _banded(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Means over groups of neighbours in x, about seven of them."""
    groups = np.array_split(np.argsort(x, kind="stable"), min(7, len(x)))
    return np.array([x[g].mean() for g in groups]), np.array([y[g].mean() for g in groups])
