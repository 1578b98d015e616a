"""Registry of filters: built-in ones, plug-ins and those of scripts.

A new one of the package is one file beside this and its name here.
"""

from typing import ClassVar, Protocol

from validate.arrays import Floats
from validate.estimate.ensemble.ensemble_kf import EnsembleKf
from validate.estimate.ensemble.roukf import Roukf
from validate.estimate.extended.node_ekf import NodeEKF
from validate.estimate.filterpy.filters import FilterpyFilter
from validate.estimate.gating import NoiseSettings
from validate.estimate.kalman.coordinates import Batch
from validate.estimate.kalman.kf_fem import KfFem
from validate.estimate.kalman.modal_kf import ModalKf
from validate.estimate.measurements import Measurements
from validate.estimate.reduced.load_scale import LoadScale
from validate.estimate.reduced.reduced_ekf import ReducedEKF
from validate.estimate.reduced.reduced_kf import ReducedKf
from validate.fem.system import System
from validate.plugins import Registry, settings_faults
from validate.solve.handles import Handles, handles_faults
from validate.solve.types import Stepper


class FilterStepper(Stepper, Protocol):
    """A prepared filter: it tells what it was given, steps, and may filter many recordings."""

    @property
    def offered(self) -> Measurements:
        """The measurements that it was given."""
        ...

    def batch(self, inputs: Floats, z: Floats, rows: Floats) -> Batch | None:
        """Filter z (seeds, nt, m) m of the components of `offered`, NaN = missing, by step of
        inputs (nt, k); `rows` (p, N) read the estimates. None where it cannot."""
        ...


class Filter(Protocol):
    """Settings of a filter: it sees a system and its measurements, never the truth."""

    handles: ClassVar[Handles]
    noise_settings: ClassVar[NoiseSettings]

    def prepare(self, system: System, measurements: Measurements) -> FilterStepper: ...


_OWN: tuple[type[Filter], ...] = (
    KfFem,
    ModalKf,
    ReducedKf,
    LoadScale,
    FilterpyFilter,
    NodeEKF,
    ReducedEKF,
    Roukf,
    EnsembleKf,
)
FILTERS: Registry[type[Filter]] = Registry(
    "filters",
    _OWN,
    lambda filter_: filter_.__name__,
    lambda part: settings_faults(part, "noise_settings", "prepare") or handles_faults(part),
)
