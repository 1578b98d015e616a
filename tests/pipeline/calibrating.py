"""A block whose top is moved: its modulus stands open, and the force on the stage identifies it."""

from dataclasses import dataclass, field, replace
from typing import Any

from tiny import AT_HOLDS, MOVED, place_moved, record_moved

from validate.compare.verdict import Accept
from validate.parameters import with_given
from validate.pipeline.calibration.calibration import Calibrates, Calibration, Free
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.run.twin_record import stamped
from validate.recording.types import Recording
from validate.register.registration import Registered
from validate.register.sensing import ForceSensing
from validate.register.signals import SignalObservation
from validate.scene.geometries.specification import Box
from validate.scene.scene import Scene

TRUE = AT_HOLDS.parameters


@dataclass(frozen=True)
class Sensed:
    cell: ForceSensing = field(default_factory=ForceSensing)


def placed(recording: Recording, tree: Tree, its: Scene) -> Registered:
    seen = place_moved(recording, tree, its)
    *others, cell = seen.observations
    assert isinstance(cell, SignalObservation)
    return replace(seen, observations=(*others, tree.settings.cell.of(cell)))


COARSE = replace(MOVED, body=Box(MOVED.body.size, (2, 2, 2)))
OPENED = with_given(Tree(scene=COARSE, settings=Sensed()), {"material.E": None})


def known(**values: Any) -> Tree:
    """The tree with these of its material, E in Pa."""
    changed: Tree = with_given(OPENED, {f"material.{k}": v for k, v in values.items()})
    return changed


E = Free("material.E", 1e3, 1e5, "assumed")
NU = Free("material.nu", 0.0, 0.45, "assumed", "the sides' motion")

OPEN: Experiment = replace(
    AT_HOLDS,
    parameters=OPENED,
    load=lambda tree, folder: (stamped(record_moved(TRUE, print), TRUE),),
    place=placed,
    calibrations=(Calibration("fem", (E,), (Calibrates(("force@0.1mm",)),)),),
    accept=(Accept("node_B", 1e-4, "ours"), Accept("force", 0.1, "ours", ("0.3mm",))),
    cases=(),
    twin=replace(AT_HOLDS.twin, truth=None, remake=()),
)
