"""References of a ladder: solvers without error in time, and pairs of laws.

Its candidates are those that schemes declare (`SCHEMES.candidates`).
"""

from collections.abc import Callable
from typing import Any

from validate.pipeline.ladder.ladder import LawPair
from validate.scene.material import LawName
from validate.solve.dynamic.implicit import NewtonDynamics
from validate.solve.dynamic.modal import Modal
from validate.solve.dynamic.newmark import Newmark
from validate.solve.fluid.cavities import ExactPressure
from validate.solve.static.newton import StaticNewton
from validate.solve.static.quasi_static import QuasiStatic
from validate.solve.types import Scheme

_MODES = 60  # of the reference, beside the statics of the rest

# --- with inertia ---------------------------------------------------------------------------------


def exact_in_time(dt: float) -> Scheme:
    """Without error for loads that stand still within a step."""
    return Modal(dt, modes=_MODES, propagate="constant")


def exact_in_ramps(dt: float) -> Scheme:
    """Without error for loads that change linearly within a step."""
    return Modal(dt, modes=_MODES, propagate="linear")


def swinging_pair(element: str, level: int, dt: float, law: LawName = "neo_hooke") -> LawPair:
    """Average acceleration of the linear law and at large strain."""
    return LawPair(element, level, dt, implicit(), _newton_dynamics, law)


def implicit(**settings: Any) -> Callable[[float], Scheme]:
    return lambda dt: Newmark(dt, **settings)


def _newton_dynamics(dt: float) -> Scheme:
    return NewtonDynamics(dt, mass="consistent")


# --- without --------------------------------------------------------------------------------------


def still_best(cavities: bool) -> Callable[[float], Scheme]:
    """Return the linear solver without error: superposition, with the root of the fluid's
    pressure."""
    return lambda dt: ExactPressure() if cavities else QuasiStatic()


def still_pair(
    element: str, level: int, dt: float, cavities: bool, law: LawName = "neo_hooke"
) -> LawPair:
    """Linear statics and Newton's at large strain."""
    return LawPair(element, level, dt, still_best(cavities), lambda dt: StaticNewton(), law)
