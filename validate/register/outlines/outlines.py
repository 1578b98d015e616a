"""Outlines in an image plane, and their distances from the section of the deformed wall."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
import shapely
from scipy import sparse
from scipy.spatial.distance import cdist

from validate.arrays import Floats, rms
from validate.errors import ComparisonError
from validate.fem.assembly.locate import Rows
from validate.recording.types import Contours
from validate.register.clocks import SAME, around, with_clock
from validate.register.observation import (
    AnyDraw,
    Deviation,
    History,
    Role,
    Selection,
    Simulated,
    field_at,
    frame_at,
    nearest_sample,
)
from validate.register.outlines.sections import SurfaceSampler, from_image, require_rigid

_TURN = 2 * np.pi
EVERY_TEN = np.deg2rad(np.arange(0.0, 360.0, 10.0))  # rad


def normal_distances(outline: Floats, points: Floats) -> Floats:
    """How far the closed `outline` (k, 2) m lies outside each point (m, 2) m: negative inside.

    The distance is the shortest one, so along the outline's normal wherever that is smooth.
    """
    polygon = _polygon(outline)
    marks = shapely.points(points)
    distance = shapely.distance(polygon.exterior, marks)
    return np.asarray(np.where(shapely.contains(polygon, marks), distance, -distance))


def enclosed(outline: Floats) -> tuple[float, Floats]:
    """Area m^2 and centroid (2,) m inside a closed outline."""
    polygon = _polygon(outline)
    return float(polygon.area), np.array([polygon.centroid.x, polygon.centroid.y])


def angular_points(outline: Floats, angles: Floats) -> Floats:
    """Points (a, 2) m of the outline seen from its centroid at polar angles (a,) rad.

    The radius is interpolated linearly in angle; the outline must be star-shaped about its
    centroid, else `ComparisonError`.
    """
    centre, at, radius = _rays(outline)
    found = np.interp(np.mod(angles, _TURN), at, radius, period=_TURN)
    return np.asarray(centre + found[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1))


def outline_places(angles: Floats) -> tuple[str, ...]:
    """Return the names of places at polar angles (a,) rad."""
    return tuple(f"outline at {deg:.0f} deg" for deg in np.rad2deg(angles))


def ray_points(outline: Floats, angles: Floats) -> Floats:
    """Where rays from the outline's centroid at polar angles (a,) rad cross its straight segments:
    (a, 2) m, on the outline itself."""
    centre, at, radius = _rays(outline)
    after = np.searchsorted(at, np.mod(angles, _TURN)) % len(at)
    before = after - 1
    span = np.mod(at[after] - at[before], _TURN)
    gone = np.mod(angles - at[before], _TURN)
    across = radius[before] * np.sin(gone) + radius[after] * np.sin(span - gone)
    corner = across <= 0  # two vertices on one ray
    whole = radius[before] * radius[after] * np.sin(span) / np.where(corner, 1.0, across)
    found = np.where(corner, radius[after], whole)
    return np.asarray(centre + found[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1))


def at_normals(outline: Floats, points: Floats) -> tuple[Floats, Floats]:
    """Return the outline's vertices nearest to points (m, 2) m, and the outward normals there."""
    nearest = cdist(points, outline).argmin(axis=1)
    across = normals(outline)
    middle = enclosed(outline)[1]
    outward = np.sign(((outline - middle) * across).sum(axis=1, keepdims=True))
    return outline[nearest], (outward * across)[nearest]


def along_normals(still: Floats, outlines: Sequence[Floats], angles: Floats) -> Floats:
    """Displacements (nt, a, 2) m of outlines along the normals of the one at rest, at its places at
    polar angles (a,) rad; to first order those of the material."""
    places, across = at_normals(still, ray_points(still, angles))
    away = np.array([normal_distances(outline, places) for outline in outlines])
    return np.asarray((away - normal_distances(still, places))[:, :, None] * across)


def polar_angles(outline: Floats) -> Floats:
    """Polar angles (k,) rad of the outline's points about its centroid."""
    _, centre = enclosed(outline)
    away = outline - centre
    return np.asarray(np.arctan2(away[:, 1], away[:, 0]))


def normals(outline: Floats) -> Floats:
    """Unit normals (k, 2) of a closed outline at its points, across the chord of both next ones."""
    along = np.roll(outline, -1, axis=0) - np.roll(outline, 1, axis=0)
    across = np.stack([along[:, 1], -along[:, 0]], axis=1)
    return np.asarray(across / np.linalg.norm(across, axis=1, keepdims=True))


