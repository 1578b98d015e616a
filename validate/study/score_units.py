"""Units in which a study shows its scores."""


def shown_unit(unit: str) -> tuple[float, str]:
    """The factor and the unit in which a score of `unit` (SI) is shown."""
    return (1e3, "mm") if unit == "m" else (1.0, unit)
