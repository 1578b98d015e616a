"""Stability of a static experiment: gain of its pressure loop, if it has one."""

from collections.abc import Mapping
from dataclasses import asdict

import numpy as np

from validate.compare.exhibit import Exhibit, Mark, NumberTable, Panel, RegimeMap
from validate.pipeline.experiment.experiment import Experiment
from validate.report.views.records import Shown, table
from validate.study.stability.gain import TOLERANCE, GainCell, GainLimit, GainMap
from validate.study.study_page import Findings

_REGIMES = ("settles", "never settles")
_NOTHING = (
    "{name} declares no density and no fluid. It has no scheme that marches in time and no "
    "pressure loop, so there is no stability to map."
)


def told_nothing(experiment: Experiment, quick: bool) -> Findings:
    """Return a page that says so."""
    said = _NOTHING.format(name=experiment.name)
    words = Exhibit("stability", "No scheme steps in time", (said,))
    document = {"kind": "stability", "points": 0}
    return Findings(
        f"Stability map: {experiment.title}",
        said,
        (words,),
        document,
        table("cells", "", (), {}),
        quick,
    )


def told_gain(found: GainMap, quick: bool) -> Findings:
    band = ("good", "Predictions hold") if found.passed else ("bad", "Predictions fail")
    return Findings(
        f"Stability map: {found.experiment.title}", sentence(found), (_exhibit(found),),
        {
            "kind": "stability",
            "passed": found.passed,
            "points": sum(len(v.gains) for _, v in found.limits),
            "gains": [{"load": c.load, **asdict(v)} for c, v in found.limits],
            "refused": [r.why for r in found.done.records.values() if r.why],
        },
        _cells(found), quick, passed=found.passed, band=band,
    )  # fmt: skip


def sentence(found: GainMap) -> str:
    """Where the loop's gain has its limit, and whether that was predicted, in one sentence."""
    errors = [abs(v.error) for _, v in found.limits if v.error is not None]
    limits = [v.measured for _, v in found.limits if v.measured is not None]
    if not limits:
        return "No scheme steps in time; no limit of the pressure loop's gain was found."
    tuned = found.limits[0][1].tuned
    return (
        "No scheme steps in time; the loop that keeps the fluid's volume settles up to gains "
        f"of {min(limits):.4g} to {max(limits):.4g} Pa (tuned: {tuned:.4g} Pa), at most "
        f"{100 * max(errors):.2g} % from the predicted ones, {100 * TOLERANCE:g} % allowed."
    )


def _exhibit(found: GainMap) -> Exhibit:
    columns: Mapping[str, Shown] = {
        "share of the largest load / 1": "0.load", "predicted limit / Pa": "1.predicted",
        "measured limit / Pa": "1.measured", "relative difference / 1": "1.error",
        "tuned gain / Pa": "1.tuned", "updates at the nearest gain": _nearest,
    }  # fmt: skip
    limits = table("gains", "Limits of the gain under load", found.limits, columns)
    words = (
        "Paper 000's loop P <- P + Kp (1 - V/V0) settles where |1 - Kp dV/dP / V0| < 1. Predicted "
        "from the compliance of the cavity at the pressure that keeps its volume; measured by "
        "running the loop from rest and halving the interval.",
    )
    maps = (_map(found),) if found.limits else ()
    return Exhibit("gain", "The gain of the pressure loop", words, (limits,), regimes=maps)


def _nearest(limit: tuple[GainCell, GainLimit]) -> int:
    """Updates at the gain that is nearest to the tuned one."""
    _, v = limit
    return v.updates[int(np.argmin(np.abs(np.log(np.array(v.gains) / v.tuned))))]


def _map(found: GainMap) -> RegimeMap:
    first = found.limits[0][1]
    codes = [[int(n < 0) for n in v.updates] for _, v in found.limits]
    border = np.array([v.predicted for _, v in found.limits])
    panel = Panel("pressure loop", np.array(codes), border)
    return RegimeMap(
        "gain", f"{found.experiment.name}: gain against load", "gain / Pa",
        "share of the largest load", np.array(first.gains),
        tuple(f"{c.load:g}" for c, _ in found.limits), _REGIMES, (panel,),
        (Mark("tuned", first.tuned, 0.0),), "Line: predicted limit. Mark: the tuned gain.",
    )  # fmt: skip


def _cells(found: GainMap) -> NumberTable:
    rows = [
        (c.load, gain, None if n < 0 else n)
        for c, v in found.limits
        for gain, n in zip(v.gains, v.updates, strict=True)
    ]
    return table("cells", "Every gain.", rows, {"load_1": "0", "gain_Pa": "1", "updates": "2"})
