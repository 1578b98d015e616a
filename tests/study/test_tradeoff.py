"""A small trade whose answers are known, and fronts and memory by hand."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from types import SimpleNamespace as Made

import numpy as np
import pytest
from scipy import sparse

from validate.commands import study as studying
from validate.commands.main import run
from validate.engine.cell import Plan, Record, Where
from validate.engine.execution import finish
from validate.errors import ComparisonError, SceneError, UsageError
from validate.estimate.kalman import displacement_filter
from validate.fem.linear_solvers.factor import factorise
from validate.fem.system import build
from validate.library import studies
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.ladder.ladder import RUNGS, LawPair, Rival, Rung, Trial
from validate.pipeline.run.job import Job
from validate.scene.geometries.box import box
from validate.scene.material import LawName, Material
from validate.scene.scene import Drive, Load, Scene, Support
from validate.solve.dynamic.implicit import NewtonDynamics
from validate.solve.dynamic.modal import Modal
from validate.solve.dynamic.newmark import Newmark
from validate.solve.explicit.linear import ExplicitLinear
from validate.solve.static.quasi_static import QuasiStatic
from validate.solve.types import StepTimes
from validate.study.choose import study as climb
from validate.study.choose.exhibits import choose_exhibits
from validate.study.choose.facts import principal_strains
from validate.study.choose.study import Wanted, choose, wanted
from validate.study.coverage import plan as coverage_plan
from validate.study.stability import cell as precision
from validate.study.stability import cell as stability_cell
from validate.study.stability import gain
from validate.study.tradeoff import cell as trade_cell
from validate.study.tradeoff import study as trade
from validate.study.tradeoff.cell import Measured, TradeCell, held_bytes, run_cell
from validate.study.tradeoff.exhibits import trade_exhibits
from validate.study.tradeoff.page import cells_table, trade_document
from validate.study.tradeoff.study import Trade, TradeRow, front, trade_cells, traded

# private: _locking, _measured, _predicted, _sharing, _solved: called alone, case by case.
# private: _march, _scheme: replaced, to bring a case about.

OPTIONS = studying.StudyOptions(None, False, None, "", False)
STEPS = (0.02, 0.01, 0.005)
STATIC = Rival("static", "static superposition", lambda dt: QuasiStatic(), stepped=False)
AVERAGE = Rival("average", "prefactored", Newmark)


def block(element: str, level: int, law: LawName) -> Scene:
    """A block that is pulled, in level^3 boxes."""
    mesh = box((0.1, 0.1, 0.1), (level, level, level))
    return Scene(
        mesh.quadratic() if element == "P2" else mesh,
        Material(4e3, 0.3, law, rho=1000.0, mass_damping=2.0, stiffness_damping=1e-3),
        (Support("z0", (0, 1, 2)),),
        loads=(Load("pull", "z1", (0.0, 0.0, 1.0)),),
    )


def small(job: Job | None = None) -> Trial:
    return Trial(
        block, lambda level: 0.1 / level,
        {"P1": (1, 2), "P2": (1,)}, STEPS,
        lambda t: np.full((len(t), 1), 0.8), np.arange(0.04, 0.21, 0.04),
        np.array([[0.05, 0.05, 0.1], [0.05, 0.05, 0.05]]), ("P2", 2),
        lambda dt: Modal(dt, propagate="constant"),
        (
            STATIC,
            Rival("all modes", "modal", lambda dt: Modal(dt, propagate="constant"), stepped=False),
            AVERAGE,
            Rival("explicit", "explicit", lambda dt: ExplicitLinear(dt, damping_terms="full")),
            Rival("large", "large strain",
                   lambda dt: NewtonDynamics(dt, mass="consistent"), law="neo_hooke",
                   elements=("P1",), finest=1, shortest=STEPS[1]),
        ),
        LawPair("P1", 1, STEPS[0], Newmark, lambda dt: NewtonDynamics(dt, mass="consistent")),
        dynamic=True, rise_s=0.0,
    )  # fmt: skip


@pytest.fixture(scope="module")
def measured(phantom: Experiment, tmp_path_factory: pytest.TempPathFactory) -> Trade:
    """The trade above, under the name of an experiment."""
    cells = trade_cells(small(), Job("", ""))
    plan = Plan(Job("", ""), cells, small, run_cell, Measured)
    done = finish(plan, tmp_path_factory.mktemp("cells"), Where(workers=0))
    return traded(replace(phantom, name="small"), small(), cells, done, quick=False)


def rows_of(found: Trade, name: str, element: str = "P1", level: int = 2) -> list[TradeRow]:
    return [
        r for r in found.rows
        if (r.solver.name, r.element, r.level) == (name, element, level)
    ]  # fmt: skip


def test_every_solver_runs_on_every_mesh_element_and_step(measured: Trade) -> None:
    assert len(measured.rows) == 3 * (1 + 1 + 3 + 3) + 2
    assert all(r.step is not None and r.step.n > 0 for r in measured.rows if not r.failed)
    assert [r.dt for r in rows_of(measured, "average")] == list(STEPS)


def test_a_solver_without_error_leaves_the_meshes(measured: Trade) -> None:
    for element, level in (("P1", 1), ("P1", 2), ("P2", 1)):
        (row,) = rows_of(measured, "all modes", element, level)
        assert row.solver_error == pytest.approx(0.0, abs=1e-12)
        assert row.error == pytest.approx(row.mesh_error)
        assert row.error is not None
        assert 0 < row.error < measured.moved


def test_the_step_error_is_of_second_order_and_the_mesh_rules(measured: Trade) -> None:
    errors = [r.solver_error or 0.0 for r in rows_of(measured, "average")]
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.3)
    assert errors[2] < 0.1 * (rows_of(measured, "average")[2].mesh_error or 0.0)
    ladder = next(x for x in measured.refinements if x.what.startswith("steps of average"))
    assert ladder.found.order == pytest.approx(2.0, abs=0.6)
    stepped = [x.what.split(",")[0] for x in measured.refinements if x.what.startswith("steps")]
    assert stepped == ["steps of average", "steps of explicit"]  # of one law


def test_too_long_explicit_steps_are_rows_with_the_reason(measured: Trade) -> None:
    failed = [r for r in measured.rows if r.solver.name == "explicit" and r.failed]
    assert failed
    assert all("times the critical step" in r.failed and r.error is None for r in failed)


def test_statics_assemble_no_mass_and_say_so(measured: Trade) -> None:
    assert rows_of(measured, "static")[0].assembled == "K"
    assert "M" in rows_of(measured, "average")[0].assembled


def test_large_strain_is_held_against_its_own_truth(measured: Trade) -> None:
    large, _ = rows_of(measured, "large", level=1)
    linear = rows_of(measured, "average", level=1)[0]
    assert measured.law_error > 0
    # On the pair's own mesh and step the law's share cancels: what is left is the linear error.
    assert large.total == pytest.approx(linear.error, rel=1e-9)


def test_a_trade_is_told_in_numbers_that_are_finite(measured: Trade) -> None:
    made = trade_exhibits(measured)
    assert [e.anchor for e in made] == ["front", "shares", "costs", "convergence", "unscored"]
    told = trade_document(measured)
    assert {row[-1] for row in cells_table(measured).rows} == {
        r.failed or None for r in measured.rows
    }
    assert None in {row[-1] for row in cells_table(measured).rows}
    assert len(told["cells"]) == len(measured.rows)
    choice = choose(climbing(measured, []), wanted("1mm", "1Hz"), False, lambda trade, row, dt: row)
    assert {e.anchor for e in choose_exhibits(choice)} > {"choice", "numbers", "ladder"}


def climbing(
    whole: Trade, asked: list[tuple[str, float | None]], left_out: tuple[str, ...] = ()
) -> Callable[[Rung, float | None], climb.Reached | None]:
    """The trade rung by rung, with those that were asked for; solvers `left_out` have a bound."""
    solvers: set[str] = set()

    def climbed(rung: Rung, fastest: float | None) -> climb.Reached | None:
        asked.append((rung, fastest))
        mine = {s.name for s in whole.trial.solvers if s.rung == rung}
        out = [name for name in mine if name in left_out and fastest is not None]
        solvers.update(mine - set(out))
        rows = tuple(r for r in whole.rows if r.solver.name in solvers)
        bounds = tuple(
            climb.Excluded(rung, f"{n}, P1", f"{n}, P1 mesh 1", 2e-3, fastest or 0.0) for n in out
        )
        return climb.Reached(replace(whole, rows=rows), bounds)

    return climbed


def retimed(whole: Trade, times: dict[str, float]) -> Trade:
    """All cells of a solver with the same time s of a step."""
    rows = []
    for r in whole.rows:
        t = times.get(r.solver.name, 1.0)
        rows.append(replace(r, step=r.step and StepTimes(t, t, t, 9), field_s=0.0))
    return replace(whole, rows=tuple(rows))


def test_the_pick_is_the_fastest_of_all_rungs(measured: Trade) -> None:
    asked: list[tuple[str, float | None]] = []
    times = {"static": 1e-6, "all modes": 2e-4, "average": 1e-4}
    static = min(r.total or 1.0 for r in measured.rows if r.solver.name == "static")
    average = max(r.total or 0.0 for r in rows_of(measured, "average"))
    assert average < static
    want = Wanted((average + static) / 2, 1.0)
    choice = choose(climbing(retimed(measured, times), asked), want, False,
                    lambda trade, row, dt: row)  # fmt: skip
    assert [rung for rung, _ in asked] == list(RUNGS)
    assert asked[2] == ("condensed", 2e-4)  # bounds are held against the pick so far
    assert asked[-1] == ("large strain", 1e-4)
    assert choice.pick is not None
    assert choice.pick.solver.name == "average"  # above 'modal', that meets both too
    assert choice.excluded == ()


def test_a_rung_that_a_bound_excludes_says_so(measured: Trade) -> None:
    times = {"static": 1e-6, "all modes": 2e-4, "average": 1e-4}
    climbed = climbing(retimed(measured, times), [], left_out=("explicit",))
    choice = choose(climbed, Wanted(1.0, 1.0), False, lambda trade, row, dt: row)
    explicit = next(c for c in choice.ladder if c.rung == "explicit")
    assert explicit.verdict == "excluded"
    assert "at least 2e+03 us a step, more than 1 us of the pick" in explicit.evidence
    tables = [t for e in choose_exhibits(choice) for t in e.tables if t.name == "excluded"]
    assert [row[:2] for row in tables[0].rows] == [("explicit", "explicit, P1")]


def test_a_bound_is_the_fastest_step_less_what_the_clock_hides() -> None:
    steps = [StepTimes(t, 9.0, 9.0, 4) for t in (3.0, 2.0)]
    strides = tuple(trade_cell.Stride(1.0, step=s, field_s=0.5) for s in steps)
    assert climb.time_bound(Measured(strides)) == pytest.approx(2.5 / 1.25)
    assert climb.time_bound(Measured((trade_cell.Stride(1.0, failed="refused"),))) is None
    assert climb.time_bound(None) is None


def test_where_nothing_meets_both_every_rung_is_climbed(measured: Trade) -> None:
    asked: list[tuple[str, float | None]] = []
    climbed = climbing(measured, asked)
    choice = choose(climbed, Wanted(1e-12, 1.0), False, lambda trade, row, dt: row)
    assert (choice.pick, asked) == (None, [(rung, None) for rung in RUNGS])


def test_a_rung_that_meets_both_only_at_its_own_step_is_left_for_the_next(measured: Trade) -> None:
    asked: list[tuple[str, float | None]] = []
    slow = StepTimes(9.0, 9.0, 9.0, 9)
    choice = choose(
        climbing(measured, asked), Wanted(0.1, 1e3), False,
        lambda trade, row, dt: replace(row, dt=dt, step=slow),
    )  # fmt: skip
    assert (choice.pick, asked) == (None, [(rung, None) for rung in RUNGS])
    assert len(choice.rejected) > 4


@pytest.fixture
def ran(monkeypatch: pytest.MonkeyPatch) -> list[TradeCell]:
    """Cells that a climb of the small trade has run."""
    ran: list[TradeCell] = []

    def noted(trial: Trial, cell: TradeCell) -> Measured:
        ran.append(cell)
        return run_cell(trial, cell)

    monkeypatch.setattr(climb, "trial_of", lambda *_: small())
    monkeypatch.setattr(climb, "job_of", lambda *_, **__: Job("", ""))
    monkeypatch.setattr(
        climb, "plan_of", lambda job, cells: Plan(job, cells, small, noted, Measured)
    )
    return ran


def test_no_cell_of_a_rung_runs_before_it_is_asked_for(
    phantom: Experiment, tmp_path: Path, ran: list[TradeCell]
) -> None:
    climbed = climb.Climb(phantom, declared_law=True, out=tmp_path, where=Where(0))
    assert ran == []
    first = climbed("static superposition", None)
    assert {c.solver for c in ran} == {"", "static"}
    second = climbed("modal", None)
    assert {c.solver for c in ran} == {"", "static", "all modes"}
    assert first is not None
    assert second is not None
    assert second.trade.rows[: len(first.trade.rows)] == first.trade.rows
    assert second.trade.done.records.keys() > first.trade.done.records.keys()
    assert climbed("condensed", None) is None
    assert climbed("large strain", None) is None  # --declared-law


def test_a_candidate_slower_than_the_pick_is_timed_on_its_coarsest_mesh_only(
    phantom: Experiment, tmp_path: Path, ran: list[TradeCell]
) -> None:
    climbed = climb.Climb(phantom, out=tmp_path, where=Where(0))
    climbed("static superposition", None)
    del ran[:]
    reached = climbed("prefactored", 1e-12)
    assert [(c.element, c.level, c.budget) for c in ran] == [("P1", 1, 0.0), ("P2", 1, 0.0)]
    assert reached is not None
    assert [e.candidate for e in reached.excluded] == ["average, P1", "average, P2"]
    assert all(e.bound > e.pick == 1e-12 for e in reached.excluded)
    assert {r.solver.name for r in reached.trade.rows} == {"static"}
    reached = climbed("modal", 1e3)
    assert reached is not None
    assert (len(reached.excluded), {r.solver.name for r in reached.trade.rows}) == (
        0, {"static", "all modes"},
    )  # fmt: skip


def test_errors_of_forces_are_those_of_what_drives_the_scene(
    phantom: Experiment, tmp_path: Path
) -> None:
    """Without Poisson's ratio the force is E A d / h on every mesh: 4 kPa, 0.1 m, 1 mm: 0.4 N."""

    def driven(element: str, level: int, law: LawName) -> Scene:
        held = block(element, level, law)
        material = Material(4e3, 0.0, law)
        stage = Drive("stage", "z1", (0.0, 0.0, -1.0))
        return replace(held, material=material, loads=(), drives=(stage,))

    trial = replace(
        small(), build=driven, inputs=lambda t: np.full((len(t), 1), 1e-3), pair=None,
        solvers=(STATIC,), best=lambda dt: QuasiStatic(), dynamic=False,
    )  # fmt: skip
    cells = trade_cells(trial, Job("", ""))
    done = finish(Plan(Job("", ""), cells, lambda job: trial, run_cell, Measured), tmp_path,
                  Where(workers=0))  # fmt: skip
    found = traded(phantom, trial, cells, done, False, "N")
    assert found.moved == pytest.approx(0.4, rel=1e-9)
    assert [r.error for r in found.rows] == pytest.approx([0.0] * 3, abs=1e-12)
    assert found.shown(0.2) == "0.2 N"
    climb.require_judged(trial, "N")
    with pytest.raises(UsageError, match=r"--error in Pa: .* N: stage\.fo"):
        climb.require_judged(trial, "Pa")
    assert trade_exhibits(found)[0].tables[0].headings[6] == "error / N"
    assert "error_N" in trade_document(found)["cells"][0]


