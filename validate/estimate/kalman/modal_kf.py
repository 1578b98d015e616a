"""KF-FEM in modal coordinates, where a covariance step needs no matrix product.

Newmark's transition is diagonal there, so P- = P * f f^T + Q takes one pass over P instead of two
dense products; with all modes the estimate equals KF-FEM's to rounding, white Q included (it is
dense in amplitudes: shapes are orthonormal in M, not in the unknowns).
"""

from dataclasses import dataclass

from validate.estimate.kalman.coordinates import InModes, in_modes
from validate.estimate.kalman.covariance import shared_gains
from validate.estimate.kalman.displacement_filter import DisplacementStepper
from validate.estimate.kalman.kf_fem import DisplacementNoise, Gains, modal_covariance, stepper_of
from validate.estimate.measurements import Measurements
from validate.fem.system import System
from validate.parameters import quantity
from validate.solve.dynamic.newmark_rule import Rule
from validate.solve.handles import require_handled


@dataclass(frozen=True)
class ModalKf(DisplacementNoise):
    """`gains`: "every_step" is the exact recursion as it goes, "shared" the same beforehand; with a
    gate or a doubtful clock, as it goes."""

    gains: Gains = quantity("every_step", "1", "computed in advance, or at every step")

    def prepare(self, system: System, measurements: Measurements) -> DisplacementStepper:
        """Raise `SceneError` for what linear schemes refuse and for damping that couples modes."""
        require_handled(system.scene, self)
        return self.with_modes(system, measurements, in_modes(system, Rule.of(self.rule, self.dt)))

    def with_modes(
        self, system: System, measurements: Measurements, modes: InModes
    ) -> DisplacementStepper:
        """`prepare` with modes that are known: many settings of one system share them."""
        covariance = modal_covariance(self, system, measurements, modes)
        beforehand = self.gains == "shared" and self.care(measurements) is None
        table = measurements.timetable(self.dt)
        gains = None
        if beforehand:
            gains = shared_gains(system, covariance, table, self.settled)
        return stepper_of(self, system, measurements, modes, covariance, modes, gains)
