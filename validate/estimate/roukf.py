"""Reduced-order unscented Kalman filter: sigma points in the space of parameters alone.

Every sigma point is a run of the same model with stiffness, loads or supports of its own; states
are uncertain only through them (Moireau & Chapelle 2011). p parameters cost p + 1 runs. Parameters
are constant in time: the filter listens less and less, and where the truth is of another kind than
the model it is confidently wrong: NIS far above 1 is then the alarm.
"""

from dataclasses import dataclass
from typing import ClassVar

from validate.arrays import Floats
from validate.estimate.measurements import Measurements
from validate.estimate.member_filter import HANDLES, MemberModel, MemberStepper, sight
from validate.estimate.noise_settings import NoiseSettings
from validate.estimate.reduced_unscented import SigmaName, reduced_update, spread, unit_points
from validate.estimate.sampled_kalman import Corrected
from validate.fem.system import System
from validate.parameters import quantity
from validate.solve.handles import Handles, require_handled


@dataclass(frozen=True)
class Roukf(MemberModel):
    """`points`: p + 1 runs of a simplex, or 2 p runs on the axes."""

    handles: ClassVar[Handles] = HANDLES
    noise_settings: ClassVar[NoiseSettings] = NoiseSettings("", "R", "sd")

    points: SigmaName = quantity("simplex", "1", "sigma points of p parameters: p + 1, or 2 p")

    def prepare(self, system: System, measurements: Measurements) -> MemberStepper:
        """Raises `SceneError` for what no member can step, `UsageError` for parameters that the
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
