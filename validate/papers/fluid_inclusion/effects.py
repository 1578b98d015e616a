"""What is uncertain of paper 000's phantom, and what each choice of a model moves."""

from dataclasses import replace
from typing import Any

from validate.replay.cards import changed, moved
from validate.replay.experiment import Change, EffectSpec, Input, Uncertainty, Variant
from validate.replay.inclusion import BLOCK_MESHES, INPUTS, gridded


def _rounder(p: Any, z: float) -> Any:
    if p.inclusion.shape == "capsule":
        return p
    return replace(p, inclusion=replace(p.inclusion, free=p.inclusion.free + z))


ALL = (
    *INPUTS,
    Input("image pose x",
          moved("registration",
                image_shift_x=lambda p, z: p.registration.image_shift_x + z * p.ranges.pose),
          "image plane along the stage; the meshed inclusion follows", "assumed"),
    Input("image pose z",
          moved("registration",
                image_shift_z=lambda p, z: p.registration.image_shift_z + z * p.ranges.pose),
          "image plane sideways; the meshed inclusion follows", "assumed"),
    Input("inclusion radius",
          moved("inclusion", wider=lambda p, z: p.inclusion.wider + z * p.ranges.radius),
          "radius of the meshed inclusion", "assumed"),
    Input("inclusion length",
          moved("inclusion", longer=lambda p, z: p.inclusion.longer + z * p.ranges.length),
          "length of the meshed inclusion", "assumed"),
    Input("circular sections", _rounder,
          "a swept inclusion from circles to its outlines (harmonics 2 to 6); a capsule stays",
          "measured: difference between outlines of the sweep and their circles"),
)  # fmt: skip
UNCERTAINTY = Uncertainty(BLOCK_MESHES, ALL, surrogate="md_fluid")

BASE = Variant("md_fluid")


def _base(change: Change) -> Variant:
    return Variant("md_fluid", change)


EFFECTS = (
    EffectSpec("fluid", "no fluid instead of constant volume (P1)",
               Variant("p1_fluid"), Variant("p1_dry")),
    EffectSpec("plate contact", "bonded instead of slipping plates",
               BASE, _base(changed(plates="bonded")),
               itself="plate friction"),
    EffectSpec("partial friction", "plates with 1e5 N/m3 of tangential stiffness instead of slip",
               BASE, _base(changed(plates="partial", friction=1e5)),
               itself="plate friction"),
    EffectSpec("membrane", "a taut latex membrane of 0.1 mm on the cavity wall",
               BASE, _base(changed("membrane", thickness=1e-4))),
    EffectSpec("locking", "P1 instead of P2 on the same mesh",
               Variant("p2_fluid"), Variant("p1_fluid")),
    EffectSpec("element", "P1 mean dilatation instead of P2 on the same mesh",
               Variant("p2_fluid"), BASE),
    EffectSpec("mesh", "the finest mesh", BASE, _base(gridded(None))),
    EffectSpec("loop", "the paper's loop at 1 % instead of the exact pressure",
               Variant("p1_fluid"), Variant("p1_loop")),
    EffectSpec("nearest node", "nearest node instead of interpolation",
               BASE, _base(changed("registration", sampling="nearest_node", wall="nearest_node"))),
    EffectSpec("modulus", "E 10 % higher",
               BASE, _base(changed("material", E=lambda p: 1.1 * p.material.E)),
               itself="modulus"),
    EffectSpec("Poisson ratio", "nu 0.45",
               BASE, _base(changed("material", nu=0.45)),
               itself="Poisson ratio"),
    EffectSpec("radius", "inclusion radius 0.5 mm smaller",
               BASE, _base(changed("inclusion", wider=-0.5e-3)),
               itself="inclusion radius"),
    EffectSpec("centre", "image pose 1 mm along the stage, the inclusion follows",
               BASE, _base(changed("registration", image_shift_x=1e-3)),
               itself="image pose x"),
    EffectSpec("registration", "similarity (scale fitted) instead of rigid",
               BASE, _base(changed("registration", method="similarity"))),
)  # fmt: skip
