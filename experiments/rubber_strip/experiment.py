"""A rubber strip tracked by two cameras: its Poisson ratio and law from the first steps.

Stereo image correlation of 435 points over 19 steps of 1 mm (SolavLab/DuoDIC, Apache-2.0). Each law
gets its Poisson ratio from the steps up to 6 % strain, and predicts how far the strip contracts at
the last one; no force and no thickness were recorded. The tracker is held against a motor stage.
Another one: `--set recording=POINTS_mm.npz`.
"""

from validate.compare.overall_verdict import Expected
from validate.compare.verdict import Accept
from validate.pipeline.calibration.calibration import Calibrates, Calibration, Free
from validate.pipeline.experiment.experiment import Experiment, Uncertainty
from validate.pipeline.experiment.method import Method
from validate.scene.material import Material
from validate.scene.meshless import MaterialPoint
from validate.solve.static.stretch_test import StretchTest

from .exhibits import exhibits
from .strip import FIRST, LAST, Strip, load, place

METHODS = {
    "svk": Method(
        "St. Venant-Kirchhoff",
        StretchTest(),
        {"material.law": "svk", "material.nu": "as nu.svk"},
    ),
    "neo_split": Method(
        "neo-Hooke, split volume", StretchTest(), {"material.nu": "as nu.neo_split"}
    ),
    "neo_coupled": Method(
        "neo-Hooke, coupled volume",
        StretchTest(),
        {"material.nu": "as nu.neo_coupled", "material.coefficients.volumetric": "coupled"},
    ),
    "incompressible": Method(
        "neo-Hooke, volume kept", StretchTest(), {"material.nu": "as nu.incompressible"}
    ),
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
    # No force is compared: the modulus changes nothing. Each law has a Poisson ratio of its own.
    scene=MaterialPoint(Material("1 kPa", 0.4999, "neo_hooke"), "uniaxial"),
    settings=Strip(),
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
    place=place,
    calibrations=CALIBRATIONS,
    uncertainty=Uncertainty(surrogate="neo_split"),
    exhibits=exhibits,
    locates=("recording", "unit"),
)
