"""Identification of parameters from recordings, each with its uncertainty and samples."""

from validate.exports import lazily, names

_HOMES = {
    "identification": ("Identification", "InTurn", "Profiled", "identify"),
    "least_squares": ("Fit", "fit", "Range", "Side", "side", "Space", "whitened"),
    "scaled_curve": ("ScaledFit", "UnitCurve", "fit_scaled"),
    "budget": ("IdentifiedValue", "Pattern", "pattern"),
    "modulus": ("ModulusFit",),
}

__all__ = names(_HOMES)
__getattr__ = lazily(__name__, _HOMES)
