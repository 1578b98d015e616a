"""Asynchronous regions of paper 004 in 2-D and 3-D: a block touched in the middle of a face.

A cube of 0.1 m (343 nodes), pushed and pulled by 5 mm at 0.5
to 1.5 Hz. The recording is the whole solve's, as in the paper, so it repeats itself; what regions
cost in force and phase, and from which size they pay, is told beside a Krylov model.
"""

from validate.compare.verdict import Accept
from validate.pipeline.experiment.experiment import Experiment, Twin
from validate.scene.contact import Needle
from validate.scene.geometries.specification import Box
from validate.scene.material import Material
from validate.scene.scene import Probe, Scene, Support

from ..async_line.probe import place
from .block import PUSHED, record, sets, tell
from .methods import BLOCK
from .published import BLOCK_FIGURES

MIDDLE = ("100 mm", "50 mm", "50 mm")

EXPERIMENT = Experiment(
    name="async_block",
    title="Asynchronous regions on a touched block",
    source="paper 004 (asynchronous regions), sections 5 and 6",
    recording="../../recordings/async_block.mcap",
    scene=Scene(
        body=Box(("100 mm", "100 mm", "100 mm"), cells=(6, 6, 6)),
        # The paper's damping, 6.5, has no unit: C = 6.5 M.
        material=Material("5 kPa", 0.45, "linear", "1000 kg/m3", mass_damping="6.5 1/s"),
        supports=(Support("x0"),),
        tools=(Needle("probe", "x1", MIDDLE, "-x"),),
        probes=(Probe("end", MIDDLE),),
    ),
    settings=PUSHED,
    methods=BLOCK,
    accepted=("whole",),
    accept=(Accept("force", 0.05, "a twentieth of the largest force"),),
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
        remake=("twin.", "probe.", "body.", "material.", "dt"),
        kind="same model",
        seed=PUSHED.twin.seed,
        notice="The recording is a twin: the full solve on the mesh of the models, plus noise.",
    ),
)
