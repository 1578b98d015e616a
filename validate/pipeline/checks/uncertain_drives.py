"""Standard deviations of drives as uncertain inputs of a verdict.

A recorded standard deviation of a stage, a force or of tracked points is taken as an error that is
there at all times after rest (an offset): at every instant of a static problem it does what an
independent error of that instant would do. A set of nodes that follows tracked points has one input
for every rigid motion.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.numbers import with_unit
from validate.pipeline.experiment.experiment import Experiment, Input
from validate.pipeline.experiment.method import Method
from validate.recording.types import Recording
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.scene.meshless import AnyScene, RigidBody
from validate.scene.prescribed_motion import Prescribed
from validate.scene.scene import Scene


def with_uncertain_drives(
    experiment: Experiment,
    methods: Mapping[str, Method],
    recordings: tuple[Recording, ...],
    parameters: Any,
) -> Experiment:
    """Return the experiment with an input for every drive whose standard deviation is known.

    Unchanged where it declares no uncertainty (a twin of the same model), or accepts no method.
    """
    declared = experiment.uncertainty
    names = [name for name in experiment.accepted if name in methods]
    if declared is None or not names:
        return experiment
    by = declared.surrogate or names[0]
    scene = experiment.build(recordings[0], parameters, experiment.methods[by].scene)
    if isinstance(scene, RigidBody):  # poses have no standard deviation of their own
        return experiment
    inputs = drive_inputs(scene, experiment.place(recordings[0], parameters, scene))
    if not inputs:
        return experiment
    more = replace(declared, inputs=(*declared.inputs, *inputs), surrogate=by)
    return replace(experiment, uncertainty=more)


def drive_inputs(scene: AnyScene, seen: Registered) -> tuple[Input, ...]:
    """Return the inputs of all drives that have a standard deviation, in order."""
    count = sum(drive.y.shape[1] for drive in seen.drives)
    found: list[Input] = []
    first = 0
    for drive in seen.drives:
        wide = drive.y.shape[1]
        rows = list(_deviations(scene, drive, first))
        for k, row in enumerate(rows, 1):
            off = np.zeros(count)
            off[first : first + wide] = row
            which = f", {k} of {len(rows)}" if len(rows) > 1 else ""
            words = (
                f"{drive.name} shifted by its standard deviation, {with_unit(drive.sd, drive.unit)}"
            )
            name = f"sd of {drive.name}{which}"
            found.append(Input(name, _as_it_is, words, "recorded", off=tuple(off.tolist())))
        first += wide
    return tuple(found)


def _deviations(scene: AnyScene, drive: SignalObservation, first: int) -> Iterator[Floats]:
    """Errors (columns of the drive,) of one standard deviation each, independent of each other."""
    wide = drive.y.shape[1]
    # The set of nodes whose tracked points are these inputs
    follower: Prescribed | None = None
    if isinstance(scene, Scene):
        own = scene.inputs[first : first + wide]
        follower = next((p for p in scene.tracked if p.inputs == own), None)
    if follower is not None:
        yield from follower.deviations(drive.sd)
    elif drive.sd > 0:
        yield from drive.sd * np.eye(wide)


def _as_it_is(parameters: Any, z: float) -> Any:
    return parameters
