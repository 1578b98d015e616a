"""A tracked stylus touches eight landmarks of a phantom: real data made by others.

The pose of the phantom is fitted on what was touched (PlusToolkit/PlusLibData, BSD-3), which is no
evidence; each landmark predicted from the seven others is. Another recording of the kind: `--set
recording=FILE.mha --set landmarks=DEVICES.xml`, with any count and order of landmarks.
"""

from typing import Any

from validate.compare.published import Figure
from validate.compare.verdict import Accept
from validate.pipeline.experiment.experiment import Experiment, Uncertainty, vary
from validate.pipeline.experiment.method import Method
from validate.solve.static.without_mechanics import RigidMotion

from .exhibits import exhibits, follows, identified
from .phantom import StylusPhantom, build, load, place, stated


def _tip(axis: str) -> Any:
    return vary(
        f"tip.off_{axis}", "absolute tip.sd", f"tip {axis}", f"{axis} of the tip's offset",
        "Error of the device set's StylusTip to Stylus, over root 3",
    )  # fmt: skip


DETECTED = "PLUS detects with four samples of every dwell"
BASELINE = (
    "PLUS's error for this recording, from the description of the data set; its file is missing"
)
PUBLISHED = (
    Figure(
        "registration error, as PLUS detects landmarks", "identified:plus.error",
        0.198e-3, 0.0198e-3, "m", "reproduced", DETECTED, BASELINE, 0.1954e-3, 1e-6,
    ),
    Figure(
        "registration error, ours", "identified:touch.error", 0.198e-3, None, "m", "not comparable",
        "ours uses other samples of every dwell", BASELINE, 0.1727e-3, 2e-6,
    ),
    Figure(
        "error given with the transform in PhantomRegistration.results.xml",
            "identified:touch.error",
        0.2299e-6, None, "m", "not comparable",
        "that transform belongs to another recording with a simulated tracker: it is rotated "
        "by 90 degrees and 0.2 m away", "PlusLibData, PhantomRegistration.results.xml",
    ),
)  # fmt: skip

EXPERIMENT = Experiment(
    name="stylus_phantom",
    needs="stylus",
    title="Landmarks of a phantom touched with a tracked stylus",
    source="PlusToolkit/PlusLibData 51dcbb7 (BSD-3)",
    settings=StylusPhantom(),
    methods={"rigid": Method("rigid body, each landmark from the others", RigidMotion())},
    accepted=("rigid",),
    accept=(Accept("landmark", 1e-3, "1 mm, rms over the landmarks", statistic="rms"),),
    load=load,
    build=build,
    place=place,
    stated=stated,
    identify=identified,
    uncertainty=Uncertainty(inputs=(_tip("x"), _tip("y"), _tip("z")), surrogate="rigid"),
    exhibits=exhibits,
    published=PUBLISHED,
    follows=follows,
    locates=("recording", "landmarks", "published"),
)
