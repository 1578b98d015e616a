"""Skin in vivo pulled apart by two pads: force to 4 mm calibrates, force to 8.4 mm is predicted.

One recording of aflahelouneg/inverse_identification_soft_tissue (MIT): 544 tracked points in 49
images, pad force in a unit that nobody stated. Neither thickness nor unit is known, so modulus
times thickness is identified, in that unit per metre. No modulus changes the field of the points.
Other recordings of the kind: `--set data=FOLDER`. Where the marks of the pads are not of the same
images, the pads can follow the edges of the field: `--set pads.follow=edges --set pads.window=8mm`.
"""

from validate.compare.expected import Expected
from validate.compare.verdict import Accept
from validate.papers.skin_pads.laws import exhibits, follows
from validate.papers.skin_pads.placed import place
from validate.papers.skin_pads.sheet import PulledSkin, build, load, stated
from validate.papers.skin_pads.sheet import SheetModel as Model
from validate.replay.calibration import Calibrates, Calibration, Free
from validate.replay.experiment import Experiment, MeshLadder, Uncertainty, vary
from validate.replay.method import Method
from validate.solve.newton import StaticNewton
from validate.solve.proportional import Proportional

LINEAR, LARGE = Proportional(), Proportional(StaticNewton("none", tolerance=1e-7))
METHODS = {
    "neo_hooke": Method("neo-Hooke", LARGE, Model()),
    "linear": Method("linear", LINEAR, Model("linear", "linear")),
    "svk": Method("St. Venant-Kirchhoff", LARGE, Model("svk", "svk")),
    "yeoh": Method("Yeoh, cubic term assumed", LARGE, Model("yeoh", "yeoh")),
    "ogden": Method("Ogden, power assumed", LARGE, Model("ogden", "ogden")),
    "held": Method("neo-Hooke, far boundary held", LARGE, Model(stiffness="held", far="held")),
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
UNCERTAINTY = Uncertainty(
    # Order: the corners of the pads are singular.
    MeshLadder(
        (
            {"mesh.cells": "- 1"},
            {"mesh.cells": "+ 1"},
        ),
        lambda p: p.pads.width / p.mesh.cells,
        order=1.2,
    ),
    (
        vary("material.nu", "absolute ranges.nu, below 0.5", "Poisson ratio", "nu", NONE),
        vary(("pads.length", "pads.width"), "absolute ranges.pads", "pads",
              "length and width of the pads", "assumed; drawn 8 mm, the window is 24 mm"),
        vary("pads.gap", "absolute ranges.gap", "distance",
              "between the pads at rest", "assumed; unknown in the authors' scripts"),
    ),
    surrogate="neo_hooke",
)  # fmt: skip

EXPERIMENT = Experiment(
    name="skin_pads",
    needs="skin-pads",
    title="Skin in vivo between two pads",
    source="aflahelouneg/inverse_identification_soft_tissue e9c7a1c (MIT)",
    parameters=PulledSkin(),
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
    uncertainty=UNCERTAINTY,
    calibrations=CALIBRATIONS,
    exhibits=exhibits,
    follows=follows,
    axis="x",
    locates=("data",),
)
"""Skin in vivo between two pads: what a force to 4 mm says of one to 8.4 mm."""
