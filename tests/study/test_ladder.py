"""Ladders derived from a scene: which meshes, steps, solvers and points, and a gain's limit."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from beside import experiment
from study_samples import experiment_file

from experiments.kf_cube.ladder import PRINTED_LADDER
from experiments.needle_block.body import MP1, MP2
from experiments.needle_block.ladder import NEEDLE_LADDER
from validate.errors import SceneError, UsageError
from validate.fem.system import Responses
from validate.pipeline.bodies.own_body import ExperimentBody, own_body
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.find import load_file
from validate.pipeline.ladder import default as ladder_default
from validate.pipeline.ladder.default import body_of, trial_of
from validate.pipeline.ladder.ladder import LARGEST, Rival, StabilityBody, Turned
from validate.register.registration import Registered
from validate.scene.geometries.box import box
from validate.scene.geometries.refinement import linear, of_element, refined
from validate.scene.material import Material, Region
from validate.scene.mesh import boundary_facets
from validate.scene.meshless import MaterialPoint
from validate.scene.scene import Scene, Support
from validate.solve.static.quasi_static import QuasiStatic
from validate.study.stability.gain import DECADES, GainBench, GainCell, run_cell
from validate.study.stability.study import stability


@pytest.fixture(scope="module")
def pulled(tmp_path_factory: pytest.TempPathFactory) -> Experiment:
    return load_file(experiment_file(tmp_path_factory.mktemp("ladder")))


@pytest.fixture(scope="module")
def own_phantom(phantom: Experiment) -> ExperimentBody:
    return own_body(replace(phantom, identify=None))


# --- meshes ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [(1.0, 1.0), (1.0, 2.0, 1.0)])
def test_refined_simplices_fill_the_body_and_keep_sets_and_regions(
    size: tuple[float, ...],
) -> None:
    mesh, d = box(size, (2,) * len(size)), len(size)
    stiff = Region("stiff", np.array([0, 2]), Material(2.0, 0.3))
    scene = Scene(mesh, Material(1.0, 0.3), (Support("x0", (0,)),), regions=(stiff,))
    fine = refined(scene)
    volumes = fine.mesh.cell_volumes()
    assert volumes.min() > 0
    assert volumes.sum() == pytest.approx(mesh.cell_volumes().sum())
    own = volumes[fine.regions[0].cells].sum()
    assert own == pytest.approx(mesh.cell_volumes()[stiff.cells].sum())
    sides = {tuple(sorted(f)) for facets in fine.mesh.facets.values() for f in facets}
    assert sides == {tuple(sorted(f)) for f in boundary_facets(fine.mesh.cells, d)}
    assert {n: len(f) for n, f in fine.mesh.facets.items()} == {
        n: 2 ** (d - 1) * len(f) for n, f in mesh.facets.items()
    }


def test_elements_of_a_quadratic_scene_are_those_of_its_vertices() -> None:
    mesh = box((1.0, 1.0, 1.0), (1, 1, 1))
    scene = of_element(Scene(mesh, Material(1.0, 0.3)), "P2")
    assert (scene.mesh.kind, linear(scene.mesh).kind) == ("tet10", "tet4")
    np.testing.assert_array_equal(linear(scene.mesh).nodes, mesh.nodes)
    assert of_element(scene, "MD").dilatation == "nodal_mean"


@pytest.mark.slow
def test_a_parameter_refines_where_it_changes_the_nodes_and_not_the_body(
    own_phantom: ExperimentBody,
) -> None:
    paths = [p.path for p in own_phantom.refining]
    assert paths == ["body.cells"]
    coarse, whole = own_phantom.at(75), own_phantom.at(100)
    assert len(coarse.mesh.nodes) < len(whole.mesh.nodes)
    np.testing.assert_allclose(np.ptp(coarse.mesh.nodes, axis=0), np.ptp(whole.mesh.nodes, axis=0))
    assert own_phantom.size(75) > own_phantom.size(100)


def test_levels_are_those_that_differ(own_phantom: ExperimentBody) -> None:
    assert own_phantom.levels((100, 101, 75)) == (75, 100)


# --- over time ------------------------------------------------------------------------------------


def of_a_mesh(experiment: Experiment) -> Experiment:
    """Its body as a mesh, which has no cells to set."""
    tree = experiment.parameters
    mesh = tree.scene.body.resolved(Path())
    return replace(experiment, parameters=tree.with_scene(body=mesh))


def test_a_body_without_such_a_parameter_is_refined_itself(pulled: Experiment) -> None:
    trial = trial_of(of_a_mesh(pulled), quick=True)
    assert dict(trial.meshes) == {"P1": (100, 200), "MD": (100, 200), "P2": (100,)}
    assert trial.reference == ("P2", 200)
    assert trial.size(200) == pytest.approx(trial.size(100) / 2)
    assert trial.dynamic
    assert trial.steps == pytest.approx((0.02, 0.01))
    t = trial.times(0.01)
    np.testing.assert_allclose(trial.inputs(t)[:, 0], 0.2 * np.sin(9 * t), atol=1e-12)
    assert trial.rise_s == pytest.approx(0.17, abs=0.011)
    top, side = trial.points[:2]
    assert (tuple(top), tuple(side)) == ((0.01, 0.01, 0.02), (0.0, 0.01, 0.01))
    assert {s.rung for s in trial.solvers} == {
        "static superposition", "modal", "prefactored", "explicit", "large strain",
    }  # fmt: skip


def test_its_stability_body_has_all_of_its_own_material(pulled: Experiment) -> None:
    body = body_of(pulled)
    assert body is not None
    assert body.meshes == (100, 140, 200)
    assert (body.base.E, body.base.stiffness_damping) == (1e4, 0.02)
    scene = body.build(replace(body.base, E=2e4, nu=0.3, mesh=100))
    assert (scene.material.E, scene.material.nu) == (2e4, 0.3)
    assert body.dt == pytest.approx(0.01)


def test_a_declared_ladder_is_the_one_that_is_climbed(phantom: Experiment) -> None:
    trial = trial_of(phantom, quick=True)
    assert trial.meshes["P1"] == (7, 9)
    assert not trial.dynamic


def test_a_body_that_cannot_be_coarsened_says_what_to_do(
    pulled: Experiment, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ladder_default, "LARGEST", 50)
    with pytest.raises(UsageError, match="number of cells as a parameter"):
        body_of(of_a_mesh(pulled))


def _at_one_instant(experiment: Experiment) -> Experiment:
    """Its drives as one sample, as of a body that has come to rest."""

    def place(*given: Any) -> Registered:
        seen = experiment.place(*given)
        return replace(
            seen, observations=tuple(replace(d, t=d.t[:1], y=d.y[:1]) for d in seen.drives)
        )

    return replace(experiment, place=place)


@pytest.mark.parametrize("ladder", [lambda e: trial_of(e, quick=True), body_of])
def test_one_instant_says_no_time_step(
    pulled: Experiment, ladder: Callable[[Experiment], object]
) -> None:
    with pytest.raises(UsageError, match="driven at 1 instant, so there"):
        ladder(_at_one_instant(pulled))


# --- the gain of a loop ---------------------------------------------------------------------------


def test_nothing_steps_in_time_without_a_density(phantom: Experiment, tmp_path: Path) -> None:
    assert stability(replace(phantom, identify=None), out=tmp_path) is None


def test_a_gains_limit_is_two_over_the_compliance(own_phantom: ExperimentBody) -> None:
    """A cavity whose volume is 1 + c P: the loop P <- P + Kp (1 - V) settles to Kp = 2 / c."""
    c, form = 4e-4, np.zeros((1, 3, 3, 3))
    form[0, 0, 0, 0] = 1.0
    for index in ((0, 0, 2), (0, 2, 0), (2, 0, 0)):
        form[(0, *index)] = c / 3
    for index in ((0, 0, 1), (0, 1, 0), (1, 0, 0)):
        form[(0, *index)] = -0.1 / 3  # the drive squeezes it
    scene = own_phantom.scene
    columns = Responses(scene, np.zeros((2, *scene.mesh.nodes.shape)), np.zeros((1, 2)), form)
    found = run_cell(GainBench(columns, np.array([1.0])), GainCell(1.0, "k"))
    assert found.predicted == pytest.approx(2 / c, rel=1e-9)
    assert found.measured == pytest.approx(2 / c, rel=0.01)
    assert found.holds
    settled = [g for g, n in zip(found.gains, found.updates, strict=True) if n >= 0]
    assert max(settled) < 2 / c
    reach = 10 ** (DECADES / 2)
    assert (found.gains[0], found.gains[-1]) == pytest.approx(
        (found.tuned / reach, found.tuned * reach)
    )


def test_a_material_point_enters_no_study(pulled: Experiment) -> None:
    point = MaterialPoint(Material(1e4, 0.3, "neo_hooke"), "uniaxial")
    lone = replace(pulled, build=lambda recording, parameters, options: point)
    with pytest.raises(SceneError, match="no mesh and no steps"):
        trial_of(lone, quick=True)


# --- what is declared -----------------------------------------------------------------------------


def test_a_body_of_just_the_largest_number_of_unknowns_is_mapped() -> None:
    """20 x 25 nodes of two unknowns are a thousand; one row more is refused."""
    variant = Turned(1e4, 0.3, 1000.0, 0.0, 0.0, 19)

    def strip(n: int, material: Material) -> Scene:
        return Scene(box((1.0, 1.0), (n, 24)), material, (Support("x0", (0, 1)),))

    body = StabilityBody("strip", strip, variant, (19,), 1e-3)
    assert body.build(variant).mesh.nodes.size == LARGEST
    with pytest.raises(SceneError, match=r"1050 unknowns at mesh 20: .* 1000"):
        body.build(replace(variant, mesh=20))


def test_a_rival_takes_the_steps_and_meshes_it_declares() -> None:
    plain, steps = Rival("a", "nodes", lambda dt: QuasiStatic()), (1.0, 0.5)
    assert plain.steps("P1", 9, steps) == steps
    assert replace(plain, stepped=False).steps("P1", 1, steps) == (0.5,)
    assert replace(plain, shortest=1.0).steps("P1", 1, steps) == (1.0,)
    assert replace(plain, elements=("P2",)).steps("P1", 1, steps) == ()
    assert replace(plain, finest=2).steps("P1", 2, steps) == steps
    assert replace(plain, finest=2).steps("P1", 3, steps) == ()


def test_printed_settings_are_those_of_the_papers_experiments() -> None:
    """Paper 001's block as its experiment has it; paper 002's materials on one mesh of ten."""
    own = experiment("kf_cube").parameters.scene.material
    (paper,) = PRINTED_LADDER.body.papers  # type: ignore[union-attr]
    assert (paper.variant.material, paper.dt) == (replace(own, law="linear"), 0.002)
    papers = NEEDLE_LADDER.body.papers  # type: ignore[union-attr]
    assert [p.variant.mesh for p in papers] == [10, 10]
    assert [p.variant.material for p in papers] == [MP1, MP2]
