"""Every filter there is. A new one is one file beside this and its name here."""

from typing import ClassVar, Protocol

from validate.arrays import Floats
from validate.estimate.batch import Batch
from validate.estimate.ensemble_kf import EnsembleKf
from validate.estimate.filterpy_guest import FilterpyGuest
from validate.estimate.kf_fem import KfFem
from validate.estimate.load_scale import LoadScale
from validate.estimate.measurements import Measurements
from validate.estimate.modal_kf import ModalKf
from validate.estimate.node_ekf import NodeEKF
from validate.estimate.noise_settings import NoiseSettings
from validate.estimate.reduced_ekf import ReducedEKF
from validate.estimate.reduced_kf import ReducedKf
from validate.estimate.roukf import Roukf
from validate.fem.system import System
from validate.solve.handles import Handles
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


FILTERS: tuple[type[Filter], ...] = (
    KfFem,
    ModalKf,
    ReducedKf,
    LoadScale,
    FilterpyGuest,
    NodeEKF,
    ReducedEKF,
    Roukf,
    EnsembleKf,
)
LINEAR_FILTERS = tuple(f for f in FILTERS if "linear" in f.handles.law)
EXPLICIT_FILTERS = tuple(f for f in FILTERS if set(f.handles.law) != {"linear"})
