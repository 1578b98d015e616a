"""The ladder of paper 002's rod: its trade, and where it is stable."""

from typing import Any

import numpy as np

from validate.pipeline.ladder.ladder import Ladder, PaperSetting, StabilityBody, Trial, Turned
from validate.pipeline.ladder.references import swinging_trial
from validate.recording.types import Recording

from ..needle_block.body import STEP
from .body import MP3, bending_rod, gravity_inputs


def _rod_trial(recording: Recording, parameters: Any, quick: bool) -> Trial:
    return swinging_trial(
        bending_rod(1),
        (2, 1, 1),
        (1 / 15, 1 / 30, 1 / 60),
        np.arange(0.2, 4.1 if quick else 8.1, 0.2),
        gravity_inputs,
        quick,
    )


_COARSE = Turned.of(MP3, 3)
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
