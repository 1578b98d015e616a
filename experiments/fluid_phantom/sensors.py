"""Simulated sensors of the phantom's twin: stage, segmented outline and pen, with their noise."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from validate.arrays import Floats
from validate.fem.assembly.locate import Rows
from validate.recording.types import Contours, Markers
from validate.register.outlines.sections import SurfaceSampler
from validate.scene.mesh import Mesh


@dataclass(frozen=True)
class StageProfile:
    """Ramps between loads m at `speed` m/s, held `hold` s at each, sampled at `rate` Hz."""

    loads: tuple[float, ...]
    speed: float
    hold: float
    rate: float

    def positions(self) -> tuple[Floats, Floats, Floats]:
        """t (nt,) s, stage (nt,) m, and the middle of every hold (h,) s."""
        corners_t, corners_q, middles = [0.0], [self.loads[0]], []
        for load in self.loads:
            corners_t.append(corners_t[-1] + abs(load - corners_q[-1]) / self.speed)
            corners_t.append(corners_t[-1] + self.hold)
            corners_q += [load, load]
            middles.append(corners_t[-1] - self.hold / 2)
        t = np.arange(round(corners_t[-1] * self.rate) + 1) / self.rate
        return t, np.interp(t, corners_t, corners_q), np.round(np.array(middles), 6)


@dataclass(frozen=True)
class OutlineSensor:
    """Segmented outlines: points per outline, sd m along the normal, its pose in `frame`."""

    pose: Floats
    points: int
    sd: float
    frame: str

    def measure(
        self, t: Floats, u: Floats, wall: SurfaceSampler, rng: np.random.Generator
    ) -> Contours:
        """One outline per field of u (nt, n, d) m, at times t (nt,) s."""
        outlines = tuple(self._segmented(wall.section(ui, self.pose), rng) for ui in u)
        return Contours(t, outlines, self.sd, self.pose, self.frame)

    def _segmented(self, outline: Floats, rng: np.random.Generator) -> Floats:
        closed = np.vstack([outline, outline[:1]])
        length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
        s = length[-1] * (np.arange(self.points) + rng.uniform()) / self.points
        places = np.stack([np.interp(s, length, c) for c in closed.T], axis=1)
        step = length[-1] / self.points
        ahead, behind = (
            np.stack([np.interp((s + d) % length[-1], length, c) for c in closed.T], axis=1)
            for d in (step, -step)
        )
        tangent = (ahead - behind) / np.linalg.norm(ahead - behind, axis=1, keepdims=True)
        normal = np.stack([tangent[:, 1], -tangent[:, 0]], axis=1)
        return np.asarray(places + self.sd * rng.standard_normal((self.points, 1)) * normal)


@dataclass(frozen=True)
class Pen:
    """A digitising pen: tip error and placing by hand, sd m per axis, own frame (Euler deg, m)."""

    sd_tip: float
    sd_hand: float
    turn: tuple[float, float, float]
    shift: tuple[float, float, float]

    @property
    def sd(self) -> float:
        return float(np.hypot(self.sd_tip, self.sd_hand))

    @property
    def rotation(self) -> Floats:
        """R (3, 3): scene directions in the pen's frame."""
        return np.asarray(Rotation.from_euler("xyz", self.turn, degrees=True).as_matrix())

    def direction(self, d: tuple[float, float, float]) -> Floats:
        """Return a direction (3,) of the scene in the pen's frame."""
        return np.asarray(self.rotation @ np.array(d))

    def measure(
        self,
        t: Floats,
        u: Floats,
        mesh: Mesh,
        layout: Mapping[str, Floats],
        rng: np.random.Generator,
    ) -> Markers:
        """Every marker of the layout (3,) m under each field of u (nt, n, d) m, in its frame."""
        rest = np.array(list(layout.values()))
        rows = Rows.barycentric(mesh, rest)
        x = np.array([rest + rows.apply(ui) for ui in u])
        x = x + self.sd_tip * rng.standard_normal(x.shape)
        x = x + self.sd_hand * rng.standard_normal(x.shape)
        return Markers(t, tuple(layout), x @ self.rotation.T + np.array(self.shift), self.sd, "pen")
