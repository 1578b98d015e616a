"""Symmetric difference of two bodies: polygons by shapely, solids by manifold3d in doubles.

The only file that knows manifold3d. VTK's booleans are not used: they lose volume and crash.
"""

import manifold3d
import numpy as np
import shapely

from validate.arrays import Floats
from validate.compare.boundary import Boundary, enclosed
from validate.errors import ComparisonError

# Share of the volume by which the library may differ from the signed sum before we mistrust it.
_TRUST = 1e-6


def symmetric_difference(one: Boundary, other: Boundary) -> float:
    """|A - B| + |B - A|, m^2 or m^3. Raises `ComparisonError` where a boundary encloses no body."""
    if one.points.shape[1] == 2:
        a, b = polygon(one), polygon(other)
        return float((a - b).area + (b - a).area)
    # About the origin and of size 1, as the library's tolerance follows the coordinates.
    middle = other.points.mean(axis=0)
    size = float(np.ptp(other.points, axis=0).max())
    solid, reference = _solid(one, middle, size), _solid(other, middle, size)
    return float(((solid - reference).volume() + (reference - solid).volume()) * size**3)


def polygon(boundary: Boundary) -> shapely.MultiPolygon:
    """The plane body inside a boundary: outer loops run anticlockwise, holes clockwise."""
    rings = [shapely.Polygon(boundary.points[loop]) for loop in _loops(boundary)]
    outward = [shapely.is_ccw(r.exterior) for r in rings]
    shells = [r for r, out in zip(rings, outward, strict=True) if out]
    holes = [r for r, out in zip(rings, outward, strict=True) if not out]
    parts = [
        shapely.Polygon(s.exterior, [h.exterior for h in holes if s.contains(h)]) for s in shells
    ]
    body = shapely.MultiPolygon(parts)
    area = enclosed(boundary)
    if not body.is_valid or abs(body.area - area) > _TRUST * abs(area):
        raise ComparisonError(
            f"a boundary of {len(boundary.pieces)} segments encloses no plane body "
            f"({shapely.is_valid_reason(body)}, {body.area:.4g} of {area:.4g} m2)"
        )
    return body


def _loops(boundary: Boundary) -> list[list[int]]:
    after = dict(boundary.pieces.tolist())
    if len(after) != len(boundary.pieces):
        twice = len(boundary.pieces) - len(after)
        raise ComparisonError(
            f"the boundary touches itself in {twice} nodes, so it is not an outline"
        )
    loops = []
    while after:
        start, at = after.popitem()
        loop = [start]
        while at != start:
            loop.append(at)
            at = after.pop(at)
        loops.append(loop)
    return loops


def _solid(boundary: Boundary, middle: Floats, size: float) -> manifold3d.Manifold:
    points = np.ascontiguousarray((boundary.points - middle) / size)
    triangles = np.ascontiguousarray(boundary.pieces, dtype=np.uint64)
    solid = manifold3d.Manifold(manifold3d.Mesh64(points, triangles))
    volume = enclosed(boundary) / size**3
    if solid.status() != manifold3d.Error.NoError or abs(solid.volume() - volume) > _TRUST * volume:
        raise ComparisonError(
            f"a boundary of {len(triangles)} triangles encloses no solid "
            f"({solid.status().name}, {solid.volume():.4g} of {volume:.4g})"
        )
    return solid
