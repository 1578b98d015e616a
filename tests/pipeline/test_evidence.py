"""What is no evidence: same models, twins made again from one's own parameters, fitted data."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from tiny import DECLARED, TINY, record

from validate.commands import check as checking
from validate.commands import run as running
from validate.commands.run import run as run_command
from validate.commands.run_screen import show_run
from validate.compare.overall_verdict import Expected
from validate.compare.result import Result
from validate.compare.verdict import Accept
from validate.engine.cell import Where
from validate.engine.pool import Pool
from validate.errors import ComparisonError, UsageError
from validate.library.single_run import ReportedRun
from validate.parameters import with_given
from validate.pipeline.experiment.experiment import Experiment, Identified, Twin, Uncertainty, vary
from validate.pipeline.experiment.options import Options
from validate.pipeline.experiment.tree import Built, Tree
from validate.pipeline.run.pipeline import compare
from validate.pipeline.run.twin_record import stamped
from validate.recording.types import Recording
from validate.scene.material import Material
from validate.scene.scene import Scene

# private: _content, _document: called alone, case by case.

RECORDINGS = Path(__file__).parents[2] / "recordings"
FEM = {"fem": TINY.methods["fem"]}

HERE = Pool(Where(0))


def other_model(**more: Any) -> Experiment:
    """The block and its twin, declared as made by another model; the twin is a file."""
    twin = replace(TINY.twin or Twin(record), kind="twin", remake=("twin.", "sd"))
    uncertainty = Uncertainty(vary("body.cells", "x 2"))
    own = replace(TINY, twin=twin, uncertainty=uncertainty, methods=FEM, cases=(), load=shipped)
    return replace(own, **more)


def shipped(tree: Tree, folder: Path) -> tuple[Recording, ...]:
    return (stamped(record(DECLARED, print), DECLARED),)


def judged(experiment: Experiment, **values: str) -> Result:
    return compare(experiment, Options(values, methods=("fem",)))


def test_a_mesh_that_no_level_changes_shows_no_convergence() -> None:
    """Its answers differ by nothing; that is no u_num of 0."""

    def build(recording: Recording, tree: Tree, changes: None) -> Scene:
        return Built()(recording, tree, {"body.cells": (3, 3, 3)})

    (check,) = judged(other_model(build=build)).checks
    assert (check.verdict, check.u_num) == ("undecided", float("inf"))
    assert "fewer than two different sizes" in check.why


def test_the_same_model_repeats_itself_and_predicts_nothing() -> None:
    result = judged(replace(TINY, cases=()))
    assert [c.verdict for c in result.checks] == ["same model"]
    assert (result.kind, result.overall.word, result.passed) == ("same model", "no evidence", True)
    assert result.overall.counted == "evidence: 0 of 1 checks"
    assert "predicts" not in result.sentence
    assert "of the same model, no evidence" in result.sentence


def test_a_same_model_that_differs_has_failed() -> None:
    result = judged(replace(TINY, cases=(), load=shipped), **{"material.E": "9e4"})
    assert [(c.validation, c.verdict) for c in result.checks] == [("differs", "not good enough")]
    assert not result.passed


@pytest.fixture(scope="module")
def other() -> Result:
    return judged(other_model())


def test_another_models_twin_is_evidence_but_no_measurement(other: Result) -> None:
    result = other
    assert [c.verdict for c in result.checks] == ["good enough"]
    assert result.kind == "twin"
    assert "predicts what was measured" not in result.sentence
    assert {s.against for s in result.methods[0].scores} >= {"recording of a twin"}


@pytest.mark.slow
def test_a_twin_made_again_from_own_parameters_cannot_agree() -> None:
    result = judged(other_model(), sd="1e-6")
    assert result.notes[0].startswith("The twin was simulated again")
    assert [c.verdict for c in result.checks] == ["same model"]
    assert "simulated again with this run's parameters" in result.checks[0].why


def unsaid(tree: Tree, folder: Path) -> tuple[Recording, ...]:
    """The twin's file without a word of what made it."""
    return (record(DECLARED, print),)


