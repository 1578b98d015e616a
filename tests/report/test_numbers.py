"""SI values as readers see them."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from validate.numbers import (
    at_load,
    duration,
    rate,
    significant,
    spaced,
    text,
    to_decimal_of,
    with_unit,
)


@pytest.mark.parametrize(
    ("value", "unit", "shown"),
    [
        (0.000102345, "m", "0.102 mm"),
        (1233.4, "Pa", "1\u202f233 Pa"),
        (-8.013, "Pa", "−8.01 Pa"),
        (2.5e-4, "m2", "250 mm²"),
        (0.0000466, "s", "0.0466 ms"),
        (3.0, "1", "3"),
        (0.0, "m", "0 mm"),
        (0.9996, "N", "1.00 N"),
        (5e-12, "m", "5e−9 mm"),
        (None, "N", "– N"),
        (math.nan, "N", "– N"),
    ],
)
def test_with_unit(value: float | None, unit: str, shown: str) -> None:
    assert with_unit(value, unit) == shown


@given(st.floats(1e-12, 1e12), st.integers(2, 5))
def test_never_more_digits_than_asked_and_never_wrong(value: float, digits: int) -> None:
    shown = significant(value, digits).replace("\u202f", "").replace("−", "-")
    assert float(shown) == pytest.approx(value, rel=0.51 * 10 ** (1 - digits))
    if "e" not in shown and value < 10**digits:
        assert len(shown.replace(".", "").lstrip("0")) <= digits


def test_missing_is_a_dash() -> None:
    assert text(math.inf) == "–"


def test_loads_as_text() -> None:
    assert spaced("9mm") == "9 mm"
    assert spaced("0.5mm") == "0.5 mm"
    assert spaced("10pct") == "10 %"
    assert spaced("end") == "end"


@pytest.mark.parametrize(
    ("hz", "shown"),
    [(2.0, "2.00 Hz"), (999.0, "999 Hz"), (1000.0, "1.00 kHz"), (2e5, "200 kHz"), (None, "–")],
)
def test_rate(hz: float | None, shown: str) -> None:
    assert rate(hz) == shown


@pytest.mark.parametrize(
    ("seconds", "shown"),
    [(5e-6, "5.00 µs"), (1e-3, "1.00 ms"), (0.42, "420 ms"), (12.0, "12.0 s"), (None, "–")],
)
def test_duration(seconds: float | None, shown: str) -> None:
    assert duration(seconds) == shown


def test_at_load() -> None:
    assert at_load("9mm") == "at 9 mm"
    assert at_load("all") == "over the whole time"


@pytest.mark.parametrize(
    ("u", "value", "shown"),
    [
        (0.0107, -0.01364, ("0.011", "−0.014")),
        (0.0996, 1.2345, ("0.10", "1.23")),
        (9.96, 123.456, ("10", "123")),
        (1234.0, 15678.0, ("1\u202f200", "15\u202f700")),
        (91.4, -0.3, ("91", "0")),
        (0.0, 1.2345, ("0", "1.23")),
        (1e-9, 1.2345, ("1e−9", "1.23")),
    ],
)
def test_an_error_has_the_decimal_of_two_digits_of_its_uncertainty(
    u: float, value: float, shown: tuple[str, str]
) -> None:
    assert to_decimal_of(u, value) == shown
