"""NIS, NEES and whiteness of hand-made runs, against chi-square by hand."""

from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

from validate.arrays import Floats
from validate.pipeline.checks.consistency import (
    consistency_exhibit,
    consistency_scores,
    nees_of,
    nis_of,
)
from validate.pipeline.run.method_run import MethodRun, Truth
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.scene.geometries.box import box
from validate.scene.material import Material
from validate.scene.scene import Probe, Scene, Support
from validate.solve.types import Outcome, Run, Trace

STEPS, DT = 40, 0.1
MESH = box((1.0, 1.0, 1.0), (1, 1, 1))
NODE = MESH.nearest_node(np.array([1.0, 1.0, 1.0]))
SCENE = Scene(
    MESH,
    Material(1e3, 0.3),
    (Support("z0", (0, 1, 2)),),
    probes=(Probe("tip", (1.0, 1.0, 1.0)), Probe("own", (0.0, 0.0, 1.0))),
)
T = DT * np.arange(1, STEPS + 1)


def followed(
    nis: Floats | None,
    dof: Floats | None,
    error: Floats | None = None,
    sd: Floats | None = None,
    case: str = "",
    innovation: Floats | None = None,
) -> MethodRun:
    """A run whose tip is off the truth by `error` (no, 3) and claims `sd` (no, 3) at all frames."""
    at = np.arange(1, STEPS, 2)
    u = np.zeros((len(at), len(MESH.nodes), 3))
    path = np.stack([0.1 * T, 0.2 * T, -0.3 * T], axis=1)
    u[:, NODE] = path[at] + (0.0 if error is None else error)
    claimed = None
    if sd is not None:
        claimed = np.zeros_like(u)
        claimed[:, NODE] = sd
    traces = {f"{p.name}.{c}": Trace(np.zeros(STEPS), "m") for p in SCENE.probes for c in "xyz"}
    if nis is not None and dof is not None:
        traces |= {"nis": Trace(nis, "1"), "nis.dof": Trace(dof, "1")}
    if innovation is not None:
        traces |= {
            "innovation.tip.x": Trace(innovation, "m"),
            "innovation.tip.x.sd": Trace(np.full(STEPS, 2.0), "m"),
        }
    run = Run("kf", T, at, u, traces, Outcome("finished", STEPS), 0.0, None, claimed)
    seen = Registered((SignalObservation("pull", "drives", T, np.ones((STEPS, 1)), "N", 0.0),))
    return MethodRun("kf", "filter", case, SCENE, (seen,), (run,), {}, Truth({"tip": path}))


def rows_of(found: MethodRun, others: dict[str, Any] | None = None) -> list[dict[str, Any]]:
    shown = consistency_exhibit({"kf": found}, others or {}, ())
    assert shown is not None
    table = shown.tables[0]
    return [dict(zip(table.headings, row, strict=True)) for row in table.rows]


def test_nis_counts_measured_components_only() -> None:
    """30 of 40 steps measure 3 components, each NIS 4.5: 1.5 per degree over 90 degrees."""
    dof = np.where(np.arange(STEPS) % 4 == 0, 0.0, 3.0)
    (row,) = rows_of(followed(1.5 * dof, dof))
    low, high = chi2.ppf((0.025, 0.975), 90) / 90
    assert row == {
        "case": "recorded", "filter": "filter", "what": "NIS", "per dof / 1": pytest.approx(1.5),
        "95 % band from / 1": pytest.approx(low), "to / 1": pytest.approx(high), "steps": 30,
        "dof": 90, "verdict": "over-confident", "alarm": "none",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("per_dof", "verdict"),
    [(0.5, "under-confident"), (1.0, "consistent"), (2.0, "over-confident")],
)
def test_verdicts_follow_the_band(per_dof: float, verdict: str) -> None:
    dof = np.full(STEPS, 3.0)
    (row,) = rows_of(followed(per_dof * dof, dof))
    assert row["verdict"] == verdict
    assert row["alarm"] == "none"


def test_a_model_of_another_kind_raises_the_alarm() -> None:
    dof = np.full(STEPS, 3.0)
    (row,) = rows_of(followed(59.0 * dof, dof))
    assert row["alarm"].startswith("wrong model class: NIS per degree of freedom 59")


