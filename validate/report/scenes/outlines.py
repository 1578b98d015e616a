"""Figures of a cavity's outlines in the image, measured and simulated."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from validate.arrays import Floats
from validate.compare.exhibit import Chart, Exhibit, NumberTable, Picture, Series, TableCell
from validate.compare.residual import Residual
from validate.compare.result import MethodResult, Result
from validate.numbers import shown_unit, spaced
from validate.register.outlines.outlines import (
    Corner,
    OutlineObservation,
    angular_points,
    enclosed,
    normal_distances,
)
from validate.report.charts.style import (
    MEASURED,
    WIDTH,
    Style,
    draw,
    legend_below,
    legend_height,
    looks,
    panels,
)
from validate.report.scenes.outline_images import closed, outline_images
from validate.report.sections.observations import (
    Held,
    distinct,
    finished,
    outline_seen,
    shown_loads,
    shown_method,
)

_MM = 1e3
_GREY = "#9A9A9A"
_COLUMNS, _PANEL = 2, 2.6  # panels of a row, and their inches


@dataclass(frozen=True)
class _Outlines:
    """The loads, the measured outlines (k, 2) m at them, and the runs' frames there."""

    seen: OutlineObservation
    holds: tuple[Held, ...]
    measured: tuple[Floats, ...]
    frames: tuple[int, ...]

    @property
    def loads(self) -> str:
        return ", ".join(spaced(h.label) for h in self.holds)


@dataclass(frozen=True)
class _Sections:
    """A method's sections (k, 2) m with the image plane at the loads."""

    method: MethodResult
    look: Style
    sections: tuple[Floats, ...]


def outlines(result: Result) -> Exhibit | None:
    """Outlines at every load, rivals and errors at the last one; None without outlines at loads."""
    judged = shown_method(result)
    seen = outline_seen(judged) if judged else None
    at, frames = shown_loads(judged) if judged and seen else ((), ())
    if seen is None or judged is None or not at:
        return None
    measured = _Outlines(seen, at, tuple(seen.measured(h.t) for h in at), frames)
    drawn = _drawn(result, measured)
    first = next(d for d in drawn if d.method is judged)
    images = outline_images(result.recordings[0], seen.name, at, first.sections, judged.label)
    return Exhibit(
        "outlines",
        "Outlines in the image",
        tables=tuple(t for c in seen.corners if (t := _corner_table(result, at[1:], c))),
        charts=(_at_last(measured, drawn),),
        pictures=(_by_load(measured, first, drawn), *(series for series, _ in images)),
        files=tuple(picture for _, picture in images),
    )


def _drawn(result: Result, measured: _Outlines) -> list[_Sections]:
    """Methods whose outlines do not lie on each other at the last load."""
    styles, found = looks(result), []
    for method in finished(result):
        seen = outline_seen(method)
        if seen is not None:
            sections = tuple(seen.simulated(method.run.u[i]) for i in measured.frames)
            found.append(_Sections(method, styles[method.name], sections))
    on = distinct([(d.method, _off(d, measured)) for d in found])
    return [d for d in found if d.method.name not in on]


def _off(drawn: _Sections, measured: _Outlines) -> Floats:
    """Distances (k,) m of the section from the measured points at the last load, outward."""
    return normal_distances(drawn.sections[-1], measured.measured[-1])


# --- every load ----------------------------------------------------------------------------------


