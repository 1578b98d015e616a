"""A statement over all stored runs as a page, its tables and one JSON document."""

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from validate.compare.bias import Estimated
from validate.compare.exhibit import Exhibit, NumberTable, Picture, TableCell
from validate.report.numbers import shown_unit, significant, text, with_unit
from validate.study.loose_page import write_loose
from validate.study.predictions import Foretold
from validate.study.summary import OfKind, Range, Summary, area_of

_PERCENT = 100.0
#: Of a row's texts: what is stated, then where it holds.
STATED = ("quantity", "bias / %", "scatter / %", "measurement / %", "predictions", "specimens")
COVERED = ("size", "strain / %", "rate / 1/s", "body / mm")
_WORDS = (
    "Bias: predicted over true, less one. Scatter: relative standard deviation of the "
    "predictions, without that of the measurements (a separate column). Unknown moduli, "
    "geometry and friction are included in it. Both with 95 % intervals over specimens "
    "(McGrattan and Toman 2011; NUREG-1824).",
    "Repeats of one specimen under one load count once. All specimens have the same weight, "
    "whatever the number of their loads. Undecided checks count. Fitted checks, quick runs "
    "and runs with warnings do not. The first accepted method of each run counts.",
    "A row is valid only for the sizes, strains, rates and bodies that it names.",
)


def write_summary(found: Summary, folder: Path) -> Path:
    """Replaces `folder`; returns the path of report.html. Raises what `replace_folder` does."""
    told = (
        "summary", "Prediction errors over all stored runs", f"{len(found.taken)} stored runs",
        sentence(found),
    )  # fmt: skip
    exhibits = (
        Exhibit("statement", "Measured recordings", _WORDS, (_table("statement", found.kinds),),
                pictures=_pictures("against", found.kinds)),
        *_twins(found),
        Exhibit("predictions", "Every prediction that counts",
                tables=(_points("predictions", found.kinds),)),
        Exhibit("runs", "Counted and excluded runs", tuple(_left(found)),
                (_runs(found),)),
    )  # fmt: skip
    return write_loose(told, exhibits, document(found), folder, "Summary")


def sentence(found: Summary) -> str:
    """The statement over measured recordings in one sentence."""
    if not found.kinds:
        return "No stored run of a measured recording counts; twins are in a separate table."
    points = sum(len(k.points) for k in found.kinds)
    specimens = len({p.specimen for k in found.kinds for p in k.points})
    parts = "; ".join(f"{k.kind} {_short(k)}" for k in found.kinds)
    return f"{_count(points, 'prediction')} of {_count(specimens, 'specimen')}: {parts}."


def _count(number: int, what: str) -> str:
    return f"{number} {what}" + ("s" if number != 1 else "")


def _short(kind: OfKind) -> str:
    if kind.stated is None:
        return f"({kind.why})"
    s = kind.stated
    scatter = ""
    if s.scatter is not None:
        size = f"{percent(s.scatter.value)} %" if s.scatter.value else "no"
        scatter = f", {size} scatter beyond the measurements'"
    return f"{percent(s.bias.value - 1, sign=True)} %{scatter} ({s.points} of {s.specimens})"


def percent(value: float, *, sign: bool = False) -> str:
    """A relative value in per cent, two digits."""
    plus = "+" if sign and value > 0 else ""
    return plus + significant(_PERCENT * value, 2)


def row(kind: OfKind) -> tuple[str, ...]:
    """A kind of quantity as texts under `STATED` and `COVERED`."""
    s, c = kind.stated, kind.covered
    specimens = len({p.specimen for p in kind.points})
    stated = ("–", "–", "–") if s is None else (
        interval(s.bias, -1.0), "–" if s.scatter is None else interval(s.scatter), percent(s.own)
    )  # fmt: skip
    return (
        kind.kind, *stated, str(len(kind.points)), str(specimens),
        f"{spanned(c.size, c.unit)} {shown_unit(c.unit)}".strip(),
        spanned(c.strain, "1", _PERCENT), spanned(c.rate, "1"), spanned(c.sides, "m"),
    )  # fmt: skip


def interval(found: Estimated, shift: float = 0.0) -> str:
    """A value with its interval, in per cent."""
    signed = shift != 0
    if not signed and found.value == 0:
        most = "" if found.high is None else f" (to {percent(found.high)})"
        return f"none beyond the measurements'{most}"
    value = percent(found.value + shift, sign=signed)
    if found.low is None or found.high is None:
        return f"{value} (no interval)"
    ends = (percent(end + shift, sign=signed) for end in (found.low, found.high))
    return f"{value} ({' to '.join(ends)})"


