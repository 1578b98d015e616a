"""Which way compression points, by the sign that the user gives."""

from types import SimpleNamespace

import numpy as np
import pytest

from validate.recording.tables.columns import kind_of_test, signs


def pick(slope: float, sign: int | None = None) -> SimpleNamespace:
    said = None if sign is None else SimpleNamespace(sign=sign)
    return SimpleNamespace(values=slope * np.linspace(0.0, 1.0, 9), said=said)


@pytest.mark.parametrize(
    ("displacement", "force", "expected"),
    [
        (pick(1.0, 1), pick(2.0), (1, 1)),
        (pick(1.0, 1), pick(-2.0), (1, -1)),
        (pick(-1.0, -1), pick(-2.0), (-1, -1)),
        (pick(-1.0), pick(2.0, 1), (-1, 1)),
        (pick(1.0), pick(2.0, -1), (-1, -1)),
    ],
)
def test_the_other_signal_follows_the_sign_that_is_said(
    displacement: SimpleNamespace, force: SimpleNamespace, expected: tuple[int, int]
) -> None:
    found = signs(displacement, force, None, None, None)
    assert (found.displacement, found.force) == expected
    assert found.why == "sign given by --map"
    pressed = displacement.values[-1] * expected[0] > 0
    assert found.kind is not None
    assert found.kind.name == ("compression" if pressed else "tension")


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("Material", "compression moulded silicone sheet"),
        ("Load cell", "compression load cell 500 N"),
        ("Company", "Tensile Labs Inc"),
        ("Comment", "cube cut from tensile bar"),
        ("Grip", "tension grips"),
        ("Bemerkung", "aus Zugversuch Nr. 3"),
        ("Method", r"C:\Tests\compression\m.im_tens"),
    ],
)
def test_what_is_beside_the_test_says_nothing_of_its_kind(key: str, value: str) -> None:
    """A test is never taken for pressing or pulling by what it was made of or held with."""
    assert kind_of_test(None, {key: value}, ["Load (N)"]) is None
    told = kind_of_test(None, {key: value, "Test type": "Tensile"}, ["Load (N)"])
    assert told is not None
    assert told.name == "tension"
