"""Errors at what was withheld, blocks of time and nested choices, against numbers made by hand."""

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import multivariate_normal
from script_modules import module_of
from study_samples import experiment_file

from validate.engine.cell import Where
from validate.errors import ComparisonError, UsageError
from validate.estimate.kalman.formulas import Gaussian, kf_update
from validate.fem.assembly.locate import Rows
from validate.pipeline.experiment.find import find, load_file
from validate.pipeline.experiment.options import Options
from validate.pipeline.run.pipeline import compare
from validate.recording.types import Contours
from validate.register.outlines.outlines import OutlineObservation
from validate.register.outlines.sections import SurfaceSampler
from validate.scene.geometries.box import box
from validate.study.filters.cell import folds_of, run_cell
from validate.study.filters.page import against_first, study_exhibits
from validate.study.filters.plan import Bench, FilterCell, plan
from validate.study.filters.score import (
    AHEAD,
    HELD_OUT,
    WITHHELD,
    FilterScores,
    cut,
    nested,
    score_interval,
)
from validate.study.filters.study import study
from validate.study.filters.withheld_errors import (
    Innovations,
    MarkerTracks,
    Segments,
    Withheld,
    ahead_errors,
    innovations_of,
)

CUBE = box((1.0, 1.0, 1.0), (1, 1, 1))


def test_samples_are_counted_in_their_own_segments_and_none_at_rest() -> None:
    segments = Segments(np.array([0.0, 1.0, 2.0]))
    t = np.array([0.0, 0.5, 1.0, 1.5, 2.0])
    assert segments.number(t).tolist() == [-1, 0, 0, 1, 1]
    assert segments.sums(t, np.array([9.0, 1.0, 2.0, 3.0, 4.0])).tolist() == [3.0, 7.0]


def tracks(z: np.ndarray, rest: np.ndarray) -> MarkerTracks:  # type: ignore[type-arg]
    names = tuple("abc"[: z.shape[1]])
    return MarkerTracks(names, np.arange(1.0, len(z) + 1), z, rest, Rows.barycentric(CUBE, rest))


def test_the_error_of_a_marker_is_its_distance_where_it_was_seen() -> None:
    z = np.zeros((4, 2, 3))
    z[1, 0] = np.nan
    own = tracks(z, np.array([[0.5, 0.5, 1.0], [0.5, 0.5, 0.5]]))
    u = np.zeros((4, 2, 3))
    u[:, 0] = (3.0, 4.0, 0.0)
    a, b = own.errors(own.t, u, Segments(np.array([0.0, 2.0, 4.0])), ahead=False)
    assert (a.squares.tolist(), a.counts.tolist()) == ([[25.0, 50.0]], [[1.0, 2.0]])
    assert b.squares.sum() == 0


def test_persistence_is_the_last_displacement_of_the_nearest_given_marker() -> None:
    z = np.zeros((3, 2, 3))
    z[:, 0, 0] = (1.0, np.nan, 3.0)
    z[:, 1, 0] = (7.0, 8.0, 9.0)
    given = tracks(z, np.array([[0.0, 0.0, 1.0], [1.0, 1.0, 1.0]]))
    scored = tracks(np.zeros((3, 1, 3)), np.array([[0.1, 0.1, 1.0]]))
    assert scored.held(given)[:, 0, 0].tolist() == [1.0, 1.0, 3.0]


def test_innovations_stay_correlated_as_long_as_they_remember() -> None:
    """Of a first-order process of memory .8 the autocorrelation is .8^k: below 1/e from 5 on."""
    rng, e = np.random.default_rng(2), np.zeros(4000)
    for k in range(1, len(e)):
        e[k] = 0.8 * e[k - 1] + rng.standard_normal()
    t, zero = 0.01 * np.arange(1, len(e) + 1), np.zeros(len(e))
    segments = Segments(np.linspace(0, t[-1], 11))
    found = innovations_of(t, e[:, None], zero, zero, segments)
    assert found.lag_1 == pytest.approx(0.8, abs=0.03)
    assert found.correlation_s == pytest.approx(0.05, abs=0.011)
    white = innovations_of(t, rng.standard_normal((4000, 2)), zero, zero, segments)
    assert white.correlation_s == pytest.approx(0.01)


