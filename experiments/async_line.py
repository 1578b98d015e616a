"""Asynchronous regions on the bar of paper 004: near nodes at 1 kHz, the far ones at 500, 50, 5 Hz.

A bar of 40 free nodes (0.1 m, 40 cm2, 5 kPa) pushed and pulled by a probe behind a spring, 1 cm at
0.1 to 1 Hz. The paper holds regions against its own whole solve; here the truth is the continuous
bar in the frequency domain, so that the whole solve is judged, too.
"""

from pathlib import Path

from validate.compare.verdict import Accept
from validate.papers.async_regions.bodies import LENGTH
from validate.papers.async_regions.figures import FIGURES
from validate.papers.async_regions.line import TouchedLine, build, place, record, sets
from validate.papers.async_regions.line_exhibits import tell
from validate.papers.async_regions.methods import LINE
from validate.replay.cards import shipped
from validate.replay.experiment import Experiment, MeshLadder, StepLadder, Twin, Uncertainty

RECORDING = Path(__file__).parents[1] / "recordings" / "async_line.mcap"
PARAMETERS = TouchedLine(recording=str(RECORDING))

EXPERIMENT = Experiment(
    name="async_line",
    title="Asynchronous regions on a touched bar",
    source="paper 004 (asynchronous regions), section 6, Tables 1 and 2",
    parameters=PARAMETERS,
    methods=LINE,
    accepted=("whole",),
    accept=(Accept("force", 0.08, "a twentieth of the largest force"),),
    load=shipped,
    build=build,
    place=place,
    sets=sets,
    axis="x",
    reference="whole",
    uncertainty=Uncertainty(
        MeshLadder(({"body.cells": 10}, {"body.cells": 20}), lambda p: LENGTH / p.body.cells),
        steps=StepLadder(1.0),
    ),
    exhibits=tell,
    published=FIGURES,
    frames=40,
    quick={"probe.seconds": 10.0},
    twin=Twin(
        record,
        remake=("twin.", "probe.", "body.", "dt"),
        kind="same law, finer mesh",
        seed=PARAMETERS.twin.seed,
        notice="The recording is a twin: a continuous bar in the frequency domain, exact.",
    ),
)
