"""Requested times of an external simulator, and the run at all times from its answers."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from validate.arrays import Floats
from validate.scene.geometries.box import grid
from validate.scene.material import Material, Prony
from validate.scene.places import OnPlane
from validate.scene.scene import Mass, Scene, Support, Weight
from validate.solve.external.exchange import write_job
from validate.solve.external.scheme import Asked, at_levels, at_rest, changes
from validate.solve.types import Ending, Outcome, Run, Trace


def told(asked: Asked, y: Floats, state: Ending = "finished") -> Run:
    """A run of one node at the first times asked, that moves by y (k,) m."""
    k = len(y)
    u = y[:, None, None] * np.array([1.0, 0.0, 2.0])
    run = Run("", asked.t[:k], np.arange(k), u, {"top.x": Trace(y, "m")}, Outcome(state, k), 0.1,
              None)  # fmt: skip
    return asked.answered(run)


def test_the_same_inputs_are_asked_once() -> None:
    t = np.arange(1.0, 7.0)
    asked = changes(t, np.array([0.0, 0.0, 1.0, 1.0, 1.0, 0.0])[:, None])
    assert asked.t.tolist() == [1.0, 3.0, 6.0]
    run = told(asked, np.array([0.0, 5.0, 7.0]))
    assert run.t.tolist() == t.tolist()
    assert run.traces["top.x"].y.tolist() == [0.0, 0.0, 5.0, 5.0, 5.0, 7.0]
    assert run.u[3, 0].tolist() == [5.0, 0.0, 10.0]
    gave_up = told(asked, np.array([0.0, 5.0]), "not_converged")
    assert (len(gave_up.t), gave_up.outcome.step) == (5, 5)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_between_levels_a_cubic_is_exact(sign: float) -> None:
    t, y = np.arange(1.0, 12.0), sign * np.linspace(0.0, 2.0, 11)[::-1]
    asked = at_levels(t, y[:, None], 5)
    assert asked.inputs[:, 0] == pytest.approx(sign * np.array([0.4, 0.8, 1.2, 1.6, 2.0]))
    run = told(asked, asked.inputs[:, 0] ** 3 + asked.inputs[:, 0])
    assert run.traces["top.x"].y == pytest.approx(y**3 + y, abs=1e-12)
    assert "solved at 5 levels" in run.said[-1]


def test_levels_that_were_not_reached_end_the_run() -> None:
    t, y = np.arange(1.0, 6.0), np.array([0.2, 0.4, 0.6, 0.8, 1.0])
    run = told(at_levels(t, y[:, None], 5), np.array([1.0, 2.0, 3.0]), "not_converged")
    assert len(run.t) == 3
    assert run.traces["top.x"].y == pytest.approx([1.0, 2.0, 3.0])


def test_an_input_to_both_sides_has_no_levels() -> None:
    y = np.array([1.0, -1.0, 0.5])[:, None]
    assert at_levels(np.arange(1.0, 4.0), y, 5).inputs.tolist() == y.tolist()


def test_what_hangs_is_carried_and_what_relaxes_has_relaxed(tmp_path: Path) -> None:
    end = OnPlane((0.0, 0.0, 0.02), (0.0, 0.0, 1.0)).faces
    material = Material(1e4, 0.3, "neo_hooke", 1000.0, prony=Prony((0.5,), (1.0,)))
    scene = Scene(
        grid((0.01, 0.01, 0.02), (1, 1, 2)), material, (Support("z0", (0, 1, 2)),),
        loads=(Weight("gravity", (0.0, 0.0, -1.0)),), masses=(Mass("load", end, 0.08),),
    )  # fmt: skip
    write_job(tmp_path, at_rest(scene), np.ones(1), np.array([[9.81]]), False, 1e-6)
    said = json.loads((tmp_path / "job.json").read_text())
    assert said["material"]["hung"] == 0.08
    assert said["masses"]["kg"] == pytest.approx([0.02] * 4)
    assert {round(z, 6) for z in scene.mesh.nodes[said["masses"]["nodes"], 2]} == {0.02}
    assert at_rest(scene).material.prony.g == ()
    taut = replace(material, prony=replace(material.prony, statics="instantaneous"))
    assert at_rest(replace(scene, material=taut)).material.prony.g == (0.5,)
