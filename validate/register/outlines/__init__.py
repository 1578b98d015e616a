"""Outlines in image planes against the wall of a simulated body.

Start with `outlines`.
"""

from validate.exports import lazily, names

_HOMES = {
    "outlines": ("Corner", "OutlineObservation", "NormalDistances", "merged"),
}

__all__ = names(_HOMES)
__getattr__ = lazily(__name__, _HOMES)
