"""A refined scene keeps its regions where they were."""

from dataclasses import replace

import numpy as np
import pytest

from validate.scene.geometries.box import box
from validate.scene.geometries.refinement import refined
from validate.scene.material import Material, Region
from validate.scene.scene import Scene


def test_a_region_keeps_its_volume_and_place() -> None:
    soft = Material(1e3, 0.3)
    scene = Scene(box((1.0, 1.0, 1.0), (2, 2, 2)), soft)
    cells = np.array([0, 5, 17])
    scene = replace(scene, regions=(Region("stiff", cells, replace(soft, E=5e3)),))
    fine = refined(scene)
    (region,) = fine.regions
    assert len(region.cells) == len(set(region.cells.tolist())) == 8 * len(cells)
    volumes = [s.mesh.cell_volumes()[s.regions[0].cells].sum() for s in (scene, fine)]
    assert volumes[1] == pytest.approx(volumes[0], rel=1e-12)
    centres = [
        s.mesh.nodes[s.mesh.corners[s.regions[0].cells]].mean(axis=(0, 1)) for s in (scene, fine)
    ]
    assert centres[1] == pytest.approx(centres[0], abs=1e-12)
