"""Coverage of verdicts: a normal E differs in 4.6 %, and what is off is named."""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from types import SimpleNamespace

import jsonschema
import numpy as np
import pytest
from command_line import refused

from validate.commands.main import run
from validate.compare.overall_verdict import ALPHA
from validate.engine.cell import Record, Where
from validate.errors import ComparisonError, UsageError
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.find import load_file
from validate.pipeline.run.job import job_of
from validate.pipeline.run.runs import ExperimentRuns
from validate.report.stored.store import schema
from validate.study.coverage import bench as coverage_bench
from validate.study.coverage import study as coverage_module
from validate.study.coverage import worlds as coverage_worlds
from validate.study.coverage.bench import ExactReading, opened_here
from validate.study.coverage.page import sentence
from validate.study.coverage.plan import (
    World,
    draws_of,
    in_world,
    steps_of,
    true_method,
    wrong_paths,
)
from validate.study.coverage.study import Coverage, Quantity, coverage
from validate.study.coverage.worlds import Study, _alike

# private: _Truth, _alike, _mistaken, _of_method, _sides, _terms: called alone, case by case.
# private: _readings: replaced, to bring a case about.

ROOT = Path(__file__).parents[2]
HERE = Where(0)
TINY = (ROOT / "tests" / "pipeline" / "tiny.py").read_text("utf-8")
# The block at three holds: one force each, its sensor's noise .1 mN, E perhaps uncertain.
OWN = """
from validate.pipeline.experiment.experiment import Uncertainty, vary

EXPERIMENT = replace(
    AT_HOLDS, name="{name}", accept=(Accept("{quantity}", {limit}, "ours"),),
    uncertainty={uncertainty}, path=None)
"""
REGION = """
from validate.scene.material import Region

WHOLE = Region("all", where="box 0,0,0 to 10mm,10mm,10mm", contrast=1.0)
AT_HOLDS = replace(AT_HOLDS, parameters=AT_HOLDS.parameters.with_scene(regions=(WHOLE,)))
"""
INPUTS = """Uncertainty(
    inputs=(vary("material.E", "relative {range}", "modulus"),), surrogate="fem")"""


def written(name: str, quantity: str = "force", uncertain: float = 0.0) -> Experiment:
    path = Path(mkdtemp()) / f"{name}.py"
    declared = INPUTS.format(range=uncertain) if uncertain else "None"
    limit = 5e-3 if quantity == "force" else 5e-5
    own = OWN.format(name=name, quantity=quantity, limit=limit, uncertainty=declared)
    path.write_text(TINY + own, encoding="utf-8")
    return load_file(path)


@cache
def studied(
    quantity: str = "force", uncertain: float = 0.0, noise: float = 1.0, draws: int = 200
) -> Coverage:
    own = written("drawn", quantity, uncertain)
    out = Path(mkdtemp())
    return coverage(own, draws=draws, noise=noise, out=out, where=HERE)


def pooled(found: Coverage) -> float:
    return float(np.mean([q.share.value for q in found.quantities]))


def one(found: Coverage) -> Quantity:
    return found.quantities[0]


@pytest.mark.slow
def test_one_number_with_normal_noise_differs_in_two_sided_two_sd() -> None:
    """600 draws: their share has a standard deviation of .85 %."""
    found = studied()
    assert len(found.quantities) == 3  # a force at each hold
    assert pooled(found) == pytest.approx(ALPHA, abs=2 * 0.0085)
    assert all(t.ratio == pytest.approx(1, abs=0.2) for q in found.quantities for t in q.terms)
    assert all(q.undecided.number == 0 for q in found.quantities)


@pytest.mark.slow
def test_a_standard_deviation_that_is_declared_twice_too_small_is_named() -> None:
    found = studied(noise=2.0, draws=100)
    assert pooled(found) == pytest.approx(0.317, abs=0.06)  # a normal law beyond one sd
    for q in found.quantities:
        assert q.finding.word == "too narrow"
        assert q.finding.fault is not None
        assert q.finding.fault.name == "measurement"
        assert q.finding.fault.ratio == pytest.approx(2, rel=0.25)
    assert not found.passed


