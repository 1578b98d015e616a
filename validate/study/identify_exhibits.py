"""What an identification shows: values with intervals, profiles, correlations, starts."""

from collections.abc import Iterator

import numpy as np

from validate.compare.exhibit import Chart, Exhibit, Heat, NumberTable, Series, TableCell
from validate.identify.identification import Profiled
from validate.identify.profile import RISE
from validate.parameters import describe
from validate.replay.calibrated_words import helping, lines
from validate.replay.problem import Calibrated
from validate.report.numbers import scale, shown_unit
from validate.study.identify import IdentifyStudy

HEAD = ("parameter", "value", "unit", "95 % from", "95 % to", "sd", "found on", "verdict")
_STRAIGHT = 25  # points of a profile as drawn


def exhibits(study: IdentifyStudy) -> tuple[Exhibit, ...]:
    shown = [_values(study), *(e for c in study.calibrated for e in _of(study, c))]
    return tuple(shown)


def units(one: Calibrated) -> dict[str, str]:
    """SI units by path."""
    return {p.path: p.unit for p in describe(one.problem.parts[0].parameters)}


def verdict(e: Profiled) -> str:
    return "identified" if e.identified else f"not identifiable: {'; '.join(e.findings)}"


def end(value: float, is_open: bool) -> str:
    """Words beside an end of an interval that is only the bound searched."""
    return "bound searched" if is_open else ""


def _values(study: IdentifyStudy) -> Exhibit:
    rows = [_row(c, e) for c in study.calibrated for e in c.found.estimates]
    table = NumberTable(
        "parameters", "Identified parameters", HEAD, tuple(rows), below="verdict",
        note="95 %: the interval in which chi-square rises by less than 3.84, with all other "
             "parameters fitted again.",
    )  # fmt: skip
    words = tuple(line for c in study.calibrated for line in lines(c))
    return Exhibit("identified", "Identified parameters", words, (table,))


def _row(one: Calibrated, e: Profiled) -> tuple[TableCell | str, ...]:
    unit = units(one)[e.name]
    numbers = [TableCell(v, unit) for v in (e.value, e.low, e.high, e.sd)]
    free = next(f for f in one.problem.free if f.path == e.name)
    said = verdict(e) if e.identified else f"{verdict(e)}; {helping(free)} would identify it"
    shown = TableCell(said, emphasis="good" if e.identified else "bad")
    value, low, high, sd = numbers
    return e.name, value, shown_unit(unit) or "1", low, high, sd, one.on, shown


def _of(study: IdentifyStudy, one: Calibrated) -> Iterator[Exhibit]:
    method = one.problem.calibration.method
    charts = tuple(_profile(one, e) for e in one.found.estimates)
    yield Exhibit(
        f"profiles_{method}", f"Profiles, {method}",
        ("Rise of chi-square when one parameter is changed and the others are fitted again. "
         "Points are computed; the line joins them.",),
        charts=charts, heats=tuple(_correlations(one)), tables=(_starts(one),),
    )  # fmt: skip


def _profile(one: Calibrated, e: Profiled) -> Chart:
    unit = units(one)[e.name]
    x, y = scale(unit) * np.array(e.at), np.array(e.rise)
    label = f"{e.name} / {shown_unit(unit) or '1'}"
    line, points = Series("through them", *_between(x, y)), Series("computed", x, y, "points")
    method = one.problem.calibration.method
    return Chart(
        f"profile_{method}_{e.name.replace('.', '_')}", f"{e.name}: profile", label,
        "rise of chi-square / 1", (line, points), (("95 %", RISE),), caption=f"{verdict(e)}.",
    )  # fmt: skip


def _between(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Squares of straight lines through the signed roots, which are nearly straight."""
    best = int(np.argmin(y))
    roots = np.sqrt(np.maximum(y, 0)) * np.where(np.arange(len(y)) < best, -1, 1)
    fine = np.unique(np.concatenate([x, np.linspace(x[0], x[-1], _STRAIGHT)]))
    return fine, np.interp(fine, x, roots) ** 2


def _correlations(one: Calibrated) -> Iterator[Heat]:
    """None of a single parameter."""
    names = one.found.space.names
    if len(names) > 1:
        yield Heat(
            f"correlations_{one.problem.calibration.method}", "Correlations of the estimates",
            "parameter", "parameter", names, names, one.found.correlations, "correlation / 1", 0.0,
        )  # fmt: skip


def _starts(one: Calibrated) -> NumberTable:
    found = one.found
    head = ("start", "chi-square / 1", *(f"{n} / {u}" for n, u in _named(one)),
            "evaluations", "ended")  # fmt: skip
    rows = tuple(
        (i + 1, f.chi_square if f.count else None,
         *(scale(u) * found.space.value(k, float(f.x[k])) for k, u in enumerate(_si(one))),
         f.evaluations, "converged" if f.converged else f"did not: {f.why}")
        for i, f in enumerate(found.fits)
    )  # fmt: skip
    name = f"starts_{one.problem.calibration.method}"
    return NumberTable(name, "Result of every start", head, rows, below="ended", folded=True)


def _si(one: Calibrated) -> list[str]:
    return [units(one)[n] for n in one.found.space.names]


def _named(one: Calibrated) -> list[tuple[str, str]]:
    return [(n, shown_unit(u) or "1") for n, u in zip(one.found.space.names, _si(one), strict=True)]