@pytest.mark.slow
@pytest.mark.parametrize("files", [1, 2])
def test_a_twins_setting_is_refused_where_nothing_says_what_made_the_recording(files: int) -> None:
    silent = other_model(load=lambda tree, folder: files * unsaid(tree, folder))
    assert [c.verdict for c in judged(silent).checks] == ["good enough"]
    with pytest.raises(UsageError, match=r"--set sd=0\.0001 would.*validate record"):
        judged(silent, sd="1e-4")


@pytest.mark.slow
def test_a_setting_that_the_record_does_not_know_is_refused() -> None:
    def older(tree: Tree, folder: Path) -> tuple[Recording, ...]:
        made = stamped(record(DECLARED, print), DECLARED)
        known = {k: v for k, v in made.record("made_with").items() if k != "twin.stiffness"}
        return (replace(made, metadata={**made.metadata, "made_with": known}),)

    assert [c.verdict for c in judged(other_model(load=older)).checks] == ["good enough"]
    with pytest.raises(UsageError, match=r"--set twin\.stiffness=1\.5 would"):
        judged(other_model(load=older), **{"twin.stiffness": "1.5"})


def test_a_twin_made_again_is_read_like_one_that_was_loaded() -> None:
    seen: list[Recording] = []

    def read(recording: Recording, tree: Tree) -> Recording:
        seen.append(recording)
        return recording

    base = other_model()
    assert base.twin is not None
    judged(replace(base, twin=replace(base.twin, read=read)), sd="1e-4")
    assert len(seen) == 1


@pytest.mark.parametrize("name", sorted(p.stem for p in RECORDINGS.glob("*.json")))
def test_every_shipped_recording_says_what_made_it(name: str) -> None:
    """Its digest is what must be read from the file, which another test compares."""
    made = json.loads((RECORDINGS / f"{name}.json").read_text("utf-8"))["metadata"]["made_with"]
    assert any(path.startswith("twin.") for path in made)


def test_an_undeclared_uncertainty_is_no_excuse_for_a_measurement() -> None:
    """A measured recording put into a same-model experiment is not judged as its own model."""

    def measured(tree: Tree, folder: Path) -> tuple[Recording, ...]:
        made = record(tree, print)
        told = {k: v for k, v in made.metadata.items() if k != "provenance"}
        return (replace(made, metadata=told),)

    with pytest.raises(ComparisonError, match="no uncertainty is declared"):
        judged(replace(TINY, cases=(), load=measured))


@pytest.mark.parametrize("name", ["node_B", "node_B@all"])
def test_data_that_served_to_identify_are_fitted(name: str) -> None:
    def identify(recordings: Any, tree: Tree, methods: Any) -> Identified:
        return Identified(tree, (), (), calibrated=(name,))

    result = judged(other_model(identify=identify))
    assert [c.verdict for c in result.checks] == ["fitted"]
    assert (result.overall.word, result.passed) == ("no evidence", True)


def test_a_marker_given_to_a_filter_is_fitted() -> None:
    methods = {"kf": TINY.methods["kf"]}
    accept = tuple(Accept(m, 1e-4, "ours") for m in ("node_A", "node_B"))
    experiment = replace(TINY, methods=methods, accepted=("kf",), accept=accept, cases=())
    found = {c.name: c.verdict for c in compare(experiment, Options({})).checks}
    assert methods["kf"].markers == ("node_A",)
    assert found == {"node_A.max@all": "fitted", "node_B.max@all": "same model"}