def test_nees_is_squared_error_over_claimed_variance_where_any_is_claimed() -> None:
    """Errors 2 and 3 sd, the last component held: (4 + 9) / 2 per degree, 20 frames of 2."""
    dof = np.full(STEPS, 3.0)
    error, sd = np.tile([0.02, 0.06, 0.0], (20, 1)), np.tile([0.01, 0.02, 0.0], (20, 1))
    found = followed(dof, dof, error, sd)
    nees = nees_of(found)
    assert set(nees) == {"tip"}  # the other probe has no truth
    assert nees["tip"].mean == pytest.approx(6.5, rel=1e-9)
    assert (nees["tip"].samples, nees["tip"].dof) == (20, 40)
    assert [r["what"] for r in rows_of(found)] == ["NIS", "NEES at tip"]
    scores = {s.name: (s.value, s.count, s.against) for s in consistency_scores(found)}
    assert scores["nis.per_dof"] == (pytest.approx(1.0), 120, "measured recording")
    assert scores["tip.nees.per_dof"] == (pytest.approx(6.5), 40, "truth of the twin")


def test_an_error_beside_no_claimed_doubt_at_all_is_over_confidence() -> None:
    """P - K H P reaches exactly zero: such frames must not be left out."""
    dof = np.full(STEPS, 3.0)
    error, sd = np.tile([0.02, 0.0, 0.0], (20, 1)), np.zeros((20, 3))
    nees = nees_of(followed(dof, dof, error, sd))["tip"]
    assert (nees.verdict, nees.samples, nees.dof) == ("over-confident", 20, 20)
    assert "is wrong here" in nees.alarm
    error[::2] = 0.0  # right at times is not held
    assert nees_of(followed(dof, dof, error, sd))["tip"].dof == 20


def test_nees_reads_the_truth_at_the_times_of_the_frames() -> None:
    """A field on the truth's path has no error, though its frames are every second step."""
    dof = np.full(STEPS, 3.0)
    found = followed(dof, dof, sd=np.full((20, 3), 1e-6))
    assert nees_of(found)["tip"].mean == pytest.approx(0.0, abs=1e-12)


def test_cases_are_named_in_rows_and_scores() -> None:
    dof = np.full(STEPS, 3.0)
    main, other = followed(dof, dof), followed(2 * dof, dof, case="stiff")
    assert [r["case"] for r in rows_of(main, {"stiff": {"kf": other}})] == ["recorded", "stiff"]
    assert [s.name for s in consistency_scores(other)] == ["nis.per_dof@stiff"]


def test_solvers_and_filters_that_measured_nothing_say_nothing() -> None:
    for nothing in (followed(None, None), followed(np.zeros(STEPS), np.zeros(STEPS))):
        assert nis_of(nothing) is None
        assert consistency_scores(nothing) == ()
        assert consistency_exhibit({"kf": nothing}, {}, ()) is None
    unclaimed = followed(np.full(STEPS, 3.0), np.full(STEPS, 3.0), sd=np.zeros((20, 3)))
    assert nees_of(unclaimed) == {}


@pytest.mark.parametrize("white", [True, False])
def test_whiteness_tells_noise_from_memory(white: bool) -> None:
    dof, rng = np.full(STEPS, 3.0), np.random.default_rng(4)
    y = rng.standard_normal(STEPS) if white else np.sin(0.2 * np.arange(STEPS))
    shown = consistency_exhibit({"kf": followed(dof, dof, innovation=y)}, {}, ())
    assert shown is not None
    (row,) = shown.tables[1].rows
    lag = float(y[1:] @ y[:-1] / (y @ y))
    assert row[:2] == ("filter", "tip.x")
    assert row[3] == pytest.approx(lag, rel=1e-12)
    assert row[4:] == (STEPS, "yes" if white else "no")


def test_the_chart_shows_measured_steps_and_the_band_of_one_step() -> None:
    dof = np.where(np.arange(STEPS) % 2 == 0, 3.0, 0.0)
    shown = consistency_exhibit({"kf": followed(0.7 * dof, dof)}, {}, ())
    assert shown is not None
    band, points = shown.charts[0].series
    assert points.x == pytest.approx(T[::2])
    assert points.y == pytest.approx(0.7)
    low, high = chi2.ppf((0.025, 0.975), 3) / 3
    assert band.upper is not None
    assert (band.y[0], band.upper[0]) == pytest.approx((low, high))
