"""Figures of markers at the load steps: vectors, in-plane positions, out-of-plane motion."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection
from matplotlib.figure import Figure

from validate.arrays import Floats
from validate.compare.exhibit import Exhibit, Picture
from validate.compare.result import MethodResult, Result
from validate.numbers import spaced, with_unit
from validate.register.markers.markers import MarkerObservation
from validate.register.observation import nearest_sample
from validate.report.charts.style import (
    ACCEPTED,
    MEASURED,
    WIDTH,
    Style,
    draw,
    legend_below,
    legend_height,
    looks,
    panels,
)
from validate.report.scenes.body import flattest
from validate.report.sections.observations import (
    Held,
    axis_label,
    distinct,
    finished,
    markers_seen,
    shown_loads,
    shown_method,
)

_MM = 1e3
# Wide and pale under thin and black: they are told apart on grey paper too.
_WIDE: Mapping[str, Any] = {"color": ACCEPTED, "alpha": 0.45, "width": 0.014, "headwidth": 2.2,
                            "headlength": 2.2, "headaxislength": 2.2}  # fmt: skip
_THIN: Mapping[str, Any] = {"color": MEASURED, "width": 0.005, "headwidth": 3.5, "headlength": 4}
_PANEL, _ROOM = 2.9, 1.2  # inches of a row of panels at most, of labels and legend
_FLAT, _TITLE = 0.8, 0.7  # inches of a row at least; of it, what is no panel
_NARROW = 0.6  # of the longer side of a panel: the shorter is no less, as of markers in a line
_LINE = 1 / 3  # of the spread along one axis: less along the other is a line along the one
_BANDS = 7  # groups of neighbours that a line joins


@dataclass(frozen=True)
class _Seen:
    """The markers, the loads after rest, and the axes that the markers spread along or lie across.

    `frames` are the runs' at rest and the loads, `across` is None in 2-D; labels of all axes say
    along which the body is driven.
    """

    markers: MarkerObservation
    rest: Held
    loaded: tuple[Held, ...]
    frames: tuple[int, ...]
    plane: list[int]
    across: int | None
    labels: tuple[str, ...]

    def at(self, hold: Held) -> Floats:
        """The measured positions (k, d) m."""
        return np.asarray(self.markers.x[nearest_sample(self.markers.t, hold.t, "markers")])

    @property
    def along(self) -> int:
        """The axis of the plane along which they are spread: the first, but for a line on the
        other."""
        first, second = np.ptp(self.markers.rest[:, self.plane], axis=0)
        return self.plane[0] if first >= _LINE * second else self.plane[1]


def markers(result: Result) -> Exhibit | None:
    """Vectors and positions at every load, motion across their plane; None without loads."""
    judged = shown_method(result)
    seen = markers_seen(judged) if judged else None
    at, frames = shown_loads(judged) if judged and seen else ((), ())
    if seen is None or judged is None or len(at) < 2:
        return None
    rest, *loaded = at
    plane, across = flattest(seen.rest)
    labels = tuple(axis_label(judged.scene, i) for i in range(seen.rest.shape[1]))
    shown = _Seen(seen, rest, tuple(loaded), frames, plane, across, labels)
    pictures = (_in_plane(shown, judged), *_across(result, shown))
    return Exhibit("markers", "Markers", pictures=pictures)


# --- in their plane ------------------------------------------------------------------------------


def _in_plane(seen: _Seen, judged: MethodResult) -> Picture:
    count = len(seen.loaded)
    along = "" if seen.across is None else f", seen along {'xyz'[seen.across]}"
    # The height of a row, so that panels to scale fill it
    places = seen.at(seen.rest)[:, seen.plane]
    wide, high = np.maximum(np.nanmax(places, axis=0) - np.nanmin(places, axis=0), 1e-9)
    row = float(np.clip(WIDTH / 2 * high / wide + _TITLE, _FLAT + _TITLE, _PANEL))
    return Picture(
        "markers",
        f"The markers in the plane of {' and '.join('xyz'[i] for i in seen.plane)}{along}, mm. "
        "Left: displacement from "
        f"rest, measured (thin, black) and {judged.label} (wide, blue), to scale. Right: measured "
        f"positions as circles of the declared noise ({with_unit(seen.markers.sd, 'm')} per axis), "
        "the simulated ones as dots. If the model is right, about four dots in ten lie in their "
        "circle.",
        f"Marker displacement vectors and positions for {count} loads, measured and simulated.",
        draw(lambda f: _panels(f, seen, judged), WIDTH, row * count + _ROOM),
    )


def _panels(figure: Figure, seen: _Seen, judged: MethodResult) -> None:
    axes = figure.subplots(len(seen.loaded), 2, sharex=True, sharey=True, squeeze=False)
    start, rest = _MM * seen.at(seen.rest)[:, seen.plane], _MM * seen.markers.rest[:, seen.plane]
    shown = [start, rest]
    for i, hold in enumerate(seen.loaded):
        simulated = _MM * seen.markers.simulated(judged.run.u[seen.frames[i + 1]])[:, seen.plane]
        measured = _MM * seen.at(hold)[:, seen.plane]
        shown += [simulated, measured]
        left, right = axes[i]
        _vectors(left, rest, simulated, _WIDE, judged.label)
        _vectors(left, start, measured, _THIN, "measured")
        _circles(right, measured, _MM * seen.markers.sd)
        right.plot(*simulated.T, ".", color=ACCEPTED, ms=4.5, label=judged.label)
        left.set_title(f"{spaced(hold.label)}: displacement", loc="left", fontsize=8.5)
        right.set_title(f"{spaced(hold.label)}: position", loc="left", fontsize=8.5)
        left.set_ylabel(seen.labels[seen.plane[1]])
        for ax in (left, right):
            ax.set_aspect("equal")
    xlim, ylim = _limits(np.concatenate(shown))
    axes[0, 0].set(xlim=xlim, ylim=ylim)  # those of all panels
    for ax in axes[-1]:
        ax.set_xlabel(seen.labels[seen.plane[0]])
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2)


def _limits(points: Floats) -> Floats:
    """From and to (2, 2) along both axes, around points (k, 2) with a margin."""
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    half = (high - low) / 2
    half = 1.1 * np.maximum(half, max(_NARROW * half.max(), 1e-9))
    middle = (low + high) / 2
    return np.asarray(np.stack([middle - half, middle + half], axis=1))


def _vectors(ax: Axes, start: Floats, end: Floats, look: Mapping[str, Any], label: str) -> None:
    ax.quiver(
        *start.T, *(end - start).T, angles="xy", scale_units="xy", scale=1, label=label, **look
    )


def _circles(ax: Axes, centres: Floats, sd: float) -> None:
    there = centres[np.isfinite(centres).all(axis=1)]
    size = np.full(len(there), 2 * sd)
    ax.add_collection(
        EllipseCollection(
            size, size, np.zeros(len(there)), units="xy", offsets=there,
            transOffset=ax.transData, facecolors="none", edgecolors=MEASURED, linewidths=0.9,
        )
    )  # fmt: skip
    ax.plot(*there.T, ",", color="none")


# --- across it -----------------------------------------------------------------------------------


def _across(result: Result, seen: _Seen) -> tuple[Picture, ...]:
    if seen.across is None:
        return ()
    c, styles = seen.across, looks(result)
    own = {m.name: o for m in finished(result) if (o := markers_seen(m)) is not None}
    known = [m for m in finished(result) if m.name in own]
    on = distinct([(m, own[m.name].positions.apply(m.run.u[seen.frames[-1]])[:, c]) for m in known])
    drawn = [(m, styles[m.name]) for m in known if m.name not in on]
    x, labels = "xyz"[seen.along], [m.label for m, _ in drawn]
    height = 2.2 * -(-len(seen.loaded) // 2) + 0.6 + legend_height(["measured", *labels])
    made = Picture(
        "markers_across",
        f"Displacement of the markers along {'xyz'[c]} from rest against their {x}, mm. Bars: ± 1 "
        "standard deviation of a measured displacement (√2 times the declared noise). Each model's "
        f"line joins the mean of markers of equal rank in {x}.",
        f"Displacement of the markers along {'xyz'[c]} against {x} for each load: measured and "
        f"{', '.join(labels)}.",
        draw(lambda f: _across_panels(f, seen, c, drawn), WIDTH, height),
    )
    return (made,)


def _across_panels(
    figure: Figure, seen: _Seen, c: int, drawn: list[tuple[MethodResult, Style]]
) -> None:
    columns = min(len(seen.loaded), 2)
    axes, lowest = panels(figure, len(seen.loaded), columns)
    x, start = _MM * seen.markers.rest[:, seen.along], seen.at(seen.rest)[:, c]
    for i, (ax, hold) in enumerate(zip(axes, seen.loaded, strict=True), start=1):
        ax.errorbar(x, _MM * (seen.at(hold)[:, c] - start), np.sqrt(2) * _MM * seen.markers.sd,
                    fmt=".", color=MEASURED, ecolor="#A0A0A0", ms=4, lw=0.8,
                    label="measured")  # fmt: skip
        for method, look in drawn:
            own = markers_seen(method)
            assert own is not None
            y = _MM * own.positions.apply(method.run.u[seen.frames[i]])[:, c]
            groups = np.array_split(np.argsort(x, kind="stable"), min(_BANDS, len(x)))
            line = np.array([x[g].mean() for g in groups]), np.array([y[g].mean() for g in groups])
            ax.plot(*line, color=look.colour, ls=look.dash, lw=look.width, marker=look.point, ms=4,
                    label=method.label)  # fmt: skip
        ax.set_title(spaced(hold.label), loc="left", fontsize=8.5)
    for ax in lowest:
        ax.set_xlabel(seen.labels[seen.along])
    figure.supylabel(f"displacement along {'xyz'[c]} / mm", fontsize="medium")
    legend_below(figure, axes[0])
