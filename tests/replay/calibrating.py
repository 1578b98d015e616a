"""A block whose top is moved: its modulus stands open, and the force on the stage identifies it."""

from dataclasses import dataclass, replace
from typing import Any

from tiny import AT_HOLDS, Card, moved_scene, place_moved, record_moved

from validate.compare.verdict import Accept
from validate.parameters import quantity
from validate.recording.types import Recording
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


def built(recording: Recording, p: Open, model: Any) -> Scene:
    its = moved_scene(1.0, TRUE.cells)
    assert p.E is not None
    assert p.nu is not None
    return replace(its, material=Material(p.E, p.nu, "linear", 1000.0, 0.0, 0.05))


E = Free("E", 1e3, 1e5, "assumed")
NU = Free("nu", 0.0, 0.45, "assumed", "the sides' motion")

OPEN: Experiment = replace(
    AT_HOLDS,
    parameters=Open(),
    load=lambda p, folder: (stamped(record_moved(TRUE, print), TRUE),),
    build=built,
    place=lambda recording, p, its: place_moved(recording, TRUE, its),
    calibrations=(Calibration("fem", (E,), (Calibrates(("force@0.1mm",)),)),),
    accept=(Accept("node_B", 1e-4, "ours"), Accept("force", 0.1, "ours", ("0.3mm",))),
    cases=(),
    twin=replace(AT_HOLDS.twin, truth=None, remake=()),
)
