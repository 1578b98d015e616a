"""The ladder of the swinging block: what a solver's error costs where inertia matters."""

import numpy as np

from validate.arrays import Floats
from validate.pipeline.experiment.tree import Built, Tree
from validate.pipeline.ladder.ladder import Ladder, Trial, marker_noise
from validate.pipeline.ladder.references import swinging_trial
from validate.recording.types import Recording


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