def angular_weights(outline: Floats, angles: Floats) -> Floats:
    """Weights (a, k) by which `angular_points` takes the radii of the outline's points, in the
    order of their polar angles."""
    _, at, _ = _rays(outline)
    ahead = np.mod(angles[:, None] - at, _TURN)
    # Of points at one angle (repeated, or on one ray) the last: the next one lies ahead of it.
    rows, before = np.arange(len(angles)), len(at) - 1 - ahead[:, ::-1].argmin(axis=1)
    after = (before + 1) % len(at)
    share = ahead[rows, before] / np.mod(at[after] - at[before], _TURN)
    weights = np.zeros(ahead.shape)
    weights[rows, before], weights[rows, after] = 1 - share, share
    return weights


def _rays(outline: Floats) -> tuple[Floats, Floats, Floats]:
    """The centroid (2,) m, and polar angles (k,) in 0..2 pi, rising, with radii (k,) m about it."""
    _, centre = enclosed(outline)
    away = outline - centre
    polar = np.arctan2(away[:, 1], away[:, 0])
    around = np.unwrap(np.append(polar, polar[0]))  # the closed way
    ahead = (around - around[0]) * np.sign(around[-1] - around[0])
    back = (np.maximum.accumulate(ahead) - ahead).max()
    if back > np.deg2rad(20) or not 1.5 * np.pi < ahead[-1] < 2.5 * np.pi:
        raise ComparisonError("an outline folds back on itself; its polar angles are not ordered")
    at = np.mod(polar, _TURN)
    order = np.argsort(at, kind="stable")
    return centre, at[order], np.linalg.norm(away[order], axis=1)


def _polygon(outline: Floats) -> shapely.Polygon:
    polygon = shapely.Polygon(outline)
    if not polygon.is_valid or polygon.area == 0:
        reason = shapely.is_valid_reason(polygon)
        raise ComparisonError(f"outline of {len(outline)} points is not a simple curve: {reason}")
    return polygon


_TINY = np.finfo(float).tiny
_ANGLES = EVERY_TEN


@dataclass(frozen=True)
class Corner:
    """A place of the outline that is followed on its own: polar angle in the image, rad."""

    quantity: str
    angle: float
    words: str


