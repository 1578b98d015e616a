"""What the report shows: laws ranked by prediction, a picture of every mode, the plane."""

from collections.abc import Iterable, Sequence

import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import Chart, Entry, Exhibit, NumberTable, Series
from validate.pipeline.experiment.experiment import Progress, ReportAdditions
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.run.method_run import MAIN, Cases, MethodRun
from validate.register.registration import Registered
from validate.scene.meshless import MaterialPoint
from validate.solve.static.stretch_test import StretchTest

from .calibration import words_of
from .curves import Multimode, point
from .laws import as_card
from .ranking import (
    LawError,
    RankedLaw,
    better_fit_worse_prediction,
    mode_of,
    ranked,
    stress_of,
)

_FINE = 200  # stretches of a drawn line
_BEYOND = 1.3  # of the largest measured stress: a line ends there
_PAIRS = 4  # of laws, in sentences
_MEGA = 1e5  # Pa: stresses from here on are shown in MPa


def exhibits(tree: Tree, cases: Cases, tell: Progress) -> ReportAdditions:
    """Ranking, its sentences, and every mode with all laws."""
    p: Multimode = tree.settings
    tell("ranks the laws by prediction")
    runs = cases[MAIN]
    seen = next(iter(runs.values())).registered
    if len(seen) == 1:
        return ReportAdditions()  # nothing is predicted
    found = ranked(p, runs, {name: as_card(name) for name in runs})
    if not found:
        return ReportAdditions()
    roles = ["identified on these points", *(["predicted"] * (len(seen) - 1))]
    charts = [
        _plane(p, one, found, role) if mode_of(one) == "biaxial" else _mode(p, one, found, role)
        for one, role in zip(seen, roles, strict=True)
    ]
    exhibit = Exhibit(
        "laws-by-prediction",
        "Laws ranked by prediction",
        (*sentences(found), *left_out(runs.values())),
        tables=(_ranking(found, mode_of(seen[0])),),
        charts=tuple(charts),
    )
    numbers = {f"predicted.{one.method}": one.predicted.value for one in found}
    numbers |= {f"fitted.{one.method}": one.fit.value for one in found}
    return ReportAdditions((exhibit,), numbers)


def sentences(found: Sequence[RankedLaw]) -> tuple[str, ...]:
    """Which law predicts best, which fits best, where the two part, and who is unstable."""
    best, fitting = found[0], min(found, key=lambda one: one.fit.value)
    first = f"{best.label} predicts best: {_said(best.predicted)} of the measured stress"
    if fitting is best:
        said = [f"{first}; it fits best as well ({_said(best.fit)})."]
    else:
        said = [
            f"{first}. {fitting.label} fits best ({_said(fitting.fit)}) and predicts to "
            f"{_said(fitting.predicted)}. A law is chosen by prediction, not by fit."
        ]
    said += [
        f"{one.label} fits better, predicts worse than {other.label}: fitted {_said(one.fit)} "
        f"against {_said(other.fit)}, predicted {_said(one.predicted)} against "
        f"{_said(other.predicted)}."
        for one, other in better_fit_worse_prediction(found)[:_PAIRS]
    ]
    said += [
        f"{one.label} as identified loses positive energy at stretch {one.lost[1]:.3g} "
        f"({one.lost[0]}), within the measured stretches: do not use it in a simulation."
        for one in found
        if one.lost
    ]
    return tuple(said)


def left_out(runs: Iterable[MethodRun]) -> tuple[str, ...]:
    """The laws that are not ranked, each with its reason."""
    ends = ((f.label, next((r.outcome for r in f.runs if not r.finished), None)) for f in runs)
    return tuple(f"{label} is not ranked: {end.why}." for label, end in ends if end)


def _said(s: LawError) -> str:
    return f"{100 * s.value:.1f} % ({_interval(s)})"


def _interval(s: LawError) -> str:
    return f"{100 * s.low:.1f} to {100 * s.high:.1f}"


def _ranking(found: Sequence[RankedLaw], fitted: str) -> NumberTable:
    modes = list(found[0].modes)
    headings = ["law", "rank"]
    for name in (*(f"predicted, {m}" for m in ("all", *modes)), f"fitted, {fitted}"):
        headings += [f"{name} / %", "95 %"]
    rows: list[tuple[Entry, ...]] = []
    for k, one in enumerate(found):
        spreads = (one.predicted, *one.modes.values(), one.fit)
        cells = [c for s in spreads for c in (round(100 * s.value, 2), _interval(s))]
        rows.append((one.label, k + 1, *cells, _stable(one)))
    return NumberTable(
        "laws",
        "Rms over the rows of simulated less measured stress, relative to the measured one. "
        "The interval is the effect of another digitisation of the figures, with every law "
        "identified again. In 'all', rows of all predicted modes have the same weight.",
        (*headings, "stable where measured"),
        tuple(rows),
    )


def _stable(one: RankedLaw) -> str:
    return f"no: {one.lost[0]}, {one.lost[1]:.3g}" if one.lost else "yes"


def _stress(scene: MaterialPoint, stretches: Floats, name: str) -> Floats:
    """The named stress (n,) Pa of a point under stretches (n, k)."""
    rows = np.arange(len(stretches), dtype=np.float64)
    return StretchTest().solve(scene, rows, stretches).traces[name].y


def _mode(p: Multimode, seen: Registered, found: Sequence[RankedLaw], role: str) -> Chart:
    """Measured points of a mode and the curves of all laws."""
    mode, stress, l = mode_of(seen), stress_of(seen).y[:, 0], seen.inputs[:, 0]
    fine = np.linspace(min(l.min(), 1.0), max(l.max(), 1.0), _FINE)
    unit, factor = _shown(stress)
    lines = []
    for one in found:
        y = _stress(point(p, as_card(one.method), mode), fine[:, None], "nominal_stress")
        inside = np.abs(y) <= _BEYOND * np.abs(stress).max()
        lines.append(Series(one.label, fine[inside], factor * y[inside]))
    return Chart(
        f"stress_{mode}",
        f"{words_of(mode).capitalize()}, {role}",
        "stretch / 1",
        f"nominal stress / {unit}",
        (Series("measured", l, factor * stress, "points"), *lines),
        caption="A line ends where it exceeds the measured stresses by 30 %.",
    )


def _plane(p: Multimode, seen: Registered, found: Sequence[RankedLaw], role: str) -> Chart:
    """The second stress of every row of a plane, as each law has it, over the measured one."""
    stress = stress_of(seen).y[:, 1]
    unit, factor = _shown(stress)
    series = [Series("equal", ends := factor * np.array([0.0, stress.max()]), ends)]
    for one in found:
        y = _stress(point(p, as_card(one.method), "biaxial"), seen.inputs, "second_stress")
        inside = np.abs(y) <= _BEYOND * np.abs(stress).max()
        series.append(Series(one.label, factor * stress[inside], factor * y[inside], "points"))
    return Chart(
        "stress_biaxial",
        f"Second stress of the plane, {role}",
        f"measured / {unit}",
        f"second nominal stress / {unit}",
        tuple(series),
        caption="Stresses 30 % above the largest measured one are omitted.",
    )


def _shown(stress: Floats) -> tuple[str, float]:
    """The unit that stresses Pa are drawn in."""
    return ("MPa", 1e-6) if np.abs(stress).max() >= _MEGA else ("kPa", 1e-3)
