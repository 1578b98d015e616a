"""The ladder of paper 003's cube and of the cone's material: where steps are stable."""

from dataclasses import replace

from validate.pipeline.ladder.ladder import Ladder, PaperSetting, StabilityBody, Turned
from validate.scene.geometries.box import box
from validate.scene.material import Material
from validate.scene.scene import Load, Scene, Support

SIDE = 0.1  # m, of the cube


def _cube(n: int, material: Material) -> Scene:
    return Scene(
        box((SIDE, SIDE, SIDE), (n, n, n)),
        material,
        (Support("z0", (0, 1, 2)),),
        loads=(Load("pull", "x0", (-1.0, 0.0, 0.0)),),
    )


_COARSE = Turned(30e3, 0.49, 1000.0, 0.0, 0.0, 4)
_CONE = replace(_COARSE, E=3 * 22.081e3, nu=0.5, rho=1060.0)
CUBE_LADDER = Ladder(
    body=StabilityBody(
        "paper 003's cube, coarser (tetrahedra)",
        _cube,
        _COARSE,
        (3, 4, 5),
        0.001,
        (
            PaperSetting("003 cube", "paper 003, coarser mesh", _COARSE, 0.001),
            PaperSetting("003 cone", "paper 003, the cone's material here", _CONE, 1e-4),
        ),
    )
)
