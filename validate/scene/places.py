"""Places of a scene's parts: a label, a side, a plane, a box or a point.

    top                            the facet set of that name
    zmax                           the facets on the body's highest plane across z
    z=20mm                         those on a plane; "z=20mm~0.5mm" within half a millimetre of it
    box 0,0,18mm to 5mm,5mm,20mm   those inside a box
    near 10mm,0,20mm               the one nearest to a point
    x1 & z1                        the edges that two sides share

Lengths without a unit are metres. Several places are joined by "+".
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import reduce
from operator import and_, or_
from typing import Literal

import numpy as np
from scipy.spatial import cKDTree

from validate.arrays import Floats, Ints
from validate.errors import SceneError, UsageError
from validate.parameters import nearest_names
from validate.scene.mesh import Mesh
from validate.scene.shape_functions import CORNERS, LATTICE
from validate.units import in_si, split

# --- Where the parts of a scene sit: faces, edges or points, chosen by place or by label.
#
# A choice is a rule, not a list of numbers: it holds on a finer mesh, too. Rules combine with & |
# - and are asked for what they choose: `(OnPlane(a, x) & OnPlane(a, z)).edges`.

EntityKind = Literal["faces", "edges", "points"]
_SQUARE = CORNERS[2]
#: Where the middles of the four sides stand among the nodes of a quadratic quadrilateral.
_MIDDLES = [
    LATTICE[2].tolist().index(side) for side in ((_SQUARE + np.roll(_SQUARE, -1, 0)) / 2).tolist()
]
_SLACK = 1e-6  # of the body's size: rounding of coordinates


class Site(ABC):
    """Base of the rules: `away` says how far from being chosen faces, edges or points are."""

    @abstractmethod
    def away(self, mesh: Mesh, entities: Ints) -> Floats:
        """(k,) m for entities (k, m) of node numbers; zero where chosen."""

    def __and__(self, other: "Site") -> "Site":
        return Both(self, other)

    def __or__(self, other: "Site") -> "Site":
        return Either(self, other)

    def __sub__(self, other: "Site") -> "Site":
        return Without(self, other)

    @property
    def faces(self) -> "Chosen":
        """Facets of the surface."""
        return Chosen(self, "faces")

    @property
    def edges(self) -> "Chosen":
        """Edges of facets of the surface."""
        return Chosen(self, "edges")

    @property
    def points(self) -> "Chosen":
        """Nodes, those inside the body as well."""
        return Chosen(self, "points")


@dataclass(frozen=True)
class OnPlane(Site):
    """All that lies on the plane through `point` m across `normal`, within `tolerance` m."""

    point: tuple[float, ...]
    normal: tuple[float, ...]
    tolerance: float = 0.0

    def away(self, mesh: Mesh, entities: Ints) -> Floats:
        normal = _vector(self.normal, mesh, "normal of a plane")
        length = float(np.linalg.norm(normal))
        if length == 0:
            raise SceneError("normal of a plane: length 0; give a direction")
        height = (mesh.nodes - _vector(self.point, mesh, "point of a plane")) @ normal / length
        beyond = np.maximum(np.abs(height) - self.tolerance, 0.0)
        return np.asarray(beyond[entities].max(axis=1))


@dataclass(frozen=True)
class Facing(Site):
    """Faces that face along `normal`, whichever way, within 45 degrees; edges and points do."""

    normal: tuple[float, ...]

    def away(self, mesh: Mesh, entities: Ints) -> Floats:
        if entities.shape[1] < 3 or mesh.dimension == 2:
            return np.zeros(len(entities))
        along = _vector(self.normal, mesh, "normal of a face")
        corners = mesh.nodes[entities[:, :3]]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        share = np.abs(across @ along) / np.linalg.norm(across, axis=1) / np.linalg.norm(along)
        return np.where(share**2 >= 0.5, 0.0, _size(mesh))


@dataclass(frozen=True)
class InBox(Site):
    """All that lies within the corners `low` and `high` m."""

    low: tuple[float, ...]
    high: tuple[float, ...]

    def away(self, mesh: Mesh, entities: Ints) -> Floats:
        low, high = (_vector(x, mesh, "corner of a box") for x in (self.low, self.high))
        if (low > high).any():
            raise SceneError(f"box from {self.low} to {self.high} m: low must not exceed high")
        outside = np.maximum(np.maximum(low - mesh.nodes, mesh.nodes - high), 0.0)
        return np.asarray(np.linalg.norm(outside, axis=1)[entities].max(axis=1))


@dataclass(frozen=True)
class Labelled(Site):
    """The facets that the mesh has under a label, their edges, their nodes."""

    label: str

    def away(self, mesh: Mesh, entities: Ints) -> Floats:
        nodes = mesh.facet_nodes(self.label)
        kind: EntityKind = "edges"
        if entities.shape[1] == 1:
            kind = "points"
        elif entities.shape[1] == mesh.surface.shape[1]:
            kind = "faces"
        known = {tuple(e) for e in np.sort(_parts(mesh.facets[self.label], mesh, kind), 1).tolist()}
        inside = np.array([tuple(e) in known for e in np.sort(entities, axis=1).tolist()])
        distance, _ = cKDTree(mesh.nodes[nodes]).query(_middles(mesh, entities))
        # A facet beside the set may touch its nodes: it is not chosen all the same.
        return np.where(inside, 0.0, np.maximum(distance, _size(mesh)))


@dataclass(frozen=True)
class Nearest(Site):
    """The one whose middle is nearest to `point` m."""

    point: tuple[float, ...]

    def away(self, mesh: Mesh, entities: Ints) -> Floats:
        offset = _middles(mesh, entities) - _vector(self.point, mesh, "nearest to a point")
        distance = np.linalg.norm(offset, axis=1)
        distance[np.arange(len(distance)) != np.argmin(distance)] += _size(mesh)
        distance[np.argmin(distance)] = 0.0
        return np.asarray(distance)


@dataclass(frozen=True)
class Both(Site):
    """What two rules choose alike."""

    first: Site
    second: Site

    def away(self, mesh: Mesh, entities: Ints) -> Floats:
        return np.maximum(self.first.away(mesh, entities), self.second.away(mesh, entities))


@dataclass(frozen=True)
class Either(Site):
    """What at least one of two rules chooses."""

    first: Site
    second: Site

    def away(self, mesh: Mesh, entities: Ints) -> Floats:
        return np.minimum(self.first.away(mesh, entities), self.second.away(mesh, entities))


@dataclass(frozen=True)
class Without(Site):
    """What the first rule chooses and the second does not."""

    first: Site
    second: Site

    def away(self, mesh: Mesh, entities: Ints) -> Floats:
        taken = self.second.away(mesh, entities) <= _SLACK * _size(mesh)
        return np.where(taken, _size(mesh), self.first.away(mesh, entities))


@dataclass(frozen=True)
class Chosen:
    """Faces, edges or points by a rule; `entities` finds them in a mesh."""

    where: Site
    of: EntityKind

    def entities(self, mesh: Mesh) -> Ints:
        """(k, m) node numbers; raises `SceneError` with the nearest one where there is none."""
        if self.of == "points":
            known = np.arange(len(mesh.nodes))[:, None]
        else:
            known = _parts(mesh.surface, mesh, self.of)
        away = self.where.away(mesh, known)
        inside = away <= _SLACK * _size(mesh)
        if not inside.any():
            nearest = int(np.argmin(away))
            at = ", ".join(f"{1e3 * x:.3g}" for x in _middles(mesh, known[[nearest]])[0])
            raise SceneError(
                f"none of {len(known)} {self.of} is chosen by {self.where}; the nearest, at "
                f"({at}) mm, is {1e3 * away[nearest]:.3g} mm away: move the selection or "
                "refine the mesh"
            )
        return np.asarray(known[inside])


# What a part of a scene takes: the name of a facet set, or a choice.
Place = str | Chosen


def kind_of(place: Place) -> EntityKind:
    """What a place consists of."""
    return "faces" if isinstance(place, str) else place.of


def facets_of(mesh: Mesh, place: Place) -> Ints:
    """Facets, edges or points (k, m) of a place; `SceneError` where it is absent or empty."""
    if isinstance(place, str):
        mesh.facet_nodes(place)
        return mesh.facets[place]
    return place.entities(mesh)


def nodes_of(mesh: Mesh, place: Place) -> Ints:
    """Sorted node numbers of a place; `SceneError` where it is absent or empty."""
    return mesh.facet_nodes(place) if isinstance(place, str) else np.unique(place.entities(mesh))


def _parts(facets: Ints, mesh: Mesh, kind: EntityKind) -> Ints:
    """The facets themselves, their edges, each once, or their nodes."""
    if kind == "points":
        return np.unique(facets)[:, None]
    if kind == "faces" or mesh.dimension == 2:
        return facets
    corners = 4 if facets.shape[1] in (4, 9) else 3
    ends = facets[:, [(i, (i + 1) % corners) for i in range(corners)]].reshape(-1, 2)
    _, first = np.unique(np.sort(ends, axis=1), axis=0, return_index=True)
    if facets.shape[1] == corners:
        return np.asarray(ends[first])
    middles = facets[:, _MIDDLES if corners == 4 else slice(3, None)].reshape(-1, 1)
    return np.hstack([ends, middles])[first]


def _middles(mesh: Mesh, entities: Ints) -> Floats:
    return np.asarray(mesh.nodes[entities].mean(axis=1))


def _size(mesh: Mesh) -> float:
    return float(np.ptp(mesh.nodes, axis=0).max())


def _vector(value: tuple[float, ...], mesh: Mesh, what: str) -> Floats:
    vector = np.array(value, dtype=np.float64)
    if vector.shape != (mesh.dimension,) or not np.isfinite(vector).all():
        raise SceneError(f"{what}: {value}, needs {mesh.dimension} finite numbers")
    return vector


# -------------------------------------------------------------------------------------------------

GRAMMAR = (
    "a facet set, zmin, zmax, z=20mm, z=20mm~0.5mm, box A to B, near P (points as 1mm,2mm,0), A & B"
)
_AXES = "xyz"
_FLAT = 2e-3  # of the body's diagonal: how far the facets of a filled surface lie off its sides


def place_of(text: str, mesh: Mesh) -> Place:
    """Return the facets that the words choose of a mesh; raises `SceneError` for words that say
    nothing, or choose nothing."""
    if "&" in text:
        # Sides without the way their faces look, which edges do not have.
        named = [_site(part.strip(), mesh) for part in text.split("&")]
        sides = [site.first if isinstance(site, Both) else site for site in named]
        edges = reduce(and_, sides).edges
        edges.entities(mesh)
        return edges
    sites = [_site(part.strip(), mesh) for part in text.split("+")]
    chosen = reduce(or_, sites).faces
    if len(sites) == 1 and text.strip() in mesh.facets:
        return text.strip()
    chosen.entities(mesh)
    return chosen


def axis_of(text: str) -> tuple[float, ...]:
    """Return the unit vector of "+x", "-z", or of three numbers; raises `SceneError` for anything
    else."""
    word = text.strip().lower()
    if word.lstrip("+-") in tuple(_AXES) and len(word) <= 2:
        sign = -1.0 if word.startswith("-") else 1.0
        return tuple((sign * np.eye(3)[_AXES.index(word[-1])] + 0.0).tolist())
    try:
        v = np.array([float(part) for part in text.split(",")])
    except ValueError:
        v = np.zeros(0)
    if v.shape != (3,) or not np.isfinite(v).all() or not v.any():
        raise SceneError(f"direction '{text[:40]}': one of +x -x +y -y +z -z, or three numbers")
    return tuple((v / np.linalg.norm(v)).tolist())


def pose_of(origin: tuple[float, ...], image_x: str, image_y: str) -> Floats:
    """T_body_from_image of what is declared; raises `UsageError` for axes that are not square."""
    x, y = np.array(axis_of(image_x)), np.array(axis_of(image_y))
    if len(origin) != 3 or abs(float(x @ y)) > 1e-6:
        raise UsageError(
            f"origin {origin}, image_x {image_x}, image_y {image_y}: three lengths, and two "
            "directions at right angles"
        )
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2], pose[:3, 3] = x, y, np.cross(x, y), origin
    return pose


def point_of(text: str) -> tuple[float, ...]:
    """Three lengths as metres; raises `SceneError` for anything else, and where some of them have
    a unit and others that are not 0 have none."""
    found = [split(part) for part in text.split(",")]
    units = {bool(f[1]) for f in found if f and f[0] != 0}
    if len(found) != 3 or len(units) > 1:
        raise SceneError(
            f"point '{text[:40]}': expected three lengths with their units, for example 10mm,0,20mm"
        )
    return tuple(_metres(part) for part in text.split(","))


def box_of(text: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the corners m of "box A to B"; raises `SceneError` for anything else."""
    if not (text.startswith("box ") and " to " in text):
        raise SceneError(f"place '{text[:60]}': expected a box, as box 0,0,1mm to 4mm,4mm,2mm")
    low, high = map(point_of, text[4:].split(" to ", 1))
    return low, high


