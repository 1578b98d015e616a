"""The ladders of paper 001's block: its stability as printed, the trade where inertia matters."""

import numpy as np

from validate.arrays import Floats
from validate.papers.swinging import swinging_trial
from validate.recording.types import Recording
from validate.replay.ladder import (
    Ladder,
    PaperSetting,
    StabilityBody,
    Trial,
    Turned,
    marker_noise,
)
from validate.replay.tree import Built, Tree
from validate.scene.box import box
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


def _swing(recording: Recording, tree: Tree, quick: bool) -> Trial:
    base, loading = Built()(recording, tree), tree.settings.loading
    width, depth, _ = tree.scene.body.size
    force = loading.traction * width * depth

    def inputs(t: Floats) -> Floats:
        return np.asarray(force * (t < loading.off + 1e-9)[:, None])

    frames = np.arange(0.016, 0.5 if quick else 0.97, 0.016)
    steps = (0.004, 0.002, 0.001)
    return swinging_trial(base, (1, 1, 2), steps, frames, inputs, quick, marker_noise(recording))


SWINGING_LADDER = Ladder(_swing)