def test_the_likelihood_is_the_density_of_what_was_measured() -> None:
    rng = np.random.default_rng(5)
    P, H = np.diag([2.0, 3.0]), rng.standard_normal((3, 2))
    R, z = np.diag([0.5, 0.1, 0.2]), rng.standard_normal(3)
    own = kf_update(Gaussian(np.ones(2), P), z, H, R).innovation
    S = H @ P @ H.T + R
    density = multivariate_normal(H @ np.ones(2), S)
    assert own.log_likelihood == pytest.approx(density.logpdf(z))
    part = kf_update(Gaussian(np.ones(2), P), np.array([z[0], np.nan, z[2]]), H, R).innovation
    pick = np.ix_([0, 2], [0, 2])
    density = multivariate_normal((H @ np.ones(2))[[0, 2]], S[pick])
    assert part.log_likelihood == pytest.approx(density.logpdf(z[[0, 2]]))


def test_an_outline_moves_along_its_normals_as_the_wall_does() -> None:
    """A block that grows by a part in a thousand: its section is a square that grows."""
    mesh = box((1.0, 1.0, 1.0), (4, 4, 4))
    sides = np.concatenate([mesh.facets[s] for s in ("x0", "x1", "y0", "y1", "z0", "z1")])
    mesh = replace(mesh, facets={**mesh.facets, "all": sides})
    wall = SurfaceSampler.of_cavity(mesh, "all", None, 1)
    pose = np.eye(4)
    pose[2, 3] = 0.4
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    edge = np.concatenate(
        [
            a + np.linspace(0, 1, 40, endpoint=False)[:, None] * (b - a)
            for a, b in zip(square, np.roll(square, -1, axis=0), strict=True)
        ]
    )
    middle, by = np.array([0.5, 0.5]), 1e-3
    outlines = (edge, middle + (1 + by) * (edge - middle))
    contours = Contours(np.array([0.0, 1.0]), outlines, 1e-5, pose, "body")
    found = OutlineObservation.of(contours, wall, 0.0).along_normals(8)
    u = by * (mesh.nodes - np.array([0.5, 0.5, 0.4]))
    sides_alone = np.abs(found.normals).max(axis=1) > 0.99  # at a corner no normal is the side's
    assert sides_alone.sum() >= 4
    moved = found.H @ u.ravel()
    assert moved[sides_alone] == pytest.approx(0.5 * by, rel=1e-6)
    assert found.z[1][sides_alone] == pytest.approx(0.5 * by, rel=1e-6)
    assert found.sd == pytest.approx(np.sqrt(2) * 1e-5)


# --- blocks and nested choices --------------------------------------------------------------------


def result(squares: np.ndarray, correlation_s: float = 0.01) -> FilterScores:  # type: ignore[type-arg]
    """Of one recording: squared errors (markers, segments) with one sample in each, segments of
    0.1 s."""
    count = np.ones((1, squares.shape[1]))
    parts = tuple(Withheld(f"m{i}", "m", s[None], count, marker=True)
                  for i, s in enumerate(squares))  # fmt: skip
    rms = float(np.sqrt(squares.mean()))
    return FilterScores(
        {WITHHELD: (rms,)}, {WITHHELD: "m"}, nis=1.0, nis_dof=1, withheld=parts,
        innovations=Innovations(count, count, correlation_s, 0.0), segment_s=0.1,
    )  # fmt: skip


