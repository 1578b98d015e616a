"""Reduced-order unscented Kalman filter: sigma points in the space of parameters alone.

Every sigma point is a run of the same model with stiffness, loads or supports of its own; states
are uncertain only through them (Moireau & Chapelle 2011). p parameters cost p + 1 runs. Parameters
are constant in time: the filter listens less and less, and where the truth is of another kind than
the model it is confidently wrong: NIS far above 1 is then the alarm.
"""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from scipy.linalg import helmert, solve, solve_triangular

from validate.arrays import Floats
from validate.estimate.ensemble.member_filter import HANDLES, MemberModel, MemberStepper, sight
from validate.estimate.gating import NoiseSettings
from validate.estimate.kalman.formulas import Corrected, best_gain, innovation
from validate.estimate.measurements import Measurements
from validate.fem.system import System
from validate.parameters import quantity
from validate.solve.handles import Handles, require_handled

# --- The reduced-order unscented filter's formulas: sigma points in the space of parameters
# alone.
#
# The whole state is uncertain only through p parameters, so that P = L L^T has rank p: sigma
# points are runs Z_i = mean + L I_i of unit points I_i with mean 0 and covariance 1, and so many
# runs as unit points carry the covariance, without any tangent (Moireau & Chapelle 2011, ESAIM:
# Control, Optimisation and Calculus of Variations 17, 380-405, sections 2 and 3).
#
# Departures: points of equal weight alone. With fewer measurements than parameters S_yy is solved
# instead of the paper's U; both are equal (Woodbury).

SigmaName = Literal["simplex", "canonical"]


def unit_points(name: SigmaName, p: int) -> Floats:
    """(s, p) of equal weight 1/s: p + 1 corners of a regular simplex, or 2 p on the axes."""
    if name == "simplex":
        return np.asarray(np.sqrt(p + 1) * helmert(p + 1).T)
    axes = np.sqrt(p) * np.eye(p)
    return np.vstack([axes, -axes])


def spread(Z: Floats, unit: Floats) -> Floats:
    """L (n, p) of members Z (s, n) at unit points (s, p): P = L L^T."""
    return np.asarray((Z - Z.mean(axis=0)).T @ unit / len(unit))


def reduced_update(Z: Floats, seen: Floats, z: Floats, R: Floats, unit: Floats) -> Corrected:
    """Members Z (s, n), of which `seen` (s, m) would be measured, corrected by z (m,), NaN =
    missing, of noise R (m, m): new points about the new mean."""
    L, Ly, i = spread(Z, unit), spread(seen, unit), np.isfinite(z)
    gain = best_gain(L @ Ly.T, Ly @ Ly.T + R, tuple(i.tolist()))
    found = innovation(z, seen.mean(axis=0), gain)
    U = np.eye(unit.shape[1]) + Ly[i].T @ solve(R[np.ix_(i, i)], Ly[i], assume_a="pos")
    narrowed = solve_triangular(np.linalg.cholesky(U).T, np.eye(len(U)))  # T T^T = U^-1
    mean = Z.mean(axis=0) + gain.G @ found.y[i]
    return Corrected(mean + unit @ (L @ narrowed).T, found)


# -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Roukf(MemberModel):
    """`points`: p + 1 runs of a simplex, or 2 p runs on the axes."""

    handles: ClassVar[Handles] = HANDLES
    noise_settings: ClassVar[NoiseSettings] = NoiseSettings("", "R", "sd")

    points: SigmaName = quantity("simplex", "1", "sigma points of p parameters: p + 1, or 2 p")

    def prepare(self, system: System, measurements: Measurements) -> MemberStepper:
        """Raise `SceneError` for what no member can step, `UsageError` for parameters that the
        scene does not have, `ComparisonError` for measurements off the steps."""
        require_handled(system.scene, self)
        members = self.members(system)
        sd = members.doubts.sd
        analysis = SigmaRuns(unit_points(self.points, len(sd)), sd)
        looks = sight(self, members, measurements)
        return MemberStepper(self, members, analysis, looks, self.limit(system))


@dataclass(frozen=True)
class SigmaRuns:
    """unit (s, p), sd (p,) at the start."""

    unit: Floats
    sd: Floats

    @property
    def degrees(self) -> int:
        return len(self.unit)

    def start(self) -> Floats:
        return self.unit * self.sd

    def walked(self, x: Floats, number: int) -> Floats:
        return x

    def claimed(self, seen: Floats) -> Floats:
        Ly = spread(seen, self.unit)
        return Ly @ Ly.T

    def corrected(self, Z: Floats, seen: Floats, z: Floats, R: Floats, number: int) -> Corrected:
        return reduced_update(Z, seen, z, R, self.unit)
