"""Report of an identification: values with intervals, profiles, correlations, starts."""

from collections.abc import Iterator, Mapping

import numpy as np

from validate.compare.exhibit import Chart, Exhibit, Heat, NumberTable, Series, TableCell
from validate.identify.identification import Profiled
from validate.identify.profile import RISE
from validate.parameters import describe
from validate.pipeline.calibration.problem import Calibrated
from validate.pipeline.calibration.sentences import helping, lines
from validate.report.views.numbers import scale, shown_unit
from validate.report.views.records import Shown, sized, table
from validate.study.identify.study import IdentifyStudy

_STRAIGHT = 25  # points of a profile as drawn


def exhibits(study: IdentifyStudy) -> tuple[Exhibit, ...]:
    return (_values(study), *map(_of, study.calibrated))


def units(one: Calibrated) -> dict[str, str]:
    """SI units by path."""
    return {p.path: p.unit for p in describe(one.problem.parts[0].parameters)}


def verdict(e: Profiled) -> str:
    return "identified" if e.identified else f"not identifiable: {'; '.join(e.findings)}"


def _values(study: IdentifyStudy) -> Exhibit:
    pairs = [(c, e) for c in study.calibrated for e in c.found.estimates]
    columns: Mapping[str, Shown] = {
        "parameter": "1.name", "value": sized("1.value", _unit),
        "unit": lambda pair: shown_unit(_unit(pair)) or "1", "95 % from": sized("1.low", _unit),
        "95 % to": sized("1.high", _unit), "sd": sized("1.sd", _unit), "found on": "0.on",
        "verdict": _verdict,
    }  # fmt: skip
    found = table(
        "parameters", "Identified parameters", pairs, columns, below="verdict",
        note="95 %: the interval in which chi-square rises by less than 3.84, with all other "
             "parameters fitted again.",
    )  # fmt: skip
    words = tuple(line for c in study.calibrated for line in lines(c))
    return Exhibit("identified", "Identified parameters", words, (found,))


def _unit(pair: tuple[Calibrated, Profiled]) -> str:
    return units(pair[0])[pair[1].name]


def _verdict(pair: tuple[Calibrated, Profiled]) -> TableCell:
    one, e = pair
    free = next(f for f in one.problem.free if f.path == e.name)
    said = verdict(e) if e.identified else f"{verdict(e)}; {helping(free)} would identify it"
    return TableCell(said, emphasis="good" if e.identified else "bad")


def _of(one: Calibrated) -> Exhibit:
    method = one.problem.calibration.method
    charts = tuple(_profile(one, e) for e in one.found.estimates)
    words = (
        "Rise of chi-square when one parameter is changed and the others are fitted again. "
        "Points are computed; the line joins them.",
    )
    return Exhibit(
        f"profiles_{method}", f"Profiles, {method}", words, (_starts(one),), charts,
        heats=tuple(_correlations(one)),
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
    named = zip(found.space.names, _si(one), strict=True)
    head = ("start", "chi-square / 1", *(f"{n} / {shown_unit(u) or '1'}" for n, u in named),
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