def test_the_terminals_first_line_says_what_was_judged(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("VALIDATE_NO_GL", "1")
    monkeypatch.setattr(
        "validate.commands.run.find", lambda name, start, named: replace(TINY, cases=())
    )
    code = run_command(
        ("tiny",), pool=HERE, named=(), quick=True, out=tmp_path, values=(), methods="fem",
        as_json=False, anyway=False,
    )  # fmt: skip
    printed = " ".join(capsys.readouterr().out.split())
    assert code == 0
    assert printed.startswith(
        "tiny: no evidence (quick run); no check is evidence. Recording: same model, made by "
        "the checked model itself"
    )


@pytest.mark.parametrize(
    ("doubts", "word"), [((), "good enough;"), (("50 m?",), "good enough, with warnings;")]
)
def test_the_first_line_doubts_what_the_warnings_doubt(
    other: Result, doubts: tuple[str, ...], word: str, capsys: pytest.CaptureFixture[str]
) -> None:
    show_run(replace(other, warnings=doubts), "tiny", Path("report.html"), 1.0)
    assert capsys.readouterr().out.startswith(f"tiny: {word} 1 of 1 requirements are met; ")


@pytest.mark.slow
def test_cells_that_lock_are_a_line_on_the_terminal_and_a_note(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The page's notes alone left a quick run of linear cells at nu .4999 without a word."""

    monkeypatch.setenv("VALIDATE_NO_GL", "1")
    tree = DECLARED.with_scene(material=Material(10e3, 0.4999, rho=1000.0))
    locks = replace(TINY, cases=(), parameters=tree)
    monkeypatch.setattr("validate.commands.run.find", lambda name, start, named: locks)
    run_command(
        ("tiny",), pool=HERE, named=(), quick=True, out=tmp_path, values=(), methods="fem",
        as_json=False, anyway=False,
    )  # fmt: skip
    said = "linear tetrahedra lock near incompressibility"
    (line,) = (x for x in capsys.readouterr().out.splitlines() if said in x)
    assert line.startswith("warning: ")
    (stored,) = tmp_path.rglob("results.json")
    assert said in stored.read_text("utf-8")


# --- declared verdicts ----------------------------------------------------------------------------


def declaring(verdict: str, limit: float = 1e-9) -> Experiment:
    """A model that cannot be good enough, with the verdict that its experiment declares."""
    accept = (Accept("node_B", limit, "ours"),)
    return replace(other_model(), accept=accept, expected=(Expected(verdict, "it is stiff"),))


@pytest.fixture(scope="module")
def known() -> Result:
    """A model of a tenth of the stiffness: its error is many times any limit."""
    softer = replace(
        declaring("not good enough"), parameters=with_given(DECLARED, {"material.E": 9e4})
    )
    return judged(softer)


def test_a_declared_verdict_is_as_expected_though_the_run_fails(known: Result) -> None:
    assert (known.overall.word, known.passed, known.as_expected) == (
        "not good enough", False, True
    )  # fmt: skip
    moved = replace(known, expected=(Expected("good enough", "it was"),))
    assert not moved.as_expected
    assert [m.found for m in moved.moved] == ["not good enough"]


def test_check_holds_the_declared_verdict_and_fails_where_it_moves(known: Result) -> None:
    assert checking._document(checking._content(known), declared=False)["holds"]
    moved = replace(known, expected=(Expected("good enough", "it was"),))
    assert not checking._document(checking._content(moved), declared=False)["holds"]
    bare = checking._content(replace(known, expected=()))
    assert not checking._document(bare, declared=False)["holds"]


def test_declared_verdicts_are_those_of_what_is_shipped() -> None:
    """What a user set has no declared verdict."""
    result = judged(declaring("not good enough"), **{"material.E": "9e4"})
    assert (result.expected, result.as_expected, result.passed) == ((), False, False)


@pytest.mark.parametrize(("names", "code"), [(("tiny",), 1), ((), 0)])
def test_all_pass_by_declared_verdicts_and_one_by_its_own(
    names: tuple[str, ...], code: int, known: Result, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    shipped = declaring("not good enough")
    monkeypatch.setattr("validate.commands.run.find", lambda name, start, named: shipped)
    monkeypatch.setattr(
        "validate.commands.run.experiment_files", lambda start, named: {"tiny": shipped}
    )
    told = ReportedRun(known, tmp_path / "report.html", "")
    monkeypatch.setattr(running, "reported_run", lambda *_, **__: told)
    found = run_command(
        names, pool=HERE, named=(), quick=False, out=tmp_path, values=(), methods="", as_json=False,
        anyway=False,
    )  # fmt: skip
    assert found == code
