"""Figures of paper 000, section 3.3, for the planar block."""

from validate.compare.published import Figure
from validate.solve.fluid.pressure_loop import PressureLoop

from .block import PressedBlock
from .curves import RATIOS
from .scene import SCENE

_ASSUMED = "cavity, boundary, plane state and tool are not printed: ours"
_P = PressedBlock()


def _drawn(name: str, number: str, theirs: float | None, unit: str, source: str,
           reason: str = f"drawn, no number is printed; {_ASSUMED}") -> Figure:  # fmt: skip
    return Figure(name, f"told:{number}", theirs, None, unit, "not comparable", reason, source)


FIGURES = (
    Figure(
        "Fig. 4a: axis of the pressure at 70..130 % volume", "told:largest", 8000.0, None, "Pa",
        "not reproduced", f"a resolved block with a free outside stays below; {_ASSUMED}",
        "section 3.3, Fig. 4a",
    ),
    Figure(
        "updates to 1 %, cold start, .3..15 % strain, under a needle", "told:needle.cold", 1.0, 0.0,
        "1", "reproduced", _ASSUMED, "section 3.3",
    ),
    Figure(
        "updates to 1 %, cold start, .3..15 % strain, under a plate", "told:plate.cold", 1.0, 0.0,
        "1", "not reproduced", f"more at 10 to 15 % of strain; {_ASSUMED}", "section 3.3",
    ),
    _drawn("updates to 1 %, cold start, .3..15 % strain, under a patch", "patch.cold", 1.0, "1",
           "section 3.3", _ASSUMED),
    Figure.of_setup("width of the block", 0.05, SCENE.body.width, "m", "section 3.3"),
    Figure.of_setup("height of the block", 0.05, SCENE.body.height, "m", "section 3.3"),
    Figure(
        "thickness of the block", None, 0.012, None, "m", "not comparable",
        "plane: forces are per metre, and a thickness changes neither pressure nor volume ratio",
        "section 3.3", setting=True,
    ),
    Figure.of_setup("modulus of the block", 34e3, SCENE.material.E, "Pa", "section 3.3"),
    Figure.of_setup("Poisson ratio of the block", 0.35, SCENE.material.nu, "1", "section 3.3"),
    Figure.of_setup("least strain", 0.003, _P.strains[0], "1", "section 3.3",
                    "read as displacement over height"),
    Figure.of_setup("largest strain", 0.15, _P.strains[-1], "1", "section 3.3",
                    "read as displacement over height"),
    Figure.of_setup("tolerance of the volume", 0.01, PressureLoop().tolerance, "1", "section 3.3"),
    Figure.of_setup("least volume of the curve", 0.7, float(RATIOS[0]), "1", "section 3.3"),
    Figure.of_setup("largest volume of the curve", 1.3, float(RATIOS[-1]), "1", "section 3.3"),
    _drawn("Fig. 4a: the curve is not linear, largest departure", "off.line", None, "Pa",
           "section 3.3, Fig. 4a"),
    _drawn("Fig. 4a: R2 of its line", "r_squared", None, "1", "section 3.3, Fig. 4a",
           f"'a very good approximation' in words; {_ASSUMED}"),
    _drawn("slope of the line, Kp", "gain", None, "Pa", "section 3.3",
           f"used and not printed; {_ASSUMED}"),
    _drawn("Fig. 4b: pressure at 70 % of volume", "P70", None, "Pa", "section 3.3, Fig. 4b"),
    _drawn("Fig. 4c: pressure at 130 % of volume", "P130", None, "Pa", "section 3.3, Fig. 4c"),
    Figure("Fig. 3a: at rest, without load", None, None, None, "1", "not comparable",
           "a figure without numbers: the mesh in the report", "section 3.3, Fig. 3a"),
    _drawn("Fig. 3b: volume under load, pressure zero", "ratio.empty", None, "1",
           "section 3.3, Fig. 3b", "drawn: 'decreased'; its load is not printed, ours is 15 %"),
    Figure(
        "Fig. 3c: volume under load, pressure added", "told:ratio.full", 1.0, 0.01, "1",
        "reproduced", "the same volume as at rest; its load is not printed, ours is 15 %",
        "section 3.3, Fig. 3c",
    ),
)  # fmt: skip