@pytest.mark.slow
def test_many_numbers_at_once_hold_too() -> None:
    found = studied("node_B")
    assert 0.01 <= pooled(found) <= 0.08
    assert found.together[0].share.value <= 0.07


def test_models_whose_error_is_the_limit_are_rarely_called_either() -> None:
    """And not all undecided: were nothing added to the error, all of them would be good enough."""
    (quantity, *_) = studied(draws=50).quantities
    assert quantity.rejected.number == 0
    for share in (quantity.false_good, quantity.false_bad):
        assert share is not None
        assert (share.count, share.value <= 0.08) == (50, True)


@pytest.mark.slow
def test_an_input_alone_never_leaves_its_uniform_range() -> None:
    found = studied(uncertain=0.2)
    for q in found.quantities:
        assert q.share.number == 0
        assert q.finding.word == "blunt"
        assert q.finding.fault is not None
        assert q.finding.fault.name == "u_input (modulus)"
        assert "uniform range ends" in q.finding.words
    assert found.passed  # a blunt check raises no false alarm
    assert "Blunt by u_input (modulus) (force" in sentence(found)


@pytest.mark.slow
def test_a_wrong_modulus_is_noticed_the_more_the_wronger() -> None:
    found = studied()
    every = [p for p in found.power if p.path == "material.E" and p.name is None]
    shares = [p.share.value for p in every if p.share]
    assert [p.by for p in every] == [0.05, 0.1, 0.2]
    assert shares == [1.0, 1.0, 1.0]  # .1 mN in a force of 30 mN
    blunt = studied(uncertain=0.2)
    own = [p for p in blunt.power if p.name is None and p.path == "material.E"]
    weak = [p.share.value for p in own if p.share]
    assert weak[0] < 0.1
    assert weak == sorted(weak)


@pytest.mark.slow
def test_what_is_finished_is_not_run_again(tmp_path: Path) -> None:
    own = written("drawn", uncertain=0.05)
    first = coverage(own, draws=20, out=tmp_path, where=HERE)
    again = coverage(own, draws=20, out=tmp_path, where=HERE)
    assert (first.done.reused, again.done.reused) == (0, 2)
    assert again.quantities == first.quantities


def test_readings_add_up_as_a_linear_body_does() -> None:
    """Half the step to a wrong world is what lies half-way; other samples are interpolated."""
    t = np.array([0.0, 1.0, 2.0])
    base, step = (
        ExactReading((np.zeros(3),), (t,)),
        ExactReading((np.array([2.0, 4.0, 6.0]),), (t,)),
    )
    assert base.plus(0.5, step, base).left[0] == pytest.approx([1.0, 2.0, 3.0])
    finer = ExactReading((np.array([2.0, 3.0, 4.0, 5.0, 6.0]),), (np.linspace(0, 2, 5),))
    assert finer.on(base).left[0] == pytest.approx([2.0, 4.0, 6.0])
    with pytest.raises(ComparisonError, match=r"8 numbers.*3 as"):
        ExactReading((np.zeros(8),), (t,)).on(base)


def test_what_was_identified_is_drawn_as_noise_has_it_and_ranges_as_they_end() -> None:
    own = written("drawn", uncertain=0.1)
    assert own.uncertainty is not None
    (one,) = own.uncertainty.inputs
    both = replace(own.uncertainty, inputs=(one, replace(one, name="found", identified=True)))
    z = draws_of(replace(own, uncertainty=both), 200, 1)
    assert np.abs(z).max(axis=0) == pytest.approx([np.sqrt(3), 2.8], rel=0.01)
    assert z.std(axis=0) == pytest.approx([1.0, 1.0], rel=0.02)
    assert draws_of(replace(own, uncertainty=None), 20, 1).shape == (20, 0)


