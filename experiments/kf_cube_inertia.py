"""The block of paper 001 made ten times as large and lightly damped, so that inertia matters.

The paper's own block creeps: every mode has the same time constant of 0.1 s, and no integrator can
be told from another. Here the traction is switched on and released, the block swings along
its axis at 12 Hz, and the twin takes ten steps in one of the models'.
"""

from dataclasses import replace
from pathlib import Path

from validate.compare.verdict import Accept
from validate.estimate.kf_fem import KfFem
from validate.estimate.reduced_kf import ReducedKf
from validate.estimate.roukf import Roukf
from validate.papers.kf_fem.block import BlockModel
from validate.papers.kf_fem.ladders import SWINGING_LADDER
from validate.replay.experiment import Case, StepLadder, Uncertainty
from validate.replay.find import load_file
from validate.replay.method import WALK_UNRECORDED, Method
from validate.solve.modal import Modal
from validate.solve.newmark import Newmark
from validate.solve.quasi_static import QuasiStatic

CREEPING = load_file(Path(__file__).with_name("kf_cube.py"))
_p, _twin = CREEPING.parameters, CREEPING.twin
assert _twin is not None
PARAMETERS = replace(
    _p,
    material=replace(_p.material, stiffness_damping=1e-3),
    body=replace(_p.body, cell=0.01),
    loading=replace(_p.loading, traction=300.0, a0="zero", off=0.4),
    twin=replace(_p.twin, finer=10, seed=2),
    recording=str(Path(__file__).parents[1] / "recordings" / "kf_cube_inertia.mcap"),
)
A = ("node_A",)
PRINTED = 1e-9  # m2
# The joint filter's scene: the block on springs, whose stiffness and whose load nobody knows.
SPRINGS = BlockModel(springs=3e5)
METHODS = {
    "average": Method("FEM, average acceleration", Newmark()),
    "generalised_alpha": Method("FEM, generalised alpha", Newmark(rule="generalised_alpha")),
    "backward_euler": Method("FEM, backward Euler", Newmark(rule="backward_euler")),
    "modal": Method("FEM, 20 modes, exact in time", Modal(modes=20)),
    "quasi_static": Method("FEM, quasi-static", QuasiStatic()),
    "kf_printed": Method("KF-FEM as printed", KfFem(Q=PRINTED, R=PRINTED, P0=PRINTED), markers=A),
    "kf_load": Method(
        "KF-FEM, Q along the load",
        KfFem(Q=PRINTED, R=PRINTED, P0=PRINTED, structure="load"),
        markers=A,
    ),
    "kf_reduced": Method("20 modes and load bias", ReducedKf(), markers=A, chosen=WALK_UNRECORDED),
    "roukf_support": Method(
        "unscented filter of load and support, 3 runs",
        Roukf(parameters=("load.pull", "support.z0"), sd=(0.1, 0.3)),
        SPRINGS,
        markers=A,
    ),
}
RIVALS = ("average", "kf_printed", "kf_load", "kf_reduced")


SOFT_BASE = Case(
    "soft_base",
    "the truth has supporting springs of 450 kN/m3, the model of the joint filter 300",
    {"twin.springs": 4.5e5},
    methods=(*RIVALS, "roukf_support"),
)


def _named(name: str) -> Case:
    case = next(c for c in CREEPING.cases if c.name == name)
    return replace(case, methods=RIVALS)


EXPERIMENT = replace(
    CREEPING,
    name="kf_cube_inertia",
    title="Kalman filter finite elements where inertia matters",
    source="in addition to paper 001 (KF-FEM), whose scene is nearly static",
    parameters=PARAMETERS,
    methods=METHODS,
    accepted=("kf_reduced",),
    accept=(
        Accept(
            "node_B",
            0.2e-3,
            "a tenth of the largest displacement there, rms over time",
            statistic="rms",
        ),
        Accept(
            "corner",
            0.3e-3,
            "a tenth of the largest displacement there, rms over time",
            statistic="rms",
        ),
    ),
    reference="average",
    uncertainty=Uncertainty(steps=StepLadder(2.0)),
    cases=(*(_named(name) for name in ("stiff_model", "layer", "sparse")), SOFT_BASE),
    exhibits=None,
    ladder=SWINGING_LADDER,
    published=(),
    twin=replace(
        _twin,
        seed=PARAMETERS.twin.seed,
        notice=(
            "The recording is a twin: the same mesh and law as the models, ten of its steps in one "
            "of theirs, plus white noise. Models know the load at the ends of their steps only, so "
            "a load that is switched acts up to half a step late: most of the plain models' error, "
            "and no part of u_num here."
        ),
    ),
)
