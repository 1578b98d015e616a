"""The box that calibrated: how far every method is off there, which is no evidence."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from validate.arrays import rms
from validate.compare.score import Score
from validate.papers.gel.box import GelIndentation, build, place
from validate.recording.types import Recording
from validate.register.displacements import DisplacementObservation
from validate.register.scattered import noise
from validate.replay.experiment import Identified
from validate.replay.method import Method
from validate.solve.march import run_scheme

_WORDS = "rms error of displacement vectors in the lower box over that about local quadratics"


def fitted_box(
    recordings: Sequence[Recording], parameters: GelIndentation, methods: Mapping[str, Method]
) -> Identified:
    """Errors over the floor in the lower box, under the Poisson ratio that was found there."""
    lower = replace(parameters, box=replace(parameters.box, which="lower"))
    found, count, last = {}, 0, np.zeros(1, dtype=np.int64)
    for name, method in methods.items():
        scene = build(recordings[0], lower, method.scene)
        placed = place(recordings[0], lower, scene)
        run = run_scheme(name, method.settings, scene, placed.t, placed.inputs, last)
        (seen,) = placed.of(DisplacementObservation)
        if run.finished:
            floor, _ = noise(seen.points, seen.u)
            found[name] = rms(seen.simulated(run.u[-1]) - seen.u) / rms(floor)
            count = len(floor)
    scores = tuple(
        Score(f"lower.over_floor.{name}", ratio, "1", count, "what calibrates", _WORDS)
        for name, ratio in found.items()
    )
    each = ", ".join(f"{name} {ratio:.2f}" for name, ratio in found.items())
    note = f"In the lower box, {count} particles, errors over the floor there: {each} (fitted)."
    return Identified(parameters, scores, (note,))
