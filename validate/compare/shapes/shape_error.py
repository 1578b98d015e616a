"""Shape errors of two deformed bodies: E_s (paper 002, III B), its shell check, distances.

Bodies are compared as each run's own mesh bounds them; the shell formula needs corresponding
points and works on the common mesh.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import manifold3d
import numpy as np
import shapely
from scipy.spatial import cKDTree

from validate.arrays import Floats
from validate.compare.score import Counted, Metric, Score
from validate.compare.shapes.pair import (
    Boundary,
    FieldPair,
    crossings,
    deformed_boundary,
    enclosed,
    normals,
    require_comparable,
    same_mesh,
)
from validate.errors import ComparisonError
from validate.scene.shape_functions import symmetric_points

# --- Symmetric difference of two bodies: polygons by shapely, solids by manifold3d in doubles.
#
# The only file that knows manifold3d. VTK's booleans are not used: they lose volume and crash.

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
    """Return the plane body inside a boundary: outer loops run anticlockwise, holes clockwise."""
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


# --- Distances between two boundaries of flat pieces, from samples of each to all of the other.

_SAMPLES = {2: symmetric_points(1, 3)[0], 3: symmetric_points(2, 2)[0]}  # segment, triangle
_CHUNK = 200_000  # point-piece pairs measured at once


def hausdorff(one: Boundary, other: Boundary) -> float:
    """max over both directions of the largest distance of a sample to the other boundary, m."""
    if _same(one, other):
        return 0.0
    return float(max(_all_samples(one, other).max(), _all_samples(other, one).max()))


def mean_surface_distance(one: Boundary, other: Boundary) -> float:
    """Mean of the two directions' mean distances, each weighted by length (area), m."""
    if _same(one, other):
        return 0.0
    return (_mean(one, other) + _mean(other, one)) / 2


def distances(points: Floats, boundary: Boundary) -> Floats:
    """Distance m of every point (k, d) to the boundary, exact up to rounding."""
    x = boundary.points[boundary.pieces]
    centres = x.mean(axis=1)
    reach = float(np.linalg.norm(x - centres[:, None], axis=2).max())
    near, _ = cKDTree(boundary.points).query(points)
    # The nearest piece holds a point no further than the nearest corner is.
    lists = cKDTree(centres).query_ball_point(points, np.asarray(near) * (1 + 1e-9) + reach)
    found = np.full(len(points), np.inf)
    lengths = [len(pieces) for pieces in lists]
    number = np.cumsum(lengths) // _CHUNK
    cuts = [0, *(np.flatnonzero(np.diff(number)) + 1).tolist(), len(lengths)]
    parts = [slice(a, b) for a, b in pairwise(cuts)]
    for part in parts:
        which = np.repeat(np.arange(len(points))[part], [len(pieces) for pieces in lists[part]])
        pieces = np.concatenate([np.asarray(p, dtype=np.int64) for p in lists[part]])
        np.minimum.at(found, which, np.linalg.norm(_to_simplices(points[which], x[pieces]), axis=1))
    return found


def _same(one: Boundary, other: Boundary) -> bool:
    """Whether nothing differs: Gauss points of one boundary would miss it by rounding, 1e-16."""
    return np.array_equal(one.points, other.points) and np.array_equal(one.pieces, other.pieces)


def _all_samples(one: Boundary, other: Boundary) -> Floats:
    return distances(np.vstack([one.points, _gauss(one)]), other)


def _mean(one: Boundary, other: Boundary) -> float:
    found = distances(_gauss(one), other).reshape(len(one.pieces), -1).mean(axis=1)
    weights = np.linalg.norm(normals(one), axis=1)
    return float(found @ weights / weights.sum())


def _gauss(boundary: Boundary) -> Floats:
    samples = _SAMPLES[boundary.pieces.shape[1]]
    places = np.einsum("qa,sad->sqd", samples, boundary.points[boundary.pieces])
    return np.asarray(places.reshape(-1, boundary.points.shape[1]))


