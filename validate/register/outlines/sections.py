"""Image planes: their poses, the section of a deformed surface, round outlines."""

from dataclasses import dataclass
from typing import Self

import numpy as np
import shapely
from scipy import sparse
from scipy.optimize import least_squares
from scipy.spatial import cKDTree

from validate.arrays import Floats, Ints, rms
from validate.errors import RegistrationError
from validate.fem.assembly.locate import Rows, facet_samples, nearest_node_rows
from validate.recording.types import Contours, Record
from validate.scene.geometries.inclusion import Capsule, InclusionShape
from validate.scene.mesh import Mesh

_CANDIDATES = 12  # nearest triangles that may hold a point


@dataclass(frozen=True)
class SurfaceSampler:
    """Points on a cavity wall that follow the simulation: rest (v, 3) m, rows, triangles (t, 3)."""

    rest: Floats
    rows: Rows
    triangles: Ints

    def deformed(self, u: Floats) -> Floats:
        """Positions (v, 3) m under nodal displacements u (n, 3) m."""
        return self.rest + self.rows.apply(u)

    def section(self, u: Floats, pose: Floats) -> Floats:
        """Outline (k, 2) m in the plane of `pose` (4, 4) under displacements u; as `section`."""
        return section(self.deformed(u), self.triangles, pose)

    def rows_at(self, points: Floats) -> sparse.csr_array:
        """Rows (m, n) of the places on the wall that are nearest to points (m, 3) m."""
        middles = self.rest[self.triangles].mean(axis=1)
        near = cKDTree(middles).query(points, k=min(_CANDIDATES, len(middles)))[1]
        corners = self.triangles[near.reshape(len(points), -1)]
        shares = _shares(self.rest[corners], points)
        feet = np.einsum("pkc,pkcd->pkd", shares, self.rest[corners])
        best = np.linalg.norm(feet - points[:, None], axis=2).argmin(axis=1)
        each = np.arange(len(points))
        shape = (len(points), len(self.rest))
        entries = (shares[each, best].ravel(), (np.repeat(each, 3), corners[each, best].ravel()))
        return sparse.csr_array(sparse.csr_array(entries, shape=shape) @ self.rows.weights)

    @classmethod
    def of_cavity(
        cls,
        mesh: Mesh,
        facets: str,
        shape: InclusionShape | None,
        parts: int = 8,
        *,
        nearest: bool = False,
    ) -> Self:
        """Samples of a cavity wall, `parts` per facet edge.

        With a `shape` the samples lie on it instead of on the flat facets, so that the outline
        shows the inclusion that was measured and not the corners of the mesh; the displacement is
        the mesh's, interpolated, or with `nearest` that of the nearest node of the wall (paper 000,
        section 4.5).
        """
        rows, triangles = facet_samples(mesh, mesh.facets[facets], parts)
        points = rows.apply(mesh.nodes)
        _, first, number = np.unique(
            np.round(points, 9), axis=0, return_index=True, return_inverse=True
        )
        rows = Rows(rows.weights[first], rows.outside[first])
        rest = points[first] if shape is None else shape.project(points[first])
        if nearest:
            rows = nearest_node_rows(mesh, rest, mesh.facet_nodes(facets))
        return cls(rest, rows, number.ravel()[triangles])


def _shares(corners: Floats, points: Floats) -> Floats:
    """Barycentric coordinates (p, k, 3) of points (p, 3) m in triangles (p, k, 3, 3) m, within
    them."""
    start = corners[..., 0, :]
    u, v = corners[..., 1, :] - start, corners[..., 2, :] - start
    w = points[:, None] - start
    uu, uv, vv = (u * u).sum(-1), (u * v).sum(-1), (v * v).sum(-1)
    wu, wv = (w * u).sum(-1), (w * v).sum(-1)
    area = np.maximum(uu * vv - uv**2, np.finfo(float).tiny)
    s, t = (vv * wu - uv * wv) / area, (uu * wv - uv * wu) / area
    inside = np.clip(np.stack([1 - s - t, s, t], axis=-1), 0, None)
    return np.asarray(inside / inside.sum(axis=-1, keepdims=True))


def to_image(pose: Floats, points: Floats) -> Floats:
    """Scene points (n, 3) m as image x, y and distance from the plane (n, 3) m."""
    return (points - pose[:3, 3]) @ pose[:3, :3]


def from_image(pose: Floats, points: Floats) -> Floats:
    """Image points (n, 2) m as scene points (n, 3) m."""
    return points @ pose[:3, :2].T + pose[:3, 3]


def require_rigid(pose: Floats, name: str) -> None:
    """Raise `RegistrationError` when a pose is not a proper rotation and translation."""
    R = pose[:3, :3]
    off = float(np.abs(R.T @ R - np.eye(3)).max())
    if off > 1e-6 or np.linalg.det(R) < 0 or not np.allclose(pose[3], [0, 0, 0, 1]):
        kind = (
            "mirrors the image" if np.linalg.det(R) < 0 else f"is not orthogonal: error {off:.1e}"
        )
        raise RegistrationError(f"pose '{name}' {kind}; give T_frame_from_image, right-handed")