def test_blocks_are_as_long_as_the_correlation_and_few_give_no_interval() -> None:
    assert cut(100, 0.1, 0.01, "kf").count == 20
    many = cut(100, 0.1, 1.0, "kf")
    assert (many.count, many.length_s, many.sure) == (10, 1.0, True)
    few = cut(100, 0.1, 1.5, "kf")
    assert (few.count, few.sure) == (6, False)
    assert "fewer than 8 blocks give no interval" in few.words
    own = result(np.random.default_rng(1).chisquare(3, (1, 100)))
    assert score_interval(own, WITHHELD, few).half is None
    assert score_interval(own, WITHHELD, many).half is not None
    remembers = replace(own, innovations=replace(own.innovations, correlation_s=2.0))
    assert score_interval(remembers, WITHHELD, many).half is None


def test_an_interval_over_blocks_holds_the_true_error() -> None:
    """Squared errors of three components, independent: rms sqrt(3), 400 recordings."""
    rng, blocks = np.random.default_rng(6), cut(100, 0.1, 0.5, "kf")
    found = [score_interval(result(rng.chisquare(3, (1, 100))), WITHHELD, blocks)
             for _ in range(400)]  # fmt: skip
    share = np.mean([i.low <= np.sqrt(3) <= i.high for i in found])
    assert share == pytest.approx(0.95, abs=3 * np.sqrt(0.05 * 0.95 / 400))


def test_a_nested_choice_tells_what_the_winner_of_many_is_worth() -> None:
    """Twenty settings that are all alike: the winner looks better than it is, the nested one does
    not."""
    rng, looks, worth = np.random.default_rng(7), [], []
    for _ in range(30):
        filters = {f"kf {i}": result(rng.chisquare(3, (2, 100))) for i in range(20)}
        looks.append(min(v.scores[WITHHELD][0] for v in filters.values()))
        own = nested(filters, {}, WITHHELD, cut(100, 0.1, 0.5, "kf"))
        assert own is not None
        assert own.split
        worth.append(own.error.mean)
    assert np.mean(looks) < np.sqrt(3) - 0.05
    assert np.mean(worth) == pytest.approx(np.sqrt(3), abs=0.02)


def test_a_setting_that_is_best_everywhere_is_chosen_everywhere() -> None:
    good, poor = result(np.full((1, 40), 1.0)), result(np.full((1, 40), 4.0))
    blocks = cut(40, 0.1, 0.2, "kf")
    own = nested({"good": good, "poor": poor}, {"fem": poor}, WITHHELD, blocks)
    assert own is not None
    assert (dict(own.chosen), own.error.mean, own.beside, own.split) == (
        {"good": 20}, 1.0, {"fem": 2.0}, False,
    )  # fmt: skip
    assert nested({"good": good, "poor": poor}, {}, WITHHELD, cut(40, 0.1, 4.0, "kf")) is None


# --- cells ----------------------------------------------------------------------------------------


def two_markers(folder: object) -> tuple[Bench, FilterCell]:
    pulled = load_file(experiment_file(folder))  # type: ignore[arg-type]
    kf = pulled.methods["kf"]
    both = {**pulled.methods, "kf": replace(kf, markers=("top", "side"))}
    more = replace(pulled, methods=both)
    planned = plan(more, Options({}, ("kf",)), (), 2)
    return Bench(more, planned.job), planned.cells[0]


def test_without_a_free_marker_each_is_held_out_in_turn(tmp_path: object) -> None:
    bench, cell = two_markers(tmp_path)
    folds = folds_of(cell, bench.ready(cell, 5)[0])
    assert [(f.given, f.scores) for f in folds] == [
        (("top", "side"), ()), (("side",), ("top",)), (("top",), ("side",)),
    ]  # fmt: skip
    found = run_cell(bench, cell)
    assert {(w.name, w.ahead) for w in found.withheld} == {
        ("top", False), ("side", False), ("top", True), ("side", True),
    }  # fmt: skip
    assert len(found.scores[HELD_OUT]) == len(found.scores[AHEAD]) == 2


