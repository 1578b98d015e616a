"""Laws at a point: energies, stresses and tangents of the displacement gradient.

Start with `law`.
"""

from validate.exports import lazily, names

_HOMES = {
    "law": (
        "Law",
        "SaintVenantKirchhoff",
        "law_of",
        "parts_of",
        "instant",
        "stiffened",
    )
}

__all__ = names(_HOMES)
__getattr__ = lazily(__name__, _HOMES)
