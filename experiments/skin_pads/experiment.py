"""Skin in vivo pulled apart by two pads: force to 4 mm calibrates, force to 8.4 mm is predicted.

One recording of aflahelouneg/inverse_identification_soft_tissue (MIT): 544 tracked points in 49
images, pad force in a unit that nobody stated. Neither thickness nor unit is known, so modulus
times thickness is identified, in that unit per metre. No modulus changes the field of the points.
Other recordings of the kind: `--set data=FOLDER`. Where the marks of the pads are not of the same
images, the pads can follow the edges of the field: `--set pads.follow=edges --set pads.window=8mm`.
"""

from validate.compare.overall_verdict import Expected
from validate.compare.verdict import Accept
from validate.pipeline.calibration.calibration import Calibrates, Calibration, Free
from validate.pipeline.experiment.experiment import Experiment, MeshLadder, Uncertainty, vary
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.tree import CellSize
from validate.scene.geometries.sheet import Sheet
from validate.scene.material import Material
from validate.scene.scene import Drive, Scene, Support
from validate.solve.static.newton import StaticNewton
from validate.solve.static.proportional import Proportional

from .files import FORCE
from .laws import exhibits, follows
from .registration import place
from .skin import PulledSkin, build, load, stated

# Pads are driven apart and let nothing turn.
PADS = (Support("left_pad", (1,)), Support("right_pad", (1,)))
FAR = tuple(Support(side, (0, 1)) for side in ("x0", "x1", "y0", "y1"))
LINEAR, LARGE = Proportional(), Proportional(StaticNewton("none", tolerance=1e-7))
OGDEN = {"material.law": "ogden", "material.ogden_alpha": (8.0,), "material.stretches": (0.5, 2.0)}
METHODS = {
    "neo_hooke": Method("neo-Hooke", LARGE, {"material.E": "as material.E_neo"}),
    "linear": Method(
        "linear", LINEAR, {"material.law": "linear", "material.E": "as material.E_linear"}
    ),
    "svk": Method(
        "St. Venant-Kirchhoff", LARGE, {"material.law": "svk", "material.E": "as material.E_svk"}
    ),
    "yeoh": Method(
        "Yeoh, cubic term assumed",
        LARGE,
        {"material.law": "yeoh", "material.E": "as material.E_yeoh"},
    ),
    "ogden": Method("Ogden, power assumed", LARGE, {**OGDEN, "material.E": "as material.E_ogden"}),
    "held": Method(
        "neo-Hooke, far boundary held",
        LARGE,
        {"supports": (*FAR, *PADS), "material.E": "as material.E_held"},
    ),
}
WHERE = "assumed: five decades"
HELPS = "a force with a known unit, and the skin's thickness by ultrasound,"
CALIBRATIONS = tuple(
    Calibration(
        method,
        (Free(f"material.E_{name}", 0.1, 1e4, WHERE, HELPS),),
        (Calibrates(("force@fitted",)),),
    )
    for method, name in (("neo_hooke", "neo"), ("linear", "linear"), ("svk", "svk"),
                         ("yeoh", "yeoh"), ("ogden", "ogden"), ("held", "held"))
)  # fmt: skip
NONE = "assumed; the data set gives none"

EXPERIMENT = Experiment(
    name="skin_pads",
    needs="skin-pads",
    title="Skin in vivo between two pads",
    source="aflahelouneg/inverse_identification_soft_tissue e9c7a1c (MIT)",
    scene=Scene(
        body=Sheet(),
        material=Material(None, 0.45, "neo_hooke"),  # per metre of thickness
        supports=PADS,
        drives=(Drive("moving", "left_pad", (-1.0, 0.0)), Drive("fixed", "right_pad", (1.0, 0.0))),
        plane="stress",
        force_unit=FORCE,
    ),
    settings=PulledSkin(),
    methods=METHODS,
    accepted=("neo_hooke", "linear"),
    accept=(
        Accept("force", 0.03, "a tenth of the largest force", ("predicted", "end")),
        Accept("field.axial", 0.2e-3, "a twentieth of the displacement of the pads"),
        Accept("field.lateral", 0.1e-3, "half of that"),
    ),
    expected=(
        Expected(
            "not good enough",
            "neither law predicts skin in vivo: it stiffens above the fitted range, and its "
            "field is not that of an isotropic sheet",
        ),
        Expected("undecided", "the Poisson ratio is assumed", check="field.lateral.max@2.0mm"),
    ),
    load=load,
    build=build,
    place=place,
    stated=stated,
    # Order: the corners of the pads are singular.
    uncertainty=Uncertainty(
        MeshLadder(({"body.cells": "- 1"}, {"body.cells": "+ 1"}), CellSize(), order=1.2),
        surrogate="neo_hooke",
    ),
    variations=(
        vary("material.nu", "absolute ranges.nu, below 0.5", "Poisson ratio", "nu", NONE),
        vary(("body.pad_length", "body.pad_width"), "absolute ranges.pads", "pads",
             "length and width of the pads", "assumed; drawn 8 mm, the window is 24 mm"),
        vary("body.gap", "absolute ranges.gap", "distance",
             "between the pads at rest", "assumed; unknown in the authors' scripts"),
    ),
    calibrations=CALIBRATIONS,
    exhibits=exhibits,
    follows=follows,
    axis="x",
    locates=("data",),
)  # fmt: skip
