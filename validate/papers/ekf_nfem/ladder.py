"""The ladders of paper 003: where steps are stable on its cube, the cone's material, a liver."""

from dataclasses import replace

from validate.papers.ekf_nfem.figures import PRINTED_LIVER_STEP
from validate.papers.ekf_nfem.liver_body import generated_liver, with_sets
from validate.replay.ladder import Ladder, PaperSetting, StabilityBody, Turned
from validate.scene.box import box
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


def _liver(n: int, material: Material) -> Scene:
    """The body made by formulas, coarser, so that all modes are at hand."""
    return Scene(
        with_sets(generated_liver((2 * n, n + 1, n))),
        material,
        (Support("held", (0, 1, 2)),),
        loads=(Load("pull", "loaded", (0.0, 0.0, 1.0)),),
    )


_LIVER = replace(_COARSE, mesh=3)
LIVER_LADDER = Ladder(
    body=StabilityBody(
        "a liver made by formulas, coarser (tetrahedra)",
        _liver,
        _LIVER,
        (2, 3, 4),
        PRINTED_LIVER_STEP,
        (
            PaperSetting(
                "003 liver", "paper 003, another and coarser mesh", _LIVER, PRINTED_LIVER_STEP
            ),
        ),
    )
)
