"""What is uncertain of paper 000's phantom, and what each choice of a model moves."""

from validate.parameters import with_given
from validate.pipeline.experiment.experiment import EffectSpec, Input, Variant, vary
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.plates.inclusion import InclusionTest

_FINER = 1.25  # times the cells along every edge: the finest mesh
#: 8 x 9 x 14 cells have no common factor: within 5 % these grids are similar. Order 2: corners at
#: the plates and facets on the wall limit that of quadratic elements.
MESHES = vary("body.cells", f"x 0.625 0.75 0.875 {_FINER}, order 2")


def finest(tree: Tree) -> Tree:
    """The block with the cells of its finest mesh."""
    return tree.with_scene(body=tree.scene.body.scaled(_FINER))


def _rounder(tree: Tree, z: float) -> Tree:
    inclusion = tree.scene.body.inclusion
    if inclusion.shape == "capsule":
        return tree
    changed: Tree = with_given(tree, {"body.inclusion.free": inclusion.free + z})
    return changed


INPUTS = (
    *InclusionTest.inputs(),
    vary("registration.image_shift_x", "absolute ranges.pose", "image pose x",
         "image plane along the stage; the meshed inclusion follows"),
    vary("registration.image_shift_z", "absolute ranges.pose", "image pose z",
         "image plane sideways; the meshed inclusion follows"),
    vary("body.inclusion.wider", "absolute ranges.radius", "inclusion radius",
         "radius of the meshed inclusion"),
    vary("body.inclusion.longer", "absolute ranges.length", "inclusion length",
         "length of the meshed inclusion"),
    Input("circular sections", _rounder,
          "a swept inclusion from circles to its outlines (harmonics 2 to 6); a capsule stays",
          "measured: difference between outlines of the sweep and their circles"),
)  # fmt: skip
BASE = Variant("md_fluid")


EFFECTS = (
    EffectSpec("fluid", "no fluid instead of constant volume (P1)",
               Variant("p1_fluid"), Variant("p1_dry")),
    EffectSpec("plate contact", "bonded instead of slipping plates",
               BASE, Variant("md_fluid", {"foundations.plates.contact": "bonded"}),
               itself="plate friction"),
    EffectSpec("partial friction", "plates with 1e5 N/m3 of tangential stiffness instead of slip",
               BASE, Variant("md_fluid", {"foundations.plates.contact": "partial",
                      "foundations.plates.stiffness": 1e5}),
               itself="plate friction"),
    EffectSpec("membrane", "a taut latex membrane of 0.1 mm on the cavity wall",
               BASE, Variant("md_fluid", {"membranes.wall.thickness": "0.1 mm"})),
    EffectSpec("locking", "P1 instead of P2 on the same mesh",
               Variant("p2_fluid"), Variant("p1_fluid")),
    EffectSpec("element", "P1 mean dilatation instead of P2 on the same mesh",
               Variant("p2_fluid"), BASE),
    EffectSpec("mesh", "the finest mesh", BASE, Variant("md_fluid", finest)),
    EffectSpec("loop", "the paper's loop at 1 % instead of the exact pressure",
               Variant("p1_fluid"), Variant("p1_loop")),
    EffectSpec("nearest node", "nearest node instead of interpolation",
               BASE, Variant("md_fluid", {"registration.sampling": "nearest_node",
                      "registration.wall": "nearest_node"})),
    EffectSpec("modulus", "E 10 % higher",
               BASE, Variant("md_fluid", {"material.E": "x 1.1"}),
               itself="modulus"),
    EffectSpec("Poisson ratio", "nu 0.45",
               BASE, Variant("md_fluid", {"material.nu": 0.45}),
               itself="Poisson ratio"),
    EffectSpec("radius", "inclusion radius 0.5 mm smaller",
               BASE, Variant("md_fluid", {"body.inclusion.wider": "-0.5 mm"}),
               itself="inclusion radius"),
    EffectSpec("centre", "image pose 1 mm along the stage, the inclusion follows",
               BASE, Variant("md_fluid", {"registration.image_shift_x": "1 mm"}),
               itself="image pose x"),
    EffectSpec("registration", "similarity (scale fitted) instead of rigid",
               BASE, Variant("md_fluid", {"registration.method": "similarity"})),
)  # fmt: skip
