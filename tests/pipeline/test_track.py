"""Pipeline of experiments over time, on a cube of 27 boxes that is pulled for 30 steps."""

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tiny import (
    DECLARED,
    DT,
    METHODS,
    PROBES,
    STEPS,
    TINY,
    A,
    missed,
    record,
    stiffer,
    true_run,
    truth,
)

from validate.arrays import Floats, rms
from validate.compare.convergence import convergence
from validate.compare.published import Figure
from validate.compare.result import MethodResult, Result
from validate.compare.verdict import Accept
from validate.errors import ComparisonError, UsageError
from validate.estimate.measurements import Measurements
from validate.fem.system import System
from validate.parameters import quantity
from validate.pipeline.experiment.experiment import (
    Case,
    Experiment,
    MeshLadder,
    ReportAdditions,
    Twin,
    Uncertainty,
    vary,
)
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.options import Options
from validate.pipeline.experiment.tree import CellSize, Tree
from validate.pipeline.experiment.variation import change_of
from validate.pipeline.run.method_run import Cases, Truth
from validate.pipeline.run.pipeline import compare
from validate.recording.types import Recording
from validate.register.registration import Registered
from validate.solve.dynamic.newmark import Newmark
from validate.solve.types import Stepper

METRICS = ("mae", "rmse", "sd", "max", "nrmse")


def run(experiment: Experiment, *methods: str, quick: bool = False, **values: str) -> Result:
    return compare(experiment, Options(values, methods, quick))


def of(result: Result, name: str) -> MethodResult:
    return next(m for m in result.methods if m.name == name)


def scores(result: Result, name: str) -> dict[str, float]:
    return {s.name: s.value for s in of(result, name).scores}


def table(result: Result, name: str) -> list[tuple[Any, ...]]:
    found = [t for e in result.exhibits for t in e.tables if t.name == name]
    assert len(found) == 1
    return list(found[0].rows)


def speeds(result: Result) -> dict[str, dict[str, float]]:
    """Speed rows by method and quantity."""
    found: dict[str, dict[str, float]] = {}
    for block in result.rows:
        found.setdefault(block.row.method, {})[block.row.quantity] = float(block.values[0])
    return found


@pytest.fixture(scope="module")
def whole() -> Result:
    return compare(TINY, Options({}))


def test_every_probe_is_scored_on_every_case(whole: Result) -> None:
    """The model that made the recording has no error; `@all` are residuals of what was measured."""
    names = {f"{p}.{m}" for p in PROBES for m in METRICS}
    mine = {n for n in scores(whole, "fem") if n.split("@")[0] in names and "@all" not in n}
    assert mine == names | {f"{n}@stiff" for n in names}
    assert all(scores(whole, "fem")[n] == 0.0 for n in names)
    assert all(scores(whole, "fem")[f"{p}.rmse@stiff"] > 1e-5 for p in PROBES)
    filtered = scores(whole, "kf")
    assert {f"{n}@{case}" for n in names for case in ("stiff", "missing")} <= set(filtered)
    assert {"nis.per_dof", "nis.per_dof@stiff", "node_B.nees.per_dof@missing"} <= set(filtered)
    assert filtered["node_B.rmse@stiff"] < scores(whole, "fem")["node_B.rmse@stiff"]


def test_scores_are_those_of_the_runs_traces_against_the_truth(whole: Result) -> None:
    true = true_run(DECLARED)[1]
    found = of(whole, "kf")
    off = found.run.traces["node_B.z"].y - true.traces["node_B.z"].y
    by_hand = {
        "mae": np.abs(off).mean(),
        "rmse": np.sqrt((off**2).mean()),
        "sd": np.abs(off).std(ddof=1),
        "max": np.abs(off).max(),
        "nrmse": np.sqrt((off**2).mean()) / np.ptp(true.traces["node_B.z"].y),
    }
    for name, value in by_hand.items():
        assert scores(whole, "kf")[f"node_B.{name}"] == pytest.approx(value, rel=1e-12)


def test_no_method_sees_the_truth(whole: Result) -> None:
    """Another truth moves every score and not one number of a run."""

    def shifted(tree: Tree, seen: Registered) -> Truth:
        return Truth({name: u + 1.0 for name, u in truth(tree, seen).probes.items()})

    other = run(replace(TINY, twin=Twin(record, shifted, kind="same model"), cases=()))
    for name in ("fem", "kf", "slow"):
        one, two = of(whole, name).run, of(other, name).run
        assert np.array_equal(one.u, two.u)
        assert all(np.array_equal(t.y, two.traces[n].y) for n, t in one.traces.items())
        assert scores(other, name)["node_B.rmse"] > 0.9


