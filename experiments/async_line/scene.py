"""The bar of paper 004: at nu = 0 one row of cells is a row of its 1-D elements."""

from validate.scene.contact import Needle
from validate.scene.geometries.specification import Box
from validate.scene.material import Material
from validate.scene.scene import Probe, Scene, Support

SCENE = Scene(
    body=Box(("100 mm", "2.5 mm"), cells=(40, 1), element="quad4"),
    # The paper's damping, 6.5, has no unit; as C = 6.5 M it gives its whole-model peaks.
    material=Material("5 kPa", 0.0, "linear", "1000 kg/m3", mass_damping="6.5 1/s"),
    supports=(Support("x0", (0, 1)), Support("y0", (1,)), Support("y1", (1,))),
    plane="stress",
    thickness="1.6 m",  # 40 cm2 over the height of the row
    tools=(Needle("probe", "x1", ("100 mm", "0 mm"), "-x"),),
    probes=(Probe("end", ("100 mm", "0 mm")),),
)
