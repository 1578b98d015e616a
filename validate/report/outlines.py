"""Outlines of the inclusion in the image, measured and simulated (paper 000, figure 7)."""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from validate.arrays import Floats
from validate.compare.outline import angular_points, enclosed
from validate.compare.residual import TOP_LEFT
from validate.compare.result import MethodResult, Result
from validate.register.observe import Hold, OutlineObservation, nearest_sample
from validate.report.animation import moving_outline
from validate.report.numbers import shown_unit, spaced, text
from validate.report.observed import at_loads, distinct, outline_seen, shown_method
from validate.report.page import Cell, Picture, Section, Table, section
from validate.report.style import ACCEPTED, MEASURED, NOISE, Look, draw, looks

_MM = 1e3


@dataclass(frozen=True)
class _Drawn:
    """A method's sections (k, 2) m at the holds."""

    method: MethodResult
    look: Look
    sections: tuple[Floats, ...]


def outlines(result: Result) -> Section | None:
    """Outlines at every load, rivals and errors at the last one; None without outlines at loads."""
    judged = shown_method(result)
    seen = outline_seen(judged) if judged else None
    if seen is None or judged is None or not at_loads(judged):
        return None
    holds = result.registered[0].holds
    measured = tuple(seen.outlines[nearest_sample(seen.t, h.t, "outlines")] for h in holds)
    drawn = _drawn(result, len(holds))
    return section(
        "outlines",
        "Outlines of the inclusion",
        moving_outline(result, judged),
        _by_load(holds, measured, next(d for d in drawn if d.method is judged)),
        _at_last(holds[-1], measured[-1], drawn, seen),
        _top_left_table(result, holds),
    )


def _drawn(result: Result, count: int) -> list[_Drawn]:
    styles, found = looks(result), []
    for method in distinct(result, "contour"):
        seen = outline_seen(method)
        if seen is not None:
            sections = tuple(seen.simulated(u) for u in method.run.u[:count])
            found.append(_Drawn(method, styles[method.name], sections))
    return found


def _closed(points: Floats) -> Floats:
    return np.asarray(_MM * np.vstack([points, points[:1]]))


def _by_load(holds: tuple[Hold, ...], measured: tuple[Floats, ...], judged: _Drawn) -> Picture:
    pixels = draw(
        lambda figure: _panels(figure, holds, measured, judged), 2.6 * len(holds) + 0.4, 4.3
    )
    loads = ", ".join(spaced(h.label) for h in holds)
    return Picture(
        "outlines",
        f"Outlines in image coordinates at {loads} stage displacement: x lateral, y depth below "
        f"the probe, mm. Points: measured outline; line: section of {judged.method.label} with the "
        "image plane; grey line: measured rest outline. Ringed: the top left corner (225°), whose "
        "displacement from rest is written below (the paper's figure 7 and its 3.3 and 3.71 mm).",
        f"Measured outline points and the simulated section of {judged.method.label}, one panel "
        f"per load ({loads}), probe at the top.",
        pixels,
    )


def _panels(
    figure: Figure, holds: tuple[Hold, ...], measured: tuple[Floats, ...], judged: _Drawn
) -> None:
    axes = figure.subplots(1, len(holds), sharex=True, sharey=True, squeeze=False)[0]
    everything = _MM * np.vstack([*measured, *judged.sections])
    low, high = everything.min(axis=0), everything.max(axis=0)
    for i, (ax, hold) in enumerate(zip(axes, holds, strict=True)):
        rest = _closed(measured[0])
        ax.plot(rest[:, 0], rest[:, 1], color="#9A9A9A", lw=0.8, label="measured at rest")
        ax.plot(*(_MM * measured[i]).T, ".", color=MEASURED, ms=3, label="measured")
        line = _closed(judged.sections[i])
        ax.plot(line[:, 0], line[:, 1], color=ACCEPTED, label=judged.method.label)
        _mark_top_left(ax, measured, judged, i)
        ax.set_title(spaced(hold.label))
        ax.set_aspect("equal")
        ax.set_xlabel("x lateral / mm")
        ax.axhline(0, color="#5A5A5A", lw=3)
        ax.text(0.98, 1.2, "probe", transform=ax.get_yaxis_transform(), va="top", ha="right")
    axes[0].set_ylabel("y depth / mm")
    axes[0].set_xlim(low[0] - 3, high[0] + 3)
    axes[0].set_ylim(high[1] + 9, -0.7)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3)