@pytest.fixture
def commanded(measured: Trade, monkeypatch: pytest.MonkeyPatch) -> None:
    """The command line's trade is the one above."""
    monkeypatch.setattr(studying, "find", lambda *_: measured.experiment)
    monkeypatch.setattr(studies, "trade", lambda experiment, **rest: measured)
    monkeypatch.setattr(studies, "Climb", lambda experiment, **rest: climbing(measured, []))


@pytest.mark.slow
@pytest.mark.usefixtures("commanded")
def test_choose_writes_its_folder_and_exits_by_its_verdict(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = ["study", "choose", "small", "--rate", "1Hz", "--out", str(tmp_path)]
    assert run([*asked, "--error", "10mm", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["study"]
    fastest = min(
        (c for c in told["cells"] if c["error_m"] is not None and c["with_law_m"] <= 0.01),
        key=lambda c: c["time_s"],
    )
    assert told["pick"]["solver"] == fastest["solver"]
    assert told["pick"]["time_s"] == fastest["time_s"]
    assert run([*asked, "--error", "1nm"]) == 1
    said = " ".join(capsys.readouterr().out.split())
    assert "Nothing meets both 1e-06 mm and 1 Hz. Nearest: " in said
    (folder,) = (tmp_path / "small").glob("study-choose*+1nm+1Hz-*")
    assert (folder / "tables" / "cells.csv").is_file()
    assert (folder / "figures" / "chart_choice.png").is_file()


@pytest.mark.slow
@pytest.mark.usefixtures("commanded")
def test_tradeoff_writes_its_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["study", "tradeoff", "small", "--out", str(tmp_path)]) == 0
    assert "the front runs from" in capsys.readouterr().out
    text = (tmp_path / "small" / "study-tradeoff" / "report.html").read_text(encoding="utf-8")
    assert "Pareto front of error" in text
    assert "Observed order and grid convergence index" in text


def test_bad_input_exits_with_2_and_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["study", "choose", "bending_rod", "--error", "0.5", "--rate", "1000Hz"]) == 2
    assert run(["study", "tradeoff", "bending_rood"]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 2
    assert "write for example 0.5mm" in lines[0]
    assert "bending_rod" in lines[1]


def timed(name: str, error: float, time: float, solver: Rival = AVERAGE) -> TradeRow:
    step = StepTimes(time, time, time, 9)
    solver = replace(solver, name=name)
    return TradeRow(solver, "P1", 1, 0.01, step=step, error=error, total=error)


def test_the_front_by_hand() -> None:
    rows = (timed("fast", 4.0, 1.0), timed("mean", 2.0, 3.0), timed("slow", 1.0, 9.0),
            timed("beaten", 3.0, 4.0), timed("worst", 5.0, 20.0))  # fmt: skip
    found = front(rows, "error")
    assert [r.solver.name for r in found.rows] == ["fast", "mean", "slow"]
    assert found.dominated == ("beaten", "worst")
    assert [r.solver.name for r in front(rows, "error", floor=2.5).rows] == ["fast", "mean"]


def test_a_row_of_the_front_in_its_own_units(
    measured: Trade, capsys: pytest.CaptureFixture[str]
) -> None:
    row = replace(timed("fast", 2e-3, 4e-6), mesh_error=1e-3, solver_error=5e-4)
    found = replace(measured, rows=(row,))
    table = trade_exhibits(found)[0].tables[0]
    told = dict(zip(table.headings, table.rows[0], strict=True))
    assert told["time / us"] == pytest.approx(4.0)
    assert told["rate / Hz"] == pytest.approx(2.5e5)
    assert told["error / mm"] == pytest.approx(2.0)
    assert told["of the motion / %"] == pytest.approx(0.2 / measured.moved)
    shown = Made(found=found, page=Path("report.html"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(studies, "tradeoff", lambda *_: shown)
        patch.setattr(studying, "find", lambda *_: None)
        assert studying.tradeoff("", OPTIONS) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert lines.count(["fast", "P1", "1", "2.00", "4.00"]) == 2


def test_a_ladder_has_the_error_of_its_rungs(
    measured: Trade, capsys: pytest.CaptureFixture[str]
) -> None:
    best = timed("fast", 2e-3, 4e-6)
    rungs = (Made(rung="modal", verdict="meets", best=best, evidence="one"),
             Made(rung="large", verdict="nothing ran", best=None, evidence="none"))  # fmt: skip
    choice = Made(trade=measured, facts=(), ladder=rungs, by="error", rejected=(), excluded=(),
                  pick=None)  # fmt: skip
    shown = Made(found=choice, page=Path("report.html"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(studying, "words", lambda choice: iter(["none"]))
        patch.setattr(studies, "choice", lambda *_, **__: shown)
        patch.setattr(studying, "find", lambda *_: None)
        assert studying.choosing("", OPTIONS, error="", rate="", declared_law=False) == 1
    found = capsys.readouterr().out.split("Candidate methods")[1]
    modal, large = (next(x for x in found.splitlines() if r in x) for r in ("modal", "large"))
    assert modal.split() == ["modal", "2.00", "meets"]
    assert large.split() == ["large", "–", "nothing", "ran"]
    assert "0.00" not in large


def test_memory_counts_every_array_once() -> None:
    one = np.zeros(1000)
    assert held_bytes((one, one[10:], {"again": one})) == 8000
    system = build(block("P1", 2, "linear"))
    K = system.K[system.free][:, system.free]
    factor = factorise(K, system.free // 3, system.scene.mesh.nodes)
    assert held_bytes(factor) == 12 * factor.lu.nnz + factor.order.nbytes


def test_principal_strains_of_a_stretched_block() -> None:
    mesh = box((1.0, 1.0, 1.0), (1, 1, 1))
    u = mesh.nodes * np.array([0.02, -0.05, 0.01])
    assert principal_strains(mesh, u) == pytest.approx(np.full(len(mesh.cells), 0.05))


def test_steps_must_land_on_frames() -> None:
    with pytest.raises(SceneError, match="do not end on the frames"):
        replace(small(), steps=(0.03,))


def test_elements_that_lock_are_named(measured: Trade) -> None:
    def stiff(element: str, level: int, law: LawName) -> Scene:
        scene = block(element, level, law)
        return replace(scene, material=replace(scene.material, nu=0.499))

    assert measured.locking == ()
    found = replace(measured, trial=replace(measured.trial, build=stiff))
    (warning,) = found.locking
    assert warning.startswith("linear tetrahedra lock near incompressibility")
    assert warning.endswith("nu = 0.499 (P1)")
    assert warning in trade_exhibits(found)[0].words


def test_a_trade_without_its_reference_compares_nothing() -> None:
    trial = SimpleNamespace(reference=("tet4", 9))
    cell = SimpleNamespace(part="best", element="tet4", level=9, key="k")
    done = SimpleNamespace(records={"k": Record("k", failed="out of memory")})
    with pytest.raises(ComparisonError, match="no reference, so nothing was compared"):
        trade.traded(None, trial, (cell,), done, True)  # type: ignore[arg-type]


def test_a_reference_that_ends_early_names_its_mesh(monkeypatch: pytest.MonkeyPatch) -> None:
    end = SimpleNamespace(state="diverged", step=3, why="not finite")
    scheme = SimpleNamespace(prepare=lambda system: None)
    monkeypatch.setattr(trade_cell, "_scheme", lambda *_: (scheme, None))
    monkeypatch.setattr(trade_cell, "build", lambda scene: None)
    run = SimpleNamespace(finished=False, outcome=end)
    monkeypatch.setattr(trade_cell, "_march", lambda *_: run)
    trial = SimpleNamespace(build=lambda *_: None)
    cell = SimpleNamespace(part="best", element="tet4", level=9, steps=(0.1,))
    with pytest.raises(ComparisonError, match="tet4 mesh 9 ended at step 3"):
        trade_cell.run_cell(trial, cell)  # type: ignore[arg-type]


def test_a_system_that_is_singular_in_a_precision_has_no_answer() -> None:
    one = sparse.csr_array(np.diag([1.0, 0.0]))
    assert np.isnan(precision._solved(one, np.ones(2))).all()
    whole = sparse.csr_array(np.diag([1.0, 2.0]))
    assert precision._solved(whole, np.ones(2)).tolist() == [1.0, 0.5]


def test_cells_that_mixed_elements_do_not_know_have_no_locking(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def unknown(scene: object) -> None:
        raise SceneError("mixed elements support linear meshes")

    monkeypatch.setattr(stability_cell, "mixed_static", unknown)
    assert stability_cell._locking(None) is None  # type: ignore[arg-type]


def test_a_solver_that_is_refused_has_a_stride_of_its_words(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def refuse(*_: object) -> None:
        raise SceneError("no density")

    cell = SimpleNamespace(element="P1", level=2, steps=(0.1, 0.2), budget=1.0)
    trial = SimpleNamespace(build=lambda *_: None)
    monkeypatch.setattr(trade_cell, "build", refuse)
    found = trade_cell._measured(trial, cell, SimpleNamespace(law="svk"))  # type: ignore[arg-type]
    assert [s.failed for s in found.strides] == ["refused: no density"] * 2
    monkeypatch.setattr(trade_cell, "build", lambda scene: None)
    solver = SimpleNamespace(law="svk", make=refuse)
    found = trade_cell._measured(trial, cell, solver)  # type: ignore[arg-type]
    assert [(s.dt, s.failed) for s in found.strides] == [
        (0.1, "refused: no density"),
        (0.2, "refused: no density"),
    ]


def test_studies_of_what_cannot_be_are_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stability_cell, "body_of", lambda experiment: None)
    job = SimpleNamespace(experiment=lambda: None)
    with pytest.raises(ComparisonError, match="the experiment declares no density, so"):
        stability_cell.open_bench(job)  # type: ignore[arg-type]
    marked = SimpleNamespace(markers=("tip",), steps=None)
    experiment = SimpleNamespace(name="x", methods={"kf": marked}, reference="", accepted=("kf",))
    with pytest.raises(ComparisonError, match="x: every method uses markers, so none"):
        coverage_plan.true_method(experiment, "kf")  # type: ignore[arg-type]
    failed = SimpleNamespace(failure=("not_converged", "no root"))
    stepper = SimpleNamespace(rest=lambda: None, step=lambda *_: failed)
    exact = SimpleNamespace(on=lambda columns: stepper)
    monkeypatch.setattr(gain, "ExactPressure", lambda: exact)
    with pytest.raises(ComparisonError, match="no pressure keeps the volume constant"):
        gain._predicted(None, None)  # type: ignore[arg-type]

    def coupled(*_: object) -> None:
        raise SceneError("damping couples the modes")

    monkeypatch.setattr(displacement_filter, "in_modes", coupled)
    filters = SimpleNamespace(
        care=None, smooth=False, claimed=None, covariance=None, system=None,
        excitation=SimpleNamespace(rule=None),
    )  # fmt: skip
    alone = displacement_filter.DisplacementStepper._sharing(filters)  # type: ignore[arg-type]
    assert alone is None
