"""Bodies at large strain in two dimensions: plane strain and plane stress, against exact truths."""

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from law_samples import NAMES, sample

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.assembly.assemble import stiffness
from validate.fem.large_strain.hyperelastic import Body
from validate.scene.geometries.box import box, grid
from validate.scene.material import Material, Prony
from validate.scene.mesh import Mesh
from validate.scene.meshless import MaterialPoint
from validate.scene.scene import Drive, PlaneState, Scene, Support
from validate.solve.march import run_scheme
from validate.solve.static.newton import StaticNewton
from validate.solve.static.stretch_test import StretchTest

SIZE, THICKNESS = (0.03, 0.02), 0.002
MESHES = {
    "tri3": box(SIZE, (3, 2)),
    "tri6": box(SIZE, (3, 2)).quadratic(),
    "quad4": grid(SIZE, (3, 2)),
}
every = pytest.mark.parametrize(
    ("kind", "plane", "name"),
    [(k, p, n) for k in MESHES for p in ("strain", "stress") for n in NAMES],
)


def sheet(mesh: Mesh, plane: PlaneState, material: Material) -> Scene:
    return Scene(mesh, material, plane=plane, thickness=THICKNESS)


def deformed(mesh: Mesh) -> Floats:
    rng = np.random.default_rng(1)
    H = np.array([[0.3, 0.15], [-0.05, -0.1]])
    return (mesh.nodes @ H.T + 1e-4 * rng.normal(size=mesh.nodes.shape)).ravel()


@every
def test_tangent_at_rest_is_the_linear_stiffness(kind: str, plane: PlaneState, name: str) -> None:
    scene = sheet(MESHES[kind], plane, sample(name, 15_200.0, 0.45))
    K, T = stiffness(scene), Body(scene).tangent(np.zeros(scene.mesh.nodes.size))
    assert abs(T - K).max() <= 1e-10 * abs(K).max()


@every
def test_force_and_tangent_are_derivatives(kind: str, plane: PlaneState, name: str) -> None:
    b = Body(sheet(MESHES[kind], plane, sample(name, 15_200.0, 0.45)))
    u = deformed(b.mesh)
    v, h = np.random.default_rng(2).normal(size=u.size), 1e-8
    work = (b.energy(u + h * v) - b.energy(u - h * v)) / (2 * h)
    assert work == pytest.approx(b.force(u) @ v, rel=1e-7)
    T = b.tangent(u)
    slope = (b.force(u + h * v) - b.force(u - h * v)) / (2 * h)
    assert slope == pytest.approx(T @ v, abs=1e-7 * np.abs(T @ v).max())
    assert abs(T - T.T).max() <= 1e-12 * abs(T).max()


def test_mixed_cells_in_plane_strain_are_consistent() -> None:
    scene = sheet(MESHES["tri6"], "strain", sample("neo_hooke", 15_200.0, 0.499))
    b = Body(replace(scene, dilatation="mixed"))
    assert (
        abs(
            b.tangent(np.zeros(b.mesh.nodes.size)) - stiffness(replace(scene, dilatation="mixed"))
        ).max()
        < 1e-5
    )
    u, h = 0.1 * deformed(b.mesh), 1e-8
    v = np.random.default_rng(2).normal(size=u.size)
    slope = (b.force(u + h * v) - b.force(u - h * v)) / (2 * h)
    assert slope == pytest.approx(b.tangent(u) @ v, rel=1e-5, abs=1e-7 * np.abs(slope).max())


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("mode", ["uniaxial", "pure_shear"])
def test_a_stretched_sheet_is_the_material_point(
    name: str, mode: Literal["uniaxial", "pure_shear"]
) -> None:
    """A homogeneous strip, free at its sides or held there: nominal stress times its section."""
    material = sample(name, 15_200.0, 0.4995)
    sides = (Support("y0", (1,)), *([Support("y1", (1,))] if mode == "pure_shear" else []))
    scene = replace(
        sheet(MESHES["tri6"], "stress", material),
        supports=(Support("x0", (0,)), *sides),
        drives=(Drive("pull", "x1", (1.0, 0.0)),),
    )
    stretch = np.array([[1.1], [1.25]])
    t, at = np.array([1.0, 2.0]), np.array([1])
    run = run_scheme("sheet", StaticNewton("none"), scene, t, SIZE[0] * (stretch - 1), at)
    point = run_scheme("point", StretchTest(), MaterialPoint(material, mode), t, stretch, at)
    assert run.finished
    section = SIZE[1] * THICKNESS
    expected = section * point.traces["nominal_stress"].y
    assert run.traces["pull.force"].y == pytest.approx(expected, rel=1e-8)


def test_forces_have_the_unit_of_their_scene() -> None:
    scene = replace(
        sheet(MESHES["tri3"], "stress", sample("neo_hooke", 15_200.0, 0.45)),
        supports=(Support("x0", (0, 1)),),
        drives=(Drive("pull", "x1", (1.0, 0.0)),),
    )
    one = np.array([1.0]), np.array([[0.001]]), np.array([0])
    known, unknown = (
        run_scheme("sheet", StaticNewton("none"), s, *one)
        for s in (scene, replace(scene, force_unit="force unit"))
    )
    assert known.traces["pull.force"].unit == "N"
    assert unknown.traces["pull.force"].unit == "force unit"
    assert unknown.traces["pull.displacement"].unit == "m"
    assert (unknown.traces["pull.force"].y == known.traces["pull.force"].y).all()
    with pytest.raises(SceneError, match="forces in 'kN'"):
        replace(scene, force_unit="kN")


def test_a_sheet_turned_over_is_inverted() -> None:
    b = Body(sheet(MESHES["tri3"], "stress", sample("neo_hooke", 15_200.0, 0.45)))
    turned = b.mesh.nodes @ np.diag([-2.0, 0.0])
    found = b.inverted(turned.ravel())
    assert found is not None
    assert found.count == found.points


def test_a_prony_series_is_refused() -> None:
    material = replace(sample("neo_hooke", 15_200.0, 0.45), prony=Prony((0.5,), (1.0,)))
    with pytest.raises(SceneError, match="3-D"):
        Body(sheet(MESHES["tri3"], "stress", material))