def _to_simplices(p: Floats, x: Floats) -> Floats:
    """Vector (k, d) from each point to the nearest point of its segment or triangle (k, c, d)."""
    if x.shape[1] == 2:
        return _to_segment(p, x[:, 0], x[:, 1])
    edges = [_to_segment(p, x[:, i], x[:, (i + 1) % 3]) for i in range(3)]
    shortest = np.asarray(np.argmin([np.linalg.norm(v, axis=1) for v in edges], axis=0))
    best = np.take_along_axis(np.stack(edges), shortest[None, :, None], axis=0)[0]
    normal = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    square = (normal**2).sum(axis=1)
    sides = [np.cross(x[:, (i + 1) % 3] - x[:, i], p - x[:, i]) for i in range(3)]
    above = np.all([(s * normal).sum(axis=1) >= 0 for s in sides], axis=0) & (square > 0)
    height = ((x[:, 0] - p) * normal).sum(axis=1) / np.where(square > 0, square, 1.0)
    return np.asarray(np.where(above[:, None], height[:, None] * normal, best))


def _to_segment(p: Floats, a: Floats, b: Floats) -> Floats:
    along = b - a
    square = (along**2).sum(axis=1)
    s = np.clip(((p - a) * along).sum(axis=1) / np.where(square > 0, square, 1.0), 0, 1)
    return np.asarray(a + s[:, None] * along - p)


# -------------------------------------------------------------------------------------------------

# Below this share of the size, rounding of the solid boolean shows (16 % at 1e-12) and the shell
# formula, of first order in the same share, does not err.
RESOLVED = 1e-9


def surface_error(pair: FieldPair) -> float:
    """E_s = |M xor M'| over |M| of the deformed bodies.

    By polygons in the plane, by a double-precision boolean in space. Raises `ComparisonError` for
    a body that is inside out or crosses itself.
    """
    require_comparable(pair.one.soundness, pair.one.name)
    require_comparable(pair.other.soundness, pair.other.name)
    if _beyond_booleans(pair):
        return shell_error(pair)
    return xor_share(pair.one.boundary, pair.other.boundary)


def xor_share(one: Boundary, other: Boundary) -> float:
    """|A xor B| over |B| of the bodies inside two boundaries."""
    return symmetric_difference(one, other) / enclosed(other)


def shell_error(pair: FieldPair) -> float:
    """Integral of |(u' - u) . n| over the deformed boundary of M, over |M|: E_s to first order."""
    reference = deformed_boundary(pair.on, pair.on.nodes + pair.u_other)
    moved = deformed_boundary(pair.on, pair.on.nodes + pair.u_one).points - reference.points
    volume = enclosed(reference)
    through = np.einsum("sad,sd->sa", moved[reference.pieces], normals(reference))
    return float(mean_absolute(through).sum() / volume)


