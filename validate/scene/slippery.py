"""What keeps a body on a slippery plate from sliding off and turning, and presses nothing."""

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError

_OFF = 0.25  # of the place's width: how far off its middle the node is that stays
_FAR = 0.4  # of the farthest: how far from the middle the other node is at least


def resting_points(x: Floats, one: int, other: int, place: str) -> tuple[Floats, Floats]:
    """The node next to the middle of a place's nodes x (k, 3) m, which stays along the axes `one`
    and `other`; a second one, beside it along `one`, stays only along `other`.

    A second one that lies aslant would turn a body that widens. Raises `SceneError` without a node
    near the middle: the body would widen about another point.
    """
    centre = 0.5 * (x.min(axis=0) + x.max(axis=0))
    middle = x[np.linalg.norm(x - centre, axis=1).argmin()]
    off, width = float(np.linalg.norm(middle - centre)), float(np.ptp(x, axis=0).max())
    if off > _OFF * width:
        raise SceneError(
            f"{place}: no node within {1e3 * _OFF * width:.3g} mm of its middle (the nearest "
            f"is {1e3 * off:.3g} mm away), but a body that rests there needs one; use a finer "
            "mesh, of a mesh file --set body.halvings=1"
        )
    along, across = np.abs((x - middle)[:, one]), np.abs((x - middle)[:, other])
    far = np.flatnonzero(along >= _FAR * along.max())
    beside = x[far[(across[far] / along[far]).argmin()]]
    return middle, beside
