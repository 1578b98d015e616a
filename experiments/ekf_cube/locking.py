"""Locking factor of linear cells: small displacement relative to quadratic cells."""

from dataclasses import replace

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.assembly.locate import Rows
from validate.fem.system import build
from validate.scene.scene import Load, Scene


def locking_factor(scene: Scene, probe: str) -> float:
    """Displacement at a probe under the scene's one load, linear over quadratic cells (same mesh).

    Small strain, static, the load as a uniform traction; along the quadratic displacement, of
    hexahedra that of mixed ones. 1 says that the scene's cells do as well as quadratic ones, 0.6
    that they show 60 % of the motion. A scene with nodal mean or mixed dilatation is judged as it
    is. Raises `SceneError` without that probe, for other than one load, for quadratic cells, and
    for a probe that does not move.
    """
    points = [p.point for p in scene.probes if p.name == probe]
    if len(points) != 1 or len(scene.loads) != 1 or scene.mesh.order != 1:
        raise SceneError(
            f"locking at '{probe}': needs linear cells, one load and that probe; the scene has "
            f"order {scene.mesh.order}, {len(scene.loads)} loads, probes "
            f"{[p.name for p in scene.probes]}"
        )
    small = replace(
        scene,
        material=replace(scene.material, law="linear"),
        regions=tuple(
            replace(r, material=replace(r.material, law="linear")) for r in scene.regions
        ),
        loads=tuple(
            replace(load, spread="consistent") if isinstance(load, Load) else load
            for load in scene.loads
        ),
    )
    # Quadratic hexahedra lock near nu = .5, too; those of linear pressure do not.
    finer = replace(
        small, body=scene.mesh.quadratic(), dilatation="mixed" if scene.mesh.bricks else "pointwise"
    )
    ours, reference = (_moved(s, np.array(points)) for s in (small, finer))
    length = float(reference @ reference)
    if length == 0:
        raise SceneError(f"locking at '{probe}': the probe does not move under the load")
    return float(ours @ reference) / length


def _moved(scene: Scene, points: Floats) -> Floats:
    """Displacement (d,) m of the one point under a unit of the one load."""
    system = build(scene)
    u = np.zeros(scene.mesh.nodes.size)
    u[system.free] = system.factor().solve(system.loads[system.free, 0])
    moved: Floats = Rows.barycentric(scene.mesh, points).apply(u.reshape(scene.mesh.nodes.shape))[0]
    return moved