def _mark_top_left(ax: Axes, measured: tuple[Floats, ...], judged: _Drawn, i: int) -> None:
    angle = np.array([TOP_LEFT])
    at = [angular_points(o, angle)[0] for o in (measured[i], judged.sections[i])]
    start = [angular_points(o, angle)[0] for o in (measured[0], judged.sections[0])]
    ax.plot(*(_MM * at[0]), "o", mfc="none", mec=MEASURED, ms=8)
    ax.plot(*(_MM * at[1]), "o", mfc="none", mec=ACCEPTED, ms=8)
    if i == 0:
        return
    moved = [float(np.linalg.norm(a - s)) for a, s in zip(at, start, strict=True)]
    words = f"top left moved\nmeasured {text(moved[0], 'm')} mm\nsimulated {text(moved[1], 'm')} mm"
    ax.text(0.04, 0.03, words, transform=ax.transAxes, va="bottom", fontsize=8)


def _at_last(
    hold: Hold, measured: Floats, drawn: list[_Drawn], seen: OutlineObservation
) -> Picture:
    pixels = draw(lambda figure: _zoom_and_errors(figure, hold, measured, drawn, seen), 10.4, 4.9)
    names = ", ".join(d.method.label for d in drawn)
    return Picture(
        "outline_models",
        f"The outline at {spaced(hold.label)} by model. Left: image coordinates, mm. Right: "
        "distance of the simulated outline from each measured point, mm, outward positive, against "
        "the polar angle in the image; grey: ± 2 standard deviations of one measured point. Models "
        "whose line would lie on another's are left out.",
        f"Measured outline at {spaced(hold.label)} with the sections of {names}, and their "
        "distances from the measured points around the outline.",
        pixels,
    )


def _zoom_and_errors(
    figure: Figure, hold: Hold, measured: Floats, drawn: list[_Drawn], seen: OutlineObservation
) -> None:
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.35))
    left.plot(*(_MM * measured).T, ".", color=MEASURED, ms=4.5, label="measured")
    away = measured - enclosed(measured)[1]
    angle = np.rad2deg(np.mod(np.arctan2(away[:, 1], away[:, 0]), 2 * np.pi))
    order = np.argsort(angle)
    right.axhspan(-2 * _MM * seen.sd, 2 * _MM * seen.sd, color=NOISE, lw=0)
    right.axhline(0, color=MEASURED, lw=0.8)
    for d in drawn:
        line = _closed(d.sections[-1])
        width = 0.6 * d.look.width if d.look.colour != ACCEPTED else d.look.width
        left.plot(
            *line.T, color=d.look.colour, ls=d.look.dash, lw=max(width, 1), label=d.method.label
        )
        off = _MM * d.method.residuals[f"contour@{hold.label}"].values[:, 0]
        right.plot(angle[order], off[order], color=d.look.colour, ls=d.look.dash, lw=d.look.width)
    left.set(xlabel="x lateral / mm", ylabel="y depth / mm", aspect="equal")
    left.invert_yaxis()
    right.set(xlabel="image angle / ° (270° faces the probe)", ylabel="simulated − measured / mm")
    right.set_xlim(0, 360)
    right.set_xticks(range(0, 361, 45))
    right.axvline(np.rad2deg(TOP_LEFT), color="#9A9A9A", lw=0.8, ls=":")
    right.text(np.rad2deg(TOP_LEFT) + 3, 0.985, "top left", color="#5A5A5A", va="top",
               transform=right.get_xaxis_transform())  # fmt: skip
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=3)


def _top_left_table(result: Result, holds: tuple[Hold, ...]) -> Table | None:
    rows = []
    for method in result.methods:
        found = [method.residuals.get(f"contour.top_left@{h.label}") for h in holds[1:]]
        if any(r is not None for r in found):
            rows.append(
                (Cell(method.label), *(Cell(text(r.simulated if r else None, "m")) for r in found))
            )
    if not rows:
        return None
    first = [
        next((m.residuals[k] for m in result.methods if k in m.residuals), None)
        for k in (f"contour.top_left@{h.label}" for h in holds[1:])
    ]
    measured = (
        Cell("measured", "strong"),
        *(Cell(text(r.measured if r else None, "m"), "strong") for r in first),
    )
    return Table(
        f"Displacement of the top left corner (225°) from rest, {shown_unit('m')}.",
        ("", *(spaced(h.label) for h in holds[1:])),
        (measured, *rows),
    )
