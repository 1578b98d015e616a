"""A soft bar that hangs under its weight, against solutions of another code (dolfinx)."""

from pathlib import Path

import numpy as np
import pytest

from validate.fem.system import build
from validate.scene.geometries.box import grid
from validate.scene.laws import Coefficients
from validate.scene.material import Material
from validate.scene.mesh import Mesh
from validate.scene.places import OnPlane
from validate.scene.scene import Scene, Support, Weight
from validate.solve.march import march
from validate.solve.static.newton import StaticNewton
from validate.solve.types import Run

MU, LAM, GRAVITY = 1e4, 5e4, 9.80665
HEIGHT = 1.6
COUPLED = Material(
    MU * (3 * LAM + 2 * MU) / (LAM + MU), LAM / (2 * (LAM + MU)), "neo_hooke", 100.0,
    coefficients=Coefficients(volumetric="coupled"),
)  # fmt: skip


def hung(mesh: Mesh) -> Run:
    top = OnPlane((0.0, 0.0, HEIGHT), (0.0, 0.0, 1.0))
    weight = Weight("gravity", (0.0, 0.0, -1.0))
    scene = Scene(mesh, COUPLED, (Support(top.faces, (0, 1, 2)),), loads=(weight,))
    stepper = StaticNewton().prepare(build(scene))
    return march("bar", stepper, np.ones(1), np.array([[GRAVITY]]), np.array([0]), 0.0)


def test_on_its_tetrahedra_the_field_is_theirs(shared_data: Path) -> None:
    """43.2013 mm, and every node: W = mu/2 (I1 - 3) - mu ln J + lambda/2 ln^2 J."""
    folder = shared_data / "simulators" / "hanging-bar"
    bar = np.load(folder / "mesh.npz", allow_pickle=False)
    theirs = np.load(folder / "fem_result.npz", allow_pickle=False)
    nodes = bar["rest_q"].astype(np.float64)
    run = hung(Mesh(nodes, bar["tet_indices"].astype(np.int64), "tet4"))
    assert run.finished
    assert -1e3 * run.u[0][:, 2].min() == pytest.approx(43.2013, rel=1e-5)
    assert np.abs(run.u[0] - (theirs["final_q"] - nodes)).max() < 1e-6


def test_on_hexahedra_of_their_number_the_drop_is_theirs() -> None:
    """6 x 6 x 16 elements of eight nodes: 43.3963 mm."""
    run = hung(grid((0.6, 0.6, HEIGHT), (6, 6, 16)))
    assert -1e3 * run.u[0][:, 2].min() == pytest.approx(43.3963, rel=1e-5)
