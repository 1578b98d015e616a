"""Images of a recording with outlines, fitted circles and simulated sections."""

from collections.abc import Sequence
from dataclasses import dataclass
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from validate.arrays import Floats
from validate.compare.exhibit import ImageSeries, Picture, Pixels
from validate.errors import RegistrationError
from validate.numbers import spaced, with_unit
from validate.recording.types import Contours, Frames, Recording
from validate.register.observation import nearest_sample
from validate.register.outlines.sections import Circle
from validate.report.charts.style import WIDTH, draw, legend_below
from validate.report.sections.observations import Held

_MM = 1e3
_COLUMNS = 2
_SERIES, _SIDE = 12, 4.8  # images that a slider goes through at most, and inches across one
_ROOM = 1.1  # inches of labels and legend
_FOUND, _FITTED = "#F0E442", "#56B4E9"  # light, on dark images
_SIMULATED = "#FF9F1C"
_ROUND = 0.05  # rms distance over radius to which an outline is round
_SAID = "#FF77BB"
_DASH, _DOTS = (0, (4, 3)), (0, (1, 1.5))
_ANGLES = np.linspace(0, 2 * np.pi, 121)
_AROUND = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)])


@dataclass(frozen=True)
class PlaceSaid:
    """A place in the first image: centre (2,) m, and a radius m about it where one is known;
    `certain` where a user said it."""

    label: str
    centre: Floats
    radius: float | None
    certain: bool = False


@dataclass(frozen=True)
class _ImageLine:
    """Points (2, k) mm of a line; of one point a cross."""

    label: str
    colour: str
    dash: Any
    points: Floats


def closed(points: Floats) -> Floats:
    """Return an outline (k, 2) m as a closed line (k + 1, 2) mm."""
    return np.asarray(_MM * np.vstack([points, points[:1]]))


def outline_images(
    recording: Recording,
    topic: str,
    holds: tuple[Held, ...],
    sections: tuple[Floats, ...],
    label: str,
) -> tuple[tuple[ImageSeries, Picture], ...]:
    """Return the images at the loads with the `sections` (k, 2) m of the method `label`, for a
    slider and as one picture; none where outlines `topic` were not found in any."""
    contours = recording.contours.get(topic)
    frames = recording.frames.get(contours.images) if contours is not None else None
    if contours is None or frames is None:
        return ()
    words = f"Dotted, orange: the section of {label}, which is compared with the outline."
    simulated = (f"simulated: {label}", sections)
    at = [(hold.label, hold.t) for hold in holds]
    return (outlines_over(frames, contours, at, "at the loads", words, simulated),)


