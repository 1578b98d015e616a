"""What `fluid_block` shows beside its verdicts, and the printed figures of section 3.3."""

from typing import Any, cast

import numpy as np

from validate.compare.published import Figure
from validate.papers.fluid_block.block import FluidBlock
from validate.papers.fluid_block.curves import (
    condensed_block,
    curve_exhibit,
    curve_of,
    shapes_exhibit,
)
from validate.papers.fluid_block.exactness import exactness_exhibit
from validate.papers.fluid_block.updates import (
    laws_exhibit,
    pressed,
    several_exhibit,
    updates_exhibit,
)
from validate.replay.experiment import Progress, Told
from validate.replay.followed import Cases


def tell(parameters: Any, cases: Cases, progress: Progress) -> Told:
    """All exhibits of the block, and the numbers of its printed figures."""
    p = cast(FluidBlock, parameters)
    progress("pressure against volume")
    curves = []
    for order in (1, 2):
        small = condensed_block(p, order)
        curves += [(f"{k + 1} of {p.cavities.count}, P{order}", curve_of(small, k))
                   for k in range(p.cavities.count)]  # fmt: skip
    first = curves[0][1]
    updates, counted = updates_exhibit(p, progress)
    several, radii = several_exhibit(p, progress)
    exact, errors = exactness_exhibit(p, progress)
    numbers = {
        "largest": float(np.abs(first.fixed).max()),
        "r_squared": first.r_squared,
        "gain": first.gain,
        **counted, **{f"radius.{k}": v for k, v in radii.items()}, **errors,
    }  # fmt: skip
    shapes = shapes_exhibit(p, pressed(p, "plate"))
    return Told((curve_exhibit(curves), shapes, updates, several, laws_exhibit(p), exact), numbers)


_ASSUMED = "cavity, boundary, plane state and tool are not printed: ours"
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
)  # fmt: skip
