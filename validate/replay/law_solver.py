"""The solver that a method's constitutive law needs.

A method's `law` option builds its scene, its settings solve it. Where a user sets another law, a
static method takes a solver of that law: the one of the experiment's own static method that solves
it, else linear statics or Newton's method. Other methods take the laws of their scheme only.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, get_args

from validate.errors import UsageError
from validate.parameters import with_values
from validate.replay.method import Method
from validate.scene.material import LawName
from validate.solve.fluid import ExactPressure, NoFluid
from validate.solve.handles import Handles
from validate.solve.newton import StaticNewton
from validate.solve.quasi_static import QuasiStatic
from validate.solve.tabulated import Tabulated

_LINEAR, _LARGE = (ExactPressure, NoFluid, QuasiStatic), (StaticNewton, Tabulated)


def laws_of(method: Method) -> tuple[LawName, ...] | None:
    """The laws that a method's `law` may be set to; None where it has no such option."""
    if getattr(method.scene, "law", None) is None:
        return None
    if isinstance(method.settings, (*_LINEAR, *_LARGE)):
        return get_args(LawName)
    handles: Handles | None = getattr(method.settings, "handles", None)
    return get_args(LawName) if handles is None else handles.law


def with_laws(
    declared: Mapping[str, Method], values: Mapping[str, str]
) -> tuple[Mapping[str, Method], dict[str, str]]:
    """The methods with the laws that `values` set and the solvers of these, and the other values.

    Paths are NAME.FIELD. Raises `UsageError` for a law that the method's scheme does not solve.
    """
    laws = {path: text for path, text in values.items() if _is_law(declared, path)}
    rest = {path: text for path, text in values.items() if path not in laws}
    methods = dict(with_values(declared, laws))
    for path in laws:
        name = path.partition(".")[0]
        methods[name] = _solved(name, methods[name], declared)
    return methods, rest


def with_declared_law(
    name: str, method: Method, law: str, declared: Mapping[str, Method]
) -> Method:
    """A method of a declared scene, of which a user sets the law, with a solver of that law.

    Raises as `with_laws` does.
    """
    static = isinstance(method.settings, (*_LINEAR, *_LARGE))
    handles: Handles | None = getattr(method.settings, "handles", None)
    possible = get_args(LawName) if static or handles is None else handles.law
    if law not in possible:
        raise _not_solved(f"methods.{name}.material.law", law, method, possible)
    if handles is None or law in handles.law:
        return method
    return replace(method, settings=_solver(law, declared))


def _not_solved(path: str, law: str, method: Method, possible: tuple[str, ...]) -> UsageError:
    return UsageError(
        f"{path}={law}: {type(method.settings).__name__} solves {', '.join(possible)}; set the law "
        "of another method"
    )


def _is_law(declared: Mapping[str, Method], path: str) -> bool:
    name, _, field = path.partition(".")
    named = field in ("law", "scene.law") and name in declared
    return named and laws_of(declared[name]) is not None


def _solved(name: str, method: Method, declared: Mapping[str, Method]) -> Method:
    law, possible = method.scene.law, laws_of(declared[name]) or ()
    if law not in possible:
        raise _not_solved(f"methods.{name}.law", law, method, possible)
    handles: Handles | None = getattr(method.settings, "handles", None)
    if handles is None or law in handles.law:
        return method
    return replace(method, settings=_solver(law, declared))


def _solver(law: str, declared: Mapping[str, Method]) -> Any:
    kinds = _LINEAR if law == "linear" else _LARGE
    own = [m.settings for m in declared.values() if isinstance(m.settings, kinds)]
    if own:
        return own[0]
    return QuasiStatic() if law == "linear" else StaticNewton("none")
