"""The phantom of paper 000, section 4, between its probe and its stage.

Frame "phantom": x from the probe plate (0) to the stage plate, y up, z lateral; metres. The
inclusion follows from the recording.
"""

from validate.pipeline.plates.inclusion import BlockWithInclusion
from validate.scene.material import Material
from validate.scene.scene import Cavity, Drive, Foundation, Membrane, Pin, Scene, Support

SCENE = Scene(
    body=BlockWithInclusion("60 mm", "45 mm", "70 mm", cells=(8, 9, 14)),
    material=Material("15.2 kPa", 0.485),
    supports=(Support("x0", (0,)), Support("y0", (1,))),
    pins=(Pin(("0 mm", "0 mm", "35 mm"), (2,)),),
    # The stage presses towards the fixed plate; the block stands on a table.
    drives=(Drive("stage", "x1", "-x"),),
    cavities=(Cavity("inclusion", "cavity"),),
    foundations=(Foundation("x0 + x1", (1, 2), 1e5, "slip", "plates"),),
    # Latex at small strain.
    membranes=(Membrane("cavity", 0.0, Material("1.2 MPa", 0.49), "wall"),),
)