def outlines_over(
    frames: Frames,
    contours: Contours,
    at: Sequence[tuple[str, float]],
    which: str,
    words: str,
    simulated: tuple[str, tuple[Floats, ...]] = ("", ()),
    marks: tuple[PlaceSaid, ...] = (),
) -> tuple[ImageSeries, Picture]:
    """Return the images nearest to instants `at`, each a label and s, with outlines, with circles
    where the first outline is round, with what was `simulated` then, and `marks` in the first:
    up to twelve for a slider, and all as one picture. `which` they are, and `words` on what they
    are for, stand in the caption."""
    holds = tuple(Held(label, 0.0, "1", t) for label, t in at)
    circles = [_circle(contours, hold) for hold in holds]
    if circles[0] is None or circles[0].rms > _ROUND * circles[0].radius:
        circles = [None] * len(holds)
    fitted = ""
    if any(circles):
        each = zip(holds, circles, strict=True)
        fitted = (
            " and the circle through it (dashed, blue). Radius of that circle and rms distance of "
            f"the outline from it: {'; '.join(f'{spaced(h.label)}: {_told(c)}' for h, c in each)}"
        )
    lines = []
    for hold, circle in zip(holds, circles, strict=True):
        lines.append([_ImageLine("outline found", _FOUND, "-", closed(_outline(contours, hold)).T)])
        if circle is not None:
            around = _MM * (circle.centre[:, None] + circle.radius * _AROUND)
            lines[-1].append(_ImageLine("circle through it", _FITTED, _DASH, around))
    for drawn, section in zip(lines, simulated[1], strict=False):
        drawn.append(_ImageLine(simulated[0], _SIMULATED, ":", closed(section).T))
    lines[0] += [_marked(mark) for mark in marks]
    rows = -(-len(holds) // _COLUMNS)
    tall = frames.images[0].shape[0] * frames.m_per_px[1]
    wide = frames.images[0].shape[1] * frames.m_per_px[0]
    panel = float(np.clip(0.42 * WIDTH * tall / wide, 1.2, 4.0)) + 0.35
    caption = (
        f"The images '{contours.images}' {which}, image coordinates in mm, with the outline that "
        f"was found in each (solid, yellow){fitted}. {words}"
    )
    alt = f"{len(holds)} images with the outline found in each" + (
        " and the circle fitted to it." if any(circles) else "."
    )
    height = float(np.clip((_SIDE - 0.8) * tall / wide, 1.5, 5.5)) + 0.7
    shown = np.unique(np.linspace(0, len(holds) - 1, min(len(holds), _SERIES)).round().astype(int))

    def one(i: int) -> Pixels:
        return draw(lambda f: _image_axes(f.subplots(), frames, holds[i], lines[i]), _SIDE, height)

    series = ImageSeries(
        "outline_series",
        caption,
        alt,
        tuple(one(i) for i in shown.tolist()),
        tuple(_named(frames, holds[i]) for i in shown.tolist()),
    )
    pixels = draw(lambda f: _panels(f, frames, holds, lines), WIDTH, panel * rows + _ROOM)
    return series, Picture("outline_images", caption, alt, pixels, photo=True)


def _outline(contours: Contours, hold: Held) -> Floats:
    return contours.outlines[nearest_sample(contours.t, hold.t, "outlines")]


def _circle(contours: Contours, hold: Held) -> Circle | None:
    try:
        return Circle.fit(_outline(contours, hold), contours.sd)
    except RegistrationError:
        return None  # an outline pressed flat is none


def _told(circle: Circle | None) -> str:
    if circle is None:
        return "no circle"
    return f"{with_unit(circle.radius, 'm')} ({with_unit(circle.rms, 'm', 2)})"


def _panels(
    figure: Figure,
    frames: Frames,
    holds: tuple[Held, ...],
    lines: list[list[_ImageLine]],
) -> None:
    rows = -(-len(holds) // _COLUMNS)
    grid = figure.subplots(rows, _COLUMNS, sharex=True, sharey=True, squeeze=False)
    for ax, hold, drawn in zip(grid.flat, holds, lines, strict=False):
        _image_axes(ax, frames, hold, drawn)
        ax.set_title(fill(_named(frames, hold), 36), loc="left", fontsize=8.5)
        ax.label_outer()
    for ax in grid.flat[len(holds) :]:
        ax.set_axis_off()
    legend = legend_below(figure, grid[0, 0])
    legend.set_frame_on(True)
    legend.get_frame().set(facecolor="#303030", edgecolor="#303030")
    for text in legend.get_texts():
        text.set_color("white")


def _named(frames: Frames, hold: Held) -> str:
    """The load, and the image that is nearest to it."""
    at = nearest_sample(frames.t, hold.t, "images")
    return f"{spaced(hold.label)}, image {at}, t = {frames.t[at]:.4g} s"


def _image_axes(ax: Axes, frames: Frames, hold: Held, lines: list[_ImageLine]) -> None:
    # Pixel centres at their image metres; rows count downward
    i = nearest_sample(frames.t, hold.t, "images")
    x, y = (_MM * side for side in frames.m_per_px)
    height, width = frames.images[i].shape
    extent = (-0.5 * x, (width - 0.5) * x, (height - 0.5) * y, -0.5 * y)
    ax.imshow(frames.images[i], cmap="gray", vmin=0, vmax=255, extent=extent, aspect="equal")
    ax.grid(visible=False)
    for line in lines:
        if line.points.shape[1] == 1:  # a place without a size
            ax.plot(*line.points, "+", color=line.colour, ms=9, mew=1.8, label=line.label)
            continue
        # With a dark seam, to be seen on light and dark pixels and on grey paper
        known = ax.get_legend_handles_labels()[1]
        label = line.label if line.label not in known else None
        ax.plot(*line.points, color="black", lw=2.8, alpha=0.6)
        ax.plot(*line.points, color=line.colour, ls=line.dash, lw=1.4, label=label)
    ax.set(xlabel="image x / mm", ylabel="image y / mm")


def _marked(mark: PlaceSaid) -> _ImageLine:
    points = _MM * mark.centre[:, None]
    if mark.radius is not None:
        points = points + _MM * mark.radius * _AROUND
    return _ImageLine(mark.label, _SAID if mark.certain else _SIMULATED, _DOTS, points)