@dataclass(frozen=True)
class OutlineObservation:
    """Outlines (k_i, 2) m in image coordinates, and the wall that the simulation moves.

    `sds` (nt,) m are the outlines' own standard deviations, where they have any; `sd` is of all.
    `rest` s is the unloaded instant, from which displacements of the outline count; `sd_t` s says
    how uncertain the clock is.
    """

    name: str
    role: Role
    t: Floats
    outlines: tuple[Floats, ...]
    pose: Floats
    sd: float
    wall: SurfaceSampler
    rest: float
    corners: tuple[Corner, ...] = ()
    sd_t: float = 0.0
    sds: Floats | None = None

    def simulated(self, u: Floats) -> Floats:
        """Return the section (k, 2) m of the deformed wall with the image plane."""
        return self.wall.section(u, self.pose)

    def measured(self, t: float) -> Floats:
        """Return the outline (k, 2) m nearest in time."""
        return self.outlines[nearest_sample(self.t, t, self.name)]

    def _sd_at(self, *times: float) -> float:
        """m, the root mean square of the outlines nearest to times s."""
        if self.sds is None:
            return self.sd
        return rms([float(self.sds[nearest_sample(self.t, t, self.name)]) for t in times])

    def rows(self) -> Rows | None:
        return None

    def along_normals(self, count: int) -> "NormalDistances":
        """How far the outline moved along the wall's normals at `count` places of the rest section,
        evenly in polar angle; to first order what the wall's own displacement along them is."""
        still = self.simulated(np.zeros((self.wall.rows.weights.shape[1], 3)))
        places = ray_points(still, np.linspace(0, 2 * np.pi, count, endpoint=False))
        places, across = at_normals(still, places)
        rows = self.wall.rows_at(from_image(self.pose, places))
        directions = across @ self.pose[:3, :2].T
        away = np.array([normal_distances(o, places) for o in self.outlines])
        moved = away - normal_distances(self.measured(self.rest), places)
        sds = np.full(len(self.t), self.sd) if self.sds is None else self.sds
        sd = float(np.hypot(rms(sds), self._sd_at(self.rest)))
        return NormalDistances(Rows(rows, np.zeros(count)), directions, moved, sd)

    @property
    def units(self) -> Mapping[str, str]:
        lengths = ("contour", "contour.material", "contour.centroid")
        return {
            **dict.fromkeys((*lengths, *(c.quantity for c in self.corners)), "m"),
            "contour.area": "m2",
        }

    def unanswered(self, run: Simulated) -> tuple[str, ...]:
        return ()

    def left(self, run: Simulated) -> Floats:
        """Simulated section less measured outline at its points' polar angles, flat (2 k,) m."""
        pairs = zip(self.t.tolist(), self.outlines, strict=True)
        off = [ray_points(self.simulated(field_at(run, t)), polar_angles(o)) - o for t, o in pairs]
        return np.concatenate(off).ravel()

    def history(self, run: Simulated) -> History:
        """Displacements since rest along the normals at places of the outline at rest, at equal
        polar angles about its centroid."""
        sections = [self.simulated(field_at(run, t)) for t in self.t.tolist()]
        still = self.simulated(field_at(run, self.rest)), self.measured(self.rest)
        simulated, measured = (
            along_normals(start, outlines, _ANGLES)
            for start, outlines in zip(still, (sections, self.outlines), strict=True)
        )
        return History(
            self.name, self.t, outline_places(_ANGLES), measured, simulated, "m", self.sd
        )

    def anew(self, left: Floats, draw: AnyDraw) -> "OutlineObservation":
        """Return the outlines where `left` (2 k,) m has them; clock and noise (along normals)
        drawn."""
        ends = np.cumsum([len(o) for o in self.outlines])[:-1]
        moves = np.split(left.reshape(-1, 2), ends)
        exact = [o + move for o, move in zip(self.outlines, moves, strict=True)]
        late = draw.lateness(self.sd_t)
        if late:
            exact = [o + late * self._velocity(exact, i) for i, o in enumerate(exact)]
        sds = np.full(len(exact), self.sd) if self.sds is None else self.sds
        pairs = zip(sds.tolist(), exact, strict=True)
        noisy = (o + draw.white(sd, (len(o), 1)) * normals(o) for sd, o in pairs)
        return replace(self, outlines=tuple(noisy))

    def _velocity(self, outlines: list[Floats], i: int) -> Floats:
        """m/s (k, 2) of the points of outline i, by those before and after."""
        before, after = max(i - 1, 0), min(i + 1, len(outlines) - 1)
        span = float(self.t[after] - self.t[before])
        angles = polar_angles(outlines[i])
        moved = ray_points(outlines[after], angles) - ray_points(outlines[before], angles)
        return moved / span if span > 0 else np.zeros_like(moved)

    def deviations(self, run: Simulated, selection: Selection) -> tuple[Deviation, ...]:
        """Of every instant: distance; where loaded also displacement, area, centroid, corners."""
        instants = selection.instants(run)
        times = np.asarray(instants.t)
        still = self.measured(self.rest)
        start = self.simulated(frame_at(run, Selection("rest", np.array([self.rest])))[0]), still
        sd_t = float(np.hypot(self.sd_t, selection.sd_t))
        found: list[Deviation] = []
        for t, u in zip(times, frame_at(run, instants), strict=True):
            one = self._between(start, (self.simulated(u), self.measured(float(t))), float(t))
            late = float(self.t[nearest_sample(self.t, float(t), self.name)] - t)
            off = float(np.hypot(sd_t, late)) if abs(late) > SAME else sd_t
            one = self._on_clock(one, float(t), off) if off > 0 else one
            found += [replace(d, t=np.full(len(d.values), t)) for d in one]
        # One deviation a quantity, over all instants; a scalar keeps its two values only alone.
        quantities = dict.fromkeys(d.quantity for d in found)
        groups = [[d for d in found if d.quantity == q] for q in quantities]
        return tuple(replace(g[0], t=None) if len(g) == 1 else merged(g) for g in groups)

    def _between(
        self, start: tuple[Floats, Floats], end: tuple[Floats, Floats], t: float
    ) -> list[Deviation]:
        own = replace(self, sd=self._sd_at(t))
        both = replace(self, sd=self._sd_at(self.rest, t))
        return [own._distance(*end), *(both._changes(start, end) if t != self.rest else [])]

    def _on_clock(self, found: list[Deviation], t: float, sd_t: float) -> list[Deviation]:
        """Speeds are what the same quantities make of the outlines before and after."""
        near = around(self.t, nearest_sample(self.t, t, self.name), sd_t)
        span = float(np.ptp(self.t[near])) or np.nan
        still, outlines = self.measured(self.rest), self.outlines[near]
        moved = self._between((still, still), (outlines[-1], outlines[0]), t)
        pairs = zip(found, moved, strict=True)
        return [with_clock(d, sd_t, m.values / span) for d, m in pairs]

    def _distance(self, simulated: Floats, measured: Floats) -> Deviation:
        apart = normal_distances(simulated, measured)[:, None]
        words = "distance of the simulated outline from each measured outline point, outward "
        about = np.linalg.norm(measured - enclosed(measured)[1], axis=1)[:, None]
        return Deviation("contour", apart, "m", self.sd, 0.0, words + "positive", reference=about)

    def _changes(self, start: tuple[Floats, Floats], end: tuple[Floats, Floats]) -> list[Deviation]:
        """What changed of the simulated and of the measured outline since rest."""
        moved = [_moved(a, b, _ANGLES) for a, b in zip(start, end, strict=True)]
        (area, centre), (true_area, true_centre) = enclosed(end[0]), enclosed(end[1])
        along, across = _noise((start[1], end[1]), _ANGLES)
        k, radius = len(end[1]), np.sqrt(true_area / np.pi)
        spread = self.sd * np.sqrt(2 / k)
        # Independent numbers of the same spread of their mean square (Satterthwaite 1946).
        freedom = max(1, int(np.trace(along) ** 2 / (along**2).sum()))
        return [
            Deviation(
                "contour.material", moved[0] - moved[1], "m",
                self.sd * float(np.sqrt((np.diag(along).mean() + across) / 2)), 0.0,
                "displacement of the outline at equal polar angle about its centroid, every 10 "
                "deg", freedom=freedom, reference=moved[1],
            ),
            *(self._corner(c, start, end) for c in self.corners),
            Deviation(
                "contour.area", np.array([[area - true_area]]), "m2",
                self.sd * 2 * np.pi * radius / np.sqrt(k), 0.0, "area inside the outline",
                area, true_area,
            ),
            Deviation(
                "contour.centroid", (centre - true_centre)[None], "m", spread, 0.0,
                "centroid of the area inside the outline",
            ),
        ]  # fmt: skip

    def _corner(
        self, corner: Corner, start: tuple[Floats, Floats], end: tuple[Floats, Floats]
    ) -> Deviation:
        angle = np.array([corner.angle])
        ways = [_moved(a, b, angle) for a, b in zip(start, end, strict=True)]
        simulated, measured = (float(np.linalg.norm(way)) for way in ways)
        off = np.array([[simulated - measured]])
        along, across = _noise((start[1], end[1]), angle)
        ray = np.array([np.cos(corner.angle), np.sin(corner.angle)])
        share = min((float(ways[1][0] @ ray) / max(measured, _TINY)) ** 2, 1.0)
        sd = self.sd * float(np.sqrt(share * along[0, 0] + (1 - share) * across))
        return Deviation(corner.quantity, off, "m", sd, 0.0, corner.words, simulated, measured)

    @classmethod
    def of(
        cls,
        contours: Contours,
        wall: SurfaceSampler,
        rest: float,
        *,
        name: str = "outline",
        role: Role = "validates",
        corners: tuple[Corner, ...] = (),
        sd_t: float = 0.0,
    ) -> Self:
        """Register outlines; raises `RegistrationError` for an improper pose."""
        require_rigid(contours.pose, "outline")
        return cls(
            name,
            role,
            contours.t,
            contours.outlines,
            contours.pose,
            contours.sd,
            wall,
            rest,
            corners,
            sd_t,
            None if contours.each is None else contours.each[:, 0],
        )


