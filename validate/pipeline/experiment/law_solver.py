"""Solver that a method's constitutive law needs.

What a method changes of the scene's material has a law, its settings solve it. Where a user sets
another law, a static method takes a solver of that law: that of the experiment's own static method
which solves it, else linear statics or Newton's method. Others take those of their scheme.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, get_args

from validate.errors import UsageError
from validate.pipeline.experiment.method import Method
from validate.scene.laws import further_laws
from validate.scene.material import LawName
from validate.solve.fluid.cavities import ExactPressure, NoFluid
from validate.solve.handles import LARGE, Handles
from validate.solve.static.load_table import Tabulated
from validate.solve.static.newton import StaticNewton
from validate.solve.static.quasi_static import QuasiStatic

_LINEAR, _LARGE = (ExactPressure, NoFluid, QuasiStatic), (StaticNewton, Tabulated)


def laws_of(method: Method) -> tuple[str, ...]:
    """Return the laws that a method may have."""
    static = isinstance(method.settings, (*_LINEAR, *_LARGE))
    handles: Handles | None = getattr(method.settings, "handles", None)
    own: tuple[LawName, ...] = get_args(LawName) if static or handles is None else handles.law
    return (*own, *further_laws()) if set(LARGE) <= set(own) else own


def with_law(name: str, method: Method, law: str, declared: Mapping[str, Method]) -> Method:
    """Return a method of which a user sets the law, with a solver of that law.

    Raises `UsageError` for a law that the method's scheme does not solve.
    """
    possible = laws_of(method)
    if law not in possible:
        raise UsageError(
            f"methods.{name}.material.law={law}: {type(method.settings).__name__} solves "
            f"{', '.join(possible)}; set the law of another method"
        )
    handles: Handles | None = getattr(method.settings, "handles", None)
    if handles is None or handles.solves(law):
        return method
    return replace(method, settings=_solver(law, declared))


def _solver(law: str, declared: Mapping[str, Method]) -> Any:
    kinds = _LINEAR if law == "linear" else _LARGE
    own = [m.settings for m in declared.values() if isinstance(m.settings, kinds)]
    if own:
        return own[0]
    return QuasiStatic() if law == "linear" else StaticNewton("none")
