"""Tracked markers: fit to their layout, displacements in a run, quality of registration.

Start with `markers`.
"""

from validate.exports import lazily, names

_HOMES = {
    "markers": ("Together", "MarkerObservation", "vector"),
}

__all__ = names(_HOMES)
__getattr__ = lazily(__name__, _HOMES)
