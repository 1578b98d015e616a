"""Landmarks of a rigid body that a tracked tip was held on: its pose, and each landmark predicted
from the others.

What the pose was fitted on is no evidence of it. Left out one by one, every landmark is.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from validate.arrays import Floats, Ints, rms
from validate.fem.locate import Rows
from validate.register.draws import AnyDraw
from validate.register.dwell import Dwell
from validate.register.landmarks import Match
from validate.register.measures import target_covariance
from validate.register.observation import Deviation, Role, Selection, Simulated
from validate.register.transform import Similarity, fit_rigid


@dataclass(frozen=True)
class Digitised:
    """The path of a tip t (n,) s, x (n, 3) m, its dwells, the `parts` of them that count, and which
    of them is which of the landmarks `names` (k,) at `known` (k, 3) m; `sd` m of a place, per axis.
    """

    t: Floats
    x: Floats
    dwells: tuple[Dwell, ...]
    parts: tuple[Dwell, ...]
    names: tuple[str, ...]
    known: Floats
    match: Match
    sd: float

    @property
    def touched(self) -> tuple[str, ...]:
        """Names of the landmarks that were touched, in the order of the list."""
        return tuple(self.names[i] for i in self.match.known)

    @property
    def body(self) -> Floats:
        """The touched landmarks (m, 3) m in the body's frame."""
        return np.asarray(self.known[self.match.known])

    @property
    def places(self) -> Floats:
        """Where they were touched (m, 3) m."""
        return np.array([self.parts[i].centre for i in self.match.seen])

    @property
    def pose(self) -> Similarity:
        """T_frame_from_body of all touched landmarks."""
        return fit_rigid(self.body, self.places)

    @property
    def residuals(self) -> Floats:
        """Fitted less touched (m, 3) m."""
        return np.asarray(self.pose.apply(self.body) - self.places)

    @property
    def without(self) -> tuple[Similarity, ...]:
        """T_frame_from_body without each landmark in turn."""
        all_of = range(len(self.body))
        kept = [[j for j in all_of if j != i] for i in all_of]
        return tuple(fit_rigid(self.body[k], self.places[k]) for k in kept)

    @property
    def left_out(self) -> Floats:
        """Predicted from the others less touched (m, 3) m."""
        at = zip(self.without, self.body, self.places, strict=True)
        return np.array([T.apply(x) - place for T, x, place in at])

    @property
    def expected(self) -> Floats:
        """Standard deviation (m,) m per axis of what is left out: its place's, and the pose's."""
        found = []
        for i, point in enumerate(self.body):
            others = np.delete(self.body, i, axis=0)
            pose = target_covariance(point[None], others, float(np.sqrt(3)) * self.sd)[0]
            found.append(np.sqrt(self.sd**2 + np.trace(pose) / 3))
        return np.array(found)

    def moved(self, by: Floats) -> "Digitised":
        """With every landmark touched `by` (m, 3) m elsewhere."""
        parts = list(self.parts)
        for i, off in zip(self.match.seen, by, strict=True):
            parts[i] = replace(parts[i], x=parts[i].x + off)
        return replace(self, parts=tuple(parts))

    @property
    def poses(self) -> Floats:
        """The poses without each landmark (m, 6): rotation vector rad, translation m."""
        return np.array([[*Rotation.from_matrix(T.R).as_rotvec(), *T.t] for T in self.without])


@dataclass(frozen=True)
class TouchedLandmarks:
    """Every touched landmark at the instant t (m,) s of its own pose, against the run's."""

    digitised: Digitised
    t: Floats
    name: str = "landmark"
    role: Role = "validates"

    @property
    def units(self) -> Mapping[str, str]:
        return {self.name: "m"}

    def deviations(self, run: Simulated, selection: Selection) -> tuple[Deviation, ...]:
        d = self.digitised
        at = selection.samples(self.t, run.t, self.name)
        words = "predicted from all other landmarks minus touched, along the frame's axes"
        off = self._shown(run, at) - d.places[at]
        # Every pose has six numbers of all landmarks: so many of the differences are not free.
        freedom = max(off.size - 6, 1)
        about = d.places[at] - d.places.mean(axis=0)
        return (
            Deviation(self.name, off, "m", rms(d.expected), 0.0, words, freedom=freedom,
                      reference=about),
        )  # fmt: skip

    def left(self, run: Simulated) -> Floats:
        """Where the run has each landmark less where it was touched, flat (m 3,) m."""
        off = self._shown(run, np.arange(len(self.t))) - self.digitised.places
        return np.asarray(off.ravel())

    def anew(self, left: Floats, draw: AnyDraw) -> "TouchedLandmarks":
        """Touched where `left` (m 3,) m has them. A landmark's noise is drawn once: it moves its
        own place and the poses that predict all others."""
        exact = self.digitised.moved(self.digitised.residuals)  # as a rigid body has them
        noise = draw.white(self.digitised.sd, exact.places.shape)
        off = left.reshape(noise.shape) - exact.moved(noise).left_out
        return replace(self, digitised=self.digitised.moved(off))

    def _shown(self, run: Simulated, at: Ints) -> Floats:
        """Places (k, 3) m of some landmarks, each at the instant of its own pose."""
        steps = np.searchsorted(run.t, self.t[at])
        names = [self.digitised.touched[i] for i in at]
        pairs = list(zip(names, steps, strict=True))
        return np.array([[run.traces[f"{n}.{a}"].y[step] for a in "xyz"] for n, step in pairs])

    def unanswered(self, run: Simulated) -> tuple[str, ...]:
        return tuple(n for n in self.digitised.touched if f"{n}.x" not in run.traces)

    def rows(self) -> Rows | None:
        return None
