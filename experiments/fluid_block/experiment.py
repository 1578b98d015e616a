"""A planar block with fluid in one, two or three cavities under a needle, a patch or a plate.

Gosline, Salcudean, Yan (2004), section 3.3: pressure against volume (Fig. 4), and how many updates
of the pressure keep the volume. The recording is a twin: quadratic triangles on a finer mesh.
Other set-ups: `--set body.cavities.count=2 --set plane=stress --set tool=needle`, and so on.
"""

from validate.compare.verdict import Accept
from validate.pipeline.experiment.experiment import Experiment, Twin, Uncertainty, vary
from validate.pipeline.experiment.method import Method
from validate.solve.fluid.cavities import ExactPressure, NoFluid
from validate.solve.fluid.pressure_loop import PressureLoop

from .block import PressedBlock, build, place, record
from .exhibits import tell
from .published import FIGURES
from .scene import SCENE

P2 = {"body.element": "tri6"}
FINE = PressureLoop(tolerance=1e-3)

EXPERIMENT = Experiment(
    name="fluid_block",
    title="Fluid in the cavities of a planar block, and pressure updates that keep its volume",
    source="Gosline, Salcudean, Yan (2004), section 3.3",
    recording="../../recordings/fluid_block.mcap",
    scene=SCENE,
    settings=PressedBlock(),
    methods={
        "p2_exact": Method("P2, exact pressure", ExactPressure(), P2),
        "p1_exact": Method("P1, exact pressure", ExactPressure()),
        "p1_loop": Method("P1, the paper's law to 1 %", PressureLoop()),
        "p1_fine_loop": Method("P1, the paper's law to .1 %", FINE),
        "p1_retuned": Method("P1, line with the tool", PressureLoop(update="retuned")),
        "p1_secant": Method("P1, secant", PressureLoop(update="secant")),
        "p1_newton": Method("P1, Newton", PressureLoop(update="newton")),
        "p1_matrix": Method("P1, gain matrix of the rest", PressureLoop(gains="matrix")),
        "p1_dry": Method("P1 without fluid", NoFluid()),
    },
    accepted=("p2_exact",),
    accept=(
        Accept("pressure0", 200.0, "a twentieth of the largest measured pressure"),
        Accept("force", 25.0, "below a tenth of the largest measured force, per metre"),
    ),
    build=build,
    place=place,
    uncertainty=Uncertainty(surrogate="p1_exact"),
    variations=(
        # Re-entrant corners of 270 degrees: displacements grow as r^.545 there (Williams 1952).
        vary("body.cells", "x 0.5 1.5, order 1.09"),
        vary("material.E", "relative ranges.E", "modulus", "E within its declared uncertainty"),
        vary(
            "material.nu",
            "absolute ranges.nu, below 0.5",
            "Poisson ratio",
            "nu within its declared uncertainty",
        ),
    ),
    axis="y",
    reference="p1_loop",
    exhibits=tell,
    published=FIGURES,
    twin=Twin(
        record,
        remake=(
            "body.width",
            "body.height",
            "body.patch",
            "body.cavities.",
            "plane",
            "plates",
            "twin.",
            "tool",
            "strains",
        ),
        kind="same law, finer mesh",
        seed=PressedBlock().twin.seed,
        notice="The recording is a twin: it and the models share linear elasticity, not the mesh.",
    ),
)
