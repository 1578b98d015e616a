"""The ladder of a liver made by formulas: where steps are stable on it."""

from validate.pipeline.ladder.ladder import Ladder, PaperSetting, StabilityBody, Turned
from validate.scene.material import Material
from validate.scene.scene import Load, Scene, Support

from ..ekf_cube.published import PRINTED_LIVER_STEP
from .body import generated_liver, with_sets

_COARSE = Turned(30e3, 0.49, 1000.0, 0.0, 0.0, 3)


def _liver(n: int, material: Material) -> Scene:
    """The body made by formulas, coarser, so that all modes are at hand."""
    return Scene(
        with_sets(generated_liver((2 * n, n + 1, n))),
        material,
        (Support("held", (0, 1, 2)),),
        loads=(Load("pull", "loaded", (0.0, 0.0, 1.0)),),
    )


LIVER_LADDER = Ladder(
    body=StabilityBody(
        "a liver made by formulas, coarser (tetrahedra)",
        _liver,
        _COARSE,
        (2, 3, 4),
        PRINTED_LIVER_STEP,
        (
            PaperSetting(
                "003 liver", "paper 003, another and coarser mesh", _COARSE, PRINTED_LIVER_STEP
            ),
        ),
    )
)
