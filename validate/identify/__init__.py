"""Identification of parameters from recordings, each with its uncertainty and samples."""

from validate.exports import lazily, names

_HOMES = {
    "identification": (
        "Identification",
        "InTurn",
        "Profiled",
        "identify",
    ),
    "least_squares": (
        "Fit",
        "fit",
    ),
    "profile": (
        "Side",
        "side",
        "Interval",
        "mesh_share",
        "profile_interval",
    ),
    "space": (
        "Range",
        "Space",
    ),
    "whiten": ("whitened",),
    "law": (
        "LawFit",
        "fit_scale",
    ),
    "budget": ("IdentifiedValue",),
    "scaled_curve": (
        "ScaledFit",
        "UnitCurve",
        "fit_scaled",
    ),
    "residual_pattern": (
        "Pattern",
        "pattern",
    ),
    "modulus": (
        "ModulusFit",
        "gent_correction",
        "identify_modulus",
    ),
}

__all__ = names(_HOMES)
__getattr__ = lazily(__name__, _HOMES)
