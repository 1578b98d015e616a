"""Finite elements: matrices of a scene by scikit-fem; unknowns are node-major (x0 y0 z0 x1 ...)."""

from validate.exports import lazily, names

_HOMES = {
    "system": ("Responses", "System", "build"),
    "assembly.assemble": ("mass", "stiffness"),
    "laws.law": ("Law", "law_of"),
    "critical": ("CriticalStep", "Modes"),
    "assembly.locate": ("Rows",),
}

__all__ = names(_HOMES)
__getattr__ = lazily(__name__, _HOMES)
