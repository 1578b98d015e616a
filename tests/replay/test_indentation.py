"""A ball pressed into a gel, from its recording to the report: contact walks the road."""

import json
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest

from validate.compare.result import Result
from validate.compare.verdict import Accept
from validate.errors import SceneError, UsageError
from validate.parameters import quantity
from validate.recording.types import Recording, Signal, Source
from validate.register.observation import EVERYTHING
from validate.register.registered import Registered
from validate.register.signals import driving, validating
from validate.replay import compare
from validate.replay.experiment import Experiment, Input, MeshLadder, Uncertainty
from validate.replay.ladder_default import body_of, trial_of
from validate.replay.method import Method
from validate.report.write import write_report
from validate.scene.box import grid
from validate.scene.contact import RigidContact, RigidSphere
from validate.scene.material import Material
from validate.scene.scene import Scene, Support
from validate.scene.select import OnPlane
from validate.solve.contact import ContactNewton

SIDE, UP = 0.02, (0.0, 0.0, 1.0)
T = np.arange(1.0, 5.0)
DEPTH = 0.0003 * T[:, None]


@dataclass(frozen=True)
class Tool:
    friction: float = quantity(0.0, "1", "Coulomb's coefficient")
    radius: float = quantity(0.015, "m", "of the ball")
    gap: float = quantity(0.0, "m", "between ball and gel at rest")


@dataclass(frozen=True)
class GelCard:
    E: float = quantity(10e3, "Pa", "Young's modulus")
    cells: int = quantity(4, "1", "cells along an edge")
    contact: Tool = field(default_factory=Tool)


def gel(recording: Recording, p: GelCard, options: None) -> Scene:
    ball = RigidSphere(
        (SIDE / 2, SIDE / 2, SIDE + p.contact.radius + p.contact.gap), p.contact.radius
    )
    return Scene(
        grid((SIDE,) * 3, (p.cells,) * 3),
        Material(p.E, 0.3),
        (Support(OnPlane((0.0, 0.0, 0.0), UP).faces, (0, 1, 2)),),
        contacts=(
            RigidContact("ball", OnPlane((0.0, 0.0, SIDE), UP).faces, ball, (0.0, 0.0, -1.0),
                         p.contact.friction),
        ),
    )  # fmt: skip


def felt(recording: Recording, p: GelCard, scene: Scene) -> Registered:
    force = validating(recording, "force", "N", quantity="force.ball", trace="ball.force")
    return Registered((driving(recording, "depth", "m"), force), (EVERYTHING,))


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
    parameters=GelCard(),
    methods={"contact": Method("contact, static", ContactNewton())},
    accepted=("contact",),
    accept=(Accept("force.ball", 0.02, "a tenth of the largest force"),),
    load=lambda p, folder: (pressed(),),
    build=gel,
    place=felt,
    uncertainty=Uncertainty(
        mesh=MeshLadder(
            (lambda p: replace(p, cells=6), lambda p: replace(p, cells=8)),
            size=lambda p: SIDE / p.cells,
        ),
        inputs=(Input("E", lambda p, z: replace(p, E=(1 + 0.05 * z) * p.E), "modulus", "assumed"),),
        surrogate="contact",
    ),
    path=Path(__file__).resolve(),
)


@pytest.fixture(scope="module")
def result() -> Result:
    return compare(EXPERIMENT)


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
    rough = compare(EXPERIMENT, {"contact.friction": ".8", "contact.radius": "15mm"}, quick=True)
    (run,) = rough.methods[0].runs
    smooth = result.methods[0].run
    assert run.traces["ball.slipping"].y[-1] < smooth.traces["ball.slipping"].y[-1]
    assert run.traces["ball.force"].y[-1] > smooth.traces["ball.force"].y[-1]


def test_what_is_wrong_with_contact_is_one_line() -> None:
    with pytest.raises(SceneError, match=r"contact 'ball' starts inside the body: 1 of 25 nodes"):
        compare(EXPERIMENT, {"contact.gap": "-1e-4"}, quick=True)
    with pytest.raises(SceneError, match="friction -1, expected 0 or more"):
        compare(EXPERIMENT, {"contact.friction": "-1"}, quick=True)
    with pytest.raises(
        UsageError, match=r"unknown parameter 'contact.frictoin'; nearest: contact."
    ):
        compare(EXPERIMENT, {"contact.frictoin": ".3"}, quick=True)


@pytest.mark.parametrize("ladder", [lambda e: trial_of(e, quick=True), body_of])
def test_a_study_says_that_it_does_not_know_contact(ladder: Callable[[Experiment], object]) -> None:
    with pytest.raises(
        SceneError, match=r"touches 1 rigid bodies, .*; run the experiment, or declare"
    ):
        ladder(EXPERIMENT)
