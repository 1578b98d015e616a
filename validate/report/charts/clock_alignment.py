"""Chart of two channels on one clock, for a visual check of their alignment."""

from matplotlib.figure import Figure

from validate.compare.exhibit import Picture
from validate.recording.types import Signal
from validate.report.charts.style import WIDTH, draw, legend_below

_HEIGHT = 3.2  # inches
_COLOURS = ("#0072B2", "#D55E00")


def aligned(one: Signal, other: Signal, names: tuple[str, str], seconds: float) -> Picture:
    """`other` is drawn `seconds` later than its own clock says; both in their own spreads."""

    def paint(figure: Figure) -> None:
        ax = figure.subplots()
        for signal, late, name, colour, dash in (
            (one, 0.0, names[0], _COLOURS[0], "-"),
            (other, seconds, names[1], _COLOURS[1], (0, (4, 2))),
        ):
            y = signal.y[:, 0]
            even = (y - y.mean()) / (float(y.std()) or 1.0)
            ax.plot(signal.t + late, even, color=colour, ls=dash, lw=1.2, label=name)
        ax.set(xlabel="time / s", ylabel="minus its mean, over its sd / 1")
        legend_below(figure, ax)

    words = f"'{names[1]}' moved by {seconds:+.6g} s over '{names[0]}', each minus its mean."
    return Picture("aligned", words, words, draw(paint, WIDTH, _HEIGHT))
