"""Outlines of a cavity in the image, measured and simulated."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from validate.arrays import Floats
from validate.compare.exhibit import Exhibit, NumberTable, Picture, TableCell
from validate.compare.residual import Residual
from validate.compare.result import MethodResult, Result
from validate.register.outline_geometry import angular_points, enclosed, normal_distances
from validate.register.outlines import Corner, OutlineObservation
from validate.report.animation import moving_outline
from validate.report.loads import at_holds
from validate.report.numbers import shown_unit, spaced, text
from validate.report.observed import (
    Held,
    distinct,
    finished,
    holds,
    outline_seen,
    shown_method,
)
from validate.report.style import ACCEPTED, MEASURED, NOISE, Look, draw, looks

_MM = 1e3
_GREY = "#9A9A9A"


@dataclass(frozen=True)
class _Outlines:
    """The loads and the measured outlines (k, 2) m at them."""

    seen: OutlineObservation
    holds: tuple[Held, ...]
    measured: tuple[Floats, ...]

    @property
    def loads(self) -> str:
        return ", ".join(spaced(h.label) for h in self.holds)


@dataclass(frozen=True)
class _Sections:
    """A method's sections (k, 2) m with the image plane at the loads."""

    method: MethodResult
    look: Look
    sections: tuple[Floats, ...]


def outlines(result: Result) -> Exhibit | None:
    """Outlines at every load, rivals and errors at the last one; None without outlines at loads."""
    judged = shown_method(result)
    seen = outline_seen(judged) if judged else None
    if seen is None or judged is None or not at_holds(judged.registered[0], judged.run):
        return None
    at = holds(judged.registered[0])
    measured = _Outlines(seen, at, tuple(seen.measured(h.t) for h in at))
    drawn = _drawn(result, measured)
    first = next(d for d in drawn if d.method is judged)
    return Exhibit(
        "outlines",
        "Outlines in the image",
        tables=tuple(t for c in seen.corners if (t := _corner_table(result, at[1:], c))),
        pictures=(*moving_outline(judged), _by_load(measured, first), _at_last(measured, drawn)),
    )


def _drawn(result: Result, measured: _Outlines) -> list[_Sections]:
    """Methods whose outlines do not lie on each other at the last load."""
    styles, found = looks(result), []
    for method in finished(result):
        seen = outline_seen(method)
        if seen is not None:
            sections = tuple(seen.simulated(u) for u in method.run.u[: len(measured.holds)])
            found.append(_Sections(method, styles[method.name], sections))
    on = distinct([(d.method, _off(d, measured)) for d in found])
    return [d for d in found if d.method.name not in on]


def _off(drawn: _Sections, measured: _Outlines) -> Floats:
    """Distances (k,) m of the section from the measured points at the last load, outward."""
    return normal_distances(drawn.sections[-1], measured.measured[-1])


def _closed(points: Floats) -> Floats:
    return np.asarray(_MM * np.vstack([points, points[:1]]))


# --- every load ----------------------------------------------------------------------------------


def _by_load(measured: _Outlines, judged: _Sections) -> Picture:
    width = 2.6 * len(measured.holds) + 0.4
    label, loads = judged.method.label, measured.loads
    ringed = "".join(
        f" Ringed: the image angle {np.rad2deg(c.angle):.0f}°, {c.quantity}; its displacement "
        "from rest is written below."
        for c in measured.seen.corners
    )
    return Picture(
        "outlines",
        f"Outlines in image coordinates at {loads}, mm. Points: measured outline; line: section of "
        f"{label} with the image plane; grey line: measured rest outline.{ringed}",
        f"Measured outline points and the simulated section of {label}, one panel per load "
        f"({loads}).",
        draw(lambda figure: _panels(figure, measured, judged), width, 4.3),
    )


def _panels(figure: Figure, measured: _Outlines, judged: _Sections) -> None:
    count, rest = len(measured.holds), _closed(measured.measured[0])
    axes = figure.subplots(1, count, sharex=True, sharey=True, squeeze=False)[0]
    for i, (ax, hold) in enumerate(zip(axes, measured.holds, strict=True)):
        ax.plot(*rest.T, color=_GREY, lw=0.8, label="measured at rest")
        ax.plot(*(_MM * measured.measured[i]).T, ".", color=MEASURED, ms=3, label="measured")
        ax.plot(*_closed(judged.sections[i]).T, color=ACCEPTED, label=judged.method.label)
        for corner in measured.seen.corners:
            _ring(ax, corner, (measured.measured[i], judged.sections[i]))
        _write(ax, [r for c in measured.seen.corners if (r := _residual(judged.method, c, hold))])
        ax.set(title=spaced(hold.label), aspect="equal", xlabel="image x / mm")
    _in_view(axes[0], [*measured.measured, *judged.sections], below=9)
    axes[0].set_ylabel("image y / mm")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3)


