"""Checks that contracts are made of."""

from collections.abc import Callable
from dataclasses import fields
from typing import Any

from validate.errors import ValidateError


def require(condition: object, what: str) -> None:
    """Raise `AssertionError` with `what` is expected where the condition is false."""
    if not condition:
        raise AssertionError(what)


def refusal(action: Callable[[], Any]) -> str:
    """Return the one line of the `ValidateError` that an action raises.

    Raises `AssertionError` where it raises none, or one of several lines.
    """
    try:
        action()
    except ValidateError as error:
        text = str(error.args[0])
        require(len(text.splitlines()) == 1, f"an error of several lines: {text!r}")
        return str(error)
    raise AssertionError("expected a ValidateError, but nothing was raised")


def require_documented_settings(kind: type) -> None:
    """Every field of settings has a sentence and a unit, except a scheme inside."""
    for f in fields(kind):
        if f.name != "inner":
            doc = f.metadata.get("doc")
            require(doc, f"{kind.__name__}.{f.name}: declare it by quantity(default, unit, doc)")