def _by_load(measured: _Outlines, judged: _Sections, drawn: list[_Sections]) -> Picture:
    rows = -(-len(measured.holds) // _COLUMNS)
    names = ["measured at rest", "measured", *(d.method.label for d in drawn)]
    height = _PANEL * rows + 0.7 + legend_height(names)
    label, loads = judged.method.label, measured.loads
    ringed = "".join(
        f" Ringed: the image angle {np.rad2deg(c.angle):.0f}°, {c.quantity}; its displacement "
        "from rest is in the table."
        for c in measured.seen.corners
    )
    return Picture(
        "outlines",
        f"Outlines in image coordinates (mm) at {loads}. Points: measured outline; line: section "
        f"of {label} with the image plane; grey line: measured rest outline; in the last panel "
        f"also the other models, except those whose line coincides with another.{ringed}",
        f"Measured outline points and the simulated section of {label}, one panel per load "
        f"({loads}).",
        draw(lambda figure: _panels(figure, measured, judged, drawn), WIDTH, height),
    )


def _panels(figure: Figure, measured: _Outlines, judged: _Sections, drawn: list[_Sections]) -> None:
    count, rest = len(measured.holds), closed(measured.measured[0])
    axes, _ = panels(figure, count, _COLUMNS)
    for i, (ax, hold) in enumerate(zip(axes, measured.holds, strict=True)):
        ax.plot(*rest.T, color=_GREY, lw=0.8, label="measured at rest")
        ax.plot(*(_MM * measured.measured[i]).T, ".", color=MEASURED, ms=3, label="measured")
        for d in drawn if i == count - 1 else [judged]:
            look = d.look
            ax.plot(*closed(d.sections[i]).T, color=look.colour, ls=look.dash, lw=look.width,
                    label=d.method.label)  # fmt: skip
        for corner in measured.seen.corners:
            _ring(ax, corner, measured.measured[i], MEASURED)
            _ring(ax, corner, judged.sections[i], judged.look.colour)
        # Axes in image coordinates with some room about all outlines (k, 2) mm; rows of an image
        # count downward
        everything = np.vstack([_MM * o for o in (*measured.measured, *judged.sections)])
        (left, upper), (right, lower) = everything.min(axis=0) - 3, everything.max(axis=0) + 3
        ax.set(xlim=(left, right), ylim=(lower, upper), aspect="equal")
        ax.set(xlabel="image x / mm", ylabel="image y / mm")
        ax.set_title(spaced(hold.label), loc="left", fontsize=8.5)
        ax.label_outer()
    legend_below(figure, axes[-1])


def _ring(ax: Axes, corner: Corner, points: Floats, colour: str) -> None:
    at = _MM * angular_points(points, np.array([corner.angle]))[0]
    ax.plot(*at, "o", mfc="none", mec=colour, ms=8)


def _corner_table(result: Result, loaded: tuple[Held, ...], corner: Corner) -> NumberTable | None:
    """What every method says of a corner beside what was measured."""
    found = {
        m.label: [m.residuals.get(f"{corner.quantity}@{h.label}") for h in loaded]
        for m in result.methods
    }
    rows = {label: row for label, row in found.items() if any(row)}
    if not rows:
        return None
    first = [next((r for r in column if r), None) for column in zip(*rows.values(), strict=True)]
    definition = next(r.definition for r in first if r)
    return NumberTable(
        "",
        f"{corner.quantity} / {shown_unit('m')}: {definition}.",
        ("", *(spaced(h.label) for h in loaded)),
        (
            (TableCell("measured", emphasis="strong"), *(_moved(r, "measured") for r in first)),
            *((label, *(_moved(r, "simulated") for r in row)) for label, row in rows.items()),
        ),
    )


def _moved(residual: Residual | None, who: Literal["measured", "simulated"]) -> TableCell | None:
    return TableCell(getattr(residual, who), "m") if residual else None


# --- every method at the last load ---------------------------------------------------------------


def _at_last(measured: _Outlines, drawn: list[_Sections]) -> Chart:
    """Distances from the measured points around the outline."""
    points, two = measured.measured[-1], np.full(2, 2 * _MM * measured.seen.sd)
    away = points - enclosed(points)[1]
    angle = np.asarray(np.rad2deg(np.mod(np.arctan2(away[:, 1], away[:, 0]), 2 * np.pi)))
    order = np.argsort(angle)
    band = Series("± 2 sd of one point", np.array([0.0, 360.0]), -two, "band", two)
    return Chart(
        "outline_errors",
        f"Distance of the simulated outline from each measured point at "
        f"{spaced(measured.holds[-1].label)}",
        "image angle / °",
        "simulated − measured / mm",
        (band, *(Series(d.method.label, angle[order], _MM * _off(d, measured)[order])
                 for d in drawn)),
        caption="Outward positive. Models whose line coincides with another are left out.",
    )  # fmt: skip
