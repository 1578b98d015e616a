"""A planar block with fluid in one, two or three cavities under a needle, a patch or a plate.

Gosline, Salcudean, Yan (2004), section 3.3: pressure against volume (Fig. 4), and how many updates
of the pressure keep the volume. The recording is a twin: quadratic triangles on a finer mesh.
Other set-ups: `--set cavities.count=2 --set body.plane=stress --set tool=needle`, and so on.
"""

from pathlib import Path

from validate.compare.verdict import Accept
from validate.papers.fluid_block.block import (
    FluidBlock,
    build,
    load,
    place,
    record,
    refined,
    sets,
)
from validate.papers.fluid_block.block import SlabModel as Model
from validate.papers.fluid_block.told import FIGURES, tell
from validate.replay.experiment import Experiment, MeshLadder, Twin, Uncertainty, vary
from validate.replay.method import Method
from validate.solve.fluid import ExactPressure, NoFluid
from validate.solve.pressure_loop import PressureLoop

RECORDING = Path(__file__).parents[1] / "recordings" / "fluid_block.mcap"
PARAMETERS = FluidBlock(recording=str(RECORDING))
METHODS = {
    "p2_exact": Method("P2, exact pressure", ExactPressure(), Model(2)),
    "p1_exact": Method("P1, exact pressure", ExactPressure(), Model()),
    "p1_loop": Method("P1, the paper's law to 1 %", PressureLoop(), Model()),
    "p1_fine_loop": Method("P1, the paper's law to .1 %", PressureLoop(tolerance=1e-3), Model()),
    "p1_retuned": Method("P1, line with the tool", PressureLoop(update="retuned"), Model()),
    "p1_secant": Method("P1, secant", PressureLoop(update="secant"), Model()),
    "p1_newton": Method("P1, Newton", PressureLoop(update="newton"), Model()),
    "p1_matrix": Method("P1, gain matrix of the rest", PressureLoop(gains="matrix"), Model()),
    "p1_dry": Method("P1 without fluid", NoFluid(), Model()),
}
INPUTS = (
    vary("material.E", "relative ranges.E", "modulus", "E within its declared uncertainty"),
    vary("material.nu", "absolute ranges.nu, below 0.5", "Poisson ratio",
         "nu within its declared uncertainty"),
)  # fmt: skip

EXPERIMENT = Experiment(
    name="fluid_block",
    title="Fluid in the cavities of a planar block, and pressure updates that keep its volume",
    source="Gosline, Salcudean, Yan (2004), section 3.3",
    parameters=PARAMETERS,
    methods=METHODS,
    accepted=("p2_exact",),
    accept=(
        Accept("pressure0", 200.0, "a twentieth of the largest measured pressure"),
        Accept("force", 25.0, "below a tenth of the largest measured force, per metre"),
    ),
    load=load,
    build=build,
    place=place,
    sets=sets,
    uncertainty=Uncertainty(
        # Re-entrant corners of 270 degrees: displacements grow as r^.545 there (Williams 1952).
        MeshLadder((refined(20), refined(60)), lambda p: p.body.width / p.mesh.squares, 1.09),
        INPUTS,
        surrogate="p1_exact",
    ),
    axis="y",
    reference="p1_loop",
    exhibits=tell,
    published=FIGURES,
    twin=Twin(
        record,
        remake=("body.", "cavities.", "twin.", "tool", "strains"),
        kind="same law, finer mesh",
        seed=FluidBlock().twin.seed,
        notice="The recording is a twin: it and the models share linear elasticity, not the mesh.",
    ),
)