def _in_view(ax: Axes, outlines: Sequence[Floats], below: float) -> None:
    """All outlines with some room, `below` mm under them; rows of an image count downward."""
    everything = _MM * np.vstack(outlines)
    low, high = everything.min(axis=0), everything.max(axis=0)
    ax.set_xlim(low[0] - 3, high[0] + 3)
    ax.set_ylim(high[1] + below, low[1] - 3)


def _ring(ax: Axes, corner: Corner, pair: tuple[Floats, Floats]) -> None:
    for points, colour in zip(pair, (MEASURED, ACCEPTED), strict=True):
        at = _MM * angular_points(points, np.array([corner.angle]))[0]
        ax.plot(*at, "o", mfc="none", mec=colour, ms=8)


def _residual(method: MethodResult, corner: Corner, hold: Held) -> Residual | None:
    return method.residuals.get(f"{corner.quantity}@{hold.label}")


def _write(ax: Axes, moved: list[Residual]) -> None:
    words = "\n".join(
        f"{r.quantity}\nmeasured {text(r.measured, 'm')} mm\nsimulated {text(r.simulated, 'm')} mm"
        for r in moved
    )
    ax.text(0.04, 0.03, words, transform=ax.transAxes, va="bottom", fontsize=8)


def _corner_table(result: Result, loaded: tuple[Held, ...], corner: Corner) -> NumberTable | None:
    """What every method says of a corner beside what was measured."""
    found = {m.label: [_residual(m, corner, h) for h in loaded] for m in result.methods}
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


def _at_last(measured: _Outlines, drawn: list[_Sections]) -> Picture:
    load = spaced(measured.holds[-1].label)
    names = ", ".join(d.method.label for d in drawn)
    return Picture(
        "outline_models",
        f"The outline at {load} by model. Left: image coordinates, mm. Right: "
        "distance of the simulated outline from each measured point, mm, outward positive, against "
        "the polar angle in the image; grey: ± 2 standard deviations of one measured point. Models "
        "whose line would lie on another's are left out.",
        f"Measured outline at {load} with the sections of {names}, and their "
        "distances from the measured points around the outline.",
        draw(lambda figure: _zoom_and_errors(figure, measured, drawn), 10.4, 4.9),
    )


def _zoom_and_errors(figure: Figure, measured: _Outlines, drawn: list[_Sections]) -> None:
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.35))
    points, sd = measured.measured[-1], _MM * measured.seen.sd
    left.plot(*(_MM * points).T, ".", color=MEASURED, ms=4.5, label="measured")
    angle = _angles(points)
    order = np.argsort(angle)
    right.axhspan(-2 * sd, 2 * sd, color=NOISE, lw=0)
    right.axhline(0, color=MEASURED, lw=0.8)
    for d in drawn:
        style = {"color": d.look.colour, "ls": d.look.dash}
        thin = d.look.width if d.look.colour == ACCEPTED else max(0.6 * d.look.width, 1)
        left.plot(*_closed(d.sections[-1]).T, **style, lw=thin, label=d.method.label)
        right.plot(angle[order], _MM * _off(d, measured)[order], **style, lw=d.look.width)
    left.set(xlabel="image x / mm", ylabel="image y / mm", aspect="equal")
    left.invert_yaxis()
    _by_angle(right, measured.seen.corners)
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=3)


def _angles(points: Floats) -> Floats:
    """Polar angles (k,) degrees in the image about the middle of the area inside."""
    away = points - enclosed(points)[1]
    return np.asarray(np.rad2deg(np.mod(np.arctan2(away[:, 1], away[:, 0]), 2 * np.pi)))


def _by_angle(ax: Axes, named: tuple[Corner, ...]) -> None:
    ax.set(xlabel="image angle / °", ylabel="simulated − measured / mm", xlim=(0, 360))
    ax.set_xticks(range(0, 361, 45))
    for corner in named:
        at = np.rad2deg(corner.angle)
        ax.axvline(at, color=_GREY, lw=0.8, ls=":")
        ax.text(at + 3, 0.985, corner.quantity, color="#5A5A5A", va="top",
                transform=ax.get_xaxis_transform())  # fmt: skip
