"""A ball pressed into a gel, from its recording to the report: contact through the pipeline."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from validate.compare.result import Result
from validate.compare.verdict import Accept
from validate.errors import SceneError, UsageError
from validate.pipeline import run_in_memory
from validate.pipeline.experiment.experiment import Experiment, Uncertainty, vary
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.ladder.default import body_of, trial_of
from validate.recording.types import Recording, Signal, Source
from validate.register.observation import EVERYTHING
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.report.write import write_report
from validate.scene.contact import RigidContact, RigidSphere
from validate.scene.geometries.specification import Box
from validate.scene.material import Material
from validate.scene.scene import Scene, Support
from validate.solve.static.contact import ContactNewton

T = np.arange(1.0, 5.0)
DEPTH = 0.0003 * T[:, None]
SCENE = Scene(
    Box((0.02, 0.02, 0.02), (4, 4, 4), "hex8"),
    Material(10e3, 0.3),
    (Support("z0"),),
    contacts=(
        RigidContact("ball", "z1", RigidSphere((0.01, 0.01, 0.035), 0.015), "-z"),  # type: ignore[arg-type]
    ),
)


def felt(recording: Recording, tree: Tree, scene: Scene) -> Registered:
    force = SignalObservation.validating(
        recording, "force", "N", quantity="force.ball", trace="ball.force"
    )
    return Registered((SignalObservation.driving(recording, "depth", "m"), force), (EVERYTHING,))


def pressed() -> Recording:
    """Forces near those of the finest mesh of the ladder, as a rising curve."""
    force = 1.18 * (DEPTH / DEPTH[-1]) ** 1.5 * 0.128
    signals = {
        "depth": Signal(T, DEPTH, "m", 0.0, "machine"),
        "force": Signal(T, force, "N", 0.005, "machine"),
    }
    return Recording("gel", Source("gel.txt", "", 0, "made here"), 0, signals=signals)


EXPERIMENT = Experiment(
    name="gel",
    title="A ball pressed into a gel",
    source="tests",
    scene=SCENE,
    methods={"contact": Method("contact, static", ContactNewton())},
    accepted=("contact",),
    accept=(Accept("force.ball", 0.02, "a tenth of the largest force"),),
    load=lambda tree, folder: (pressed(),),
    place=felt,
    variations=(vary("body.cells", "x 1.5 2"), vary("material.E", "relative 5 %")),
    uncertainty=Uncertainty(surrogate="contact"),
    path=Path(__file__).resolve(),
)


@pytest.fixture(scope="module")
def result() -> Result:
    return run_in_memory(EXPERIMENT)


@pytest.mark.slow
def test_force_against_depth_is_compared(result: Result) -> None:
    (check,) = result.checks
    assert (check.unit, check.count) == ("N", 4)
    run = result.methods[0].run
    assert run.finished
    assert run.traces["ball.displacement"].y.tolist() == DEPTH[:, 0].tolist()
    assert (np.diff(run.traces["ball.force"].y) > 0).all()
    assert run.traces["ball.penetration"].y.max() < 1e-12


@pytest.mark.slow
def test_its_report_has_the_traces(result: Result, tmp_path: Path) -> None:
    page = write_report(result, tmp_path / "gel", created="2026-11-21T04:00:00Z")
    assert page.stat().st_size > 10_000
    stored = json.loads((tmp_path / "gel" / "results.json").read_text("utf-8"))
    assert {"ball.force", "ball.penetration", "ball.area"} <= set(stored["methods"][0]["traces"])


@pytest.mark.slow
def test_contact_is_set_like_any_parameter(result: Result) -> None:
    ball = {"contacts.ball.friction": ".8", "contacts.ball.shape.radius": "15mm"}
    rough = run_in_memory(EXPERIMENT, ball, quick=True)
    (run,) = rough.methods[0].runs
    smooth = result.methods[0].run
    assert run.traces["ball.slipping"].y[-1] < smooth.traces["ball.slipping"].y[-1]
    assert run.traces["ball.force"].y[-1] > smooth.traces["ball.force"].y[-1]


def test_what_is_wrong_with_contact_is_one_line() -> None:
    with pytest.raises(SceneError, match=r"'ball'.*1 of 25 nodes"):
        run_in_memory(EXPERIMENT, {"contacts.ball.shape.centre": "10mm,10mm,34.9mm"}, quick=True)
    with pytest.raises(SceneError, match="friction -1, expected 0 or more"):
        run_in_memory(EXPERIMENT, {"contacts.ball.friction": "-1"}, quick=True)
    with pytest.raises(UsageError, match=r"'contacts.ball.frictoin'.*contacts.ball."):
        run_in_memory(EXPERIMENT, {"contacts.ball.frictoin": ".3"}, quick=True)


@pytest.mark.parametrize("ladder", [lambda e: trial_of(e, quick=True), body_of])
def test_a_study_says_that_it_does_not_know_contact(ladder: Callable[[Experiment], object]) -> None:
    with pytest.raises(SceneError, match=r"touches 1 rigid.*; run the experiment"):
        ladder(EXPERIMENT)
