"""Particles in an indented gel: the inside of a box predicted from the motion of its faces.

35 000 particles before and after indentation (FranckLab/SerialTrack, MIT), unlinked. No force is
known: displacement alone sees the Poisson ratio and no modulus. The ratio is identified in a lower
box of small strain and predicts an upper one. Another pair: `--set data=FOLDER`.
"""

import math
from functools import partial
from pathlib import Path

from validate.compare.overall_verdict import Expected
from validate.compare.verdict import Accept
from validate.pipeline.calibration.calibration import Calibrates, Calibration, Free
from validate.pipeline.experiment.experiment import Experiment, Input, Uncertainty, vary
from validate.pipeline.experiment.method import Method
from validate.scene.material import Material
from validate.scene.scene import Drive, Scene
from validate.solve.static.newton import StaticNewton
from validate.solve.static.quasi_static import QuasiStatic
from validate.solve.static.without_mechanics import Harmonic

from .box import GelBoxes, GelIndentation, build, load, place, stated
from .displacement_errors import fitted_box
from .exhibits import tell
from .poisson_ratio import OTHER_BOXES, smoothed

STATIC = StaticNewton("none", tolerance=1e-6)
LINEAR = {"material.law": "linear"}
METHODS = {
    "linear": Method("linear law", QuasiStatic(), LINEAR),
    "neo_hooke": Method("neo-Hooke at large strain", STATIC),
    "svk": Method("St. Venant-Kirchhoff at large strain", STATIC, {"material.law": "svk"}),
    "laplace": Method("Laplace's equation: no mechanics", Harmonic(), LINEAR),
}
AXES = tuple(f"inside.{axis}" for axis in "xyz")
IN_LOWER = {"body.which": "lower"}
DRAWS = tuple(
    vary(f"faces.{name}", f"absolute {1 / math.sqrt(3)}", f"faces, {name} draw",
          "noise of the particles that move the faces; three draws, their mean square counts",
          "their residuals about local fits")
    for name in ("first", "second", "third")
)  # fmt: skip

EXPERIMENT = Experiment(
    name="gel_indentation",
    needs="gel-indentation",
    title="Particles in an indented gel",
    source="FranckLab/SerialTrack fdb01c6 (MIT); Yang et al. (2022), SoftwareX 19, 101204",
    scene=Scene(
        body=GelBoxes(),
        # No displacement depends on E: any value is valid. nu is identified in the lower box.
        material=Material("1 kPa", None, "neo_hooke"),
        drives=(Drive("faces", "x0+x1+y0+y1+z0+z1", (0.0, 0.0, 1.0)),),
        force_unit="force unit",
    ),
    settings=GelIndentation(),
    variations=(
        vary("body.cells", "x 0.5 0.75, order 3"),
        *DRAWS,
        Input("smoothing", smoothed,
              "neighbours of the fits at the faces, half to twice", "assumed"),
        vary("material.nu", OTHER_BOXES, "box",
              "Poisson ratio of another lower box, or of other faces",
              "scatter of ratios fitted in several boxes"),
    ),
    methods=METHODS,
    accepted=("linear", "neo_hooke"),
    accept=tuple(
        Accept(axis, 0.4e-6, "a voxel, rms over the particles", ("upper",), "rms") for axis in AXES
    ),
    expected=(
        Expected("undecided", "the faces of the box determine its interior to 0.3 and 0.4 "
                              "micrometres, of 0.4 required", check="inside.[xy]*"),
    ),
    load=load,
    build=build,
    place=place,
    stated=stated,
    calibrations=(
        Calibration(
            "linear",
            (Free("material.nu", 0.0, 0.4995, "the volume cannot grow under compression; "
                                              "displacement elements",
                  "a wider box, or particles with less noise along z"),),
            (Calibrates(tuple(f"{axis}@lower" for axis in AXES), IN_LOWER, "this one lower box"),),
        ),
    ),
    uncertainty=Uncertainty(surrogate="linear"),
    identify=fitted_box,
    exhibits=partial(tell, methods=METHODS, home=Path(__file__).parent),
    locates=("data", "before", "after"),
)  # fmt: skip
