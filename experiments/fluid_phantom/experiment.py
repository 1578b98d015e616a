"""A fluid-filled gelatin phantom compressed between an ultrasound probe and a stage (paper 000).

Gosline, Salcudean, Yan (2004), section 4: outlines of the inclusion by ultrasound and markers on
the top face by a digitising pen at 0, 3, 6 and 9 mm, against FEM of 1328 nodes with the fluid's
pressure. The recording is a twin: quadratic elements on a finer mesh, exact constant volume, and a
pressure transducer in the cavity, which the paper names as future work.
"""

from collections.abc import Mapping, Sequence

from validate.compare.effects import Sensor
from validate.compare.verdict import Accept
from validate.pipeline.experiment.experiment import (
    Experiment,
    Identified,
    IdentifiedByRuns,
    Twin,
    Uncertainty,
)
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.tree import Tree
from validate.recording.types import Recording
from validate.solve.external.scheme import ExternalSimulator
from validate.solve.fluid.cavities import ExactPressure, NoFluid
from validate.solve.fluid.pressure_loop import PressureLoop

from .effects import EFFECTS, INPUTS, MESHES
from .friction import SolvesVariants, friction_from_rise
from .ladder import LADDER
from .phantom import Phantom, load, place, read, record
from .published import FIGURES, STATED
from .scene import SCENE

BONDED = {"foundations.plates.contact": "bonded"}
MEAN_DILATATION = {"dilatation": "nodal_mean"}
P2 = {"body.element": "quadratic"}
FELUPE = "python benchmarks/external/felupe_simulator.py"
METHODS: Mapping[str, Method] = {
    "p1_fluid": Method("P1 with fluid", ExactPressure()),
    "p1_loop": Method("P1 with fluid, the paper's loop", PressureLoop()),
    "p1_dry": Method("P1 without fluid", NoFluid()),
    "p1_bonded": Method("P1 with fluid, bonded plates", ExactPressure(), BONDED),
    "md_fluid": Method("P1 mean dilatation with fluid", ExactPressure(), MEAN_DILATATION),
    "p2_fluid": Method("P2 with fluid", ExactPressure(), P2),
    "felupe": Method("FElupe, P2", ExternalSimulator(FELUPE), P2),  # a job carries no cavity
}


def friction(
    recordings: Sequence[Recording],
    parameters: Tree,
    methods: Mapping[str, Method],
    solves: SolvesVariants,
) -> Identified:
    return friction_from_rise(parameters, "md_fluid", solves)


ADDED_SENSORS = (
    Sensor("markers tracked by camera (0.1 mm)", "marker.inplane", 0.1e-3),
    Sensor("markers tracked by camera (0.1 mm)", "marker.vertical", 0.1e-3),
    Sensor("outline at 0.05 mm", "contour", 0.05e-3),
    Sensor("load cell (0.02 N)", "force.plate", 0.02),
    Sensor("pressure transducer (10 Pa)", "pressure", 10.0),
)

# The pressure's limit is wider than a tenth of what is measured (123 Pa at 9 mm): there 2 u_val is
# 209 Pa, most of it the declared 5 % of E, and a tenth would be undecided.
ACCEPT = (
    Accept("contour", 0.41e-3, "largest error of the paper's contour, 4.5", (), "rms", "source"),
    Accept("marker.inplane", 1.4e-3, "hand tracking error of 1 mm along each of two axes, 4.5", (),
           "rms", "source"),
    Accept("marker.vertical", 1.0e-3, "hand tracking error, 4.5", (), "rms", "source"),
    Accept("pressure", 245.0, "a fifth of the largest measured pressure"),
)  # fmt: skip

EXPERIMENT = Experiment(
    name="fluid_phantom",
    title="Fluid inclusion in a gelatin phantom under plate compression",
    source="Gosline, Salcudean, Yan (2004), section 4",
    recording="../../recordings/fluid_phantom.mcap",
    scene=SCENE,
    settings=Phantom(),
    methods=METHODS,
    accepted=("p2_fluid",),
    accept=ACCEPT,
    load=load,
    place=place,
    uncertainty=Uncertainty(surrogate="md_fluid"),
    variations=(MESHES, *INPUTS),
    effects=EFFECTS,
    sensors=ADDED_SENSORS,
    published=(*FIGURES, *STATED),
    identify=IdentifiedByRuns(friction),
    ladder=LADDER,
    quick={"positions": (0.003,)},
    twin=Twin(
        record,
        kind="same law, finer mesh",
        seed=Phantom().twin.seed,
        read=read,
        notice=(
            "The recording is a twin: it and the accepted model share the law (linear "
            "elasticity), not the mesh. A real phantom's force would differ from every linear "
            "model by about 15 % at 9 mm; this recording cannot show that."
        ),
    ),
)
