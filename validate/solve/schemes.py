"""Every scheme there is. A new one is one file beside this and its name here.

What a scheme declares in its class (`handles`, `steppings`, `candidates`) is all that the stability
study, the ladders and `choose` know of it.
"""

from collections.abc import Callable

from validate.scene.mesh import Kind
from validate.solve.candidates import RUNGS, Asked, Rival
from validate.solve.central import CentralDifference
from validate.solve.contact import ContactNewton
from validate.solve.explicit_linear import ExplicitLinear
from validate.solve.fluid import ElasticPressure, ExactPressure, NoFluid
from validate.solve.from_equilibrium import FromEquilibrium
from validate.solve.guests.guest import Guest
from validate.solve.guests.let_go import GuestLetGo
from validate.solve.handles import Handles
from validate.solve.haptic_loop import HapticLoop
from validate.solve.harmonic import Harmonic
from validate.solve.implicit import NewtonDynamics
from validate.solve.let_go import LetGo
from validate.solve.modal import Modal
from validate.solve.needle import NeedleLoop
from validate.solve.newmark import Newmark
from validate.solve.newton import StaticNewton
from validate.solve.pressure_loop import PressureLoop
from validate.solve.proportional import Proportional
from validate.solve.pulse import PulsePressure
from validate.solve.quasi_static import QuasiStatic
from validate.solve.regions import AsyncRegions
from validate.solve.rigid_motion import RigidMotion
from validate.solve.stepping import Stepping
from validate.solve.stretch_test import StretchTest
from validate.solve.tabulated import Tabulated
from validate.solve.touched_krylov import TouchedKrylov
from validate.solve.types import SceneSolver, Scheme
from validate.solve.viscous_modes import ViscousModes

SCHEMES: tuple[type[Scheme], ...] = (
    NoFluid,
    ExactPressure,
    PressureLoop,
    ElasticPressure,
    PulsePressure,
    Tabulated,
    StaticNewton,
    Newmark,
    ExplicitLinear,
    CentralDifference,
    NewtonDynamics,
    Modal,
    QuasiStatic,
    FromEquilibrium,
    ContactNewton,
    NeedleLoop,
    AsyncRegions,
    HapticLoop,
    TouchedKrylov,
)

# What solves a whole scene at once.
SOLVERS: tuple[type[SceneSolver], ...] = (
    StretchTest,
    RigidMotion,
    Proportional,
    ViscousModes,
    LetGo,
    Harmonic,
    Guest,
    GuestLetGo,
)


def schemes_that(handle: Callable[[Handles], bool]) -> tuple[type[Scheme], ...]:
    """The schemes whose `handles` pass, in order."""
    return tuple(scheme for scheme in SCHEMES if handle(scheme.handles))


def steppings() -> tuple[Stepping, ...]:
    """The step maps that schemes declare, in order: what stability studies map."""
    return tuple(s for scheme in SCHEMES for s in getattr(scheme, "steppings", tuple)())


def steppings_for(kind: Kind) -> tuple[Stepping, ...]:
    """Those that know such meshes."""
    return tuple(s for s in steppings() if not s.kinds or kind in s.kinds)


def candidates(asked: Asked) -> tuple[Rival, ...]:
    """The candidates that schemes declare for such a body, by their rung: what ladders climb."""
    none = _no_candidates
    found = [c for scheme in SCHEMES for c in getattr(scheme, "candidates", none)(asked)]
    return tuple(sorted(found, key=lambda c: RUNGS.index(c.rung)))


def _no_candidates(asked: Asked) -> tuple[Rival, ...]:
    return ()


# Linear schemes of drives and cavities, and those of drives and loads.
LINEAR = schemes_that(lambda h: "linear" in h.law and h.cavities and "needle" not in h.contact)
INERTIAL = schemes_that(lambda h: h.law == ("linear",) and h.loads)

# Dynamics at large strain of drives and loads, without cavities.
LARGE_INERTIAL = schemes_that(lambda h: "linear" not in h.law and h.inertia and h.loads)

# Bodies that touch rigid ones.
TOUCHING = schemes_that(lambda h: "rigid" in h.contact)

# Bodies that a needle touches, whose path is given.
NEEDLES = schemes_that(lambda h: "needle" in h.contact)