@dataclass(frozen=True)
class Spied:
    """A scheme that notes what it is prepared with."""

    notes: list[tuple[Any, ...]] = field(compare=False)
    dt: float = quantity(DT, "s", "time step")

    def prepare(self, system: System, looks: Measurements | None = None) -> Stepper:
        self.notes.append((system, looks))
        return Newmark(self.dt).prepare(system)


def test_a_method_gets_the_models_system_and_its_own_markers_and_no_truth() -> None:
    given: list[tuple[Any, ...]] = []
    placed: list[tuple[Any, ...]] = []

    def spy(*arguments: Any) -> dict[str, Any]:
        placed.append(arguments)
        return {"dt": DT}

    spied = Spied(given)
    methods = {"fem": Method("FEM", spied), "kf": Method("filter", spied, markers=A)}
    run(replace(TINY, methods=methods, sets=spy))
    assert len(placed) == len(given) == 5  # two recorded, two on 'stiff', one on 'missing'
    for tree, seen in placed:
        assert tree == DECLARED  # never the truth's own
        assert {f.name for f in fields(seen)} == {
            "observations", "selections", "rest", "outside", "findings", "time_scale",
            "timed", "sudden", "moves",
        }  # fmt: skip
    assert all(system.scene.material.E == DECLARED.scene.material.E for system, _ in given)
    names = [looks.names if looks else None for _, looks in given]
    own = ("node_A.x", "node_A.y", "node_A.z")
    assert names == [None, own, None, own, own]


def test_a_method_that_fails_is_a_row_and_the_others_go_on(whole: Result) -> None:
    assert [m.name for m in whole.methods] == list(METHODS)
    assert of(whole, "refused").run.outcome.state == "refused"
    assert len(of(whole, "refused").run.t) == 0
    ended = of(whole, "diverged").run
    assert (ended.outcome.state, ended.outcome.step, len(ended.t)) == ("diverged", 7, 7)
    for name in ("refused", "diverged"):
        assert not {n for n in scores(whole, name) if n.startswith("node_")}
        assert not of(whole, name).residuals
    assert "refused" not in speeds(whole)
    assert speeds(whole)["diverged"]["steps"] == 7
    cases = [row for row in table(whole, "cases") if row[1] == "diverged"]
    assert [row[0] for row in cases] == ["stiff", "missing"]
    assert all(row[2:] == (None, None, None, "diverged") for row in cases)
    assert of(whole, "kf").run.finished


def test_a_run_that_ends_early_is_compared_with_nothing_and_fails() -> None:
    result = run(replace(TINY, accepted=("diverged",), cases=()), "diverged")
    (check,) = result.checks
    assert (check.verdict, check.count) == ("nothing compared", 0)
    assert check.why == "compared nothing: diverged: told so"
    assert not result.passed


def test_a_marker_that_is_not_there_is_compared_with_nothing_and_fails() -> None:
    accept = (Accept("node_B", 1e-4, "ours"), Accept("nowhere", 1e-4, "ours"))
    result = run(replace(TINY, accept=accept, cases=()), "fem")
    one, two = result.checks
    assert one.verdict == "same model"
    assert one.count == STEPS
    assert two.why == (
        "compared nothing: the recording does not have this quantity; nearest: node_B, node_A"
    )
    assert two.verdict == "nothing compared"
    assert not result.passed


def test_only_looks_that_saw_the_marker_are_compared() -> None:
    tree = missed(DECLARED)
    markers = record(tree, print).marker("markers")
    j = markers.names.index("node_B")
    looks = int(np.isfinite(markers.x[1:, j, 0]).sum())
    assert 10 < looks < 25
    result = run(replace(TINY, parameters=tree, cases=()), "fem", "slow")
    assert of(result, "fem").residuals["node_B@all"].count == looks
    assert of(result, "fem").checks[0].count == looks
    # Nothing is compared before the first long step's end, and no marker outside the scene is.
    later = int(np.isfinite(markers.x[3:, j, 0]).sum())
    assert of(result, "slow").residuals["node_B@all"].count == later
    assert set(of(result, "fem").residuals) == {"node_A@all", "node_B@all"}