def _site(text: str, mesh: Mesh) -> Site:
    if text in mesh.facets:
        return Labelled(text)
    if text.startswith("near "):
        point = point_of(text[5:])
        _require_at(text, point, point, mesh)
        return Nearest(point)
    if text.startswith("box ") and " to " in text:
        low, high = box_of(text)
        _require_at(text, low, high, mesh)
        return InBox(low, high)
    if text[:1] in tuple(_AXES) and text[1:] in ("min", "max"):
        axis = _AXES.index(text[0])
        x = mesh.nodes[:, axis]
        at = np.zeros(3)
        at[axis] = x.min() if text[1:] == "min" else x.max()
        slack = _FLAT * float(np.linalg.norm(np.ptp(mesh.nodes, axis=0)))
        across = _tuple(np.eye(3)[axis])
        return OnPlane(_tuple(at), across, slack) & Facing(across)
    if text[:2] in ("x=", "y=", "z="):
        axis = _AXES.index(text[0])
        where, _, within = text[2:].partition("~")
        at = np.zeros(3)
        at[axis] = _metres(where)
        return OnPlane(_tuple(at), _tuple(np.eye(3)[axis]), _metres(within) if within else 0.0)
    known = set(mesh.facets)
    named = f"; {nearest_names(text, known)}" if known else "; the body has no facet sets"
    raise SceneError(f"place '{text[:40]}': none of {GRAMMAR}{named}")


