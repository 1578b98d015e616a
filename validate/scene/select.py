"""Where the parts of a scene sit: faces, edges or points, chosen by place or by label.

A choice is a rule, not a list of numbers: it holds on a finer mesh, too. Rules combine with & | -
and are asked for what they choose: `(OnPlane(a, x) & OnPlane(a, z)).edges`.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.spatial import cKDTree

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.scene.mesh import Mesh
from validate.scene.shape_functions import CORNERS, LATTICE

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
        kind = _kind(mesh, entities)
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
        known = _known(mesh, self.of)
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


def _known(mesh: Mesh, kind: EntityKind) -> Ints:
    if kind == "points":
        return np.arange(len(mesh.nodes))[:, None]
    return _parts(mesh.surface, mesh, kind)


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


def _kind(mesh: Mesh, entities: Ints) -> EntityKind:
    if entities.shape[1] == 1:
        return "points"
    return "faces" if entities.shape[1] == mesh.surface.shape[1] else "edges"


def _middles(mesh: Mesh, entities: Ints) -> Floats:
    return np.asarray(mesh.nodes[entities].mean(axis=1))


def _size(mesh: Mesh) -> float:
    return float(np.ptp(mesh.nodes, axis=0).max())


def _vector(value: tuple[float, ...], mesh: Mesh, what: str) -> Floats:
    vector = np.array(value, dtype=np.float64)
    if vector.shape != (mesh.dimension,) or not np.isfinite(vector).all():
        raise SceneError(f"{what}: {value}, needs {mesh.dimension} finite numbers")
    return vector
