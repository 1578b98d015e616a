"""One function runs what steps and what solves a whole scene: a material point in a machine."""

import ast
from pathlib import Path

import numpy as np
import pytest

from validate.errors import SceneError
from validate.fem.laws.plane_stress import response
from validate.scene.geometries.box import box
from validate.scene.material import Material
from validate.scene.meshless import MaterialPoint
from validate.scene.scene import Load, Scene, Support
from validate.solve.march import run_scheme
from validate.solve.schemes import SOLVERS
from validate.solve.static.quasi_static import QuasiStatic
from validate.solve.static.stretch_test import StretchTest

T = np.linspace(0.1, 1.0, 10)
STRETCHES = np.linspace(0.9, 1.5, 10)[:, None]
POINT = MaterialPoint(Material(3e4, 0.45, "neo_hooke"), "uniaxial")


def test_a_material_point_is_run_as_every_scene_is() -> None:
    run = run_scheme("machine", StretchTest(), POINT, T, STRETCHES, np.array([4, 9]))
    assert (run.method, run.outcome.state, run.outcome.step) == ("machine", "finished", 10)
    assert run.at.tolist() == [4, 9]
    assert run.u.shape == (2, 0, 3)
    assert np.array_equal(run.t, T)
    stress = run.traces["nominal_stress"]
    assert stress.unit == "Pa"
    assert np.array_equal(stress.y, response(POINT, STRETCHES[:, 0])["nominal_stress"])
    assert run.traces["stretch"].y.tolist() == STRETCHES[:, 0].tolist()


def test_a_stretch_without_a_state_is_an_outcome() -> None:
    run = run_scheme("m", StretchTest(), POINT, T, STRETCHES - 1.0, np.array([9]))
    assert (run.outcome.state, len(run.t), len(run.at)) == ("refused", 0, 0)
    assert "stretch -0.1" in run.outcome.why


def test_a_scheme_that_steps_is_run_by_the_same_function() -> None:
    scene = Scene(
        box((0.02, 0.02, 0.02), (2, 2, 2)),
        Material(1e4, 0.3),
        (Support("z0", (0, 1, 2)),),
        loads=(Load("pull", "z1", (0.0, 0.0, 1.0)),),
    )
    run = run_scheme("statics", QuasiStatic(), scene, T, np.ones((10, 1)), np.array([9]))
    assert run.finished
    assert run.u[0, :, 2].max() > 0
    assert run.setup_s > 0
    with pytest.raises(SceneError, match="StretchTest solves only a material point"):
        run_scheme("m", StretchTest(), scene, T, np.ones((10, 1)), np.array([9]))
    with pytest.raises(SceneError, match="QuasiStatic needs a mesh; use"):
        run_scheme("m", QuasiStatic(), POINT, T, np.ones((10, 1)), np.array([9]))


def test_the_linear_law_has_no_large_stretch() -> None:
    linear = MaterialPoint(Material(1e4, 0.3), "uniaxial")
    with pytest.raises(SceneError, match="StretchTest cannot solve the law"):
        run_scheme("m", StretchTest(), linear, T, STRETCHES, np.array([9]))


def test_every_solver_of_whole_scenes_is_in_the_tuple(project_root: Path) -> None:
    """A class with `solve` and `handles`, its own or of the class that it goes on from: linear
    solvers handle no scenes."""
    found: dict[str, set[str]] = {}
    bases: dict[str, list[str]] = {}
    for path in (project_root / "validate" / "solve").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef) and "Protocol" not in map(ast.unparse, node.bases):
                given = [f.target for f in node.body if isinstance(f, ast.AnnAssign)]
                names = {ast.unparse(target) for target in given}
                names |= {f.name for f in node.body if isinstance(f, ast.FunctionDef)}
                found[node.name], bases[node.name] = names, [ast.unparse(b) for b in node.bases]
    whole = {
        name: has.union(*(found.get(b, ()) for b in bases[name])) for name, has in found.items()
    }
    written = {name for name, has in whole.items() if {"solve", "handles"} <= has}
    assert written == {solver.__name__ for solver in SOLVERS}


def test_two_stretches_are_two_inputs() -> None:
    both = MaterialPoint(Material(3e4, 0.45, "neo_hooke"), "biaxial")
    pairs = np.hstack([STRETCHES, np.linspace(1.0, 1.2, 10)[:, None]])
    run = run_scheme("m", StretchTest(), both, T, pairs, np.array([9]))
    assert run.traces["second"].y.tolist() == pairs[:, 1].tolist()
    assert np.array_equal(run.traces["second_stress"].y, response(both, pairs)["second_stress"])