def spanned(found: Range, unit: str, by: float = 1.0) -> str:
    """From the least to the largest, with a unit where the heading has none."""
    if found is None:
        return "–"
    low, high = (text(by * end, unit, 2) for end in found)
    return low if low == high else f"{low} to {high}"


def _table(name: str, kinds: tuple[OfKind, ...]) -> NumberTable:
    rows = tuple((*row(kind), kind.why) for kind in kinds)
    note = "" if rows else "No stored run counts."
    return NumberTable(
        name, "Grouped by measured quantity.", (*STATED, *COVERED, "why"), rows, note, below="why"
    )


def _pictures(name: str, kinds: tuple[OfKind, ...]) -> tuple[Picture, ...]:
    from validate.report.against import Against, against

    panels = [
        Against(
            k.kind, k.covered.unit, tuple(p.experiment for p in k.points),
            np.array([p.measured for p in k.points]), np.array([p.simulated for p in k.points]),
            k.stated.own if k.stated else 0.0, k.stated.bias.value if k.stated else None,
            k.stated.scatter.value if k.stated and k.stated.scatter else None,
        )
        for k in kinds
    ]  # fmt: skip
    caption = (
        "Predicted against measured size of all counted checks, on logarithmic axes. Grey: "
        "two standard deviations of the measurements. Blue: bias of the models and two "
        "standard deviations of their scatter."
    )
    return (against(name, caption, panels),) if panels else ()


def _twins(found: Summary) -> tuple[Exhibit, ...]:
    """What twins say, in tables of their own; nothing without one."""
    if not found.twins:
        return ()
    words = ("Recordings made by our finer models; they are not measurements.",)
    tables = (_table("twins", found.twins), _points("twin_predictions", found.twins))
    return (Exhibit("twins", "Twins", words, tables),)


def _points(name: str, kinds: tuple[OfKind, ...]) -> NumberTable:
    head = (
        "experiment", "check", "specimen", "measured", "predicted", "ratio / 1", "E", "u_val",
        "area", "verdict", "runs",
    )  # fmt: skip
    rows = tuple(_point(p) for k in kinds for p in k.points)
    words = (
        "Sizes are along the measured direction; E, u_val and verdict are those of the check. "
        "Area: between the distributions of prediction and measurement, in the unit of E."
    )
    return NumberTable(name, words, head, rows, "" if rows else "None.", below="runs")


def _point(p: Foretold) -> tuple[Any, ...]:
    def cell(value: float) -> TableCell:
        return TableCell(value, p.unit, with_unit(value, p.unit))

    return (
        p.experiment, p.check, p.specimen, cell(p.measured), cell(p.simulated),
        TableCell(p.simulated / p.measured, "", text(p.simulated / p.measured)), cell(p.error),
        cell(p.u_val), cell(area_of(p)), p.verdict, ", ".join(p.folders),
    )  # fmt: skip


def _runs(found: Summary) -> NumberTable:
    rows = tuple((r.folder, "counts" if not r.why else "does not count", r.why) for r in found.runs)
    return NumberTable("runs", "Below one folder of reports.", ("run", "counts", "why"), rows,
                       below="why")  # fmt: skip


def _left(found: Summary) -> Iterator[str]:
    """Checks of runs that count which do not count themselves."""
    for why, number in found.left.items():
        yield f"{_count(number, 'check')} of these runs not counted: {why}."


def document(found: Summary) -> dict[str, Any]:
    """One JSON document, SI."""
    return {
        "reports": found.reports.name,
        "sentence": sentence(found),
        "measured": [_stated(k) for k in found.kinds],
        "twins": [_stated(k) for k in found.twins],
        "runs": [{"folder": r.folder, "counts": not r.why, "why": r.why} for r in found.runs],
        "checks_left_out": found.left,
    }


def _stated(kind: OfKind) -> dict[str, Any]:
    points = [
        {k: v for k, v in vars(p).items() if k != "key"} | {"area": area_of(p)} for p in kind.points
    ]
    return {
        "kind": kind.kind, "unit": kind.covered.unit, "why": kind.why,
        "statement": None if kind.stated is None else asdict(kind.stated),
        "covered": asdict(kind.covered), "predictions": points,
    }  # fmt: skip
