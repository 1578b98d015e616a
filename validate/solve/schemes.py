"""Every scheme there is. A new one is one file beside this and its name here."""

from validate.solve.central import CentralDifference
from validate.solve.explicit_linear import ExplicitLinear
from validate.solve.fluid import ExactPressure, NoFluid, PressureLoop
from validate.solve.implicit import NewtonDynamics
from validate.solve.modal import Modal
from validate.solve.newmark import Newmark
from validate.solve.newton import StaticNewton
from validate.solve.quasi_static import QuasiStatic
from validate.solve.tabulated import Tabulated
from validate.solve.types import Scheme

# Linear schemes of drives and cavities.
LINEAR: tuple[type[Scheme], ...] = (NoFluid, ExactPressure, PressureLoop)

# Linear schemes of drives and loads, without cavities.
INERTIAL: tuple[type[Scheme], ...] = (QuasiStatic, Newmark, Modal, ExplicitLinear)

# Dynamics at large strain of drives and loads, without cavities.
LARGE_INERTIAL: tuple[type[Scheme], ...] = (CentralDifference, NewtonDynamics)

SCHEMES: tuple[type[Scheme], ...] = (
    *LINEAR,
    StaticNewton,
    Tabulated,
    *INERTIAL,
    *LARGE_INERTIAL,
)
