"""Parameter paths: described, parsed by type, refused with the nearest name."""

from dataclasses import dataclass
from typing import Literal

import pytest

from validate.errors import UsageError
from validate.parameters import describe, doubts, quantity, with_values
from validate.scene.material import Region


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
    share: float = quantity(0.1, "1", "share")


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
        "x.share": ("float", "1", 0.1),
    }


def test_a_part_that_is_absent_is_no_setting() -> None:
    """It was stamped into a twin's recording as "null", and read again as a material."""
    found = {p.path: p.default for p in describe(Region("core", where="box 0,0,0 to 1,1,1"))}
    assert found == {"where": "box 0,0,0 to 1,1,1", "contrast": 1.0}


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
    assert with_values(after, {"loads": ""}).loads == ()
    assert before == Outer()
    assert with_values({"m": Inner()}, {"m.n": "9"})["m"] == Inner(n=9)


@dataclass(frozen=True)
class Paired:
    layers: tuple[int, ...] = quantity((5,), "1", "one for each rate")
    rates: tuple[float, ...] = quantity((50.0,), "Hz", "one for each count of layers")

    def __post_init__(self) -> None:
        if len(self.layers) != len(self.rates):
            raise UsageError(f"{len(self.layers)} layer counts, {len(self.rates)} rates")


def test_values_that_must_agree_change_together() -> None:
    both = {"m.layers": "5,10", "m.rates": "500,50"}
    assert with_values({"m": Paired()}, both)["m"] == Paired((5, 10), (500.0, 50.0))
    with pytest.raises(UsageError, match="2 layer counts, 1 rates"):
        with_values({"m": Paired()}, {"m.layers": "5,10"})


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
        ("loads", "3,6,9mm", "all in m without unit, or each with its unit"),
        ("loads", "3mm,6kPa", "loads=6kPa: expected m"),
        ("inner.E", "15mm", "inner.E=15mm: expected Pa"),
        ("inner.E", "15 furlong Pa", "expected Pa"),
        ("inner.E", "1e999kPa", "not finite"),
        ("inner.n", "3mm", "whole number"),
        ("share", "3mm", "without unit, or %"),
    ],
)
def test_wrong_values_are_refused_with_the_reason(path: str, text: str, says: str) -> None:
    with pytest.raises(UsageError, match=says):
        with_values(Outer(), {path: text})


def test_a_value_may_carry_its_unit_and_is_the_number_that_would_be_written() -> None:
    given = {
        "inner.E": "15.2kPa",
        "inner.maybe": " 9 mm",
        "loads": "3mm,0.6cm,9e3um",
        "share": "5%",
    }
    after = with_values(Outer(), given)
    assert after == Outer(Inner(15200.0, maybe=0.009), (0.003, 0.006, 0.009), share=0.05)


@dataclass(frozen=True)
class Gel:
    E: float = quantity(15200.0, "Pa", "modulus")
    noise: float = quantity(10.0, "Pa", "of a pressure, below every modulus")
    radius: float | None = quantity(None, "m", "radius")
    loads: tuple[float, ...] = quantity((0.003, 0.006), "m", "loads")
    mesh: float = quantity(2.0, "1", "no unit")


def test_a_bare_number_a_thousand_off_is_asked_about() -> None:
    said = doubts({"gel": Gel()}, {"gel.E": "15.2", "gel.radius": "8", "gel.loads": "0.003,6"})
    assert [line.partition("; ")[2] for line in said] == [
        "a factor 1000? gel.E=15.2kPa",
        "a factor 1000? gel.radius=8mm",
        "a factor 1000? gel.loads=6mm",
    ]
    assert said[0].startswith("gel.E=15.2: 15.2 Pa is outside 100 to 1e+09 Pa (default 15200.0)")
    assert doubts(Gel(), {"E": "2e10"})[0].endswith("; with its unit it is accepted: E=2e+10Pa")


@pytest.mark.parametrize(
    "value", ["E=15200", "E=15.2Pa", "E=-1", "noise=1", "radius=0.5", "mesh=2000"]
)
def test_a_plausible_value_or_one_with_its_unit_is_not_asked_about(value: str) -> None:
    path, _, text = value.partition("=")
    assert doubts(Gel(), {path: text}) == ()
