"""Landmarks touched by a stylus, against the pose of all others: path of the tip, observation."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from validate.arrays import Floats, Ints, rms
from validate.errors import RegistrationError
from validate.fem.assembly.locate import Rows
from validate.register.observation import AnyDraw, Deviation, Role, Selection, Simulated
from validate.register.tools.landmarks import Digitised


def tip_path(
    names: tuple[str, str],
    stylus: tuple[Floats, Floats],
    reference: tuple[Floats, Floats] | None,
    tip: Floats,
) -> tuple[Floats, Floats]:
    """Times (n,) s and places (n, 3) m of a stylus' tip (3,) m, in the reference's frame.

    `stylus` and `reference` are times and 3 x 4 poses (n, 3, 4) in a tracker's frame; without a
    reference the stylus' own frame is taken. Only times at which both were seen are kept. Raises
    `RegistrationError` where there are none.
    """
    t, T = stylus
    x = T[:, :, :3] @ tip + T[:, :, 3]
    if reference is None:
        return t, x
    at, i, j = np.intersect1d(np.rint(1e9 * t), np.rint(1e9 * reference[0]), return_indices=True)
    if not len(at):
        raise RegistrationError(
            f"'{names[0]}' and '{names[1]}' are never visible at the same time: 0 of {len(t)} and "
            f"{len(reference[0])} frames"
        )
    R = reference[1][j]
    local = np.linalg.solve(R[:, :, :3], (x[i] - R[:, :, 3])[..., None])[..., 0]
    return t[i], np.asarray(local, dtype=np.float64)


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
                      reference=about, t=self.t[at], axes=tuple("xyz")),
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