@dataclass(frozen=True)
class NormalDistances:
    """Displacements z (nt, m) m of an outline along unit `normals` (m, 3), of standard deviation
    sd m; `rows` read the places from nodal values."""

    rows: Rows
    normals: Floats
    z: Floats
    sd: float

    @property
    def H(self) -> sparse.csr_array:
        """What reads z from nodal displacements (3 n,), node by node: (m, 3 n)."""
        each = [
            sparse.kron(self.rows.weights[[i]], self.normals[[i]]) for i in range(len(self.normals))
        ]
        return sparse.csr_array(sparse.vstack(each))


def _moved(start: Floats, end: Floats, angles: Floats) -> Floats:
    return angular_points(end, angles) - angular_points(start, angles)


def _noise(outlines: Iterable[Floats], angles: Floats) -> tuple[Floats, float]:
    """Variances of a displacement over that of the outlines' points, whose noise lies along the
    normal, taken to be the ray's: covariance (a, a) along the rays, and variance across, which the
    centroids have."""
    found = [angular_weights(outline, angles) for outline in outlines]
    along = np.sum([w @ w.T for w in found], axis=0)
    return np.asarray(along), sum(2 / w.shape[1] for w in found)


def merged(group: list[Deviation]) -> Deviation:
    """Deviations of one quantity as one."""
    values = np.vstack([d.values for d in group])
    first = group[0]
    systematic = rms([d.systematic for d in group])
    freedom = None if first.freedom is None else sum(d.freedom or 0 for d in group)
    truths = [d.reference for d in group if d.reference is not None]
    reference = np.vstack(truths) if len(truths) == len(group) else None
    times = [d.t for d in group if d.t is not None]
    return Deviation(
        first.quantity, values, first.unit, rms([d.sd for d in group]), systematic,
        first.definition, freedom=freedom, reference=reference,
        t=np.concatenate(times) if len(times) == len(group) else None,
    )  # fmt: skip
