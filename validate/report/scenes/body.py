"""Geometry of a drawn body: its surface as triangles, tools, cutting plane, camera."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats, Ints
from validate.compare.result import MethodResult, Result
from validate.report.sections.observations import outline
from validate.scene.contact import RigidCylinder, RigidPlane, RigidPunch, RigidSphere, Shape
from validate.scene.mesh import Mesh, boundary_facets
from validate.scene.meshless import AnyScene
from validate.scene.places import nodes_of
from validate.scene.scene import Scene, Weight
from validate.scene.shape_functions import EDGES

_MM = 1e3
_AROUND = 48  # sides of a round tool

# --- From where a set of points is seen best: along the axis that it spreads over least.


def flattest(points: Floats) -> tuple[list[int], int | None]:
    """Return the two axes that points (k, d) spread over most, and the one across; None in 2-D."""
    spread = np.ptp(points, axis=0)
    across = int(np.argmin(spread)) if len(spread) == 3 else None
    return [i for i in range(len(spread)) if i != across], across


# --- Directions and the plane that opens a body.


def drive_direction(scene: AnyScene) -> Floats:
    """Where the body is driven or pressed to, else where its weight pulls; without either the last
    axis is drawn upward."""
    tools = scene.contacts if isinstance(scene, Scene) else ()
    pressed = [tool.direction for tool in tools if tool.direction is not None]
    weights = [load.direction for load in scene.loads if isinstance(load, Weight)]
    drives = [drive.direction for drive in scene.drives]
    return np.array([*drives, *pressed, *weights, (0.0, 0.0, -1.0)][0])


def opening_plane(result: Result, toward: Floats) -> tuple[Floats, str]:
    """The normal of the plane that opens the body, its largest part positive, and the plane in
    words: that of the images, without any one along the drive."""
    seen = outline(result.registered[0]) if result.registered else None
    if seen is None:
        return np.roll(np.abs(toward), 1), "a plane along the drive"
    normal = seen.pose[:3, 2]
    return np.asarray(normal * np.sign(normal[np.argmax(np.abs(normal))])), "the image plane"


# --- The camera.


@dataclass(frozen=True)
class Camera:
    """A camera without perspective: it looks at `middle` (3,) mm from the direction `away` (3,),
    `up` (3,) upward, and holds `half` (2,) mm to each side and upward and downward."""

    middle: Floats
    away: Floats
    up: Floats
    half: Floats


def camera(points: Floats, toward: Floats, normal: Floats | None, flat: bool) -> Camera:
    """Return the oblique camera that holds points (k, 3) mm, the drive pointing down; onto the cut
    across `normal` (3,) where there is one, from the front of a planar body."""
    up = np.array([0.0, 1.0, 0.0]) if flat else -toward / np.linalg.norm(toward)
    side = np.eye(3)[0 if abs(up[0]) < 0.9 else 1]
    side = side - up * (up @ side)
    side /= np.linalg.norm(side)
    if flat:
        away = np.array([0.0, 0.0, 1.0])
    elif normal is not None:
        away = 0.6 * np.cross(normal, up) + 1.1 * normal + 0.5 * up
    else:
        away = 0.5 * up + side - 0.7 * np.cross(up, side)
    away /= np.linalg.norm(away)
    right = np.cross(up, away)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(away, right), away], axis=1)
    low, high = np.nanmin(points @ axes, axis=0), np.nanmax(points @ axes, axis=0)
    return Camera(axes @ (0.5 * (low + high)), away, up, 0.5 * (high - low)[:2])


# --- Plates and rigid indenters.


@dataclass(frozen=True)
class Tool:
    """A plate or a rigid indenter: triangles (t, 3) between nodes (v, 3) mm at rest, and its shifts
    (f, 3) mm at the instants shown."""

    nodes: Floats
    triangles: Ints
    shifts: Floats
    plate: bool = False


def tools_of(method: MethodResult, frames: Ints) -> tuple[Tool, ...]:
    """Return plates and rigid indenters at output frames (f,) of a run; none in 2-D."""
    if method.scene.mesh.dimension != 3 or not isinstance(method.scene, Scene):
        return ()
    return *_plates(method, method.scene, frames), *_indenters(method, method.scene, frames)


def _plates(method: MethodResult, scene: Scene, frames: Ints) -> Iterator[Tool]:
    """Flat facet sets across the first drive: the driven one and the held ones."""
    drive = scene.drives[0] if scene.drives else None
    travelled = method.run.traces.get(f"{drive.name}.displacement") if drive else None
    if drive is None or travelled is None or drive.follows or drive.shape:
        return
    axis = int(np.argmax(np.abs(drive.direction)))
    moved = _MM * np.outer(travelled.y[method.run.at[frames]], drive.direction)
    held = [s.facets for s in scene.supports if axis in s.components]
    across = scene.mesh.nodes[:, axis]
    middle = 0.5 * _MM * (across.min() + across.max())
    corners = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
    for name in dict.fromkeys([drive.facets, *held]):
        nodes = _MM * scene.mesh.nodes[nodes_of(scene.mesh, name)]
        low, high = nodes.min(axis=0), nodes.max(axis=0)
        if high[axis] - low[axis] >= 1e-6:
            continue
        # A box outside the body on the flat face
        sizes = (high - low) * 1.12
        thick = 0.04 * float((high - low).max())
        sizes[axis] = thick
        centre = 0.5 * (low + high)
        centre[axis] += 0.55 * thick * np.sign(low[axis] - middle)
        shifts = moved if name == drive.facets else 0 * moved
        yield Tool(centre + 0.5 * sizes * corners, np.array(_BOX), shifts, plate=True)


_BOX = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6],
        [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]  # fmt: skip


def _indenters(method: MethodResult, scene: Scene, frames: Ints) -> Iterator[Tool]:
    for tool in scene.contacts:
        touched = _MM * scene.mesh.nodes[nodes_of(scene.mesh, tool.facets)]
        shifts, travel = (
            np.zeros((len(frames), 3)),
            method.run.traces.get(f"{tool.name}.displacement"),
        )
        if tool.direction is not None and travel is not None:
            shifts = _MM * np.outer(travel.y[method.run.at[frames]], tool.direction)
        yield Tool(*indenter_surface(tool.shape, np.ptp(touched, axis=0)), shifts)


def indenter_surface(shape: Shape, extent: Floats) -> tuple[Floats, Ints]:
    """Return nodes (v, 3) mm and triangles (t, 3) of a rigid shape at rest; a plane and a bar are
    as long as what they may touch, of `extent` (3,) mm, a punch as its radius.

    Raises `TypeError` for a shape that is none of a scene.
    """
    long = 1.2 * float(np.linalg.norm(extent))
    if isinstance(shape, RigidSphere):
        angle = np.linspace(0, np.pi, _AROUND // 2 + 1)
        profile = _MM * shape.radius * np.stack([np.sin(angle), np.cos(angle)], axis=1)
        return _revolved(profile, _MM * np.array(shape.centre), np.array([0.0, 0.0, 1.0]))
    if isinstance(shape, RigidCylinder):
        axis = np.array(shape.axis) / np.linalg.norm(shape.axis)
        half = 0.6 * float(np.abs(axis) @ extent)
        return _revolved(_bar(_MM * shape.radius, -half, half), _MM * np.array(shape.point), axis)
    if isinstance(shape, RigidPunch):
        at, radius, thick = shape.centre, _MM * shape.radius, _MM * shape.radius
    elif isinstance(shape, RigidPlane):
        at, radius, thick = shape.point, long / 2, 0.05 * long
    else:
        raise TypeError(
            f"a {type(shape).__name__} cannot be drawn; expected a rigid shape of scenes"
        )
    return _revolved(_bar(radius, -thick, 0.0), _MM * np.array(at), np.array(shape.normal))


def _bar(radius: float, low: float, high: float) -> Floats:
    """The profile (4, 2) of a closed cylinder: radius and height, mm."""
    return np.array([[0.0, low], [radius, low], [radius, high], [0.0, high]])


def _revolved(profile: Floats, origin: Floats, axis: Floats) -> tuple[Floats, Ints]:
    """A profile (k, 2) of radius and height mm turned about the `axis` through `origin` (3,) mm."""
    along = axis / np.linalg.norm(axis)
    side = np.cross(along, np.eye(3)[int(np.argmin(np.abs(along)))])
    side /= np.linalg.norm(side)
    angle = 2 * np.pi * np.arange(_AROUND) / _AROUND
    around = np.outer(np.cos(angle), side) + np.outer(np.sin(angle), np.cross(along, side))
    radius, height = profile.T[:, :, None, None]
    nodes = (origin + radius * around + height * along).reshape(-1, 3)
    here = np.arange((len(profile) - 1) * _AROUND).reshape(-1, _AROUND)
    right = np.roll(here, -1, axis=1)
    a, b, c, d = (i.ravel() for i in (here, right, right + _AROUND, here + _AROUND))
    return nodes, np.vstack([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


# --- surface of a mesh as triangles: outside and cavity walls, decimated if large ----------------

OUTSIDE = "outside"
_FEWEST = 8  # triangles that a thinned part keeps, to remain a body


@dataclass(frozen=True)
class SurfacePart:
    """One part of a surface: `nodes` (v,) of the mesh, triangles (t, 3) between them.

    `whole` counts the triangles before thinning.
    """

    name: str
    nodes: Ints
    triangles: Ints
    whole: int


def skins(scene: AnyScene, most: int) -> tuple[SurfacePart, ...]:
    """Return the outside and every cavity wall, about `most` triangles in all; none of a 2-D
    mesh."""
    mesh = scene.mesh
    if mesh.dimension != 3:
        return ()
    walls = {c.name: flat_triangles(mesh.facets[c.facets]) for c in scene.cavities}
    six = mesh.surface.shape[1] == 6
    outside = flat_triangles(mesh.surface) if six else boundary_facets(mesh.simplices, 3)
    # `facets` that are in none of the `others`, whatever the order of their corners
    others = list(walls.values())
    taken = {tuple(f) for other in others for f in np.sort(other, axis=1).tolist()}
    kept = [tuple(f) not in taken for f in np.sort(outside, axis=1).tolist()]
    parts = {OUTSIDE: np.asarray(outside[np.array(kept)]), **walls}
    total = sum(len(t) for t in parts.values())
    share = min(1.0, most / total)
    return tuple(_skin(mesh, name, t, share) for name, t in parts.items() if len(t))


def flat_triangles(facets: Ints) -> Ints:
    """Return triangles (t, 3) for facets (f, m): six-node ones as four, others by their corners."""
    if facets.shape[1] != 6:
        return facets[:, :3]
    middle = {frozenset(edge): 3 + i for i, edge in enumerate(EDGES[2])}
    a, b, c = (middle[frozenset(e)] for e in ((0, 1), (1, 2), (0, 2)))
    return facets[:, [[0, a, c], [a, 1, b], [c, b, 2], [a, b, c]]].reshape(-1, 3)


def _skin(mesh: Mesh, name: str, triangles: Ints, share: float) -> SurfacePart:
    """Triangles between fewer nodes: `share` of them at most, unless under `_FEWEST` are left."""
    corners = mesh.nodes[triangles]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * np.linalg.norm(cross, axis=1).sum()
    size = float(np.sqrt(2 * area / max(len(triangles), 1)))  # the legs of an average triangle
    used = np.unique(triangles)
    x, corner = mesh.nodes[used], np.searchsorted(used, triangles)
    kept = triangles
    while len(kept) > share * len(triangles):
        # The nodes in a box of this size become the one nearest to their mean
        box = np.floor((x - x.min(axis=0)) / size).astype(np.int64)
        _, cluster = np.unique(box, axis=0, return_inverse=True)
        cluster = cluster.ravel()
        count = np.bincount(cluster)
        mean = np.stack([np.bincount(cluster, c) / count for c in x.T], axis=1)
        order = np.lexsort((np.linalg.norm(x - mean[cluster], axis=1), cluster))
        first = order[np.searchsorted(cluster[order], np.arange(len(count)))]
        moved = used[first][cluster][corner]
        a, b, c = moved.T
        joined = moved[(a != b) & (b != c) & (a != c)]
        _, unique = np.unique(np.sort(joined, axis=1), axis=0, return_index=True)
        if len(unique) < _FEWEST:
            break
        kept, size = np.asarray(joined[np.sort(unique)]), 1.2 * size
    nodes, local = np.unique(kept, return_inverse=True)
    return SurfacePart(name, nodes, local.reshape(-1, 3), len(triangles))