def test_each_withholds_free_markers_and_those_that_a_filter_can_lose(tmp_path: Path) -> None:
    """One marker is given and cannot be lost: the other one, never given, is withheld."""
    pulled = load_file(experiment_file(tmp_path))
    found = study(
        pulled, methods=("kf", "plain"), seeds=1, hold_out=("each",), by=WITHHELD,
        out=tmp_path, where=Where(workers=0),
    )  # fmt: skip
    (ranking,) = found.rankings
    assert (len(ranking.rows), ranking.failed) == (3, ())
    for r in ranking.rows:
        scored = {(w.name, w.ahead) for w in r.result.withheld}
        assert scored == {("side", False), ("top", True)}, r.cell.name
    assert found.plan.single_words in " ".join(study_exhibits(found)[1].words)


def test_a_filter_that_is_given_nothing_is_its_model(tmp_path: Path) -> None:
    """The model of the filter is that of the plain solver: their errors are equal."""
    pulled = load_file(experiment_file(tmp_path))
    errors = {}
    for methods in (("kf",), ("kf", "plain")):
        found = study(
            pulled, methods=methods, seeds=1, by=WITHHELD, out=tmp_path, where=Where(workers=0)
        )
        errors |= {r.cell.name: r.score.mean for r in found.rankings[0].rows}
    assert set(errors) == {"kf", "kf, given nothing", "plain", "last measurement, held"}
    assert errors["kf, given nothing"] == pytest.approx(errors["plain"], rel=1e-9)


def test_a_marker_in_turn_is_not_predicted_by_itself(tmp_path: Path) -> None:
    """Persistence of a marker that is held out is the other marker's last displacement."""
    bench, cell = two_markers(tmp_path)
    held = run_cell(bench, replace(cell, baseline="persistence"))
    ready = bench.ready(cell, cell.seeds[0])[0]
    assert ready.tracks is not None
    z = ready.tracks.z[1:]
    top, side = (ready.tracks.names.index(n) for n in ("top", "side"))
    rms = float(np.sqrt(((z[:, top] - z[:, side]) ** 2).sum(axis=1).mean()))
    assert held.scores["top.held_out.rmse"][0] == pytest.approx(rms)
    assert held.scores["side.held_out.rmse"][0] == pytest.approx(rms)


def test_a_marker_that_is_held_out_by_name_scores_and_is_not_given(tmp_path: object) -> None:
    bench, cell = two_markers(tmp_path)
    named = replace(cell, hold_out=("side",))
    (fold,) = folds_of(named, bench.ready(named, 5)[0])
    assert (fold.given, fold.scores) == (("top",), ("side",))
    found = run_cell(bench, named)
    assert {(w.name, w.ahead) for w in found.withheld} == {("side", False), ("top", True)}


def test_held_out_names_are_markers_that_move_and_leave_one_to_the_filter(tmp_path: Path) -> None:
    bench, cell = two_markers(tmp_path)
    with pytest.raises(UsageError, match="--hold-out a: no"):
        run_cell(bench, replace(cell, hold_out=("a",)))
    with pytest.raises(UsageError, match="--hold-out top, side leaves"):
        run_cell(bench, replace(cell, hold_out=("top", "side")))


def test_a_next_sample_is_off_by_the_length_of_its_innovation() -> None:
    """3, 4 and 0 mm of one marker are 5 mm; a component of another one is its length."""
    y = np.array([[3.0, 4.0, 0.0, 2.0], [3.0, 0.0, 0.0, 9.0]])
    measured = np.array([[True, True, True, True], [True, True, True, False]])
    names = ("a.x", "a.y", "a.z", "b.z")
    one = Segments(np.array([0.0, 2.0]))
    a, b = ahead_errors(np.array([1.0, 2.0]), names, y, measured, one)
    assert (a.squares.item(), a.counts.item(), a.ahead) == (34.0, 2.0, True)
    assert (b.squares.item(), b.counts.item()) == (4.0, 1.0)


