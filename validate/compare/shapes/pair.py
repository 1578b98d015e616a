"""Pair of displacement fields on one mesh, with the boundaries of the deformed bodies."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy import sparse

from validate.arrays import Floats, Ints, checked
from validate.errors import ComparisonError
from validate.fem.assembly.assemble import jacobians, nodal_rule, rule, stiffness
from validate.fem.assembly.locate import Rows
from validate.scene.mesh import Mesh, boundary_facets
from validate.scene.scene import Scene
from validate.scene.shape_functions import EDGES

# --- boundary of a deformed body, and its preconditions for a shape comparison -------------------

_PIECES = {
    2: ((0, 1),),
    3: ((0, 1, 2),),
    6: ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
}
_QUARTERS = ((0, 5, 8, 4), (5, 1, 7, 8), (8, 7, 2, 6), (4, 8, 6, 3))  # as in LATTICE
_SEGMENTS = ((0, 2), (2, 1))  # an edge with its middle node


@dataclass(frozen=True)
class Boundary:
    """points (p, d) m of a closed boundary, pieces (s, d) oriented outward, by point number."""

    points: Floats
    pieces: Ints


def deformed_boundary(mesh: Mesh, nodal: Floats) -> Boundary:
    """Return the boundary of a mesh whose nodes moved to `nodal` (n, d) m.

    Point and piece numbers depend on the mesh alone: two skins of one mesh correspond.
    """
    # All nodes of the boundary facets, oriented outward
    if mesh.order == 1 or mesh.bricks:
        facets = boundary_facets(mesh.cells, mesh.dimension)
    else:
        facets = boundary_facets(mesh.corners, mesh.dimension)
        ends = np.sort(mesh.cells[:, list(EDGES[mesh.dimension])].reshape(-1, 2), axis=1)
        middle = mesh.cells[:, mesh.dimension + 1 :].ravel()
        n = len(mesh.nodes)
        key, first = np.unique(ends[:, 0] * n + ends[:, 1], return_index=True)
        sides = np.array([(0, 1)] if mesh.dimension == 2 else EDGES[2])
        wanted = np.sort(facets[:, sides], axis=2)
        found = middle[first[np.searchsorted(key, wanted[..., 0] * n + wanted[..., 1])]]
        facets = np.hstack([facets, found])
    if facets.shape[1] == 9:
        facets = facets[:, np.array(_QUARTERS)].reshape(-1, 4)
    if facets.shape[1] == 4:
        middles = len(nodal) + np.arange(len(facets))
        around = [np.stack([facets[:, i], facets[:, (i + 1) % 4], middles], 1) for i in range(4)]
        return _used(np.vstack([nodal, nodal[facets].mean(axis=1)]), np.vstack(around))
    per_facet = facets.shape[1]
    edge_with_middle = mesh.dimension == 2 and per_facet == 3
    local = _SEGMENTS if edge_with_middle else _PIECES[per_facet]
    return _used(nodal, np.vstack([facets[:, list(piece)] for piece in local]))


def outline_boundary(outline: Floats) -> Boundary:
    """Return a closed curve (k, 2) m, recorded or drawn, as a boundary; its sense is turned
    outward."""
    points = checked(outline, "outline [m]", (None, 2), error=ComparisonError)
    if len(points) < 3:
        raise ComparisonError(f"an outline of {len(points)} points encloses nothing; 3 are needed")
    number = np.arange(len(points))
    closed = Boundary(points, np.stack([number, np.roll(number, -1)], axis=1))
    return closed if enclosed(closed) > 0 else Boundary(points, closed.pieces[:, ::-1])


def enclosed(boundary: Boundary) -> float:
    """Signed area m^2 or volume m^3 inside; negative when the boundary points inward."""
    x = boundary.points - boundary.points.mean(axis=0)
    size = {2: 2.0, 3: 6.0}[x.shape[1]]
    return float(np.linalg.det(x[boundary.pieces]).sum() / size)


def normals(boundary: Boundary) -> Floats:
    """Outward normals (s, d) with the length m or area m^2 of the piece as their length."""
    x = boundary.points[boundary.pieces]
    if x.shape[2] == 2:
        along = x[:, 1] - x[:, 0]
        return np.stack([along[:, 1], -along[:, 0]], axis=1)
    return np.asarray(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]) / 2)


def _used(points: Floats, pieces: Ints) -> Boundary:
    used, number = np.unique(pieces, return_inverse=True)
    return Boundary(np.asarray(points[used]), number.reshape(pieces.shape))


# --- Where a boundary of flat pieces crosses itself.

# Share of the body's size by which an edge must reach past a triangle on both sides: triangles of
# one flat side lie off their common plane by rounding.
_PAST = 1e-10


def crossings(boundary: Boundary) -> int:
    """Pairs of pieces without a common point that meet: 0 for the boundary of a sound body.

    In space an edge must pass through the other triangle, from strictly one side to the other;
    triangles that lie flat on each other are not seen.
    """
    first, second = _close(boundary)
    if boundary.points.shape[1] == 2:
        return len(first)
    x = boundary.points[boundary.pieces]
    past = _PAST * float(np.ptp(boundary.points, axis=0).max())
    hits = _pierces(x[first], x[second], past) | _pierces(x[second], x[first], past)
    return int(hits.sum())


def _close(boundary: Boundary) -> tuple[Ints, Ints]:
    """Pairs (k,), (k,) of pieces without a common point that meet, in space whose boxes do."""
    x = boundary.points[boundary.pieces]
    low, high = x.min(axis=1), x.max(axis=1)
    if x.shape[2] == 2:
        segments = shapely.linestrings(x)
        first, second = shapely.STRtree(segments).query(segments, predicate="intersects")
    else:
        boxes = shapely.box(*low[:, :2].T, *high[:, :2].T)
        first, second = shapely.STRtree(boxes).query(boxes)
    once = first < second
    first, second = first[once], second[once]
    meet = ((low[first] <= high[second]) & (low[second] <= high[first])).all(axis=1)
    shared = (boundary.pieces[first][:, :, None] == boundary.pieces[second][:, None, :]).any(
        axis=(1, 2)
    )
    keep = meet & ~shared
    return np.asarray(first[keep]), np.asarray(second[keep])


def _pierces(edges_of: Floats, triangle: Floats, past: float) -> NDArray[np.bool_]:
    """Whether an edge of one triangle (k, 3, 3) passes through the other (k, 3, 3)."""
    a, b, c = (triangle[:, i] for i in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), np.finfo(float).tiny)
    found = np.zeros(len(triangle), dtype=bool)
    for i in range(3):
        p, q = edges_of[:, i], edges_of[:, (i + 1) % 3]
        up, down = _dot(normal, p - a), _dot(normal, q - a)
        turns = np.stack([_dot(np.cross(v - p, w - p), q - p) for v, w in ((a, b), (b, c), (c, a))])
        inside = (turns >= 0).all(axis=0) | (turns <= 0).all(axis=0)
        through = (np.minimum(up, down) < -past) & (np.maximum(up, down) > past)
        found |= through & inside
    return found


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray((a * b).sum(axis=1))


# -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Soundness:
    """A deformed body: its `inverted` cells (k,) of `cells`, signed `volume` m^d enclosed, pairs
    of boundary pieces that cross."""

    inverted: Ints
    cells: int
    volume: float
    crossings: int


def soundness(mesh: Mesh, u: Floats, boundary: Boundary) -> Soundness:
    """Return the state of the body with displacement u (n, d) m and that deformed boundary."""
    return Soundness(
        inverted_cells(mesh, u), len(mesh.cells), enclosed(boundary), crossings(boundary)
    )


def inverted_cells(mesh: Mesh, u: Floats | None = None) -> Ints:
    """Cells (k,) whose Jacobian is not positive at a node or a Gauss point."""
    # The Jacobian of quadratic and brick cells varies; linear simplices have the same everywhere.
    lowest = np.min(
        [jacobians(mesh, r, u).min(axis=1) for r in (nodal_rule(mesh), rule(mesh, 2))], 0
    )
    return np.flatnonzero(lowest <= 0)


def require_upright(mesh: Mesh, name: str) -> None:
    """Raise `ComparisonError` with counts when cells are inverted or flat at rest."""
    wrong = inverted_cells(mesh)
    if len(wrong):
        raise ComparisonError(
            f"{len(wrong)} of {len(mesh.cells)} cells of {name} are inverted or flat at rest, "
            f"first {wrong[0]}; reverse their node order or repair the mesh"
        )


def require_comparable(sound: Soundness, name: str) -> None:
    """Raise `ComparisonError` when the deformed boundary is inside out or crosses itself."""
    inverted = f"{len(sound.inverted)} of {sound.cells} cells are inverted"
    if sound.volume <= 0:
        raise ComparisonError(
            f"{name} is turned inside out (signed volume {sound.volume:.3g}; {inverted}), so "
            "it has no interior to compare; check the run's outcome"
        )
    if sound.crossings:
        raise ComparisonError(
            f"the deformed boundary of {name} crosses itself in {sound.crossings} places "
            f"({inverted}), so its interior is not defined; compare displacements (E_i) there"
        )


# --- pair of displacement fields on one mesh, the input of metrics of two runs -------------------

# Nodes nearer to the mesh than this share of its size lie on it: rounding of coordinates.
ON_THE_MESH = 1e-9
MOST_OUTSIDE = 0.5  # a larger share of nodes outside means another frame or other units


@dataclass(frozen=True)
class Field:
    """A displacement field u (n, d) m on its mesh, and whose it is.

    Raises `ComparisonError` for a wrong shape, a value that is not finite and a mesh that is
    inverted at rest.
    """

    mesh: Mesh
    u: Floats
    name: str

    def __post_init__(self) -> None:
        shape = self.mesh.nodes.shape
        u = checked(self.u, f"displacement of {self.name} [m]", shape, error=ComparisonError)
        require_upright(self.mesh, self.name)
        object.__setattr__(self, "u", u)

    @cached_property
    def boundary(self) -> Boundary:
        """Where the field puts the body's boundary."""
        return deformed_boundary(self.mesh, self.mesh.nodes + self.u)

    @cached_property
    def soundness(self) -> Soundness:
        """Inverted cells, the volume enclosed and crossings of the deformed body."""
        return soundness(self.mesh, self.u, self.boundary)


