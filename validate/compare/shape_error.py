"""Shape errors of two deformed bodies: E_s (paper 002, III B), its shell check, distances.

Bodies are compared as each run's own mesh bounds them; the shell formula needs corresponding
points and works on the common mesh.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats
from validate.compare.booleans import symmetric_difference
from validate.compare.boundary import Boundary, deformed_boundary, enclosed, normals
from validate.compare.crossing import crossings
from validate.compare.metric import Counted, Metric
from validate.compare.pair import FieldPair, same_mesh
from validate.compare.score import Score
from validate.compare.soundness import require_comparable
from validate.compare.surface_distance import hausdorff, mean_surface_distance
from validate.errors import ComparisonError

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


def boundary_scores(name: str, boundaries: Boundaries) -> tuple[Score, ...]:
    """Scores `<name>.<metric>` of two boundaries."""
    return tuple(metric.score(boundaries, f"{name}.") for metric in BOUNDARY_METRICS)


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
