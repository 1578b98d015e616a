"""Every filter there is. A new one is one file beside this and its name here."""

from typing import ClassVar, Protocol

from validate.estimate.ensemble_kf import EnsembleKf
from validate.estimate.filterpy_guest import FilterpyGuest
from validate.estimate.kf_fem import KfFem
from validate.estimate.load_scale import LoadScale
from validate.estimate.measurements import Measurements
from validate.estimate.modal_kf import ModalKf
from validate.estimate.node_ekf import NodeEKF
from validate.estimate.reduced_ekf import ReducedEKF
from validate.estimate.reduced_kf import ReducedKf
from validate.estimate.roukf import Roukf
from validate.fem.system import System
from validate.solve.handles import Handles
from validate.solve.types import Stepper


class Filter(Protocol):
    """Settings of a filter: it sees a system and its measurements, never the truth."""

    handles: ClassVar[Handles]

    def prepare(self, system: System, measurements: Measurements) -> Stepper: ...


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
