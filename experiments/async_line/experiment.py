"""Asynchronous regions on the bar of paper 004: near nodes at 1 kHz, the far ones at 500, 50, 5 Hz.

A bar of 40 free nodes (0.1 m, 40 cm2, 5 kPa) pushed and pulled by a probe behind a spring, 1 cm at
0.1 to 1 Hz. The paper holds regions against its own whole solve; here the truth is the continuous
bar in the frequency domain, so that the whole solve is judged, too.
"""

from validate.compare.verdict import Accept
from validate.pipeline.experiment.experiment import (
    Experiment,
    MeshLadder,
    StepLadder,
    Twin,
    Uncertainty,
)
from validate.pipeline.experiment.tree import CellSize

from .exhibits import tell
from .methods import LINE
from .probe import HapticTest, place
from .published import FIGURES
from .scene import SCENE
from .twin import record, sets

# Rows of square cells, all of one body: of 40 cm2.
COARSER = (
    {"body.cells": (10, 1), "body.size": ("10 cm", "10 mm"), "thickness": "0.4 m"},
    {"body.cells": (20, 1), "body.size": ("10 cm", "5 mm"), "thickness": "0.8 m"},
)

EXPERIMENT = Experiment(
    name="async_line",
    title="Asynchronous regions on a touched bar",
    source="paper 004 (asynchronous regions), section 6, Tables 1 and 2",
    recording="../../recordings/async_line.mcap",
    scene=SCENE,
    settings=HapticTest(),
    methods=LINE,
    accepted=("whole",),
    accept=(Accept("force", 0.08, "a twentieth of the largest force"),),
    place=place,
    sets=sets,
    axis="x",
    reference="whole",
    uncertainty=Uncertainty(MeshLadder(COARSER, CellSize()), steps=StepLadder(1.0)),
    exhibits=tell,
    published=FIGURES,
    frames=40,
    quick={"probe.seconds": 10.0},
    twin=Twin(
        record,
        remake=("twin.", "probe.", "body.", "material.", "dt"),
        kind="same law, finer mesh",
        seed=HapticTest().twin.seed,
        notice="The recording is a twin: a continuous bar in the frequency domain, exact.",
    ),
)