def _require_at(text: str, low: tuple[float, ...], high: tuple[float, ...], mesh: Mesh) -> None:
    """Raises `SceneError` for a box further off the body than the body is large: the nearest point
    to millimetres that were taken for metres is some point, too."""
    gap = np.maximum(np.array(low) - mesh.nodes.max(axis=0), mesh.nodes.min(axis=0) - high)
    away = float(np.linalg.norm(np.maximum(gap, 0.0)))
    size = float(np.linalg.norm(np.ptp(mesh.nodes, axis=0)))
    if away > size:
        raise SceneError(
            f"place '{text[:60]}': {1e3 * away:.3g} mm away from a body of {1e3 * size:.3g} "
            "mm; a number without a unit is in metres, write 10mm"
        )


def _metres(text: str) -> float:
    found = split(text)
    value = in_si(found[0], found[1] or "m", "m") if found else None
    if value is None:
        raise SceneError(f"'{text[:40]}': expected a length, for example 20mm or 0.02")
    return value


def _tuple(x: Floats) -> tuple[float, ...]:
    return tuple(x.tolist())


# --- What keeps a body on a slippery plate from sliding off and turning, and presses nothing.

_OFF = 0.25  # of the place's width: how far off its middle the node is that stays
_FAR = 0.4  # of the farthest: how far from the middle the other node is at least


def resting_points(x: Floats, one: int, other: int, place: str) -> tuple[Floats, Floats]:
    """Return the node next to the middle of a place's nodes x (k, 3) m, which stays along the axes
    `one` and `other`; a second one, beside it along `one`, stays only along `other`.

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
