"""Units of foreign files to SI: exact factors, refusals that name unit and quantity."""

import subprocess
import sys

import pytest

from validate import units
from validate.errors import RecordingError
from validate.units import USUAL, in_si, is_unit, pints, si_factor, split

# private: _factor: called alone, case by case.

EXACT = [
    ("N", "force", 1.0),
    ("kN", "force", 1e3),
    ("mN", "force", 1e-3),
    ("kgf", "force", 9.80665),
    ("gf", "force", 9.80665e-3),
    ("lbf", "force", 4.4482216152605),
    ("mm", "length", 1e-3),
    ("cm", "length", 1e-2),
    ("um", "length", 1e-6),
    ("µm", "length", 1e-6),
    ("μm", "length", 1e-6),
    ("m", "length", 1.0),
    ("in", "length", 0.0254),
    ("s", "time", 1.0),
    ("sec", "time", 1.0),
    ("ms", "time", 1e-3),
    ("min", "time", 60.0),
    ("Pa", "stress", 1.0),
    ("kPa", "stress", 1e3),
    ("MPa", "stress", 1e6),
    ("N/mm^2", "stress", 1e6),
    ("N/mm2", "stress", 1e6),
    ("N/mm²", "stress", 1e6),
    ("psi", "stress", 6894.757293168),
    ("%", "strain", 0.01),
    ("mm/mm", "strain", 1.0),
    ("-", "strain", 1.0),
    ("mm/min", "speed", 1e-3 / 60),
    ("in/min", "speed", 0.0254 / 60),
    ("mm^2", "area", 1e-6),
]


@pytest.mark.parametrize(("unit", "quantity", "factor"), EXACT)
def test_factor_is_the_defined_one(unit: str, quantity: str, factor: float) -> None:
    assert si_factor(f" {unit} ", quantity) == pytest.approx(factor, rel=1e-12)
    assert is_unit(unit)


@pytest.mark.parametrize(
    ("unit", "quantity", "says"),
    [
        ("mm", "force", "measures length"),
        ("kg", "force", "not known"),
        ("furlongs per N", "length", "not known"),
        ("cycle", "strain", "not known"),
        ("", "time", "not known"),
        ("10 mm", "length", "not known"),
        ("mm**999999999", "length", "not known"),
        ("-", "length", "measures strain"),
    ],
)
def test_refusal_names_unit_and_quantity(unit: str, quantity: str, says: str) -> None:
    with pytest.raises(RecordingError, match=says) as caught:
        si_factor(unit, quantity)
    assert f"'{unit}'" in str(caught.value)
    assert quantity in str(caught.value)


def test_pint_is_imported_only_when_a_unit_is_read() -> None:
    code = "import sys, validate.recording.tables.testing_machine; print('pint' in sys.modules)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "False"


@pytest.mark.parametrize(
    ("number", "unit", "si_unit", "value"),
    [
        (9.0, "mm", "m", 0.009),
        (15.2, "kPa", "Pa", 15200.0),
        (1.1, "g/cm^3", "kg/m3", 1100.0),
        (7.0, "um", "m", 7e-6),
        (5.0, "%", "1", 0.05),
        (3.0, "kHz", "1/s", 3000.0),
        (4.0, "N/s^0.5", "N/s^0.5", 4.0),
        (2.0, "dB", "dB", 2.0),
    ],
)
def test_a_value_is_the_number_that_would_be_written_in_si(
    number: float, unit: str, si_unit: str, value: float
) -> None:
    assert in_si(number, unit, si_unit) == value


@pytest.mark.parametrize(
    ("unit", "si_unit"),
    [("mm", "Pa"), ("kPa", "1"), ("dB/cm", "m"), ("mm", "px"), ("px", "m"), ("m", "N/s^0.5"),
     ("furlongs", "Pa"), ("__class__", "m"), ("m**9", "m"), ("force unit", "N"),
     ("N", "force unit"), ("force unit/m", "N/m"), ("N/m", "force unit/m")],
)  # fmt: skip
def test_another_dimension_or_an_unknown_unit_has_no_value(unit: str, si_unit: str) -> None:
    assert in_si(1.0, unit, si_unit) is None


@pytest.mark.parametrize(
    ("text", "parts"),
    [("15kPa", (15.0, "kPa")), (" -1.5e-3 m ", (-1.5e-3, "m")), (".5", (0.5, "")), ("soft", None),
     ("", None), ("kPa15", None)],
)  # fmt: skip
def test_number_and_unit_of_a_text(text: str, parts: tuple[float, str] | None) -> None:
    assert split(text) == parts


def test_a_unit_that_nobody_stated_is_itself_alone() -> None:
    assert in_si(2.5, "force unit", "force unit") == 2.5
    assert split("26 force unit/m") == (26.0, "force unit/m")
    with pytest.raises(RecordingError, match="its kind is not declared"):
        si_factor("force unit", "force")


def test_a_quantity_that_is_none_is_an_error_of_ours() -> None:
    with pytest.raises(ValueError, match=r"quantity 'taste' is none of \['area', "):
        units._factor("mm", "taste")


@pytest.mark.parametrize("pair", USUAL)
def test_usual_factors_are_those_of_the_library(pair: tuple[str, str]) -> None:
    assert USUAL[pair] == pints(*pair)
