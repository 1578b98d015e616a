"""The block of paper 001 made ten times as large and lightly damped, so that inertia matters.

The paper's own block creeps: every mode has the same time constant of 0.1 s, and no integrator can
be told from another. Here the traction is switched on and released, the block swings along
its axis at 12 Hz, and the twin takes ten steps in one of the models'.
"""

from validate.compare.verdict import Accept
from validate.estimate.ensemble.roukf import Roukf
from validate.estimate.kalman.kf_fem import KfFem
from validate.estimate.reduced.reduced_kf import ReducedKf
from validate.pipeline.experiment.experiment import Case, Experiment, Twin, vary
from validate.pipeline.experiment.method import Method
from validate.scene.geometries.specification import Box
from validate.scene.material import Material
from validate.scene.scene import Load, Probe, Scene, Support
from validate.solve.dynamic.modal import Modal
from validate.solve.dynamic.newmark import Newmark
from validate.solve.static.quasi_static import QuasiStatic

from ..kf_cube.block import (
    LayeredTwin,
    PulledBlock,
    Traction,
    on_springs,
    place,
    record,
    sets,
    truth,
)
from .ladder import SWINGING_LADDER

A = ("node_A",)
PRINTED = 1e-9  # m2
# The joint filter's scene: the block on springs, whose stiffness and whose load nobody knows.
SPRINGS = on_springs("300 kN/m3")
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
    "kf_reduced": Method(
        "20 modes and load bias", ReducedKf(), markers=A, chosen=Method.walk_unrecorded
    ),
    "roukf_support": Method(
        "unscented filter of load and support, 3 runs",
        Roukf(parameters=("load.pull", "support.z0"), sd=(0.1, 0.3)),
        SPRINGS,
        markers=A,
    ),
}
RIVALS = ("average", "kf_printed", "kf_load", "kf_reduced")


CASES = (
    Case("stiff_model", "the models are 20 % stiffer than the truth",
         {"twin.stiffness": 1 / 1.2}, methods=RIVALS),
    Case("layer", "the truth has a stiff layer (five times) at mid-height",
         {"twin.inside": "layer"}, methods=RIVALS),
    Case("sparse", "models are 20 % stiffer, measured every 10th step, a fifth missing",
         {"twin.stiffness": 1 / 1.2, "twin.every": 10, "twin.missing": 0.2}, methods=RIVALS),
    Case("soft_base",
         "the truth has supporting springs of 450 kN/m3, the model of the joint filter 300",
         {"twin.springs": 4.5e5}, methods=(*RIVALS, "roukf_support")),
)  # fmt: skip

EXPERIMENT = Experiment(
    name="kf_cube_inertia",
    title="Kalman filter finite elements where inertia matters",
    source="in addition to paper 001 (KF-FEM), whose scene is nearly static",
    recording="../../recordings/kf_cube_inertia.mcap",
    scene=Scene(
        body=Box(("40 mm", "40 mm", "70 mm"), cells=(4, 4, 7)),
        material=Material("10 kPa", 0.47, rho="1068 kg/m3", stiffness_damping="1 ms"),
        supports=(Support("z0"),),
        loads=(Load("pull", "z1", "+z"),),
        probes=(
            Probe("node_A", ("20 mm", "20 mm", "70 mm")),
            Probe("node_B", ("20 mm", "20 mm", "50 mm")),
            Probe("corner", ("0 mm", "0 mm", "70 mm")),
        ),
    ),
    settings=PulledBlock(
        loading=Traction(traction=300.0, a0="zero", off=0.4), twin=LayeredTwin(finer=10, seed=2)
    ),
    variations=(vary("dt", "x 0.5 0.25, order 2"),),
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
    place=place,
    sets=sets,
    axis="z",
    reference="average",
    cases=CASES,
    ladder=SWINGING_LADDER,
    captions={
        "displacement_node_A": "As Figs. 3 and 4 of paper 001: measurement, FEM and KF-FEM.",
        "displacement_node_B": "As Fig. 5 of paper 001: a node 2 mm below, which no filter "
        "receives.",
    },
    twin=Twin(
        record,
        truth,
        remake=("twin.", "clock.", "body.", "loading.traction", "loading.off"),
        kind="same model",
        seed=2,
        notice=(
            "The recording is a twin: the same mesh and law as the models, ten of its steps in one "
            "of theirs, plus white noise. Models know the load at the ends of their steps only, so "
            "a load that is switched acts up to half a step late: most of the plain models' error, "
            "and no part of u_num here."
        ),
    ),
)
