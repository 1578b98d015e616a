"""Animation of an outline over the load: measured over simulated."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from validate.arrays import Floats
from validate.compare.exhibit import Animation
from validate.compare.result import MethodResult
from validate.report.charts.style import ACCEPTED, MEASURED, film, legend_below
from validate.report.scenes.loads import HOW, Instant, in_steps
from validate.report.sections.observations import drive, holds, outline_seen
from validate.report.views.numbers import fixed_with_unit, spaced

_MM = 1e3
_SIDE = 4.8  # inches of a picture
_STEPS = 24  # pictures over the whole load, about
_BEFORE = "#A0A0A0"  # what was measured at an earlier load
_STILL, _HELD, _MOVING = 2000, 1000, 90  # ms


@dataclass(frozen=True)
class _Shot:
    """One picture: outlines (k, 2) mm in image coordinates and what stands above them."""

    simulated: Floats
    measured: Floats
    held: bool
    title: str


def moving_outline(method: MethodResult) -> tuple[Animation, ...]:
    """Return the last load first, as the still; then from rest through all loads. None without
    loads."""
    seen = outline_seen(method)
    count = min(len(holds(method.registered[0])), len(method.run.u)) if method.registered else 0
    if seen is None or count < 2:
        return ()
    shots, measured = list[_Shot](), seen.outlines[0]
    for instant in in_steps(method.registered[0], method.run, max(1, round(_STEPS / (count - 1)))):
        if instant.hold is not None:
            measured = seen.measured(instant.t)
        shots.append(_shot(seen.simulated(instant.u), measured, instant))
    return (_film([shots[-1], *shots[:-1]], method.label, drive(method.registered[0]).name),)


def _film(shots: list[_Shot], label: str, driven: str) -> Animation:
    times = [_STILL, *(_HELD if shot.held else _MOVING for shot in shots[1:])]
    return Animation(
        "outline",
        "The outline during loading, repeated; image coordinates in mm. "
        "Points: measured at the load in the title (black) or at the previous load (grey). "
        f"Line: section of {label}, computed at the loads, {HOW}. Thin line: measured at rest. "
        f"The still image shows {shots[0].title}.",
        f"Animation: the measured outline points over the simulated outline of {label} from rest "
        f"to {shots[0].title}; the still image shows the last load.",
        film(lambda figure: _paint(figure, shots, label, driven), len(shots), _SIDE, _SIDE),
        tuple(times),
    )


def _shot(simulated: Floats, measured: Floats, instant: Instant) -> _Shot:
    if instant.hold is not None:
        title = spaced(instant.hold.label)
    else:
        title = f"{fixed_with_unit(instant.drive, instant.unit, 1)}, interpolated"
    return _Shot(closed(simulated), _MM * measured, instant.hold is not None, title)


def closed(points: Floats) -> Floats:
    """Return an outline (k, 2) m as a closed line (k + 1, 2) mm."""
    return np.asarray(_MM * np.vstack([points, points[:1]]))


def image_axes(ax: Axes, outlines: Iterable[Floats]) -> None:
    """Axes in image coordinates with some room about all outlines (k, 2) mm; rows of an image
    count downward."""
    everything = np.vstack(list(outlines))
    (left, upper), (right, lower) = everything.min(axis=0) - 3, everything.max(axis=0) + 3
    ax.set(xlim=(left, right), ylim=(lower, upper), aspect="equal")
    ax.set(xlabel="image x / mm", ylabel="image y / mm")


def _paint(
    figure: Figure, shots: list[_Shot], label: str, driven: str
) -> Callable[[int], tuple[Artist, ...]]:
    ax = figure.subplots()
    rest = np.vstack([shots[1].measured, shots[1].measured[:1]])
    ax.plot(*rest.T, color="#9A9A9A", lw=0.8, label="measured at rest")
    (points,) = ax.plot([], [], ".", color=MEASURED, ms=4, label="measured")
    (line,) = ax.plot([], [], color=ACCEPTED, label=label)
    image_axes(ax, (o for s in shots for o in (s.simulated, s.measured)))
    legend_below(figure, ax, _SIDE)

    def turn(i: int) -> tuple[Artist, ...]:
        shot = shots[i]
        line.set_data(*shot.simulated.T)
        points.set_data(*shot.measured.T)
        points.set_color(MEASURED if shot.held else _BEFORE)
        return points, line, ax.set_title(f"{driven} at {shot.title}")

    return turn
