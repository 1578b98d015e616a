"""Consistency and error over the swept axes of a filter study, as maps or curves."""

from collections.abc import Iterator, Sequence

import numpy as np

from validate.compare.exhibit import Chart, Exhibit, Heat, Series
from validate.study.filter_plan import METHODS, FilterCell
from validate.study.filters import FilterStudy
from validate.study.score import NIS
from validate.study.score_units import shown_unit
from validate.study.sweep import Axis, named, short


def over_axes(study: FilterStudy) -> Iterator[Exhibit]:
    """Per method: NIS and error over its first two swept axes, or over the only one."""
    charts: list[Chart] = []
    heats: list[Heat] = []
    words: list[str] = []
    for method in study.plan.methods:
        axes = [a for a in _axes_of(study, method) if len(a.values) > 1]
        if not axes:
            continue
        fixed = _fixed(study, method, axes[2:])
        cells = [c for c in _cells_of(study, method) if fixed.items() <= c.values.items()]
        if fixed:
            words.append(f"{method}: the other axes are fixed at {named(fixed)}, its best cell.")
        if len(axes) == 1:
            charts += _curves(study, method, axes[0], cells)
        else:
            heats += _heats(study, method, axes[0], axes[1], cells)
    if charts or heats:
        yield Exhibit(
            "axes", "Maps over the swept values",
            ("NIS per degree of freedom is 1 for a filter with a correct covariance. Above 1 "
             "the filter is over-confident, below 1 under-confident. Only measured components "
             "count.", *words),
            charts=tuple(charts), heats=tuple(heats),
        )  # fmt: skip


def _axes_of(study: FilterStudy, method: str) -> list[Axis]:
    prefix = f"{METHODS}{method}."
    of_method = [a for a in study.plan.axes if a.path.startswith(prefix)]
    return of_method + [a for a in study.plan.axes if not a.path.startswith(METHODS)]


def _cells_of(study: FilterStudy, method: str) -> list[FilterCell]:
    return [c for c in study.plan.cells if c.method == method and not c.baseline]


def _unit(study: FilterStudy) -> str:
    return shown_unit(study.unit)[1]


def _fixed(study: FilterStudy, method: str, axes: Sequence[Axis]) -> dict[str, str]:
    rows = [
        r
        for ranking in study.rankings
        for r in ranking.rows
        if r.cell.method == method and not r.cell.baseline
    ]
    if not rows or not axes:
        return {}
    best = min(rows, key=lambda r: r.score.mean).cell.values
    return {a.path: best[a.path] for a in axes}


def _value(study: FilterStudy, cell: FilterCell, what: str) -> float | None:
    value = study.done.records[cell.key].value
    if value is None:
        return None
    if what == NIS:
        return value.consistency.mean if value.consistency else None
    if what not in value.scores:
        return None
    return shown_unit(value.units[what])[0] * float(np.mean(value.scores[what]))


def _heats(
    study: FilterStudy, method: str, x: Axis, y: Axis, cells: Sequence[FilterCell]
) -> Iterator[Heat]:
    for what, label, centre in (
        (NIS, "NIS per dof / 1", 1.0),
        (study.by, f"error / {_unit(study)}", None),
    ):
        at = {(c.values[x.path], c.values[y.path]): _value(study, c, what) for c in cells}
        values = np.array([[_nan(at.get((i, j))) for i in x.values] for j in y.values])
        if np.isfinite(values).any():
            name = "nis" if what == NIS else "error"
            yield Heat(
                f"{name}_{method}", f"{method}: {'NIS' if what == NIS else what} over "
                f"{short(x.path)} and {short(y.path)}", short(x.path), short(y.path),
                x.values, y.values, values, label, centre,
            )  # fmt: skip


def _nan(value: float | None) -> float:
    return np.nan if value is None else value


def _curves(
    study: FilterStudy, method: str, axis: Axis, cells: Sequence[FilterCell]
) -> Iterator[Chart]:
    """Over an axis of numbers; other values have the ranking alone."""
    numbers = axis.numbers
    if numbers is None:
        return
    at = dict(zip(axis.values, numbers, strict=True))
    log = "x" if min(numbers) > 0 and max(numbers) >= 20 * min(numbers) else ""
    for what, label in ((NIS, "NIS per dof / 1"), (study.by, f"{study.by} / {_unit(study)}")):
        pairs = sorted(
            (at[c.values[axis.path]], value)
            for c in cells
            if (value := _value(study, c, what)) is not None
        )
        if len({y for _, y in pairs}) < 2:
            continue
        x, y = (np.array(column) for column in zip(*pairs, strict=True))
        scale = "xy" if log else "y"
        name = "nis" if what == NIS else "error"
        yield Chart(
            f"{name}_{method}", f"{method}: {name.upper() if name == 'nis' else what} over "
            f"{short(axis.path)}", axis.label, label, (Series(method, x, y),),
            (("consistent", 1.0),) if what == NIS else (),
            scale if y.min() > 0 else log,  # type: ignore[arg-type]
        )  # fmt: skip
