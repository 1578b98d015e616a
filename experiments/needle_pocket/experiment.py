"""A needle at 512 Hz against a body with an incompressible pocket.

Gosline, Salcudean, Yan (2004), section 5.2: the block of section 3.3 under a needle that pushes,
slides, pulls and lets go. The recording is a twin of quadratic elements on a finer mesh along a
synthetic path. A path of your own: `--set recording=FILE`; in 3-D: `--set body.space=solid`.
"""

from validate.compare.overall_verdict import Expected
from validate.compare.verdict import Accept
from validate.pipeline.experiment.experiment import Experiment, Twin, Uncertainty, vary
from validate.pipeline.experiment.method import Method
from validate.solve.haptic.needle import NeedleLoop

from .exhibits import tell
from .pocket import NeedlePocket, build, load, place, sets
from .published import FIGURES, STATED
from .recording import follows
from .scene import SCENE
from .twin import record

PAPER = NeedleLoop(update="proportional", at="node", force="reaction")
P2 = {"body.element": "quadratic"}

EXPERIMENT = Experiment(
    name="needle_pocket",
    title="Needle at haptic rate in a body with a fluid pocket",
    source="Gosline, Salcudean, Yan (2004), section 5.2",
    scene=SCENE,
    settings=NeedlePocket(),
    methods={
        "p2_exact": Method("P2, exact pressure", NeedleLoop(), P2),
        "p1_exact": Method("P1, exact pressure", NeedleLoop()),
        "paper": Method("P1, the paper's law to .1 %", PAPER),
        "p1_dry": Method("P1 without fluid", NeedleLoop(), {"cavities": ()}),
    },
    accepted=("p2_exact",),
    accept=(
        # Wide: what a point feels depends on the mesh, and less could not be decided.
        Accept("force.y", 13.0, "a quarter of the largest recorded force, per metre",
               statistic="rms"),
        Accept("pressure", 220.0, "a quarter of the largest recorded pressure", statistic="rms"),
    ),
    expected=(
        Expected(
            "undecided", "the modulus is declared to 5 %, and a force at a point depends on "
                         "the mesh"
        ),
    ),
    load=load,
    build=build,
    place=place,
    sets=sets,
    uncertainty=Uncertainty(surrogate="p1_exact"),
    variations=(
        # The compliance under a point grows as the logarithm of the cell: no order is formal.
        vary("body.cells", "x 0.5 1.5, order 1"),
        vary("material.E", "relative ranges.E", "modulus", "E within its declared uncertainty"),
        vary("material.nu", "absolute ranges.nu, below 0.5", "Poisson ratio",
             "nu within its declared uncertainty"),
    ),
    axis="y",
    reference="paper",
    exhibits=tell,
    published=(*FIGURES, *STATED),
    follows=follows,
    twin=Twin(
        record,
        remake=("body.space", "body.side", "body.pocket", "body.radius", "body.length", "twin."),
        kind="same law, finer mesh",
        seed=NeedlePocket().twin.seed,
        notice="The recording is a twin along a synthetic path: it and the models share linear "
        "elasticity, not the mesh.",
    ),
)  # fmt: skip
