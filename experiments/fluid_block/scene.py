"""The block of paper 000, section 3.3: 5 x 5 cm, E 34 kPa, nu .35, held below; what presses it is
`settings.tool`."""

from validate.scene.geometries.hollow_block import HollowBlock
from validate.scene.material import Material
from validate.scene.scene import Cavity, Scene, Support

SCENE = Scene(
    body=HollowBlock(width=0.05, height=0.05, cells=40),
    material=Material("34 kPa", 0.35),
    supports=(Support("bottom", (0, 1)),),
    cavities=(Cavity("cavity", "cavity*"),),
)