def test_a_residual_is_estimate_less_measured() -> None:
    """Without noise only the modulus is left: the static part is 1/1.25 of the model's."""
    result = run(TINY, "fem", quick=True, sd="1e-12", **{"twin.stiffness": "1.25"})
    model = np.stack([of(result, "fem").run.traces[f"node_B.{c}"].y for c in "xyz"], axis=1)
    true = true_run(stiffer(DECLARED))[1]
    measured = np.stack([true.traces[f"node_B.{c}"].y for c in "xyz"], axis=1)
    values = of(result, "fem").residuals["node_B@all"].values
    assert values == pytest.approx(model - measured, abs=1e-9)
    assert values[-1, 2] / model[-1, 2] == pytest.approx(1 - 1 / 1.25, abs=0.03)


def test_long_steps_are_scored_at_their_own_times(whole: Result) -> None:
    found = of(whole, "slow").run
    assert found.t == pytest.approx(DT * np.arange(3, STEPS + 1, 3))
    assert found.finished
    true = true_run(DECLARED)[1].traces["node_A.z"].y[2::3]
    off = found.traces["node_A.z"].y - true
    value = scores(whole, "slow")["node_A.max"]
    assert value == pytest.approx(float(np.abs(off).max()), rel=1e-12)
    assert value > 0
    speed, step = speeds(whole)["slow"], found.step_s
    assert step is not None
    assert speed["dt"] == pytest.approx(3 * DT, rel=1e-12)
    assert speed["real-time factor"] == pytest.approx(3 * DT / step.p50, rel=1e-12)
    assert speed["steps"] == STEPS // 3


def test_a_baseline_is_timed_and_neither_scored_nor_run_on_other_cases(whole: Result) -> None:
    timed = of(whole, "timed")
    assert len(timed.run.t) == 5
    assert "step.p50" in scores(whole, "timed")
    assert not {n for n in scores(whole, "timed") if n.startswith("node_")}
    assert "FEM, timed" not in {row[1] for row in table(whole, "cases")}
    assert {row[1] for row in table(whole, "cases") if row[0] == "missing"} == {
        "filter", "diverged",
    }  # fmt: skip


@pytest.mark.parametrize("method", ["timed", "refused", "diverged"])
def test_methods_without_a_score_alone_are_a_result_too(method: str) -> None:
    result = run(TINY, method)
    assert [(m.name, m.label) for m in result.methods] == [(method, METHODS[method].label)]
    assert not result.passed


def test_a_case_is_loaded_where_it_ships_and_made_anew_where_not() -> None:
    loaded: list[Tree] = []
    made: list[Tree] = []

    def loads(tree: Tree, folder: Path) -> tuple[Recording, ...]:
        loaded.append(tree)
        assert folder == Path(__file__).parent
        return (record(tree, print),)

    def records(tree: Tree, progress: Callable[[str], None]) -> Recording:
        made.append(tree)
        return record(tree, progress)

    cases = (Case("a", "", stiffer, shipped=True), Case("b", "", stiffer))
    twin = Twin(records, truth, kind="same model")
    result = run(replace(TINY, load=loads, twin=twin, cases=cases), "fem")
    assert loaded == [DECLARED, stiffer(DECLARED)]
    assert made == [stiffer(DECLARED)]
    found = scores(result, "fem")
    assert found["node_B.rmse@a"] == found["node_B.rmse@b"] > 0


def test_a_filters_own_covariance_is_part_of_u_val() -> None:
    result = run(replace(TINY, accepted=("fem", "kf"), cases=()), "fem", "kf")
    plain, filtered = (of(result, name).checks[0] for name in ("fem", "kf"))
    assert plain.u_input == 0.0
    found = of(result, "kf")
    assert found.run.sd is not None
    node = found.scene.mesh.nearest_node(np.array(PROBES["node_B"]))
    claimed = np.linalg.norm(found.run.sd[:, node], axis=1)  # at the worst instant
    assert np.isclose(claimed, filtered.u_input, rtol=1e-9).any()
    assert filtered.u_input > 0
    assert filtered.u_val == pytest.approx(np.hypot(filtered.u_D, filtered.u_input))


