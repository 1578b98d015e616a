"""A pressure on faces: its resultant, its side, and a thick-walled tube's closed form."""

from dataclasses import replace

import numpy as np
import pytest

from validate.errors import SceneError
from validate.fem.assembly.assemble import load_columns
from validate.fem.system import build
from validate.scene.geometries.box import box, grid
from validate.scene.material import Material
from validate.scene.places import OnPlane, place_of
from validate.scene.scene import Pressure, Scene, Support
from validate.solve.static.quasi_static import QuasiStatic

SIZE = (0.03, 0.02, 0.01)
SOFT = Material(20e3, 0.3)


@pytest.mark.parametrize("mesh", [box(SIZE, (2, 2, 1)), box(SIZE, (2, 1, 1)).quadratic(),
                                  grid(SIZE, (2, 2, 1))])  # fmt: skip
def test_a_pascal_pushes_into_the_body(mesh: object) -> None:
    scene = Scene(mesh, SOFT, loads=(Pressure("p", "z1"),))  # type: ignore[arg-type]
    f = load_columns(scene)[:, 0].reshape(-1, 3)
    np.testing.assert_allclose(f.sum(axis=0), (0, 0, -SIZE[0] * SIZE[1]), atol=1e-15)


def test_all_around_it_has_no_resultant_however_a_file_orients_its_faces() -> None:
    mesh = box(SIZE, (2, 2, 1))
    turned = mesh.surface[:, ::-1].copy()
    found = [
        load_columns(
            Scene(replace(mesh, facets={"all": faces}), SOFT, loads=(Pressure("p", "all"),))
        )
        for faces in (mesh.surface, turned)
    ]
    np.testing.assert_array_equal(*found)
    assert np.abs(found[0].reshape(-1, 3).sum(axis=0)).max() < 1e-15


def test_a_tube_widens_as_lame_says() -> None:
    """u = p a^2 (1 + nu) / (E (b^2 - a^2)) ((1 - 2 nu) r + b^2 / r) in plane strain."""
    a, b, p, E, nu = 0.01, 0.02, 100.0, 20e3, 0.3
    unit = grid((1.0, 1.0, 1.0), (8, 16, 1))
    r, angle = a + (b - a) * unit.nodes[:, 0], np.pi / 2 * unit.nodes[:, 1]
    nodes = np.stack([r * np.cos(angle), r * np.sin(angle), 2e-3 * unit.nodes[:, 2]], axis=1)
    mesh = replace(unit, nodes=nodes, facets={"inner": unit.facets["x0"]})
    held = [("xmin", 0), ("ymin", 1), ("zmin", 2), ("zmax", 2)]
    scene = Scene(
        mesh, Material(E, nu), tuple(Support(place_of(x, mesh), (c,)) for x, c in held),
        loads=(Pressure("p", "inner"),),
    )  # fmt: skip
    stepper = QuasiStatic().prepare(build(scene))
    u = stepper.field(stepper.step(stepper.rest(), np.array([p])))
    for radius in (a, b):
        exact = p * a**2 * (1 + nu) / (E * (b**2 - a**2)) * ((1 - 2 * nu) * radius + b**2 / radius)
        at = np.isclose(r, radius)
        radial = np.einsum("ij,ij->i", u[at], mesh.nodes[at] * (1, 1, 0) / radius)
        assert np.abs(radial / exact - 1).max() < 0.01


def test_edges_and_faces_within_the_body_are_refused() -> None:
    mesh = box(SIZE, (2, 2, 2))
    edges = OnPlane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)).edges
    with pytest.raises(SceneError, match="a foundation, membrane or pressure"):
        Scene(mesh, SOFT, loads=(Pressure("p", edges),))
    outside = {frozenset(face) for face in mesh.surface.tolist()}
    inside = next(c[:3] for c in mesh.cells.tolist() if frozenset(c[:3]) not in outside)
    cut = replace(mesh, facets={"cut": np.array([inside])})
    scene = Scene(cut, SOFT, loads=(Pressure("p", "cut"),))
    with pytest.raises(SceneError, match="1 of 1 faces lie inside the body"):
        load_columns(scene)
