"""Small scenes for external simulators: the schemes of the package reach the exact solutions."""

import json

import numpy as np
import pytest

from validate.commands.main import run as command_line
from validate.solve.dynamic.newmark import Newmark
from validate.solve.external.suite import SmallScene, small_scenes
from validate.solve.march import run_scheme
from validate.solve.static.newton import StaticNewton
from validate.solve.static.quasi_static import QuasiStatic
from validate.solve.types import Run, Scheme

SCENES = small_scenes()


def ours(small: SmallScene, parts: int = 1) -> Run:
    """At the small scene's times, each step split where time counts."""
    t, every = small.t, np.arange(len(small.t))
    if not small.inertia:
        linear = small.scene.material.law == "linear"
        scheme: Scheme = QuasiStatic() if linear else StaticNewton()
        return run_scheme("ours", scheme, small.scene, t, small.inputs, every)
    fine = t[0] / parts * np.arange(1, parts * len(t) + 1)
    inputs = np.repeat(small.inputs, parts, axis=0)
    at = parts * (every + 1) - 1
    return run_scheme("ours", Newmark(dt=t[0] / parts), small.scene, fine, inputs, at)


@pytest.mark.parametrize(
    "small", [s for s in SCENES if not s.inertia], ids=[s.name for s in SCENES if not s.inertia]
)
def test_statics_are_exact(small: SmallScene) -> None:
    run = ours(small)
    assert run.finished
    assert np.abs(run.u - small.u).max() < 1e-9 * np.abs(small.u).max()
    for drive, force in small.forces.items():
        assert run.traces[f"{drive}.force"].y == pytest.approx(force, rel=1e-7, abs=1e-12)


def test_the_ring_down_is_reached_in_second_order() -> None:
    (small,) = [s for s in SCENES if s.inertia]
    off = [np.abs(ours(small, parts).u - small.u).max() for parts in (1, 2, 4)]
    assert off[0] < 3e-3 * np.abs(small.u).max()
    assert np.log2(off[0] / off[1]) == pytest.approx(2.0, abs=0.4)
    assert np.log2(off[1] / off[2]) == pytest.approx(2.0, abs=0.2)


def test_the_bar_hangs() -> None:
    """Upright it would buckle under its weight at large strain."""
    for small in (s for s in SCENES if s.name in ("hanging bar", "ring-down")):
        tip = small.scene.mesh.nodes[:, 2].argmax()
        assert np.sign(small.u[0, tip, 2]) == np.sign(small.scene.loads[0].direction[2]) == 1


@pytest.mark.slow
def test_a_simulator_that_solves_nothing_is_a_table(capsys: pytest.CaptureFixture[str]) -> None:
    """Each scene is a row with the reason, and the command fails."""
    assert command_line(["external", "check", "false", "--json"]) == 1
    rows = json.loads(capsys.readouterr().out)
    assert [r["scene"] for r in rows] == [s.name for s in SCENES]
    assert {(r["state"], r["error"], r["why"]) for r in rows} == {
        ("invalid", None, "ended with code 1")
    }
    assert command_line(["external", "check", "false"]) == 1
    assert "hanging bar: ended with code 1" in capsys.readouterr().out
    assert command_line(["external", "check", "no-such-program"]) == 2
