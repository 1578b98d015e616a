"""Number format: SI in; mm, mm², ms, N and Pa out, with three significant digits."""

import math

_SHOWN = {
    "m": ("mm", 1e3),
    "m2": ("mm²", 1e6),
    "m^2": ("m²", 1.0),
    "m/s^2": ("m/s²", 1.0),
    "s": ("ms", 1e3),
    "1": ("", 1.0),
}
MISSING = "–"


def shown_unit(unit: str) -> str:
    """Return the unit that readers see for an SI unit; empty for pure numbers."""
    return _SHOWN.get(unit, (unit, 1.0))[0]


def scale(unit: str) -> float:
    """Shown value = scale x SI value."""
    return _SHOWN.get(unit, (unit, 1.0))[1]


def text(value: float | None, unit: str = "1", digits: int = 3) -> str:
    """`value` (SI) in the shown unit, without the unit; a dash for None, NaN and infinity."""
    if value is None or not math.isfinite(value):
        return MISSING
    if unit == "1" and value == int(value) and abs(value) < 1e7:
        return f"{int(value):,}".replace(",", "\u202f").replace("-", "−")
    return significant(value * scale(unit), digits)


def with_unit(value: float | None, unit: str = "1", digits: int = 3) -> str:
    """As `text`, with the shown unit behind."""
    return f"{text(value, unit, digits)} {shown_unit(unit)}".strip()


def significant(value: float, digits: int = 3) -> str:
    """Decimal notation with `digits` significant digits; powers of ten beyond 1e-4..1e7."""
    if value == 0:
        return "0"
    power = math.floor(math.log10(abs(float(f"{value:.{digits - 1}e}"))))
    if not -4 <= power < 7:
        mantissa = f"{value / 10.0**power:.{digits - 1}f}".rstrip("0").rstrip(".")
        return f"{mantissa}e{power}".replace("-", "−")
    return f"{value:,.{max(0, digits - 1 - power)}f}".replace(",", "\u202f").replace("-", "−")


def to_decimal_of(u: float, *values: float) -> tuple[str, ...]:
    """Return u and `values` in one unit to the same decimal: that of two significant digits of u.

    Each has three significant digits of its own where u is zero, not finite, or very small or
    large.
    """
    if not 1e-4 < abs(u) < 1e7:
        return tuple(significant(v) for v in (u, *values))
    decimals = 1 - math.floor(math.log10(abs(float(f"{u:.1e}"))))
    rounded = (round(v, decimals) + 0.0 for v in (u, *values))  # no minus zero
    return tuple(
        f"{v:,.{max(0, decimals)}f}".replace(",", "\u202f").replace("-", "−") for v in rounded
    )


def digits(text: str) -> str:
    """Return a number as read in the signs that programs read."""
    return text.replace("\u202f", "").replace("−", "-")


def fixed(value: float, decimals: int) -> str:
    """Return a number already in its shown unit with fixed decimals and a true minus sign."""
    return f"{value:.{decimals}f}".replace("-", "−")


def fixed_with_unit(value: float, unit: str, decimals: int) -> str:
    """`value` (SI) with fixed decimals in the shown unit, and the unit."""
    return f"{fixed(value * scale(unit), decimals)} {shown_unit(unit)}"


def rate(hz: float | None) -> str:
    """Return a rate in Hz or kHz, whichever reads better; a dash for None."""
    if hz is None or not math.isfinite(hz):
        return MISSING
    return f"{significant(1e-3 * hz)} kHz" if hz >= 1000 else f"{significant(hz)} Hz"


def duration(seconds: float | None) -> str:
    """Return a time in µs, ms or s, whichever reads better; a dash for None."""
    if seconds is None or not math.isfinite(seconds):
        return MISSING
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if seconds >= size:
            return f"{significant(seconds / size)} {unit}"
    return f"{significant(1e6 * seconds)} µs"


def at_load(label: str) -> str:
    """Where a residual was taken, in words: "at 9 mm", or "over the whole time" for "all"."""
    return "over the whole time" if label == "all" else f"at {spaced(label)}"


def spaced(label: str) -> str:
    """Return a load label such as "9mm" as text: "9 mm"."""
    number = label.rstrip("abcdefghijklmnopqrstuvwxyzNP%")
    unit = label[len(number) :].replace("pct", "%")
    return f"{number} {unit}".strip()
