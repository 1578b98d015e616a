"""Outlines in an image plane, against the section of the deformed wall with that plane."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from validate.arrays import Floats, rms
from validate.fem.assembly.locate import Rows
from validate.recording.types import Contours
from validate.register.clocks import SAME, around, with_clock
from validate.register.draws import AnyDraw
from validate.register.observation import (
    Deviation,
    History,
    Role,
    Selection,
    Simulated,
    field_at,
    frame_at,
    nearest_sample,
)
from validate.register.outlines.distances import (
    EVERY_TEN,
    along_normals,
    angular_points,
    angular_weights,
    at_normals,
    enclosed,
    normal_distances,
    normals,
    outline_places,
    polar_angles,
    ray_points,
)
from validate.register.outlines.plane import SurfaceSampler, from_image, require_rigid, section

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
        return section(self.wall.deformed(u), self.wall.triangles, self.pose)

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
        return _stacked(found)

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
        return [
            Deviation(
                "contour.material", moved[0] - moved[1], "m",
                self.sd * float(np.sqrt((np.diag(along).mean() + across) / 2)), 0.0,
                "displacement of the outline at equal polar angle about its centroid, every 10 "
                "deg", freedom=_freedom(along), reference=moved[1],
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


def _freedom(along: Floats) -> int:
    """Independent numbers of the same spread of their mean square (Satterthwaite 1946)."""
    return max(1, int(np.trace(along) ** 2 / (along**2).sum()))


def _stacked(found: list[Deviation]) -> tuple[Deviation, ...]:
    """One deviation a quantity, over all instants; a scalar keeps its two values only alone."""
    quantities = dict.fromkeys(d.quantity for d in found)
    groups = [[d for d in found if d.quantity == q] for q in quantities]
    return tuple(replace(g[0], t=None) if len(g) == 1 else merged(g) for g in groups)


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


def observe_outlines(
    contours: Contours,
    wall: SurfaceSampler,
    rest: float,
    *,
    name: str = "outline",
    role: Role = "validates",
    corners: tuple[Corner, ...] = (),
    sd_t: float = 0.0,
) -> OutlineObservation:
    """Outlines with their pose checked; raises `RegistrationError` for an improper pose."""
    require_rigid(contours.pose, "outline")
    return OutlineObservation(
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
