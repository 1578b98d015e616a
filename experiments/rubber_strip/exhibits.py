"""What the report of the strip shows: its contraction and all laws, its parts, the tracker."""

from pathlib import Path

import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import Chart, Exhibit, NumberTable, Series
from validate.pipeline.experiment.experiment import Progress, ReportAdditions
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.run.method_run import MAIN, Cases
from validate.register.signals import SignalObservation

from .points_file import read_points
from .stretches import stretches
from .strip import FIRST, LAST, Strip, recorded
from .tracker import stage_exhibit

_UNKNOWN = (
    "No force was recorded, so no modulus is identified or used. No thickness was recorded: "
    "every law here assumes that thickness contracts like width, and this determines the "
    "change of volume. The states have no times, so no rate is known."
)


def exhibits(tree: Tree, cases: Cases, tell: Progress) -> ReportAdditions:
    """Contraction over stretch, the parts of the strip, the tracker against its stage."""
    tell("compares the tracker with its stage")
    own: Strip = tree.settings
    path = recorded(tree, Path(__file__).parent)
    tracker = stage_exhibit(path.parent, own.stage)
    x = read_points(path, own.unit).marker("points").x
    shown = (_places(cases, x), _contraction(cases), _parts(own, x))
    return ReportAdditions((*shown, *((tracker,) if tracker else ())))


def _places(cases: Cases, x: Floats) -> Exhibit:
    """Points x (nt, n, 3) m at the last state, in its plane: along the strip and across it."""
    seen = np.isfinite(x[[0, -1]]).all(axis=(0, 2))
    rest, last = (1e3 * (one[seen] - one[seen].mean(axis=0)) for one in (x[0], x[-1]))
    plane, moved = (np.linalg.svd(one, full_matrices=False)[2][:2].T for one in (rest, last))
    places = {"measured": last @ moved * np.sign((plane * moved).sum(axis=0))}
    for f in (f for f in cases[MAIN].values() if f.run.finished):
        stretch = [f.run.traces[name].y[-1] for name in ("stretch", "free_stretch")]
        places[f.label] = rest @ plane * stretch
    series = tuple(Series(name, at[:, 0], at[:, 1], "points") for name, at in places.items())
    chart = Chart(
        "strip", "The strip at the last state", "along it / mm", "across it / mm", series,
        caption="Each law moves the points at rest by its two stretches. The two axes have scales "
        "of their own.",
    )  # fmt: skip
    return Exhibit("strip", "The strip, measured and simulated", charts=(chart,))


def _contraction(cases: Cases) -> Exhibit:
    runs = [f for f in cases[MAIN].values() if f.run.finished]
    seen = runs[0].seen
    first, last = (next(s for s in seen.of(SignalObservation) if s.quantity == q)
                   for q in (FIRST, LAST))  # fmt: skip
    points = [
        Series(label, np.interp(s.t, seen.t, seen.inputs[:, 0]), s.y[:, 0], "points")
        for label, s in (("measured, calibrates", first), ("measured, predicted", last))
    ]
    lines = [
        Series(f.label, f.run.traces["stretch"].y, f.run.traces["free_stretch"].y) for f in runs
    ]
    chart = Chart(
        "contraction", "Stretch across the strip", "stretch along it / 1", "stretch across / 1",
        (*points, *lines),
    )  # fmt: skip
    return Exhibit("contraction", "Lateral contraction of the strip", (_UNKNOWN,), charts=(chart,))


def _parts(p: Strip, x: Floats) -> Exhibit:
    found = stretches(x, p.patches)
    rows = [
        (k + 1, found.axial[-1, k], found.across[-1, k], found.ratio[0, k], found.ratio[-1, k])
        for k in range(p.patches)
    ]
    table = NumberTable(
        "parts",
        "Parts of the strip from one end to the other: stretches at the last state, and "
        "-ln(across)/ln(along) at the first step and at the last.",
        ("part", "along / 1", "across / 1", "ratio, first / 1", "ratio, last / 1"),
        tuple(rows),
    )
    words = (
        "The strip is not homogeneous: the differences between its parts are included in "
        "the uncertainty."
    )
    return Exhibit("parts", "Parts of the strip", (words,), tables=(table,))
