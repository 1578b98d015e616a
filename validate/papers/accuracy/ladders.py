"""The ladders of paper 002's bodies: the rod's trade, and where block and rod are stable."""

from typing import Any

import numpy as np

from validate.papers.accuracy.needle import MP1, MP2, STEP, needle_block
from validate.papers.accuracy.rod import MP3, bending_rod, gravity_inputs
from validate.papers.swinging import swinging_trial
from validate.recording.types import Recording
from validate.replay.ladder import Ladder, PaperSetting, StabilityBody, Trial, turned
from validate.scene.scene import Load

_MEDIUM = turned(MP1, 10)
NEEDLE_LADDER = Ladder(
    body=StabilityBody(
        "paper 002's block (unit square, quadrilaterals in plane strain)",
        needle_block,
        _MEDIUM,
        (6, 10, 14, 20),
        STEP,
        (
            PaperSetting("002 MP1", "paper 002, section IV.A", _MEDIUM, STEP),
            PaperSetting("002 MP2", "paper 002, section IV.A", turned(MP2, 10), STEP),
        ),
        Load("shear", "x1", (0.0, 1.0)),
    )
)


def _rod_trial(recording: Recording, parameters: Any, quick: bool) -> Trial:
    return swinging_trial(
        bending_rod(1),
        (2, 1, 1),
        (1 / 15, 1 / 30, 1 / 60),
        np.arange(0.2, 4.1 if quick else 8.1, 0.2),
        gravity_inputs,
        quick,
    )


_COARSE = turned(MP3, 3)
ROD_LADDER = Ladder(
    _rod_trial,
    StabilityBody(
        "paper 002's rod (hexahedra)",
        bending_rod,
        _COARSE,
        (2, 3, 4),
        STEP,
        (PaperSetting("002 MP3", "paper 002, section IV.B", _COARSE, STEP),),
    ),
)
