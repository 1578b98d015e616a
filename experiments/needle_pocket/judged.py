"""What of `needle_pocket` a recording can judge: sensors, a live loop's own force, or nothing."""

from collections.abc import Sequence
from dataclasses import replace

from validate.compare.verdict import Accept
from validate.recording.types import Recording
from validate.replay.experiment import Experiment
from validate.replay.live import LIVE, as_given
from validate.replay.remade import made_here
from validate.replay.tree import Tree

_PLANE = 25.0  # N/m over N: what a force limit in the plane is worth in the solid's


def follows(experiment: Experiment, recordings: Sequence[Recording], p: Tree) -> Experiment:
    """The experiment as its recording has it: a path of the user's own is walked as it is."""
    recording = recordings[0]
    accept = tuple(_of_space(a, p) for a in experiment.accept)
    if made_here(recording):
        return replace(experiment, accept=accept)
    twin = experiment.twin
    assert twin is not None
    if LIVE in recording.metadata:
        return as_given(experiment, recording)
    there = tuple(a for a in accept if a.quantity in recording.signals)
    return replace(experiment, accept=there, twin=replace(twin, remake=()))


def _of_space(accept: Accept, p: Tree) -> Accept:
    force = accept.quantity.startswith("force") and p.scene.body.space == "solid"
    return replace(accept, limit=accept.limit / _PLANE) if force and accept.limit else accept
