"""The ladder of paper 002's block: where it is stable."""

from validate.pipeline.ladder.ladder import Ladder, PaperSetting, StabilityBody, Turned
from validate.scene.scene import Load

from .body import MP1, MP2, STEP, needle_block

_MEDIUM = Turned.of(MP1, 10)
NEEDLE_LADDER = Ladder(
    body=StabilityBody(
        "paper 002's block (unit square, quadrilaterals in plane strain)",
        needle_block,
        _MEDIUM,
        (6, 10, 14, 20),
        STEP,
        (
            PaperSetting("002 MP1", "paper 002, section IV.A", _MEDIUM, STEP),
            PaperSetting("002 MP2", "paper 002, section IV.A", Turned.of(MP2, 10), STEP),
        ),
        Load("shear", "x1", (0.0, 1.0)),
    )
)