def mean_absolute(values: Floats) -> Floats:
    """Mean of |f| over simplices, f linear with values (s, k) at the k = 2 or 3 corners; exact.

    Where f changes sign, one corner differs from the rest: f over the small simplex it cuts off
    counts with the other sign.
    """
    f = np.sort(values, axis=1)
    k = f.shape[1]
    f = np.where((f[:, k // 2] > 0)[:, None] & (k == 3), -f[:, ::-1], f)
    top, rest = f[:, -1], f[:, :-1]
    mixed = (top > 0) & (rest[:, -1] <= 0)
    gap = np.where(mixed[:, None], top[:, None] - rest, 1.0)
    corner = np.where(mixed, top * (top[:, None] / gap).prod(axis=1), 0.0) / k
    total = f.sum(axis=1) / k
    return np.asarray(np.where(mixed, 2 * corner - total, np.abs(total)))


def _beyond_booleans(pair: FieldPair) -> bool:
    """Whether two solids on one mesh differ by less than the boolean resolves."""
    if pair.on.dimension == 2 or not same_mesh(pair.one.mesh, pair.other.mesh):
        return False
    if not same_mesh(pair.on, pair.other.mesh):
        return False
    return bool(
        np.abs(pair.one.boundary.points - pair.other.boundary.points).max() < RESOLVED * pair.size
    )


@dataclass(frozen=True)
class Boundaries:
    """Two boundaries by themselves, as of a run and a recorded outline; `against` names the other.

    Raises `ComparisonError` for a boundary that crosses itself.
    """

    one: Boundary
    other: Boundary
    against: str

    def __post_init__(self) -> None:
        for boundary, whose in ((self.one, "the run"), (self.other, self.against)):
            if found := crossings(boundary):
                raise ComparisonError(f"the boundary of {whose} crosses itself in {found} places")

    @property
    def where(self) -> str:
        return "between the boundaries"

    @property
    def units(self) -> Mapping[str, object]:
        return {}

    def scores(self, name: str) -> tuple[Score, ...]:
        """Return the scores `<name>.<metric>` of the two boundaries."""
        return tuple(metric.score(self, f"{name}.") for metric in BOUNDARY_METRICS)


def _pieces(boundary: Boundary) -> int:
    return len(boundary.pieces)


_FARTHEST = (
    "largest distance from a sample (corner or Gauss point) of either boundary to the other one"
)
_MEAN = (
    "distance to the other boundary, averaged over the length (area) of each by Gauss points, then "
    "over the two"
)
_PIECES = "boundary segments or triangles of both"
_OF_BOUNDARIES: Counted[Boundaries] = Counted(_PIECES, lambda b: _pieces(b.one) + _pieces(b.other))
OF_BODIES: Counted[FieldPair] = Counted(
    _PIECES, lambda p: _pieces(p.one.boundary) + _pieces(p.other.boundary)
)
_OF_COMMON: Counted[FieldPair] = Counted(
    "boundary segments or triangles of the common mesh",
    lambda p: _pieces(deformed_boundary(p.on, p.on.nodes)),
)

BOUNDARY_METRICS: tuple[Metric[Boundaries], ...] = (
    Metric(
        "E_s",
        lambda b: xor_share(b.one, b.other),
        "1",
        "surface error: |A xor B| over |B| of what the boundaries enclose",
        _OF_BOUNDARIES,
    ),
    Metric(
        "hausdorff",
        lambda b: hausdorff(b.one, b.other),
        "m",
        _FARTHEST,
        _OF_BOUNDARIES,
        symmetric=True,
    ),
    Metric(
        "mean",
        lambda b: mean_surface_distance(b.one, b.other),
        "m",
        _MEAN,
        _OF_BOUNDARIES,
        symmetric=True,
    ),
)

SHAPE_METRICS: tuple[Metric[FieldPair], ...] = (
    Metric(
        "E_s",
        surface_error,
        "1",
        "surface error (paper 002, III B): |M xor M'| over |M| of the deformed bodies, each on its "
        "own mesh, by exact polygons or a double-precision boolean; solids nearer than 1e-9 of "
        "their size by the shell formula",
        OF_BODIES,
    ),
    Metric(
        "E_s.shell",
        shell_error,
        "1",
        "first-order check of E_s: integral of |(u' - u) . n| over the deformed boundary of M, "
        "over |M|",
        _OF_COMMON,
    ),
    Metric(
        "surface.hausdorff",
        lambda p: hausdorff(p.one.boundary, p.other.boundary),
        "m",
        f"deformed bodies: {_FARTHEST}",
        OF_BODIES,
        symmetric=True,
    ),
    Metric(
        "surface.mean",
        lambda p: mean_surface_distance(p.one.boundary, p.other.boundary),
        "m",
        f"deformed bodies: {_MEAN}",
        OF_BODIES,
        symmetric=True,
    ),
)
