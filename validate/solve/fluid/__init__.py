"""Fluid in cavities: pressure-volume relation, pressure control, boundary swap of paper 000.

Start with `cavities`.
"""

from validate.exports import lazily, names

_HOMES = {
    "cavities": (
        "NoFluid",
        "ExactPressure",
        "ElasticPressure",
        "Settling",
        "DryStepper",
        "ExactStepper",
    )
}

__all__ = names(_HOMES)
__getattr__ = lazily(__name__, _HOMES)
