"""Warnings of cells that lock."""

import pytest

from validate.fem.locking import locking_notes
from validate.scene.geometries.box import box
from validate.scene.material import Material
from validate.scene.scene import Scene, Support


@pytest.mark.parametrize(
    ("nu", "cells", "warned"),
    [(0.49, 4, True), (0.4999, 2, True), (0.48, 2, False), (0.49, 5, False)],
)
def test_few_cells_of_mean_dilatation_are_warned_of(nu: float, cells: int, warned: bool) -> None:
    """Two across a bonded cylinder at nu .4999 show 32 times the force of quadratic ones."""
    mesh = box((1.0, 1.0, 1.0), (cells,) * 3)
    body = Scene(mesh, Material(1e4, nu), (Support("z0", (0, 1, 2)),), dilatation="nodal_mean")
    found = " ".join(locking_notes([("fem", body)]))
    assert (
        "a mesh of few linear tetrahedra with nodal mean dilatation is too stiff" in found
    ) == warned
    assert (f"{cells}.0 across the body" in found) == warned