@dataclass(frozen=True)
class Common:
    """The mesh both fields are carried onto; a scene on it gives densities and moduli.

    Kept over the frames of a run, it assembles K once.
    """

    mesh: Mesh
    scene: Scene | None = None

    @cached_property
    def K(self) -> sparse.csr_array:
        """Stiffness (N, N) N/m; raises `ComparisonError` without a scene, which has the moduli."""
        if self.scene is None:
            raise ComparisonError(
                "the energy norm needs moduli: give the scene of the common mesh as `onto`"
            )
        return stiffness(self.scene)

    @cached_property
    def density(self) -> Floats:
        """Density (e,) kg/m3 of every cell; 1 where no scene declares all of them."""
        materials = (
            (self.scene.material, *(r.material for r in self.scene.regions)) if (self.scene) else ()
        )
        if self.scene is None or any(m.rho is None for m in materials):
            return np.ones(len(self.mesh.cells))
        return self.scene.per_cell(lambda m: m.rho or 0.0)


@dataclass(frozen=True)
class FieldPair:
    """`one` against `other` (the reference), both carried onto a common mesh.

    u_one, u_other (n, d) m at the nodes of `on`; `outside` (k,) m holds how far every carried node
    lay from the mesh it was read from (0 within it).
    """

    one: Field
    other: Field
    common: Common
    u_one: Floats
    u_other: Floats
    outside: Floats

    @property
    def on(self) -> Mesh:
        return self.common.mesh

    @property
    def difference(self) -> Floats:
        """u' - u (n, d) m."""
        return np.asarray(self.u_one - self.u_other)

    @cached_property
    def size(self) -> float:
        """Diagonal of the box around the mesh, m."""
        return float(np.linalg.norm(np.ptp(self.on.nodes, axis=0)))

    @property
    def swapped(self) -> "FieldPair":
        """The same pair with the other field as reference."""
        return FieldPair(self.other, self.one, self.common, self.u_other, self.u_one, self.outside)

    @property
    def against(self) -> str:
        return self.other.name

    @property
    def units(self) -> Mapping[str, object]:
        return {"dimension": self.on.dimension}

    @property
    def where(self) -> str:
        """Onto which mesh, and how many nodes lay outside."""
        words = f"on a mesh of {len(self.on.nodes)} nodes ({self.on.kind})"
        if len(self.outside) == 0:
            return words
        return f"{words}, {count_outside(self)} of {len(self.outside)} carried nodes outside"


