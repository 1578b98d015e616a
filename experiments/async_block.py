"""Asynchronous regions of paper 004 in 2-D and 3-D: a block touched in the middle of a face.

A cube of 0.1 m (343 nodes; `--set body.dimension=2` for a square), pushed and pulled by 5 mm at 0.5
to 1.5 Hz. The recording is the whole solve's, as in the paper, so it repeats itself; what regions
cost in force and phase, and from which size they pay, is told beside a Krylov model.
"""

from pathlib import Path

from validate.compare.verdict import Accept
from validate.papers.async_regions.block_figures import BLOCK_FIGURES
from validate.papers.async_regions.methods import BLOCK
from validate.papers.async_regions.touched_block import (
    TouchedBlock,
    build,
    place,
    record,
    sets,
    tell,
)
from validate.replay.cards import shipped
from validate.replay.experiment import Experiment, Twin

RECORDING = Path(__file__).parents[1] / "recordings" / "async_block.mcap"
PARAMETERS = TouchedBlock(recording=str(RECORDING))

EXPERIMENT = Experiment(
    name="async_block",
    title="Asynchronous regions on a touched block",
    source="paper 004 (asynchronous regions), sections 5 and 6",
    parameters=PARAMETERS,
    methods=BLOCK,
    accepted=("whole",),
    accept=(Accept("force", 0.05, "a twentieth of the largest force"),),
    load=shipped,
    build=build,
    place=place,
    sets=sets,
    axis="x",
    reference="whole",
    exhibits=tell,
    published=BLOCK_FIGURES,
    frames=40,
    quick={"probe.seconds": 2.0},
    twin=Twin(
        record,
        remake=("twin.", "probe.", "body.", "dt"),
        kind="same model",
        seed=PARAMETERS.twin.seed,
        notice="The recording is a twin: the full solve on the mesh of the models, plus noise.",
    ),
)