def test_a_wrong_body_with_other_samples_has_no_power_and_says_why() -> None:
    t = np.arange(3.0)
    base, other = ExactReading((np.zeros(3),), (t,)), ExactReading((np.zeros(8),), (t,))
    found = _alike(Record("key", other), base)
    assert (found.value, found.why) == (
        None,
        "8 numbers are measured in the drawn recording, 3 as judged",
    )
    assert _alike(Record("key", base), base).value is not None


def at(value: float) -> ExactReading:
    return ExactReading((np.full(3, value),), (np.arange(3.0),))


def opened_study() -> Study:
    job = job_of(written("drawn", uncertain=0.1))
    bench, opening = opened_here(job)
    return Study(job, Path(mkdtemp()), HERE, None, bench, opening, 0.0, 20, 1, 1.0)


def truth(method: str, by: str) -> coverage_worlds._Truth:
    return coverage_worlds._Truth(opened_study(), method, by, at(10.0))


def test_what_stands_in_for_a_slow_method_takes_it_to_other_worlds(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    (plus, _) = steps_of(("modulus",))
    cheap = {World(): Record("c", at(3.0)), plus: Record("d", at(5.0))}
    monkeypatch.setattr(coverage_worlds, "_readings", lambda study, method, worlds, s=0.0: cheap)
    found = truth("slow", "cheap").in_worlds((plus,), 0.0)[plus].value
    assert found is not None
    assert found.left[0].tolist() == [12.0] * 3
    assert "differences of cheap" in truth("slow", "cheap").notes[0]
    assert truth("slow", "slow").notes == ()


def test_an_input_without_solution_moves_as_the_surrogate_does(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of the surrogate 3 as judged, 5 at one u; of the method 10: 12 there."""
    plus, minus = steps_of(("modulus",))
    own = {plus: Record[ExactReading]("a", refused="no state there"), minus: Record("b", at(9.0))}
    other = {World(): Record("c", at(3.0)), plus: Record("d", at(5.0))}
    monkeypatch.setattr(coverage_worlds, "_readings", lambda study, method, worlds, s=0.0: other)
    sides, (told,) = coverage_worlds._sides(truth("dear", "dear"), own)
    assert [side.left[0].tolist() for side in sides["modulus"]] == [[12.0] * 3, [9.0] * 3]
    assert told == "dear: modulus +1 u by the surrogate's difference: no state there"


def test_a_method_that_is_its_own_surrogate_has_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    plus, minus = steps_of(("modulus",))
    own = {plus: Record[ExactReading]("a", refused="no state there"), minus: Record("b", at(9.0))}
    with pytest.raises(ComparisonError, match="its truth could not be run: no state"):
        coverage_worlds._sides(truth("fem", "fem"), own)


def test_dear_wrong_parameters_lie_on_a_line_through_the_one_that_is_solved(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[World] = []

    def solved(
        study: Study, method: str, worlds: tuple[World, ...], seconds: float
    ) -> dict[World, Record[ExactReading]]:
        asked.extend(worlds)
        return {w: Record("k", at(14.0)) for w in worlds}

    monkeypatch.setattr(coverage_worlds, "_readings", solved)
    own = truth("fem", "fem")
    wrong, found, (said,) = coverage_worlds._mistaken(own, ("E",), 1e3)
    assert asked == [World(wrong=("E", 0.1))]
    shown = {by: r.value.left[0][0] for (_, by), w in wrong.items() if (r := found[w]).value}
    assert shown == pytest.approx({0.05: 12.0, 0.1: 14.0, 0.2: 18.0})
    assert "solved at 10 % only" in said
    assert len(coverage_worlds._mistaken(own, ("E",), 0.1)[1]) == 3
    assert len(asked) == 4


def test_no_rival_is_opened() -> None:
    bench, _ = opened_here(job_of(written("drawn")))
    assert set(bench.runs.methods) == {"fem"}


def test_worlds_are_parameters() -> None:
    own = written("drawn", uncertain=0.1)
    assert [p.path for p in wrong_paths(own.parameters)] == ["material.E", "sd"]
    wrong = in_world(own, own.parameters, World(wrong=("material.E", 0.2)))
    assert pytest.approx(1.2 * own.parameters.scene.material.E) == wrong.scene.material.E
    assert (
        pytest.approx(0.9 * own.parameters.scene.material.E)
        == in_world(own, own.parameters, World((("modulus", -1.0),))).scene.material.E
    )


def test_the_truth_of_a_filter_is_a_method_without_markers() -> None:
    sys_tiny = load_file(_as_file("tiny_over_time", "EXPERIMENT = replace(TINY, path=None, "
                                  'name="tiny_over_time")'))  # fmt: skip
    assert true_method(sys_tiny, "kf") == "fem"
    assert true_method(sys_tiny, "slow") == "slow"


def _as_file(name: str, text: str) -> Path:
    path = Path(mkdtemp()) / f"{name}.py"
    path.write_text(f"{TINY}\n{text}\n", encoding="utf-8")
    return path


@pytest.mark.slow
def test_a_filter_runs_anew_on_every_draw(tmp_path: Path) -> None:
    text = 'EXPERIMENT = replace(TINY, path=None, name="filtered", accepted=("kf",), cases=())'
    found = coverage(load_file(_as_file("filtered", text)), draws=10, out=tmp_path, where=HERE)
    (q,) = found.quantities
    assert len(set(q.judged.E)) > 5  # an E that noise explains is zero
    assert "the covariance of the filter" in {t.name for t in q.terms}


@pytest.mark.parametrize(("draws", "noise"), [(3, 1.0), (20, 0.0)])
def test_too_few_draws_or_no_noise_are_refused(draws: int, noise: float) -> None:
    with pytest.raises(UsageError, match="draws of"):
        coverage(written("drawn"), draws=draws, noise=noise, out=Path(mkdtemp()), where=HERE)


def test_nothing_accepted_is_refused() -> None:
    none = replace(written("drawn"), accepted=())
    path = _as_file("none", 'EXPERIMENT = replace(AT_HOLDS, path=None, name="none", accepted=())')
    assert none.accepted == ()
    with pytest.raises(ComparisonError, match="there is nothing to check"):
        coverage(load_file(path), out=Path(mkdtemp()), where=HERE)


@pytest.mark.slow
def test_the_command_writes_a_page_with_tables_and_curves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("VALIDATE_NO_GL", "1")
    own = written("drawn", uncertain=0.05)
    asked = ["study", "coverage", str(own.path), "--quick", "--workers", "0", "--json"]
    run([*asked, "--out", str(tmp_path)])
    content = json.loads(capsys.readouterr().out)
    jsonschema.validate(content, schema())
    assert content["study"]["kind"] == "coverage"
    assert content["study"]["draws"] == 40
    (folder,) = (tmp_path / "drawn").glob("study-coverage+*")
    page = (folder / "report.html").read_text("utf-8")
    assert "Rate at which a perfect model differs" in page
    assert {p.name for p in (folder / "tables").glob("*.csv")} >= {
        "cells.csv", "coverage.csv", "terms.csv", "power.csv"
    }  # fmt: skip
    assert list((folder / "figures").glob("chart_power_fem_*.png"))


@pytest.mark.slow
def test_a_drawn_truth_without_solution_is_taken_linearly_and_named(tmp_path: Path) -> None:
    """The modulus of a region that is all of the block has no sign of its own before it is meshed;
    beyond -1/.7 u it is negative."""
    uncertainty = INPUTS.format(range=0.7).replace("material.E", "regions.all.contrast")
    text = OWN.format(name="steep", quantity="force", limit=5e-3, uncertainty=uncertainty)
    path = tmp_path / "steep.py"
    path.write_text(TINY + REGION + text, encoding="utf-8")
    found = coverage(load_file(path), draws=20, out=tmp_path, where=HERE)
    (note,) = found.notes
    assert "drawn truths have no solution" in note
    assert len(found.quantities[0].judged.validations) == 20


def test_what_has_no_coverage_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ComparisonError, match="'cell' is compared as SimpleNamespace"):
        coverage_bench.drawable(SimpleNamespace(name="cell"))  # type: ignore[arg-type]
    end = SimpleNamespace(state="diverged", why="not finite")
    ended = SimpleNamespace(registered=[None], runs=[SimpleNamespace(outcome=end)])
    monkeypatch.setattr(coverage_bench, "in_world", lambda *_: None)
    monkeypatch.setattr(coverage_bench, "solve", lambda *_: ended)
    monkeypatch.setattr(coverage_bench, "reached_end", lambda *_: False)
    runs = SimpleNamespace(experiment=None, parameters=None, recordings=(), settings={"m": None})
    cell = SimpleNamespace(world=None, method="m", label="world 3")
    with pytest.raises(ComparisonError, match="world 3: diverged, not finite"):
        coverage_bench.run_reading(SimpleNamespace(runs=runs), cell)  # type: ignore[arg-type]
    monkeypatch.setattr(coverage_bench, "terms_of", lambda *_: ())
    bench = SimpleNamespace(runs=runs, followed=lambda method: ended)
    with pytest.raises(ComparisonError, match="m: no accepted quantity was compared"):
        coverage_bench.run_terms(bench, cell)  # type: ignore[arg-type]


def test_terms_that_failed_are_raised_by_their_words(monkeypatch: pytest.MonkeyPatch) -> None:
    study = SimpleNamespace(job=SimpleNamespace(), opening=None)
    monkeypatch.setattr(coverage_module, "key_of", lambda *_: "k")
    monkeypatch.setattr(coverage_module, "Plan", lambda *_: None)
    failed = SimpleNamespace(records={"k": Record("k", failed="no force")})
    monkeypatch.setattr(coverage_module, "finished", lambda *_: failed)
    with pytest.raises(ComparisonError, match="no force"):
        coverage_module._terms(study, "linear")  # type: ignore[arg-type]


def test_blocks_of_draws_that_fail_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    records = {"a": Record("a", 1), "b": Record("b", failed="out of memory")}
    worlds = SimpleNamespace(whole=True, moved={}, base=None, sides={}, drawn={})
    for name, found in (
        ("_terms", ()), ("draws_of", None), ("read_worlds", worlds), ("key_of", ""),
        ("Given", None), ("_draws", SimpleNamespace(records=records)),
    ):  # fmt: skip
        monkeypatch.setattr(coverage_module, name, lambda *_, found=found: found)
    runs = SimpleNamespace(experiment=None)
    study = SimpleNamespace(
        bench=SimpleNamespace(runs=runs), draws=9, seed=1, job=None, noise=None, opening=None
    )
    with pytest.raises(ComparisonError, match=r"kf: 1 of 2 blocks of \d+ draws"):
        coverage_module._of_method(study, "kf")  # type: ignore[arg-type]


def test_what_cannot_be_drawn_again_is_refused_before_anything_is_solved(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, shared_data: Path
) -> None:
    def solved(*_: object, **__: object) -> None:
        raise AssertionError("it was to be refused first")

    monkeypatch.setattr(ExperimentRuns, "start", solved)
    monkeypatch.setenv("VALIDATE_SHARED_DATA", str(shared_data))
    line = refused("study", "coverage", "hanging_bar", "--quick", "--out", str(tmp_path))
    assert "'drop' is compared as Drop" in line
    assert "take an experiment that compares" in line