def pair(one: Field, other: Field, onto: Mesh | Scene | Common | None = None) -> FieldPair:
    """Both fields on one mesh: `onto`, or else the mesh of `other`, the reference.

    A field on another mesh is interpolated at the nodes of `onto`; a node outside that mesh reads
    the nearest point of the nearest cell and is counted. Raises `ComparisonError` for different
    dimensions and when more than half the nodes lie outside.
    """
    if isinstance(onto, Common):
        common = onto
    elif isinstance(onto, Scene):
        common = Common(onto.mesh, onto)
    else:
        common = Common(other.mesh if onto is None else onto)
    on = common.mesh
    require_upright(on, "the common mesh")
    dimensions = (one.mesh.dimension, other.mesh.dimension, on.dimension)
    if len(set(dimensions)) > 1:
        raise ComparisonError(
            f"{one.name} is {dimensions[0]}-D, {other.name} {dimensions[1]}-D and the common mesh "
            f"{dimensions[2]}-D; compare fields of one dimension"
        )
    u_one, away_one = _carried(one, on)
    u_other, away_other = _carried(other, on)
    outside = np.concatenate([away_one, away_other])
    return FieldPair(one, other, common, u_one, u_other, outside)


def same_mesh(one: Mesh, other: Mesh) -> bool:
    """Return whether both have the same nodes and cells, so that fields need no interpolation."""
    return one is other or (
        one.kind == other.kind
        and np.array_equal(one.nodes, other.nodes)
        and np.array_equal(one.cells, other.cells)
    )


def count_outside(pair: FieldPair) -> int:
    return int((pair.outside > ON_THE_MESH * pair.size).sum())


def _carried(field: Field, on: Mesh) -> tuple[Floats, Floats]:
    if same_mesh(field.mesh, on):
        return field.u, np.zeros(0)
    rows = Rows.barycentric(field.mesh, on.nodes)
    away = np.linalg.norm(np.ptp(on.nodes, axis=0)) * ON_THE_MESH
    far = int((rows.outside > away).sum())
    if far > MOST_OUTSIDE * len(on.nodes):
        raise ComparisonError(
            f"{far} of {len(on.nodes)} nodes lie outside the mesh of {field.name}, up to "
            f"{1e3 * rows.outside.max():.3g} mm; check the frame and the units"
        )
    return rows.apply(field.u), rows.outside
