"""Registry of schemes: built-in ones, plug-ins and those of scripts.

A new one of the package is one file beside this and its name here.

What a scheme declares in its class (`handles`, `steppings`, `candidates`) is all that the stability
study, the ladders and `choose` know of it.
"""

from collections.abc import Callable

from validate.plugins import Registry, settings_faults
from validate.scene.mesh import Kind
from validate.solve.dynamic.implicit import FromEquilibrium, NewtonDynamics
from validate.solve.dynamic.modal import Modal
from validate.solve.dynamic.newmark import Newmark
from validate.solve.dynamic.release import LetGo
from validate.solve.dynamic.viscous_modes import ViscousModes
from validate.solve.explicit.central import CentralDifference
from validate.solve.explicit.linear import ExplicitLinear
from validate.solve.external.scheme import ExternalLetGo, ExternalSimulator
from validate.solve.fluid.cavities import ElasticPressure, ExactPressure, NoFluid, PulsePressure
from validate.solve.fluid.pressure_loop import PressureLoop
from validate.solve.handles import Handles, handles_faults
from validate.solve.haptic.loop import HapticLoop
from validate.solve.haptic.needle import NeedleLoop
from validate.solve.regions.krylov import TouchedKrylov
from validate.solve.regions.scheme import AsyncRegions
from validate.solve.static.contact import ContactNewton
from validate.solve.static.load_table import Tabulated
from validate.solve.static.newton import StaticNewton
from validate.solve.static.proportional import Proportional
from validate.solve.static.quasi_static import QuasiStatic
from validate.solve.static.stretch_test import StretchTest
from validate.solve.static.without_mechanics import Harmonic, RigidMotion
from validate.solve.study_entries import RUNGS, Rival, Stepping, StudyBody
from validate.solve.types import SceneSolver, Scheme

_OWN: tuple[type[Scheme], ...] = (
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


class Schemes(Registry[type[Scheme]]):
    """The schemes, with what studies ask all of them."""

    def candidates(self, asked: StudyBody) -> tuple[Rival, ...]:
        """Return the candidates that schemes declare for such a body, by their rung: what ladders
        climb."""
        none: tuple[Rival, ...] = ()

        def declared(scheme: type[Scheme]) -> tuple[Rival, ...]:
            return tuple(scheme.candidates(asked)) if hasattr(scheme, "candidates") else none

        found = [c for scheme in self for c in self.answer(scheme, declared, none)]
        return tuple(sorted(found, key=lambda c: RUNGS.index(c.rung)))


SCHEMES = Schemes(
    "schemes",
    _OWN,
    lambda scheme: scheme.__name__,
    lambda part: settings_faults(part, "prepare") or handles_faults(part),
    lambda part: not hasattr(part, "solve"),
)

# What solves a whole scene at once.
SOLVERS: Registry[type[SceneSolver]] = Registry(
    "schemes",
    (
        StretchTest,
        RigidMotion,
        Proportional,
        ViscousModes,
        LetGo,
        Harmonic,
        ExternalSimulator,
        ExternalLetGo,
    ),
    lambda solver: solver.__name__,
    lambda part: settings_faults(part) or handles_faults(part),
    lambda part: hasattr(part, "solve"),
)


def schemes_that(handle: Callable[[Handles], bool]) -> tuple[type[Scheme], ...]:
    """Return the schemes whose `handles` pass, in order."""
    return tuple(scheme for scheme in SCHEMES if handle(scheme.handles))


def steppings() -> tuple[Stepping, ...]:
    """Return the step maps that schemes declare, in order: what stability studies map."""
    none: tuple[Stepping, ...] = ()

    def declared(scheme: type[Scheme]) -> tuple[Stepping, ...]:
        return tuple(getattr(scheme, "steppings", tuple)())

    return tuple(s for scheme in SCHEMES for s in SCHEMES.answer(scheme, declared, none))


def steppings_for(kind: Kind) -> tuple[Stepping, ...]:
    """Those that know such meshes."""
    return tuple(s for s in steppings() if not s.kinds or kind in s.kinds)
