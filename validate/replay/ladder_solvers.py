"""The solvers of a ladder: every scheme that knows a scene's kind, each by its rung."""

from collections.abc import Callable
from typing import Any

from validate.replay.ladder import LawPair, Rival
from validate.scene.material import LawName
from validate.solve.central import CentralDifference
from validate.solve.explicit_linear import ExplicitLinear
from validate.solve.fluid import ExactPressure, NoFluid
from validate.solve.implicit import NewtonDynamics
from validate.solve.modal import Modal
from validate.solve.newmark import Newmark
from validate.solve.newton import StaticNewton
from validate.solve.pressure_loop import PressureLoop
from validate.solve.quasi_static import QuasiStatic
from validate.solve.tabulated import Tabulated
from validate.solve.types import Scheme

# Of displacements in smooth fields.
ORDERS = {"H8": 2.0, "Q4": 2.0, "P1": 2.0, "MD": 2.0, "P2": 3.0}
_MODES = 60  # of the reference, beside the statics of the rest
_PARTS = 16  # explicit steps at large strain within one of the ladder's

# --- with inertia ---------------------------------------------------------------------------------


def exact_in_time(dt: float) -> Scheme:
    """Without error for loads that stand still within a step."""
    return Modal(dt, modes=_MODES, propagate="constant")


def exact_in_ramps(dt: float) -> Scheme:
    """Without error for loads that change linearly within a step."""
    return Modal(dt, modes=_MODES, propagate="linear")


def swinging(
    steps: tuple[float, ...], small: int, medium: int, law: LawName = "neo_hooke"
) -> tuple[Rival, ...]:
    """Every scheme of linear dynamics, and those of large strain on tetrahedra.

    Baselines that solve anew at every step run on meshes up to `small`, dense ones up to `medium`.
    """
    large: dict[str, Any] = {"law": law}
    return (
        Rival("quasi-static", "static superposition", lambda dt: QuasiStatic(), stepped=False),
        Rival("10 modes", "modal", _modal(10), stepped=False),
        Rival("40 modes", "modal", _modal(40), stepped=False),
        Rival("implicit, prefactored", "prefactored", implicit()),
        Rival("backward Euler, prefactored", "prefactored", implicit(rule="backward_euler"),
               order=1.0),
        Rival("generalised alpha, prefactored", "prefactored",
               implicit(rule="generalised_alpha", a0="zero")),
        Rival("implicit, dense inverse", "prefactored", implicit(solver="dense_inverse"),
               finest=medium),
        Rival("implicit, lumped mass", "prefactored", implicit(mass="lumped")),
        Rival("implicit, conjugate gradients", "prefactored", implicit(solver="cg")),
        Rival("implicit, Gauss-Seidel", "prefactored", implicit(solver="gauss_seidel")),
        Rival("implicit, sparse LU every step", "prefactored", implicit(solver="sparse_lu"),
               finest=small),
        Rival("implicit, Gaussian elimination every step", "prefactored",
               implicit(solver="gaussian_elimination"), finest=small),
        Rival("explicit, consistent mass", "explicit",
               lambda dt: ExplicitLinear(dt, mass="consistent", damping_terms="full")),
        Rival("explicit, lumped, C = alpha M", "explicit", ExplicitLinear),
        Rival("large strain, explicit", "large strain",
               lambda dt: CentralDifference(dt, _PARTS, "lagged"), elements=("P1",), **large),
        *_single(law),
        Rival("large strain, implicit", "large strain", _newton_dynamics,
               elements=("P1", "P2"), finest=medium, shortest=steps[0], **large),
    )  # fmt: skip


def _single(law: LawName) -> tuple[Rival, ...]:
    """The explicit scheme in single precision, for the laws whose loops know it."""
    if law not in ("svk", "neo_hooke"):
        return ()
    return (
        Rival("large strain, explicit, single precision", "large strain",
               lambda dt: CentralDifference(dt, _PARTS, "lagged", precision="single"),
               elements=("P1",), law=law),
    )  # fmt: skip


def swinging_pair(element: str, level: int, dt: float, law: LawName = "neo_hooke") -> LawPair:
    """Average acceleration of the linear law and at large strain."""
    return LawPair(element, level, dt, implicit(), _newton_dynamics, law)


def implicit(**settings: Any) -> Callable[[float], Scheme]:
    return lambda dt: Newmark(dt, **settings)


def _modal(count: int) -> Callable[[float], Scheme]:
    return lambda dt: Modal(dt, modes=count, propagate="constant")


def _newton_dynamics(dt: float) -> Scheme:
    return NewtonDynamics(dt, mass="consistent")


# --- without --------------------------------------------------------------------------------------


def still_best(cavities: bool) -> Callable[[float], Scheme]:
    """The linear solver without error: superposition, with the root of the fluid's pressure."""
    return lambda dt: ExactPressure() if cavities else QuasiStatic()


def still(
    cavities: bool, increment: float, table: float, medium: int, coarse: int,
    law: LawName = "neo_hooke",
) -> tuple[Rival, ...]:  # fmt: skip
    """Statics: superposition, the fluid's pressure, and large strain, in increments or a `table`.

    The table runs on meshes up to `medium`; Newton at every step on `coarse` ones, in the largest
    `increment` s only.
    """
    fluid: tuple[Rival, ...] = (
        Rival("superposition, cavity empty", "static superposition", lambda dt: NoFluid(),
               stepped=False, lacks="the fluid and its pressure"),
        Rival("condensed, exact pressure", "condensed", lambda dt: ExactPressure(), stepped=False),
        Rival("condensed, paper's loop at 1 %", "condensed", lambda dt: PressureLoop(),
               stepped=False),
    )  # fmt: skip
    dry = Rival("superposition", "static superposition", lambda dt: QuasiStatic(), stepped=False)
    return (
        *(fluid if cavities else (dry,)),
        Rival("large strain, table", "large strain", lambda dt: Tabulated(StaticNewton(), table),
               stepped=False, law=law, finest=medium),
        Rival("large strain, Newton every step", "large strain", lambda dt: StaticNewton(),
               law=law, finest=coarse, shortest=increment),
    )  # fmt: skip


def still_pair(
    element: str, level: int, dt: float, cavities: bool, law: LawName = "neo_hooke"
) -> LawPair:
    """Linear statics and Newton's at large strain."""
    return LawPair(element, level, dt, still_best(cavities), lambda dt: StaticNewton(), law)
