"""Line styles of a chart: two lines of one axes differ in colour and in dash."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from validate.compare.exhibit import Chart, Series
from validate.report.charts.style import (
    ACCEPTED,
    MEASURED,
    NOISE,
    PALETTE,
    HasMethods,
    Style,
    free_look,
    looks,
)

TOGETHER = 5  # lines that are followed on one axes; more have one each
_TURNS = 20  # of a line that is jagged, at least
_SHADES = (MEASURED, "#5F5F5F", "#8C8C8C", "#AFAFAF", "#C6C6C6")  # of several recordings
_OTHER = PALETTE[1]  # a model that is not the judged one, alone on its axes


@dataclass(frozen=True)
class Drawn:
    """A series, how it looks, and its place in the order of points series (0: a filled sign).

    `one_of` several lines of one label: its dash tells it apart, however jagged it is.
    """

    series: Series
    look: Style
    number: int = 0
    one_of: bool = False


def panel_labels(chart: Chart) -> tuple[str, ...]:
    """Return the labels that get axes of their own; none where one axes shows all lines apart."""
    lines = [s for s in chart.series if s.style == "line" and not is_given(s)]
    labels = tuple(dict.fromkeys(s.label for s in lines))
    jagged = sum(is_jagged(s) for s in lines)
    apart = len(labels) > TOGETHER or jagged > 1 or len(lines) > len(labels)
    return labels if apart and len(labels) > 1 else ()


def panel_series(chart: Chart, label: str, labels: Sequence[str]) -> list[Series]:
    """What a label's own axes show: its lines and bands, and what belongs to no label."""
    own = [s for s in chart.series if s.label == label or band_of(s, labels) == label]
    common = [s for s in chart.series if s.label not in labels and not band_of(s, labels)]
    return [*common, *own]


def band_of(series: Series, labels: Sequence[str]) -> str:
    """The label whose band it is: the longest that its own begins with."""
    own = [name for name in labels if series.style == "band" and series.label.startswith(name)]
    return max(own, key=len, default="")


def styled(result: HasMethods, series: Sequence[Series]) -> list[Drawn]:
    """Measured points black, methods as elsewhere, bands in their line's colour, others in turn."""
    found = _of_lines(result, [s for s in series if s.style != "band"])
    lines = {d.series.label: d.look for d in found if d.series.style == "line"}
    bands = [Drawn(s, _of_band(s, lines)) for s in series if s.style == "band"]
    pairs = {id(d.series): d for d in (*found, *bands)}
    return [pairs[id(s)] for s in series]


def alone(result: HasMethods, series: Sequence[Series], label: str) -> list[Drawn]:
    """As `styled`, for the axes of one label: blue where it is the judged method."""
    known = _known(result).get(label)
    judged = known is not None and known.colour == ACCEPTED
    colours = (ACCEPTED, *PALETTE[1:]) if judged else (_OTHER, ACCEPTED, *PALETTE[2:])
    lines = [s for s in series if s.label == label and s.style == "line"]
    own = {id(s): free_look(i, colours[i % len(colours)]) for i, s in enumerate(lines)}
    first = next(iter(own.values()), free_look(0, MEASURED))
    others = {id(d.series): d for d in styled(result, [s for s in series if id(s) not in own])}
    return [
        Drawn(s, own[id(s)], one_of=len(own) > 1) if id(s) in own
        else Drawn(s, first) if band_of(s, (label,)) else others[id(s)]
        for s in series
    ]  # fmt: skip


def _of_lines(result: HasMethods, series: Sequence[Series]) -> list[Drawn]:
    known = _known(result)
    unknown = [s for s in series if s.label not in known and not is_given(s)]
    # By label the methods' styles; of two with one colour or dash the later takes a free one
    named = [(s.label, known[s.label]) for s in series if s.label in known]
    mine: dict[str, Style] = {}
    for label, look in dict(named).items():
        colours = {s.colour for s in mine.values()}
        free = [c for c in (look.colour, *PALETTE) if c not in colours] or [look.colour]
        other = replace(look, colour=free[0])
        for i in range(1, len(PALETTE)):
            if all(other.dash != s.dash for s in mine.values()):
                break
            turned = free_look(i, other.colour)
            other = replace(other, dash=turned.dash, point=turned.point)
        mine[label] = other
    taken = {look.colour for look in mine.values()}
    free = [c for c in PALETTE if c not in taken] or list(PALETTE)
    others = {id(s): free_look(i, free[i % len(free)]) for i, s in enumerate(unknown)}
    signs = {id(s): i + 1 for i, s in enumerate(unknown)} if len(unknown) > len(free) else {}
    logs = (s for s in series if s.style == "points" and is_given(s))
    shades = {id(s): _SHADES[i % len(_SHADES)] for i, s in enumerate(logs)}
    return [
        Drawn(
            s,
            mine.get(s.label) or others.get(id(s)) or _given(s, shades.get(id(s), MEASURED)),
            signs.get(id(s), 0),
        )
        for s in series
    ]


def _given(series: Series, shade: str) -> Style:
    """A reference is a wide pale line under the others, what was measured dark points."""
    if series.style == "line":
        return Style("#C0C0C0", "-", "o", 3.6)
    return Style(shade, "-", "o", 1.2)


def _known(result: HasMethods) -> Mapping[str, Style]:
    styles = looks(result)
    return {**styles, **{m.label: styles[m.name] for m in result.methods}}


def is_given(one: Series) -> bool:
    """Return a line named a reference; points that say measured."""
    if one.style == "line":
        return one.label.lower().startswith("reference")
    return one.style == "points" and "measured" in one.label.lower()


def _of_band(band: Series, lines: Mapping[str, Style]) -> Style:
    own = band_of(band, tuple(lines))
    return lines[own] if own else Style(NOISE, "-", "o", 0.0)


def is_jagged(series: Series) -> bool:
    """Return a line that turns so often that dashes could not be told from its turns."""
    turns = np.count_nonzero(np.diff(np.sign(np.diff(series.y))))
    return bool(turns > max(_TURNS, 0.1 * len(series.y)))
