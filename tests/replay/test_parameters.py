"""Parameter paths: described, parsed by type, refused with the nearest name."""

from dataclasses import dataclass
from typing import Literal

import pytest

from validate.errors import UsageError
from validate.parameters import describe, quantity, with_values


@dataclass(frozen=True)
class Inner:
    E: float = quantity(2.0, "Pa", "modulus")
    n: int = quantity(3, "1", "count")
    kind: Literal["a", "b"] = quantity("a", "1", "kind")
    maybe: float | None = quantity(None, "m", "length")


@dataclass(frozen=True)
class Outer:
    inner: Inner = Inner()
    loads: tuple[float, ...] = quantity((1.0, 2.0), "m", "loads")
    on: bool = quantity(True, "1", "switch")


@dataclass(frozen=True)
class Owner:
    inner: Inner = Inner(E=5.0)


def test_every_leaf_is_described_with_its_unit() -> None:
    found = {p.path: (p.type, p.unit, p.default) for p in describe(Outer(), "x.")}
    assert found == {
        "x.inner.E": ("float", "Pa", 2.0),
        "x.inner.n": ("int", "1", 3),
        "x.inner.kind": ("a|b", "1", "a"),
        "x.inner.maybe": ("float | None", "m", None),
        "x.loads": ("tuple[float, ...]", "m", [1.0, 2.0]),
        "x.on": ("bool", "1", True),
    }


def test_what_differs_from_the_librarys_value_was_entered() -> None:
    """The owner's default for a part counts, not the part's own."""
    origins = {p.path: p.origin for p in describe(Owner(Inner(E=5.0, n=4)))}
    assert (origins["inner.E"], origins["inner.n"]) == ("default", "entered")
    assert {p.origin for p in describe(Outer(Inner(E=5.0))) if p.path == "inner.E"} == {"entered"}


def test_values_are_parsed_by_type_and_the_original_stays() -> None:
    before = Outer()
    after = with_values(
        before,
        {"inner.E": "1e3", "inner.n": "7", "inner.kind": "b", "inner.maybe": "0.5",
         "loads": "1,2.5,3", "on": "false"},
    )  # fmt: skip
    assert after == Outer(Inner(1e3, 7, "b", 0.5), (1.0, 2.5, 3.0), False)
    assert with_values(after, {"inner.maybe": "none"}).inner.maybe is None
    assert before == Outer()
    assert with_values({"m": Inner()}, {"m.n": "9"})["m"] == Inner(n=9)


@pytest.mark.parametrize(
    ("path", "text", "says"),
    [
        ("inner.EE", "1", "nearest: inner.E"),
        ("inner", "1", "unknown parameter 'inner'"),
        ("inner.n", "2.5", "whole number"),
        ("inner.E", "nan", "not finite"),
        ("inner.E", "inf", "not finite"),
        ("inner.E", "", "not a number"),
        ("inner.kind", "c", "one of a, b"),
        ("on", "yes", "true or false"),
        ("loads", "1,x", "not a number"),
    ],
)
def test_wrong_values_are_refused_with_the_reason(path: str, text: str, says: str) -> None:
    with pytest.raises(UsageError, match=says):
        with_values(Outer(), {path: text})