@pytest.mark.parametrize(("R", "used"), [("none", True), ("1e-9", False), ("1e-11", False)])
def test_a_filter_that_does_not_know_its_error_gives_no_interval(
    tmp_path: object, R: str, used: bool
) -> None:
    """NIS 0.80 with the declared noise (in the band), 0.09 and 5.0 with a wrong one."""
    pulled = load_file(experiment_file(tmp_path))  # type: ignore[arg-type]
    values = {"methods.kf.Q": "1e-11"} | ({} if R == "none" else {"methods.kf.R": R})
    check = compare(pulled, Options(values, ("kf",))).checks[0]
    assert (check.u_input > 0) == used


@pytest.mark.slow
def test_a_measured_recording_is_ranked_on_blocks_and_other_markers(
    shared_data: Path, tmp_path: Path
) -> None:
    """The silicone beam: the filter that doubts its model most is best at the tips it never saw;
    its innovations stay correlated, so there is no interval."""
    root = Path(__file__).parents[2]
    found = study(
        find("silicone_beam", root), ["methods.filter_doubt.R=4e-8,1e-6"],
        methods=("filter_doubt", "roukf"), out=tmp_path, where=Where(workers=0),
    )  # fmt: skip
    (ranking,) = found.rankings
    assert found.by == WITHHELD
    assert [r.cell.name for r in ranking.rows] == [
        "filter_doubt", "roukf", "filter_doubt", "filter_doubt, given nothing",
        "last measurement, held",
    ]  # fmt: skip
    assert ranking.rows[0].score.mean == pytest.approx(2.72e-4, rel=0.02)
    assert ranking.blocks is not None
    assert (ranking.blocks.count, ranking.rows[0].score.half) == (3, None)
    assert ranking.nested is not None
    assert ranking.nested.split
    assert dict(ranking.nested.chosen) == {"filter_doubt (R=4e-8)": 6}
    assert not found.picks


def test_where_every_setting_of_a_filter_fails_the_reason_is_said(tmp_path: Path) -> None:
    pulled = load_file(experiment_file(tmp_path))
    with pytest.raises(ComparisonError, match=r"all 1 settings.*Q = -1 m2"):
        study(
            pulled, ["methods.kf.Q=-1"], methods=("kf", "plain"), seeds=1, out=tmp_path,
            where=Where(workers=0),
        )  # fmt: skip


def test_without_an_interval_a_place_is_neither_worse_nor_a_tie(tmp_path: Path) -> None:
    pulled = load_file(experiment_file(tmp_path))
    found = study(
        pulled, methods=("kf", "plain"), seeds=1, out=tmp_path, where=Where(workers=0)
    )  # fmt: skip
    (ranking,) = found.rankings
    words = [against_first(r) for r in ranking.rows]
    assert words == ["best", "no interval", "no interval"]
    assert (found.best[0].ties, found.best[0].better) == (0, "plain")  # its twin's own model
    assert "place 2: plain is first" in found.best[0].doubts


@pytest.mark.slow
def test_a_ranking_without_truth_picks_a_good_filter(monkeypatch: pytest.MonkeyPatch) -> None:
    """One of the three twins, one of the seeds that were named before the first run; a filter of
    every kind, a good and a bad setting of the reduced one."""
    file = Path(__file__).parents[2] / "benchmarks" / "filter_rankings.py"
    ranked = module_of(file)
    of = ranked.CANDIDATES["ekf_cube"]
    cases = next(sweep for sweep in of.sweeps if sweep.startswith("case="))
    fewer = ranked.Candidates(
        ("ekf_held", "ekf_node", "reduced_modes", "roukf"),
        ("methods.reduced_modes.load_walk=0.03,3", cases),
    )
    monkeypatch.setitem(ranked.CANDIDATES, "ekf_cube", fewer)
    with tempfile.TemporaryDirectory() as folder:
        found = ranked.picks("ekf_cube", (301,), Path(folder))
    assert len(found) == 4
    assert sum(p.near for p in found) >= 3
