"""Paper 002's block and needle: what explicit steps, lumping and quasi-statics cost in accuracy.

A unit square held on three sides, poked at 0.08 m/s for 2 s. As in the paper the truth is the
implicit run with consistent mass on the same mesh; beside it stand truths that the models do not
know: the prostate's material, a finer mesh, smaller steps, plane stress.
"""

from validate.arrays import Floats
from validate.compare.verdict import Accept
from validate.pipeline.experiment.experiment import Case, Experiment
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.tree import TimeSteps
from validate.solve.dynamic.modal import Modal

from .benchmark import (
    FIVE,
    FRAMES,
    SWITCHES,
    Benchmark,
    SolverTest,
    solvers,
)
from .body import BLOCK, MP2, STEP, needle_depth
from .exhibits import tell
from .ladder import NEEDLE_LADDER
from .published import NEEDLE_FIGURES


def depth(t: Floats) -> Floats:
    return needle_depth(t)[:, 0]


BENCHMARK = Benchmark(
    "needle_block",
    "needle",
    "m",
    depth,
    {"f1": (0.0, 0.0), "f2": (0.0, 1.0), "f3": (0.3, 0.0), "f4": (0.6, 1.0)},
)
METHODS = {
    **FIVE,
    **SWITCHES,
    **solvers(),
    "modal": Method("all modes, by the implicit rule", Modal(STEP, propagate="average")),
    "modal_40": Method("40 modes, exact in time", Modal(STEP, 40)),
}
CASES = (
    Case("prostate", "the truth is MP2, the models are MP1",
         {"material": MP2}, methods=tuple(FIVE)),
    Case("finer_mesh", "the truth has twice as many cells a side",
         {"twin.refined": 2}, methods=tuple(FIVE)),
    Case("small_steps", "the truth takes 20 steps in one of the models'",
         {"twin.finer": 20}, methods=tuple(FIVE)),
    Case("plane_stress", "the truth is in plane stress, the models in plane strain",
         {"plane": "stress"}, methods=tuple(FIVE)),
)  # fmt: skip

EXPERIMENT = Experiment(
    name="needle_block",
    title="Solvers against the implicit run on a block poked by a needle",
    source="paper 002 (accuracy metrics and benchmarks), sections IV.A and VI",
    recording="../../recordings/needle_block.mcap",
    scene=BLOCK,
    settings=SolverTest(TimeSteps(STEP, 300)),
    methods=METHODS,
    accepted=("explicit",),
    accept=(
        Accept("side", 1e-3, "a few percent of the largest displacement there"),
        Accept("inside", 1e-3, "a few percent of the largest displacement there"),
    ),
    place=BENCHMARK.place,
    sets=BENCHMARK.sets,
    axis="x",
    reference="implicit",
    cases=CASES,
    exhibits=tell,
    published=NEEDLE_FIGURES,
    frames=FRAMES,
    ladder=NEEDLE_LADDER,
    twin=BENCHMARK.made(
        "The recording is a twin: the implicit method itself, as in the paper, plus noise of the "
        "markers. Errors are between solvers; no tissue was measured."
    ),
)
