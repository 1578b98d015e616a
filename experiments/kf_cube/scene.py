"""The block of paper 001, section 3, Table 1."""

from validate.scene.geometries.specification import Box
from validate.scene.material import Material
from validate.scene.scene import Load, Probe, Scene, Support

SCENE = Scene(
    # 200 nodes, 672 tetrahedra; node_B and corner are measured by nobody.
    body=Box(("4 mm", "4 mm", "7 mm"), cells=(4, 4, 7)),
    material=Material("10 kPa", 0.47, rho="1068 kg/m3", stiffness_damping="0.1 s"),
    supports=(Support("z0"),),
    loads=(Load("pull", "z1", "+z"),),
    probes=(
        Probe("node_A", ("2 mm", "2 mm", "7 mm")),
        Probe("node_B", ("2 mm", "2 mm", "5 mm")),
        Probe("corner", ("0 mm", "0 mm", "7 mm")),
    ),
)
