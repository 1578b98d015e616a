"""From where a set of points is seen best: along the axis that it spreads over least."""

import numpy as np

from validate.arrays import Floats


def flattest(points: Floats) -> tuple[list[int], int | None]:
    """The two axes that points (k, d) spread over most, and the one across; None in 2-D."""
    spread = np.ptp(points, axis=0)
    across = int(np.argmin(spread)) if len(spread) == 3 else None
    return [i for i in range(len(spread)) if i != across], across
