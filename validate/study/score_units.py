"""Units in which a study shows its scores."""


def shown_unit(unit: str) -> tuple[float, str]:
    """The factor and the unit in which a score of `unit` (SI) is shown."""
    return (1e3, "mm") if unit == "m" else (1.0, unit)


def unit_text(unit: str) -> str:
    """A shown unit after a number in a sentence: " mm"; "" for a number without unit."""
    return "" if unit == "1" else f" {unit}"
