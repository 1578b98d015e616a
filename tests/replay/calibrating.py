"""A block whose top is moved: its modulus stands open, and the force on the stage identifies it."""

from dataclasses import dataclass, field, replace
from typing import Any

from tiny import AT_HOLDS, Card, moved_scene, place_moved, record_moved

from validate.compare.verdict import Accept
from validate.parameters import quantity
from validate.recording.types import Recording
from validate.register.registered import Registered
from validate.register.sensing import ForceSensing
from validate.register.signals import SignalObservation
from validate.replay.calibration import Calibrates, Calibration, Free
from validate.replay.experiment import Experiment
from validate.replay.remade import stamped
from validate.scene.material import Material
from validate.scene.scene import Scene

TRUE = Card(cells=2)  # E 10 kPa, nu 0.3


@dataclass(frozen=True)
class Open:
    E: float | None = quantity(None, "Pa", "modulus; none: identified")
    nu: float | None = quantity(0.3, "1", "Poisson ratio")
    cell: ForceSensing = field(default_factory=ForceSensing)


def built(recording: Recording, p: Open, model: Any) -> Scene:
    its = moved_scene(1.0, TRUE.cells)
    assert p.E is not None
    assert p.nu is not None
    return replace(its, material=Material(p.E, p.nu, "linear", 1000.0, 0.0, 0.05))


def placed(recording: Recording, p: Open, its: Scene) -> Registered:
    seen = place_moved(recording, TRUE, its)
    *others, cell = seen.observations
    assert isinstance(cell, SignalObservation)
    return replace(seen, observations=(*others, p.cell.of(cell)))


E = Free("E", 1e3, 1e5, "assumed")
NU = Free("nu", 0.0, 0.45, "assumed", "the sides' motion")

OPEN: Experiment = replace(
    AT_HOLDS,
    parameters=Open(),
    load=lambda p, folder: (stamped(record_moved(TRUE, print), TRUE),),
    build=built,
    place=placed,
    calibrations=(Calibration("fem", (E,), (Calibrates(("force@0.1mm",)),)),),
    accept=(Accept("node_B", 1e-4, "ours"), Accept("force", 0.1, "ours", ("0.3mm",))),
    cases=(),
    twin=replace(AT_HOLDS.twin, truth=None, remake=()),
)
