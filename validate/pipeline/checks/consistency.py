"""Consistency scores of each filter: innovations, NIS and node errors against their bands."""

from collections.abc import Mapping

import numpy as np

from validate.compare.exhibit import Chart, Entry, Exhibit, NumberTable, Series
from validate.compare.score import Score
from validate.estimate.consistency import (
    Consistency,
    chi_square_quantile,
    nees_consistency,
    nis_consistency,
    whiteness,
)
from validate.fem.assembly.locate import probe_rows
from validate.pipeline.run.method_run import Cases, MethodRun

_LAGS = 10
_HELD = 1e-12  # m: a component without error and without doubt is held, and no estimate
# m: what a filter that claims no doubt at all is taken to claim; an error beside it is far over-
# confident, whatever this is.
_LEAST_SD = 1e-9
_NEES = (
    " and NEES at the nodes (error against the twin's truth over the filter's claimed "
    "standard deviation)"
)
_CORRELATED = "NEES of one run is correlated in time, which widens its spread beyond the band."
_HEADS = (
    "case", "filter", "what", "per dof / 1", "95 % band from / 1", "to / 1", "steps", "dof",
    "verdict", "alarm",
)  # fmt: skip


def consistency_exhibit(
    main: Mapping[str, MethodRun], others: Cases, accepted: tuple[str, ...]
) -> Exhibit | None:
    """Tables and the NIS over time; None where no method is a filter that measured anything."""
    found = {n: f for n, f in main.items() if nis_of(f)}
    filters = dict(sorted(found.items(), key=lambda item: item[0] not in accepted))
    if not filters:
        return None
    rows = [row for f in filters.values() for row in _rows(f)]
    rows += [row for case in others.values() for f in case.values() for row in _rows(f)]
    true = any(row[2] != "NIS" for row in rows)
    table = NumberTable(
        "consistency",
        f"NIS (innovations){_NEES if true else ''}, per degree of freedom, with the 95 % "
        "chi-square band: above it a filter is over-confident, below it under-confident.",
        _HEADS,
        tuple(rows),
        _CORRELATED if true else "",
    )
    white = NumberTable(
        "whiteness",
        f"Whiteness of the innovations, Ljung-Box over {_LAGS} lags: a small p means a correlated "
        f"innovation, so model or Q is wrong (white: p of 0.001 and more).",
        ("filter", "component", "p / 1", "lag-1 correlation / 1", "samples", "white"),
        tuple(row for f in filters.values() for row in _white_rows(f)),
    )
    words = [
        "NIS covers measured components only: a filter can seem consistent while unmeasured nodes "
        "are wrong. Compare it with the errors at the other nodes."
    ]
    doubted = [f.label for f in filters.values() if not claims_hold(f)]
    if doubted:
        words.append(
            "NIS outside its 95 % band, so no verdict uses the filter's claimed interval: "
            f"{'; '.join(doubted)}."
        )
    charts = tuple(_chart(f) for f in list(filters.values())[:4])
    return Exhibit(
        "consistency", "Consistency of the filters", tuple(words), (table, white), charts
    )


def nis_of(followed: MethodRun) -> Consistency | None:
    """NIS of a filter's run; None for a solver, or where nothing was measured."""
    nis, dof = followed.run.traces.get("nis"), followed.run.traces.get("nis.dof")
    if nis is None or dof is None or not dof.y.any():
        return None
    return nis_consistency(nis.y, dof.y)


def claims_hold(followed: MethodRun) -> bool:
    """Return whether NIS lies within its 95 % band; True for a method without innovations."""
    nis = nis_of(followed)
    return nis is None or nis.band_95.holds(nis.mean)


def nees_of(followed: MethodRun) -> dict[str, Consistency]:
    """NEES by probe: all components over the output frames, error against the filter's own sd."""
    run, mesh = followed.run, followed.scene.mesh
    if run.sd is None or not len(run.at):
        return {}
    found = {}
    for probe in followed.scene.probes:
        if probe.name not in followed.truth.probes:
            continue
        reference = followed.reference(probe.name)
        rows = probe_rows(mesh, (probe,))
        error = np.array([rows.apply(u)[0] for u in run.u]) - reference[run.at]
        sd = np.array([rows.apply(s)[0] for s in run.sd])
        free = (sd > 0).any(axis=0) | (np.abs(error).max(axis=0) > _HELD)
        if free.any():
            terms = (error[:, free] / np.maximum(sd[:, free], _LEAST_SD)) ** 2
            found[probe.name] = nees_consistency(terms.sum(axis=1), np.full(len(sd), free.sum()))
    return found


def consistency_scores(followed: MethodRun) -> tuple[Score, ...]:
    """`nis.per_dof` and `<probe>.nees.per_dof` of a filter's run; none for a solver."""
    end = f"@{followed.case}" if followed.case else ""
    words = "over its degrees of freedom; 1 for a consistent filter"
    found = []
    nis = nis_of(followed)
    if nis:
        text = f"normalised innovation squared {words}"
        found.append(Score(f"nis.per_dof{end}", nis.mean, "1", nis.dof, "measured recording", text))
    for probe, nees in nees_of(followed).items():
        text = f"squared error over the claimed variance at {probe}, {words}"
        name = f"{probe}.nees.per_dof{end}"
        found.append(Score(name, nees.mean, "1", nees.dof, "truth of the twin", text))
    return tuple(found)


def _rows(followed: MethodRun) -> list[tuple[Entry, ...]]:
    nis = nis_of(followed)
    if nis is None:
        return []
    parts = [("NIS", nis)] + [(f"NEES at {p}", c) for p, c in nees_of(followed).items()]
    return [
        (followed.case or "recorded", followed.label, what, c.mean, c.band_95.low, c.band_95.high,
         c.samples, c.dof, c.verdict, c.alarm or "none")
        for what, c in parts
    ]  # fmt: skip


def _white_rows(followed: MethodRun) -> list[tuple[Entry, ...]]:
    traces = followed.run.traces
    names = [n for n in traces if n.startswith("innovation.") and not n.endswith(".sd")]
    rows: list[tuple[Entry, ...]] = []
    for name in names:
        sd = traces[f"{name}.sd"].y
        if (sd > 0).sum() < 3 * _LAGS:
            continue
        white = whiteness(traces[name].y, sd, _LAGS)
        component, lag_1 = name.removeprefix("innovation."), float(white.autocorrelation[0])
        verdict = "yes" if white.white else "no"
        rows.append((followed.label, component, white.p, lag_1, white.samples, verdict))
    return rows


def _chart(followed: MethodRun) -> Chart:
    """NIS of every measured step per degree of freedom, with the band of one step."""
    traces, t = followed.run.traces, followed.own_time
    dof = traces["nis.dof"].y
    seen = dof > 0
    per = traces["nis"].y[seen] / dof[seen]
    low, high = (np.asarray(chi_square_quantile(p, dof[seen]) / dof[seen]) for p in (0.025, 0.975))
    return Chart(
        f"nis_{followed.method}", f"NIS of {followed.label}", "recorded time / s",
        "NIS per dof / 1",
        (
            Series("95 % band of one step", t[seen], low, "band", high),
            Series("NIS", t[seen], per, "points"),
        ),
        levels=(("expected", 1.0),), log="y", scale=1.0,
    )  # fmt: skip