def section(points: Floats, triangles: Ints, pose: Floats) -> Floats:
    """Return the closed outline (k, 2) m, image coordinates, where a surface crosses the image
    plane.

    Raises `RegistrationError` when the plane misses the surface.
    """
    local = to_image(pose, points)
    height = local[:, 2]
    above = height[triangles] >= 0
    crossed = triangles[above.any(axis=1) & ~above.all(axis=1)]
    if len(crossed) == 0:
        low, high = 1e3 * height.min(), 1e3 * height.max()
        raise RegistrationError(
            f"the image plane misses the inclusion, which spans {low:.2f}..{high:.2f} mm from it; "
            "check the pose of the images"
        )
    pairs = np.sort(crossed[:, [[0, 1], [1, 2], [0, 2]]], axis=2)
    above = local[:, 2] >= 0
    cut = pairs[above[pairs[..., 0]] != above[pairs[..., 1]]]  # two edges of every triangle
    start, end = local[cut[:, 0]], local[cut[:, 1]]
    s = start[:, 2] / (start[:, 2] - end[:, 2])
    places = start[:, :2] + s[:, None] * (end - start)[:, :2]
    rings = shapely.polygonize(
        [
            shapely.line_merge(
                shapely.multilinestrings(shapely.linestrings(places.reshape(-1, 2, 2)))
            )
        ]
    ).geoms
    if not rings:
        raise RegistrationError("the section with the image plane is not a closed outline")
    ring = max(rings, key=lambda polygon: float(polygon.area))
    return np.asarray(shapely.get_coordinates(shapely.orient_polygons(ring).exterior)[:-1])


# --- round outlines: circle fit, and an inclusion's pose -----------------------------------------


@dataclass(frozen=True)
class Circle:
    """Centre (2,) m, radius m; sd of each coordinate of the centre and of the radius, m."""

    centre: Floats
    radius: float
    sd_centre: float
    sd_radius: float
    rms: float

    @classmethod
    def fit(cls, points: Floats, sd: float) -> Self:
        """Least squares of the radial distances of points (k, 2) m with noise sd m.

        Raises `RegistrationError` for fewer than 6 points or an outline far from a circle.
        """
        if len(points) < 6:
            raise RegistrationError(
                f"outline of {len(points)} points: a circle fit needs 6 or more"
            )
        middle = points.mean(axis=0)
        start = np.array([*middle, np.linalg.norm(points - middle, axis=1).mean()])

        def off_circle(p: Floats) -> Floats:
            return np.asarray(np.linalg.norm(points - p[:2], axis=1) - p[2])

        found = least_squares(off_circle, start)
        x, residual = found.x, np.asarray(found.fun)
        off = rms(residual)
        if off > 0.2 * x[2]:
            raise RegistrationError(
                f"the outline is not a circle: {1e3 * off:.2f} mm rms off a radius of "
                f"{1e3 * x[2]:.2f} mm"
            )
        k = len(points)
        noise = max(sd, off)
        sds = noise * np.sqrt(2 / k), noise / np.sqrt(k)
        return cls(x[:2], float(x[2]), float(sds[0]), float(sds[1]), off)


def outlined_capsule(
    contours: Contours, rest: int, sweep: Record, allowance: float = 0.0
) -> Capsule:
    """Centre x, z and radius of outline number `rest`; height y and length from the sweep.

    Raises `RegistrationError` when the outline's centre lies further from the sweep's than 4
    standard deviations and `allowance` m: a mirrored image or a wrong pose.
    """
    circle = Circle.fit(contours.outlines[rest], contours.sd)
    centre = from_image(contours.pose, circle.centre[None])[0]
    declared = np.array([_metres(sweep, f"centre_{axis}_m") for axis in "xyz"])
    off = float(np.linalg.norm((centre - declared)[[0, 2]]))
    allowed = 4 * float(np.hypot(_metres(sweep, "sd_centre_m"), circle.sd_centre)) + allowance
    if off > allowed:
        raise RegistrationError(
            f"the rest outline's centre is {1e3 * off:.2f} mm from the inclusion of the sweep "
            f"(allowed {1e3 * allowed:.2f} mm): mirrored image or wrong pose; check record "
            "'pose/outline'"
        )
    place = (float(centre[0]), float(declared[1]), float(centre[2]))
    return Capsule(place, circle.radius, _metres(sweep, "length_m"))


def _metres(record: Record, key: str) -> float:
    try:
        return float(record[key])
    except (KeyError, ValueError):
        raise RegistrationError(
            f"record 'inclusion' lacks a number '{key}'; it has {sorted(record)}"
        ) from None
