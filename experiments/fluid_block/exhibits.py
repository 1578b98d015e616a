"""Tables and figures of `fluid_block`, and the numbers of its printed figures."""

import numpy as np

from validate.pipeline.experiment.experiment import Progress, ReportAdditions
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.run.method_run import Cases

from .curves import condensed_block, curve_exhibit, curve_of, kept, shapes_exhibit
from .exactness import exactness_exhibit
from .other_laws import laws_exhibit
from .updates import pressed, several_exhibit, updates_exhibit


def tell(p: Tree, cases: Cases, progress: Progress) -> ReportAdditions:
    """All exhibits of the block, and the numbers of its printed figures."""
    progress("pressure against volume")
    curves = []
    for order in (1, 2):
        small = condensed_block(p, order)
        curves += [(f"{k + 1} of {p.scene.body.cavities.count}, P{order}", curve_of(small, k))
                   for k in range(p.scene.body.cavities.count)]  # fmt: skip
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
    plate = pressed(p, "plate")
    shapes = shapes_exhibit(p, plate)
    numbers |= {"off.line": first.off, "P70": float(first.fixed[0]), "P130": float(first.fixed[-1]),
                **kept(p, plate)}  # fmt: skip
    return ReportAdditions(
        (curve_exhibit(curves), shapes, updates, several, laws_exhibit(p), exact), numbers
    )
