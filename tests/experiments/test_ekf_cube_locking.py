"""The locking factor: one where linear cells are exact, small where they lock."""

from dataclasses import replace

import numpy as np
import pytest

from experiments.ekf_cube.locking import locking_factor
from validate.errors import SceneError
from validate.scene.geometries.box import box, centroids, grid
from validate.scene.material import Material, Region
from validate.scene.scene import Load, Probe, Scene, Support

MESH = box((0.1, 0.1, 0.1), (3, 3, 3))
PULL = Load("pull", "z1", (0.0, 0.0, 1.0))
TOP = Probe("top", (0.05, 0.05, 0.1))


def sliding(nu: float) -> Scene:
    """Uniform strain: linear cells hold it exactly."""
    held = (Support("x0", (0,)), Support("y0", (1,)), Support("z0", (2,)))
    return Scene(MESH, Material(3e4, nu), held, loads=(PULL,), probes=(TOP,))


def bonded(nu: float) -> Scene:
    return replace(sliding(nu), supports=(Support("z0", (0, 1, 2)),))


@pytest.mark.parametrize("nu", [0.0, 0.4999])
def test_where_linear_cells_are_exact_the_factor_is_one(nu: float) -> None:
    assert locking_factor(sliding(nu), "top") == pytest.approx(1.0, abs=1e-8)


def test_it_falls_towards_incompressibility_and_mean_dilatation_holds_it() -> None:
    factors = [locking_factor(bonded(nu), "top") for nu in (0.3, 0.49, 0.4999)]
    assert (np.diff(factors) < 0).all()
    assert factors[0] > 0.85
    assert factors[-1] < 0.7
    mean = [
        locking_factor(replace(bonded(nu), dilatation="nodal_mean"), "top") for nu in (0.3, 0.4999)
    ]
    assert min(mean) > 0.8


def test_the_law_the_spread_and_regions_of_the_same_stuff_change_nothing() -> None:
    scene = bonded(0.49)
    factor = locking_factor(scene, "top")
    upper = np.flatnonzero(centroids(MESH)[:, 2] > 0.05)
    same = Material(3e4, 0.49, "svk")
    other = replace(
        scene,
        material=same,
        regions=(Region("upper", upper, same),),
        loads=(replace(PULL, spread="per_node"),),
    )
    assert locking_factor(other, "top") == pytest.approx(factor, rel=1e-9)


def test_what_it_cannot_judge_is_refused() -> None:
    scene = bonded(0.3)
    for bad in (replace(scene, body=MESH.quadratic()), replace(scene, loads=()),
                replace(scene, probes=())):  # fmt: skip
        with pytest.raises(SceneError, match="locking at 'top': needs linear cells"):
            locking_factor(bad, "top")
    low = replace(scene, probes=(Probe("low", (0.05, 0.05, 0.0)),))
    with pytest.raises(SceneError, match="the probe does not move"):
        locking_factor(low, "low")


def test_hexahedra_are_held_against_mixed_ones() -> None:
    """Near nu = .5 pointwise ones show a tenth of the bending, mixed ones nine tenths."""
    rod = Scene(
        grid((0.5, 0.25, 0.25), (6, 3, 3)),
        Material(1e4, 0.4999),
        (Support("x0", (0, 1, 2)),),
        loads=(Load("end", "x1", (0.0, 0.0, -1.0)),),
        probes=(Probe("end", (0.5, 0.125, 0.125)),),
    )
    pointwise, mixed = (
        locking_factor(replace(rod, dilatation=d), "end") for d in ("pointwise", "mixed")
    )
    assert pointwise < 0.5
    assert 0.75 < mixed < 1