@pytest.mark.slow
def test_mesh_and_inputs_enter_u_val_by_the_surrogate() -> None:
    """By hand: residuals of three runs, their differences times the declared scales."""
    declared = Uncertainty(
        mesh=MeshLadder(
            tuple(change_of({"body.cells": (n,) * 3}) for n in (2, 4)),
            CellSize(),
        ),
        inputs=(vary("material.E", "relative 1 %", "modulus"),),
        surrogate="fem",
    )
    accept = (Accept("node_B", 1e-4, "ours", statistic="rms"),)
    experiment = replace(TINY, uncertainty=declared, cases=(), accept=accept)
    check = of(run(experiment, "fem"), "fem").checks[0]

    def residual(**values: str) -> Floats:
        return of(run(TINY, "fem", quick=True, **values), "fem").residuals["node_B@all"].values

    # The recording is made with the tree, so its E stays and the twin's is moved against it.
    moved = residual(**{"material.E": "10100", "twin.stiffness": repr(1 / 1.01)})
    assert check.u_input == pytest.approx(rms(moved - residual()), rel=1e-6)
    answers = [residual(**{"body.cells": f"{n},{n},{n}"}) for n in "324"]
    u_num = convergence((4, 6, 3), answers, 0, 2.0).u
    assert check.u_num == pytest.approx(u_num, rel=1e-12)
    assert 0 < min(check.u_input, check.u_num) < np.inf


def test_another_model_without_declared_uncertainty_is_refused() -> None:
    with pytest.raises(ComparisonError, match="no uncertainty is declared; u_val"):
        run(replace(TINY, twin=Twin(record, truth), cases=()), "fem")


def told(tree: Tree, cases: Cases, progress: Callable[[str], None]) -> ReportAdditions:
    return ReportAdditions((), {"cases": float(len(cases))})


PUBLISHED = (Figure("cases", "told:cases", 3.0, 0.0, "1", "reproduced", "", "here"),)


def test_quick_skips_cases_own_exhibits_and_printed_figures() -> None:
    experiment = replace(TINY, exhibits=told, published=PUBLISHED)
    result = run(experiment, quick=True)
    assert result.quick
    assert not result.published
    assert not any("@stiff" in n for n in scores(result, "fem"))
    assert "quick run" in result.sentence


@pytest.mark.slow
def test_what_an_experiment_tells_reaches_its_printed_figures_when_all_was_run() -> None:
    experiment = replace(TINY, exhibits=told, published=PUBLISHED)
    (figure,) = run(experiment).published
    assert figure.ours == 3.0  # the recorded case and two others
    assert not figure.fault
    assert run(experiment, "fem").published == ()  # of a part of the methods it says nothing


def test_a_printed_figure_that_nothing_computes_fails_with_what_it_lacks() -> None:
    (figure,) = run(replace(TINY, published=PUBLISHED, cases=())).published
    assert figure.ours is None
    assert figure.fault == "not computed: no score 'cases'"


def test_unknown_methods_name_the_nearest() -> None:
    with pytest.raises(UsageError, match="unknown method 'femm'; nearest: fem"):
        run(TINY, "femm")


def test_progress_names_every_run_once_and_counts_the_time_they_take() -> None:
    calls: list[tuple[int, int, str]] = []
    compare(TINY, Options({}, ("fem", "kf", "timed")), lambda *told: calls.append(told))
    runs = [what.split(":")[0] for _, _, what in calls if what.endswith(": mesh")]
    cases = ["fem on stiff", "kf on stiff", "kf on missing"]
    assert runs == ["fem", "kf", "timed", *cases]
    first = next(i for i, call in enumerate(calls) if call[2].startswith("kf"))
    assert {call[:2] for call in calls[:first]} == {(0, 1)}  # nothing was timed yet
    done = [d for d, _, _ in calls[first:]]
    assert done == sorted(done)
    assert all(0 < d <= n for d, n, _ in calls[first:])
    steps = [what for _, _, what in calls if "unknowns, step" in what]
    assert len(steps) > 6


def test_maps_compare_equal_times_only() -> None:
    """Ten long steps have as many frames as ten of a truth's thirty, at other times: no map, or it
    would show a lag as an error. The exact model has no error to show."""

    def few(tree: Tree, seen: Registered) -> Truth:
        true, run = true_run(tree, 10)
        return Truth.of(run, true)

    twin = Twin(record, few, kind="same model")
    result = run(replace(TINY, twin=twin, frames=10, cases=()), "fem", "kf", "slow")
    maps = {m.name: m for e in result.exhibits for m in e.maps}
    assert set(maps) == {"error_kf"}
    true = true_run(DECLARED, 10)[1]
    assert of(result, "slow").run.u.shape == true.u.shape
    error = np.sqrt(((of(result, "kf").run.u - true.u) ** 2).sum(axis=2).mean(axis=0))
    assert maps["error_kf"].values == pytest.approx(1e3 * error, rel=1e-12)
