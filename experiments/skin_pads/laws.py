"""Which law predicts best what it was not fitted to, and the experiment as its recording has it."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.stats import t as student

from validate.arrays import Floats, rms
from validate.compare.exhibit import Exhibit, NumberTable
from validate.pipeline.experiment.experiment import Experiment, ReportAdditions
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.run.method_run import MAIN, Cases, MethodRun
from validate.recording.types import Recording
from validate.register.signals import SignalObservation

from .files import FORCE
from .registration import binned

_HEADINGS = (
    "law", f"E x thickness / {FORCE}/m", "95 % ±", f"fitted: rms / {FORCE}",
    "predicted to / mm", f"rms there / {FORCE}", "end: predicted over measured", "95 %",
)  # fmt: skip


def exhibits(tree: Tree, cases: Cases, progress: Any) -> ReportAdditions:
    """Every law's fit beside its prediction, with the interval that the fit leaves."""
    ended = [f for f in cases[MAIN].values() if f.whole]
    rows = {f.label: _row(f) for f in ended}
    note = (
        "A law is chosen by its prediction. The interval is that of the modulus alone, from "
        "the scatter about the fit (Student's t)."
    )
    if rows:
        reach = max(row[4] for row in rows.values())
        best = min((n for n, r in rows.items() if r[4] == reach), key=lambda n: rows[n][5])
        note += f" Smallest error of those that reach {reach:.2f} mm: {best}."
    table = NumberTable("laws", "Fitted moduli and their predictions", _HEADINGS,
                        tuple(rows.values()), note)  # fmt: skip
    return ReportAdditions((Exhibit("laws", "Prediction of each law", tables=(table,)),))


def _row(found: MethodRun) -> tuple[Any, ...]:
    seen = found.seen.of(SignalObservation)[0]
    force = np.interp(seen.t, found.run.t, found.run.traces["moving.force"].y)
    measured, fitted = seen.y[:, 0], calibrating(found)
    E = found.body.material.E
    share = _share(force[fitted], measured[fitted])
    end = float(force[-1] / measured[-1])
    pulled = found.seen.inputs.sum(axis=1)[-1]
    return (
        found.label, E, E * share, rms(force[fitted] - measured[fitted]),
        1e3 * float(pulled), rms(force[~fitted] - measured[~fitted]), end,
        f"{end * (1 - share):.3f} to {end * (1 + share):.3f}",
    )  # fmt: skip


def calibrating(found: MethodRun) -> np.ndarray:
    """Which steps of the force calibrated (nt,)."""
    seen = found.seen.of(SignalObservation)[0]
    fitted = next(s for s in found.seen.selections if s.label == "fitted")
    return np.isin(seen.t, np.asarray(fitted.t))


def _share(force: Floats, measured: Floats) -> float:
    """Relative half width of the 95 % interval of a scale fitted to the measured force."""
    freedom = len(force) - 1
    scatter = float(np.sqrt(((force - measured) ** 2).sum() / freedom))
    return float(student.ppf(0.975, freedom)) * scatter / float(np.linalg.norm(force))


def follows(experiment: Experiment, recordings: Sequence[Recording], tree: Tree) -> Experiment:
    """Limits in proportion to what was measured: a unit nobody stated has no scale."""
    largest = float(np.abs(binned(recordings[0], tree.settings).force).max())
    accept = tuple(
        replace(a, limit=0.1 * largest) if a.quantity == "force" else a for a in experiment.accept
    )
    name = recordings[0].name
    return replace(experiment, accept=accept, title=f"{experiment.title} ({name})")
