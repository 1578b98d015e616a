"""The printed figures of paper 000, sections 3.3 to 4.5, beside ours.

Gosline, Salcudean, Yan (2004). The block is that of its Fig. 4 (5 x 5 x 1.2 cm, E 34 kPa, nu .35)
with a centred 1 cm cavity in plane strain, held at its lower side: cavity, boundary and plane state
are our assumptions. The phantom is a reconstruction with its 1328 nodes and 80 cavity nodes.
"""

from collections.abc import Mapping

import numpy as np

from validate.compare.published import Published
from validate.fem.system import Responses, build, responses
from validate.scene.inclusion import Block, Capsule, block_with_inclusion
from validate.scene.plates import between_plates
from validate.scene.scene import Cavity, Material, Scene, Support
from validate.scene.square import square_with_hole
from validate.solve.fluid import PressureLoop, pressure_at_volume, tuned_gain
from validate.twin.phantom import PLATES

Values = Mapping[str, Mapping[str, float]]

_OTHER = "another phantom: the paper prints neither its block nor its inclusion nor plate contact"
_STRAINS = np.array([0.003, 0.01, 0.03, 0.05, 0.08, 0.10, 0.12, 0.15])


def figures(values: Values) -> tuple[Published, ...]:
    """Every printed figure that linear models and the twin can be held against.

    `values` are scores by method and name, from a run of the fluid phantom; figures whose method
    was not run are left out.
    """
    return (*_block(), *_phantom(), *_contours(values), *_impossible())


def _block() -> tuple[Published, ...]:
    r = _fig_4(50)
    ratios = np.linspace(0.7, 1.3, 61)
    pressures = pressure_at_volume(r, ratios)
    line = np.polyval(np.polyfit(ratios, pressures, 1), ratios)
    off = pressures - line
    r_squared = 1 - float((off**2).sum() / ((pressures - pressures.mean()) ** 2).sum())
    level = float(np.abs(pressures).max())
    return (
        Published(
            "Fig. 4a: largest pressure at 70..130 % volume", level, 8000.0, None, "Pa",
            "not reproduced",
            "the axis of the figure reaches 8 kPa; a resolved block with a free outer boundary "
            "stays below 3.3 kPa; cavity, boundary and plane state are not printed",
            "section 3.3, Fig. 4a", 3095.85, 1.0,
        ),
        Published(
            "Fig. 4a: R2 of the line through P(V)", r_squared, None, None, "1", "reproduced",
            "printed in words ('very good approximation'); the line is off by at most "
            f"{np.abs(off).max():.0f} Pa of {level:.0f} Pa", "section 3.3", 0.99959, 2e-4,
        ),
        Published(
            "tuned gain Kp of the block", tuned_gain(r), None, None, "Pa", "not comparable",
            "the paper uses the slope and does not print it", "section 3.3", 9857.3, 1.0,
        ),
    )  # fmt: skip


def _fig_4(n: int) -> Responses:
    held = (Support("bottom", (0, 1)),)
    cavity = (Cavity("hole", "cavity"),)
    mesh = square_with_hole(0.05, 0.01, n)
    return responses(build(Scene(mesh, Material(34e3, 0.35), held, cavities=cavity)))


def _phantom() -> tuple[Published, ...]:
    block = Block(0.060, 0.045, 0.070)
    mesh = block_with_inclusion(block, (9, 10, 15), Capsule((0.03, 0.0225, 0.035), 0.0085, 0.028))
    scene = between_plates(
        mesh, Material(15.2e3, 0.485), "slip", PLATES, cavities=(Cavity("inclusion", "cavity"),)
    )
    r = responses(build(scene))
    stepper = PressureLoop(warm_start=False).on(r)
    updates = max(stepper.step(stepper.rest(), 0.06 * s[None]).updates for s in _STRAINS)
    return (
        Published(
            "updates to 1 % volume, cold start, 0.3..15 % strain", float(updates), 1.0, 0.0, "1",
            "reproduced",
            "strain read as stage displacement over block size; true for this slipping 3-D "
            "phantom", "section 3.3", 1.0, 0.0,
        ),
        Published(
            "nodes of the phantom's mesh", float(len(mesh.nodes)), 1328.0, 0.0, "1", "reproduced",
            "by sizes that we assumed so that it does", "section 4.4", 1328.0, 0.0,
        ),
        Published(
            "nodes of the cavity", float(len(mesh.facet_nodes("cavity"))), 80.0, 0.0, "1",
            "reproduced", "by sizes that we assumed so that it does", "section 5.3", 80.0, 0.0,
        ),
    )  # fmt: skip


def _contours(values: Values) -> tuple[Published, ...]:
    """The contour at 9 mm, by the paper's own model against our twin: another phantom."""
    rows = (
        ("contour.top_left.simulated@9mm", 3.3e-3, 4.042e-3),
        ("contour.top_left.measured@9mm", 3.71e-3, 3.813e-3),
        ("contour.max@9mm", 0.41e-3, 0.727e-3),
    )
    found = values.get("p1_loop", {})
    return tuple(
        Published(
            f"p1_loop: {name}", found[name], theirs, None, "m", "not comparable", _OTHER,
            "section 4.5, Fig. 7", ours, 5e-6,
        )
        for name, theirs, ours in rows
        if name in found
    )  # fmt: skip


def _impossible() -> tuple[Published, ...]:
    return (
        Published(
            "E = 15.2 kPa validated by the deformation", None, 15.2e3, None, "Pa",
            "not reproducible as printed",
            "with prescribed displacement and constant volume no displacement depends on E; only "
            "a force or a pressure tests it", "sections 4.1 and 6",
        ),
        Published(
            "top markers validate the fluid", None, None, None, "1",
            "not reproducible as printed",
            "fluid or none differs by about 0.04 mm rms at the markers, their noise is 1 mm; they "
            "test plate friction", "section 4.5, Figs. 8 and 9",
        ),
    )  # fmt: skip
