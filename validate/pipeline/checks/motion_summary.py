"""Summary of the recorded motion and of the body's first modes."""

import numpy as np

from validate.errors import ValidateError
from validate.pipeline.bodies.first_modes import assumed_density, first_frequencies
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.origins import Opened, opened
from validate.pipeline.experiment.tree import Tree
from validate.report.sections.motion_words import motion_lines
from validate.scene.scene import Scene


def described(experiment: Experiment) -> tuple[str, ...]:
    """Return a line for each stream of the first recording that moves, and one of the first modes.

    Empty where the recording cannot be read, or nothing of it moves in time.
    """
    try:
        found = opened(experiment, experiment.parameters)
    except ValidateError:
        return ()
    lines = motion_lines(found.recordings[0]) if found.recordings else ()
    return (*lines, *_modes(experiment, found)) if lines else ()


def _modes(experiment: Experiment, found: Opened) -> tuple[str, ...]:
    """Of the first model; empty without one of known modulus that is held."""
    p = found.parameters
    if isinstance(p, Tree) and isinstance(p.scene, Scene) and p.scene.material.E is None:
        return ()
    model = next(iter(experiment.methods.values())).scene
    try:
        scene = experiment.build(found.recordings[0], p, model)
        modes = first_frequencies(scene) if isinstance(scene, Scene) else ()
    except (ValidateError, np.linalg.LinAlgError):
        return ()
    words = ", ".join(f"{f:.3g}" for f in modes)
    assumed = assumed_density(p)
    return (f"first modes of the body: {words} Hz{assumed and f' ({assumed})'}",) if modes else ()
