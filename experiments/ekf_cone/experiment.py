"""The Ecoflex cone on its testing machine: paper 003, section 3.4, at 0.15 N and at 15 N.

The recording is a twin of quadratic neo-Hookean elements between bonded plates. Two kinds of
models follow it: bodies moved by the tracked plate, which predict force and bulging, and the
paper's, pushed by the measured force, with and without filters that see the plate's marker.
"""

from dataclasses import replace
from pathlib import Path

from validate.compare.verdict import Accept
from validate.estimate.node_ekf import NodeEKF
from validate.estimate.reduced_ekf import ReducedEKF
from validate.papers.ekf_nfem.cone import (
    UNCERTAINTY,
    PressedCone,
    build,
    place,
    record,
    sets,
    truth,
)
from validate.papers.ekf_nfem.cone import ConeModel as Model
from validate.papers.ekf_nfem.cone_exhibits import tell_cone
from validate.papers.ekf_nfem.figures import CONE_FIGURES
from validate.replay.cards import shipped
from validate.replay.experiment import Case, Experiment, Twin
from validate.replay.method import WALK_UNRECORDED, Method
from validate.solve.central import CentralDifference
from validate.solve.newton import StaticNewton
from validate.solve.tabulated import Tabulated

HERE = Path(__file__).parent
RECORDINGS = HERE.parent / "recordings"
PARAMETERS = PressedCone(
    mesh=replace(PressedCone().mesh, file=str(HERE / "meshes" / "cone.npz")),
    recording=str(RECORDINGS / "ekf_cone.mcap"),
)
QUASI_STATIC = Tabulated(StaticNewton("none"), 0.4e-3)
A = ("node_A",)
METHODS = {
    "plate_p2": Method("plate moved, P2 neo-Hooke", QUASI_STATIC, Model(True, "p2", "neo_hooke")),
    "plate_mixed": Method(
        "plate moved, P2 with a pressure in every cell, neo-Hooke",
        QUASI_STATIC,
        Model(True, "p2_mixed", "neo_hooke"),
    ),
    "plate_mean": Method(
        "plate moved, P1 mean dilatation, neo-Hooke",
        QUASI_STATIC,
        Model(True, "p1_mean", "neo_hooke"),
    ),
    "plate_p1": Method("plate moved, P1 (locks)", QUASI_STATIC, Model(True, "p1", "neo_hooke")),
    "nfem": Method("NFEM, force, explicit", CentralDifference(watch=1), Model()),
    "ekf_held": Method("node-level EKF as printed, held", NodeEKF(overflow="hold"), Model(), A),
    "ekf_companion": Method(
        "node-level EKF of U_t and U_t-dt", NodeEKF(block="companion"), Model(), A
    ),
    "reduced_modes": Method(
        "reduced EKF, 20 modes and load bias", ReducedEKF(), Model(), A, chosen=WALK_UNRECORDED
    ),
    "reduced_pod": Method(
        "reduced EKF, POD and load bias",
        ReducedEKF(basis="pod", shapes=5),
        Model(),
        A,
        chosen=WALK_UNRECORDED,
    ),
}


def _small(p: PressedCone) -> PressedCone:
    return replace(
        p, recording=str(RECORDINGS / "ekf_cone_small.mcap"), twin=replace(p.twin, force=0.15)
    )


EXPERIMENT = Experiment(
    name="ekf_cone",
    title="Ecoflex cone on a testing machine, with and without filters",
    source="paper 003 (EKF-NFEM), section 3.4, Table 3",
    parameters=PARAMETERS,
    methods=METHODS,
    accepted=("plate_p2",),
    accept=(
        Accept("force", 1.5, "a tenth of the largest force"),
        Accept(
            "node_B",
            0.15e-3,
            "a tenth of the largest displacement there, rms over time",
            statistic="rms",
        ),
        Accept(
            "node_C",
            0.15e-3,
            "a tenth of the largest displacement there, rms over time",
            statistic="rms",
        ),
    ),
    load=shipped,
    build=build,
    place=place,
    sets=sets,
    axis="z",
    reference="nfem",
    cases=(Case("small", "the printed 0.15 N instead of 15 N", _small, shipped=True),),
    uncertainty=UNCERTAINTY,
    exhibits=tell_cone,
    published=CONE_FIGURES,
    twin=Twin(
        record,
        truth,
        kind="same law, finer mesh",
        seed=PARAMETERS.twin.seed,
        notice=(
            "The recording is a twin: it shares its law with the bodies that the plate moves, not "
            "their mesh; explicit runs have another law, element and loading."
        ),
    ),
)
