"""A rubber strip tracked by two cameras: its Poisson ratio and law from the first steps.

Stereo image correlation of 435 points over 19 steps of 1 mm (SolavLab/DuoDIC, Apache-2.0). Each law
gets its Poisson ratio from the steps up to 6 % strain, and predicts how far the strip contracts at
the last one; no force and no thickness were recorded. The tracker is held against a motor stage.
Another one: `--set recording=POINTS_mm.npz`.
"""

from functools import partial
from pathlib import Path

from validate.compare.expected import Expected
from validate.compare.verdict import Accept
from validate.papers.rubber_strip.exhibits import exhibits
from validate.papers.rubber_strip.strip import FIRST, LAST, Strip, StripLaw, build, load, place
from validate.replay.calibration import Calibrates, Calibration, Free
from validate.replay.experiment import Experiment, Uncertainty
from validate.replay.method import Method
from validate.solve.stretch_test import StretchTest

METHODS = {
    "svk": Method("St. Venant-Kirchhoff", StretchTest(), StripLaw("svk", "svk")),
    "neo_split": Method("neo-Hooke, split volume", StretchTest(), StripLaw()),
    "neo_coupled": Method(
        "neo-Hooke, coupled volume",
        StretchTest(),
        StripLaw("neo_coupled", volumetric="coupled"),
    ),
    "incompressible": Method("neo-Hooke, volume kept", StretchTest(), StripLaw("incompressible")),
}
FITTED = ("svk", "neo_split", "neo_coupled")
ON = (Calibrates((FIRST,), name="the first steps"),)
CALIBRATIONS = tuple(
    Calibration(name, (Free(f"nu.{name}", 0.05, 0.4995, "assumed", "the strip's thickness"),), ON)
    for name in FITTED
)

EXPERIMENT = Experiment(
    name="rubber_strip",
    needs="rubber-strip",
    title="Rubber strip: Poisson ratio from the first steps, contraction at the last predicted",
    source="SolavLab/DuoDIC b2c2147 (Apache-2.0)",
    parameters=Strip(),
    methods=METHODS,
    accepted=FITTED,
    accept=(Accept(LAST, 0.005, "half a per cent of the width"),),
    expected=(
        Expected(
            "not good enough",
            "St. Venant-Kirchhoff does not predict the contraction at large stretch",
            method="svk",
        ),
    ),
    load=load,
    build=build,
    place=place,
    calibrations=CALIBRATIONS,
    uncertainty=Uncertainty(surrogate="neo_split"),
    exhibits=partial(exhibits, folder=Path(__file__).parent),
    locates=("recording", "unit"),
)
