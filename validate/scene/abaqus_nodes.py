"""Nodes of an Abaqus part: each number once, out of the `*System` in which they are written, and to
where the part's instance stands."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from validate.arrays import Floats
from validate.errors import SceneError
from validate.scene.abaqus_text import KeywordBlock


def nodes_of(own: Sequence[KeywordBlock]) -> tuple[list[int], Floats]:
    """Numbers and places (n, 3) of all nodes; raises `SceneError` for one with two places."""
    at: dict[int, tuple[float, ...]] = {}
    for block in own:
        if block.keyword != "NODE" or not block.rows:
            continue
        numbers, places = _written(block)
        for number, place in zip(numbers, _from_system(places, block.system), strict=True):
            if at.setdefault(number, x := tuple(place.tolist())) != x:
                raise block.wrong(f"node {number} has two positions; export one part")
    if not at:
        raise SceneError("no nodes in the part that has solid elements")
    return list(at), np.array(list(at.values()), dtype=np.float64)


def _written(block: KeywordBlock) -> tuple[list[int], Floats]:
    numbers, places = [], []
    for row in block.rows:
        number, *x = block.floats(row)
        if not number.is_integer() or len(x) not in (2, 3):
            raise block.wrong(f"'{row[:40]}': expected a node number with x, y, z")
        numbers.append(int(number))
        places.append([*x, 0.0][:3])
    return numbers, np.array(places, dtype=np.float64)


def _from_system(x: Floats, system: KeywordBlock | None) -> Floats:
    """Places (n, 3) that are written in a local system, in the part's.

    Its rows: the origin and a point on the local x; then one in the local plane of x and y on the
    side of y. Without the second row z stays, and x is what the point shows across it.
    """
    if system is None:
        return x
    rows = [system.floats(row) for row in system.rows]
    if [len(row) for row in rows] not in ([3], [6], [6, 3]):
        raise system.wrong(
            "expected an origin, a point on the x axis, and in a second row a "
            "point away from that axis"
        )
    origin = np.array(rows[0][:3])
    if len(rows[0]) == 3:
        return np.asarray(x + origin)
    along = np.array(rows[0][3:]) - origin
    up = np.array([0.0, 0.0, 1.0])
    if len(rows) == 2:
        up = np.cross(along, np.array(rows[1]) - origin)
    else:
        along[2] = 0.0
    if not (np.linalg.norm(along) > 0 and np.linalg.norm(up) > 0):
        raise system.wrong("its points coincide or lie on a line")
    e_x, e_z = along / np.linalg.norm(along), up / np.linalg.norm(up)
    return np.asarray(origin + x @ np.array([e_x, np.cross(e_z, e_x), e_z]))


def placed(points: Floats, instance: KeywordBlock) -> Floats:
    """Points where the instance stands: shifted, then turned about an axis by degrees."""
    rows = [instance.floats(row) for row in instance.rows]
    if [len(row) for row in rows] not in ([], [3], [3, 7]):
        raise instance.wrong("expected a shift x, y, z, and a turn about two points by degrees")
    moved = points + np.array(rows[0]) if rows else points
    if len(rows) < 2:
        return moved
    a, b = np.array(rows[1][:3]), np.array(rows[1][3:6])
    if not np.linalg.norm(b - a) > 0:
        raise instance.wrong("the rotation axis has two equal points")
    axis = (b - a) / np.linalg.norm(b - a)
    turn = Rotation.from_rotvec(np.deg2rad(rows[1][6]) * axis)
    return np.asarray(turn.apply(moved - a) + a)
