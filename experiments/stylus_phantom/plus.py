"""Landmarks as the PLUS toolkit finds them itself, for the sake of its printed error.

As its `vtkPlusLandmarkDetectionAlgo` does by default: windows of .2 s; a landmark once the means of
successive windows stay within 1.5 mm over 1 s and a point 100 mm up the shaft has moved by 30 mm;
its place is the mean of four samples, the second to the fifth. What lies nearer to one found before
than a third of the least distance between landmarks is the same. Their order is the list's.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import pdist

from validate.arrays import Floats
from validate.errors import RegistrationError
from validate.register.markers.transform import Similarity

_WINDOW, _STANDS = 0.2, 1.0  # s
_TIP, _SHAFT = 1.5e-3, 30e-3  # m: diagonals of the boxes around tip and shaft
_TAKEN = slice(1, 5)  # samples of a detection


@dataclass(frozen=True)
class ByPlus:
    """Its T_frame_from_body and its error m: the mean distance of the landmarks, not their rms."""

    pose: Similarity
    error: float


def by_plus(t: Floats, tip: Floats, shaft: Floats, known: Floats) -> ByPlus:
    """From the path of a tip (n, 3) m and of a point (n, 3) m of its shaft at t (n,) s; landmarks
    known (k, 3) m. Raises `RegistrationError` where it finds fewer than all of them."""
    size = max(round(_WINDOW / (t[1] - t[0])), 1)
    apart = float(pdist(known).min()) / 3
    found: list[Floats] = []
    begin = 0
    for end in range(size, len(t) + 1):
        if (end - begin) % size:
            continue
        path = tip[begin:end].reshape(-1, size, 3).mean(axis=1)
        if _box(path) > _TIP:
            begin = end
            continue
        turned = _box(shaft[begin + size - 1 : end : size])
        if len(path) < round(_STANDS / _WINDOW) or turned < _SHAFT:
            continue
        place = tip[begin:end][_TAKEN].mean(axis=0)
        if all(np.linalg.norm(place - other) >= apart for other in found):
            found.append(place)
        begin = end
        if len(found) == len(known):
            return _registered(known, np.array(found))
    raise RegistrationError(f"{len(found)} of {len(known)} landmarks by the detection of PLUS")


def _box(points: Floats) -> float:
    return float(np.linalg.norm(np.ptp(points, axis=0)))


def _registered(known: Floats, found: Floats) -> ByPlus:
    pose = Similarity.rigid(known, found)
    return ByPlus(pose, float(np.linalg.norm(pose.apply(known) - found, axis=1).mean()))
