"""The sheet with two pads: its places, its meshes, sizes that a recording states later."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from validate.errors import UsageError
from validate.scene.geometries.sheet import Sheet
from validate.scene.geometries.specification import Geometry
from validate.scene.material import Material
from validate.scene.places import nodes_of
from validate.scene.scene import Drive, Scene, Support

SHEET = Sheet("60 mm", "40 mm", "8 mm", "8 mm", "30 mm", cells=1)


def test_pads_are_places_whose_edges_are_lines_of_the_mesh() -> None:
    scene = Scene(
        SHEET, Material(1.0, 0.3), (Support("x0", (0, 1)), Support("left_pad", (1,))),
        drives=(Drive("pull", "right_pad", (1.0, 0.0)),), plane="stress",
    ).resolved(SHEET.resolved(Path()))  # fmt: skip
    for place, x in ((scene.supports[1].facets, (-23, -15)), (scene.drives[0].facets, (15, 23))):
        under = 1e3 * scene.mesh.nodes[nodes_of(scene.mesh, place)]
        assert (under.min(axis=0), under.max(axis=0)) == (
            pytest.approx((x[0], -4)), pytest.approx((x[1], 4)),
        )  # fmt: skip
    assert np.ptp(scene.mesh.nodes, axis=0) == pytest.approx((0.06, 0.04))


def test_a_sheet_is_a_geometry_with_a_family() -> None:
    assert isinstance(SHEET, Geometry)
    assert replace(SHEET, cells=4).scaled(0.5).cells == 2
    assert replace(SHEET, cells=2).scaled(1.5).cells == 3


def test_sizes_that_are_open_or_too_small_are_refused() -> None:
    with pytest.raises(UsageError, match=r"body\.gap is not set"):
        Sheet().resolved(Path())
    with pytest.raises(UsageError, match="it must reach beyond them"):
        replace(SHEET, length=0.04).resolved(Path())
