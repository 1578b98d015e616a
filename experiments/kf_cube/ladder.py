"""The ladder of paper 001's block: where it is stable as printed."""

from validate.pipeline.ladder.ladder import Ladder, PaperSetting, StabilityBody, Turned
from validate.scene.geometries.box import box
from validate.scene.material import Material
from validate.scene.scene import Load, Scene, Support


def _block(n: int, material: Material) -> Scene:
    """The block, n cells across its 4 mm."""
    return Scene(
        box((0.004, 0.004, 0.007), (n, n, round(7 * n / 4))),
        material,
        (Support("z0", (0, 1, 2)),),
        loads=(Load("pull", "z1", (0.0, 0.0, 1.0)),),
    )


_PRINTED = Turned(10e3, 0.47, 1068.0, 0.0, 0.1, 4)
PRINTED_LADDER = Ladder(
    body=StabilityBody(
        "paper 001's block (tetrahedra)",
        _block,
        _PRINTED,
        (2, 3, 4),
        0.002,
        (PaperSetting("001", "paper 001, section 4", _PRINTED, 0.002),),
    )
)
