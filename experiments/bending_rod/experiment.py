"""Paper 002's bending rod: a soft bar held at one end, gravity switched on at t = 0.

As in the paper the truth is the implicit run with consistent mass on the same mesh of hexahedra;
beside it stand truths on a finer mesh and with smaller steps.
"""

from validate.arrays import Floats
from validate.compare.verdict import Accept
from validate.pipeline.experiment.experiment import Case, Experiment
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.tree import TimeSteps
from validate.solve.dynamic.modal import Modal

from ..needle_block.benchmark import (
    FIVE,
    FRAMES,
    SWITCHES,
    Benchmark,
    SolverTest,
    solvers,
)
from ..needle_block.body import STEP
from .body import ROD, SIZE, gravity_inputs
from .exhibits import tell
from .ladder import ROD_LADDER
from .published import ROD_FIGURES


def gravity(t: Floats) -> Floats:
    return gravity_inputs(t)[:, 0]


BENCHMARK = Benchmark(
    "bending_rod",
    "gravity",
    "m/s^2",
    gravity,
    {
        "f1": (0.0, 0.0, 0.0),
        "f2": (0.0, SIZE[1], 0.0),
        "f3": (0.0, 0.0, SIZE[2]),
        "f4": (0.0, 0.6 * SIZE[1], 0.8 * SIZE[2]),
    },
)
METHODS = {
    **FIVE,
    **SWITCHES,
    **solvers(),
    "modal": Method("all modes, by the implicit rule", Modal(STEP, propagate="average")),
    "modal_10": Method("10 modes, exact in time", Modal(STEP, 10)),
}
CASES = (
    Case("finer_mesh", "the truth has twice as many cells along every edge",
         {"twin.refined": 2}, methods=tuple(FIVE)),
    Case("small_steps", "the truth takes 20 steps in one of the models'",
         {"twin.finer": 20}, methods=tuple(FIVE)),
)  # fmt: skip

EXPERIMENT = Experiment(
    name="bending_rod",
    title="Solvers against the implicit run on a rod that bends under gravity",
    source="paper 002 (accuracy metrics and benchmarks), sections IV.B and VI",
    recording="../../recordings/bending_rod.mcap",
    scene=ROD,
    settings=SolverTest(TimeSteps(STEP, 300)),
    methods=METHODS,
    accepted=("explicit",),
    accept=(Accept("tip", 2e-3, "2 % of the largest displacement there"),),
    place=BENCHMARK.place,
    sets=BENCHMARK.sets,
    axis="z",
    reference="implicit",
    cases=CASES,
    exhibits=tell,
    published=ROD_FIGURES,
    frames=FRAMES,
    ladder=ROD_LADDER,
    twin=BENCHMARK.made(
        "The recording is a twin: the implicit method itself, as in the paper, plus noise of the "
        "markers. Errors are between solvers; no tissue was measured."
    ),
)
