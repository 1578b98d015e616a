"""Conversion of units, as files and users write them, to SI. The only file that imports pint.

Pint is imported when the first unit is read: the import costs more than reading a small file.
"""

import math
import re
import unicodedata
from functools import cache
from typing import Any

from validate.errors import RecordingError

QUANTITIES: tuple[tuple[str, str], ...] = (
    ("force", "newton"),
    ("length", "metre"),
    ("time", "second"),
    ("stress", "pascal"),
    ("strain", ""),
    ("speed", "metre / second"),
    ("area", "metre ** 2"),
)
_SI = dict(QUANTITIES)

_PLAIN = ("N", "m", "s", "Pa", "m/s", "m^2", "1")  # what streams are in
_NUMBERS = {"-": 1.0, "1": 1.0, "%": 0.01, "percent": 0.01}
_SPELLED = {
    **dict.fromkeys(("in", "IN", "In", "INCH", "Inch", "ins", "Zoll", "pouce", "cal"), "inch"),
    **dict.fromkeys(("sec", "secs", "Sec", "SEC", "Sek", "sek", "seg", "Sekunden"), "second"),
    **dict.fromkeys(("s", "S"), "second"),
    **dict.fromkeys(("LBF", "Lbf", "lbF"), "lbf"),
    **dict.fromkeys(("gF", "GF"), "gf"),
    **dict.fromkeys(("ozF", "OZF"), "ozf"),
    **dict.fromkeys(("Newton", "Newtons", "newtons", "niuton"), "newton"),
    **dict.fromkeys(("KN", "Kn", "kn"), "kN"),
    **dict.fromkeys(("MM", "Mm"), "mm"),
    **dict.fromkeys(("KPa", "KPA", "kpa", "Kpa"), "kPa"),
    **dict.fromkeys(("MPA", "Mpa", "mpa"), "MPa"),
    **dict.fromkeys(("KGF", "Kgf", "kgF", "kp", "kG", "Kg_f"), "kgf"),
    **dict.fromkeys(("mil", "mils"), "thou"),
    "msec": "millisecond",
    "PSI": "psi",
}
#: Units that a recording has and nobody stated: shown as they are, equal to themselves alone.
SYMBOLIC = ("force unit",)
_OWN = ("px", "dB")  # a library's are others: its pixel is 1/96 inch
_WHOLE = {
    '"': "in", "牛": "N", "牛顿": "N", "千牛": "kN", "毫米": "mm", "厘米": "cm", "米": "m",
    "秒": "s", "毫秒": "ms", "兆帕": "MPa", "千帕": "kPa", "帕": "Pa", "公斤力": "kgf",
    "Н": "N", "кН": "kN", "мм": "mm", "с": "s", "сек": "s", "МПа": "MPa", "кПа": "kPa",
}  # fmt: skip

#: What most scenes are written in, with pint's own factors: its register takes half a second.
USUAL = {
    ("mm", "m"): 1e-3, ("mm", "metre"): 1e-3, ("m", "metre"): 1.0, ("ms", "second"): 1e-3,
    ("s", "second"): 1.0, ("second", "second"): 1.0, ("N", "newton"): 1.0, ("Pa", "pascal"): 1.0,
    ("kPa", "Pa"): 1e3, ("kPa", "pascal"): 1e3, ("MPa", "Pa"): 1e6, ("MPa", "pascal"): 1e6,
    ("kg/m^3", "kg/m^3"): 1.0, ("kN/m^3", "N/m^3"): 1e3,
}  # fmt: skip

_QUANTITY = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*")

# A product of powers and nothing else: text from a file is never given to a parser unchecked.
_FACTOR = r"[A-Za-z]{1,12}(?:\^-?[1-4])?"
_PRODUCT = re.compile(rf"{_FACTOR}(?:\s*[*/.·]\s*{_FACTOR}){{0,3}}")


def si_factor(unit: str, quantity: str) -> float:
    """The number of SI units in one `unit`, e.g. ("kN", "force") -> 1000.0.

    `quantity` is one of `QUANTITIES`. Raises `RecordingError` naming unit and quantity when the
    unit is unknown or measures something else.
    """
    factor = _factor(unit.strip(), quantity)
    if factor is None:
        kinds = [name for name, _ in QUANTITIES if _factor(unit.strip(), name) is not None]
        meant = f"it measures {kinds[0]}" if kinds else "it is not known"
        if is_symbolic(unit):
            meant = "its kind is not declared, so it cannot be converted"
        if quantity == "force" and unit.strip().lower() in ("kg", "g"):
            meant = f"it is not known as force; for the weight of a mass write {unit}f"
        raise RecordingError(
            f"unit '{unit}' is not a unit of {quantity}: {meant}; examples: {_EXAMPLES[quantity]}"
        )
    return factor


