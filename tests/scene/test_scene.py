"""Scenes refuse impossible materials and sets that are not there, with the numbers."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from phantoms import COARSE_GRID, phantom_mesh, phantom_scene

from validate.errors import SceneError
from validate.scene.contact import Needle, require_usable
from validate.scene.geometries.box import box
from validate.scene.geometries.specification import Box
from validate.scene.material import Material, Region
from validate.scene.places import Chosen, Nearest
from validate.scene.scene import Cavity, Drive, Foundation, Pin, Scene, Support
from validate.solve.haptic.needle import Surface


@pytest.mark.parametrize("E", [0.0, -1.0, math.nan, math.inf])
def test_modulus_must_be_positive(E: float) -> None:
    with pytest.raises(SceneError, match=r"E = .* Pa: expected a positive number"):
        Material(E, 0.3)


@pytest.mark.parametrize("nu", [0.5000001, 0.51, -1.0, -2.0, math.nan])
def test_poisson_ratio_has_a_range_and_a_reason(nu: float) -> None:
    with pytest.raises(SceneError, match=r"expected -1 < nu <= 0.5; use at.*0.4999"):
        Material(1.0, nu)


def test_moduli() -> None:
    soft = Material(9.0, 0.125)
    assert soft.shear_modulus == pytest.approx(4.0)
    assert soft.bulk_modulus == pytest.approx(4.0)
    for nu in (-0.99, 0.4999999999):
        assert Material(1.0, nu).bulk_modulus > 0


@pytest.mark.parametrize(
    "parts",
    [
        {"supports": (Support("lid", (0,)),)},
        {"drives": (Drive("stage", "lid", (1.0, 0.0, 0.0)),)},
        {"cavities": (Cavity("cyst", "lid"),)},
    ],
)
def test_sets_that_the_mesh_lacks_are_refused(parts: dict[str, tuple[object, ...]]) -> None:
    with pytest.raises(SceneError, match=r"no facets 'lid'; it has .*'cavity'"):
        Scene(phantom_mesh(COARSE_GRID), Material(1.0, 0.3), **parts)  # type: ignore[arg-type]


def test_nodal_mean_dilatation_needs_linear_elements() -> None:
    with pytest.raises(SceneError, match="use order 1"):
        phantom_scene(phantom_mesh(COARSE_GRID).quadratic(), dilatation="nodal_mean")


@pytest.mark.parametrize("cell", [-1, 10**6])
def test_a_regions_cells_are_those_of_the_mesh(cell: int) -> None:
    stiff = Region("stiff", np.array([0, cell]), Material(1e4, 0.3))
    with pytest.raises(SceneError, match=f"region 'stiff' has cell {cell}, the mesh "):
        Scene(phantom_mesh(COARSE_GRID), Material(1.0, 0.3), regions=(stiff,))


def test_what_a_plane_mesh_cannot_have_is_refused() -> None:
    plane = box((1.0, 1.0), (1, 1))
    for parts in ({"dilatation": "nodal_mean"}, {"foundations": (Foundation("x0", (0,), 1.0),)}):
        with pytest.raises(SceneError, match="mean dilatation, foundations"):
            Scene(plane, Material(1.0, 0.3), **parts)  # type: ignore[arg-type]
    with pytest.raises(SceneError, match=r"0 copies.*least 1"):
        Scene(plane, Material(1.0, 0.3), copies=0)
    with pytest.raises(SceneError, match="nodal mean dilatation supports one"):
        Scene(
            box((1.0, 1.0, 1.0), (1, 1, 1)), Material(1.0, 0.3), dilatation="nodal_mean",
            regions=(Region("stiff", np.array([0]), Material(2.0, 0.3)),),
        )  # fmt: skip


def test_a_needle_touches_faces_of_simplices() -> None:
    mesh = box((1.0, 1.0, 1.0), (1, 1, 1))
    needle = Needle(
        "needle", Chosen(Nearest((1.0, 1.0, 1.0)), "points"), (0.5, 0.5, 2.0), (0.0, 0.0, -1.0)
    )
    with pytest.raises(SceneError, match=r"needle 'needle' touches .*: choose faces"):
        require_usable((needle,), mesh)
    with pytest.raises(SceneError, match="2 needles: expected one"):
        require_usable((needle, needle), mesh)
    with pytest.raises(SceneError, match="4 nodes in 3-D"):
        Surface(np.zeros((1, 4), int), 3)
    assert Surface(np.zeros((1, 6), int), 3).facets.shape == (1, 6)


@pytest.mark.parametrize("name", ["mass", "stiffness"])
@pytest.mark.parametrize("value", [-0.1, math.nan, math.inf])
def test_damping_is_a_number_of_at_least_zero(name: str, value: float) -> None:
    with pytest.raises(SceneError, match=f"{name} damping {value:g}: expected a number >= 0"):
        Material(1.0, 0.3, **{f"{name}_damping": value})  # type: ignore[arg-type]


def test_what_rests_on_a_plate_keeps_its_middle_and_does_not_turn() -> None:
    declared = Scene(Box(("1 m", "1 m", "1 m"), cells=(2, 2, 2)), Material(1.0, 0.3),
                     (Support("z0", (2,), rests=True),))  # fmt: skip
    scene = declared.resolved(declared.body.resolved(Path()))
    assert [pin.components for pin in scene.pins] == [(0, 1), (1,)]
    assert scene.pins[0].point == pytest.approx((0.5, 0.5, 0.0))
    assert scene.pins[1].point[1:] == pytest.approx((0.5, 0.0))
    aside = box((1.0, 1.0, 1.0), (1, 1, 1))
    with pytest.raises(SceneError, match="no node within 250 mm of its middle"):
        declared.resolved(aside)
    with pytest.raises(SceneError, match="rests on z0 along one axis"):
        replace(declared, supports=(Support("z0", rests=True),)).resolved(scene.mesh)


@pytest.mark.parametrize("part", [
    {"supports": (Support("z0", (3,)),)}, {"supports": (Support("z0", ()),)},
    {"pins": (Pin((0.0, 0.0, 0.0), (0, -1)),)}, {"foundations": (Foundation("z0", (7,), 1.0),)},
])  # fmt: skip
def test_what_holds_a_body_has_components_of_its_dimension(part: Any) -> None:
    """The component 3 of a node was the first one of its neighbour."""
    with pytest.raises(SceneError, match=r"components .*: expected some of 0, 1, 2 "):
        Scene(box((1.0, 1.0, 1.0), (1, 1, 1)), Material(1.0, 0.3), **part)


@pytest.mark.parametrize(("element", "dilatation"), [
    ("tet4", "nodal_mean"), ("tet10", "pointwise"), ("hex8", "mixed"), ("hex27", "mixed"),
])  # fmt: skip
def test_a_dilatation_by_element_is_the_one_that_does_not_lock(
    element: Any, dilatation: str
) -> None:
    declared = Scene(Box((1.0, 1.0, 1.0), (1, 1, 1), element), Material(1.0, 0.3),
                     dilatation="by_element")  # fmt: skip
    assert declared.resolved(declared.body.resolved(Path())).dilatation == dilatation