def split(text: str) -> tuple[float, str] | None:
    """Number and unit of a text as `15kPa` ("" without); None for one that begins otherwise."""
    found = _QUANTITY.fullmatch(text)
    return (float(found[1]), found[2]) if found else None


def in_si(number: float, unit: str, si_unit: str) -> float | None:
    """`number` of `unit` in `si_unit`, e.g. (9.0, "mm", "m") -> 0.009; None for another dimension.

    `si_unit` is "1" for none (then `unit` may be %) or any product of powers, as "kg/m3".
    """
    if unit == si_unit:
        return number
    if si_unit in _OWN or unit in _OWN or is_symbolic(unit) or is_symbolic(si_unit):
        return None
    if si_unit == "1":
        factor = _NUMBERS.get(unit) if unit in ("%", "percent") else None
    else:
        text = _spelling(unit)
        known = _PRODUCT.fullmatch(text) is not None
        factor = _convert(text, _spelling(si_unit)) if known else None
    return None if factor is None else _times(number, factor)


def si_of(unit: str) -> tuple[float, str]:
    """Factor and unit in SI; a unit of another dimension (V, N m) stays as it is."""
    for si in _PLAIN:
        factor = in_si(1.0, unit, si)
        if factor is not None:
            return factor, si
    return 1.0, unit


def _times(number: float, factor: float) -> float:
    """Decimal steps give the number that would have been written: 9 mm are 0.009 m to the last bit,
    9 * 0.001 are not."""
    whole, parts = round(factor), round(1 / factor)
    if parts > 1 and math.isclose(parts * factor, 1, rel_tol=1e-12):
        return number / parts
    return number * (whole if math.isclose(whole, factor, rel_tol=1e-12) else factor)


def is_symbolic(unit: str) -> bool:
    """Whether a unit is, or is made with, one that nobody stated: it converts to nothing."""
    return any(word in unit for word in SYMBOLIC)


def is_unit(text: str) -> bool:
    """Whether `text` is a unit of any of `QUANTITIES`."""
    return any(_factor(text.strip(), name) is not None for name, _ in QUANTITIES)


_EXAMPLES = {
    "force": "N, kN, mN, kgf, lbf",
    "length": "mm, cm, um, m, in",
    "time": "s, ms, min",
    "stress": "Pa, kPa, MPa, N/mm^2, psi",
    "strain": "-, %, mm/mm",
    "speed": "mm/min, mm/s",
    "area": "mm^2, m^2",
}


@cache
def _factor(unit: str, quantity: str) -> float | None:
    if quantity not in _SI:
        raise ValueError(f"quantity {quantity!r} is none of {sorted(_SI)}")
    text = _spelling(unit)
    if quantity in ("force", "stress"):  # a testing machine's pound is the weight of one
        text = re.sub(r"\b(lb|lbs|LB|LBS|pound|pounds)\b(?!f)", "lbf", text)
    if text in _NUMBERS:
        return _NUMBERS[text] if quantity == "strain" else None
    if _PRODUCT.fullmatch(text) is None:
        return None
    if quantity == "strain":
        # mm/mm and its like; pint's other numbers (turn, count, ppm) are no strain
        over, slash, under = text.partition("/")
        top, bottom = _convert(over.strip(), "metre"), _convert(under.strip(), "metre")
        return top / bottom if slash and top is not None and bottom is not None else None
    return _convert(text, _SI[quantity])


def _spelling(unit: str) -> str:
    text = unicodedata.normalize("NFKC", unit.strip()).replace("μ", "u").replace("**", "^")
    text = _WHOLE.get(text, text).rstrip(".")
    text = re.sub(r"(?<=[A-Za-z])(-?[1-4])(?![0-9])", r"^\1", text)
    return re.sub(r"[A-Za-z]+", lambda word: _SPELLED.get(word[0], word[0]), text)


def _convert(text: str, target: str) -> float | None:
    if (text, target) in USUAL:
        return USUAL[text, target]
    return pints(text, target)


def pints(text: str, target: str) -> float | None:
    """pint's factor; None for another dimension and for what is no unit."""
    import pint

    registry = _registry()
    try:
        found = registry.parse_units(text.replace("·", "*").replace(".", "*"))
        wanted = registry.parse_units(target)
        if found.dimensionality != wanted.dimensionality:
            return None
        return float(registry.Quantity(1.0, found).to(wanted).magnitude)
    except (pint.errors.PintError, ValueError, AttributeError):
        return None


@cache
def _registry() -> Any:
    import pint

    return pint.UnitRegistry()
