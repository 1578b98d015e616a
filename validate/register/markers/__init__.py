"""Tracked markers: fitted to their layout, followed in a run, judged.

Start with `markers`.
"""

from validate.exports import lazily, names

_HOMES = {
    "markers": (
        "Together",
        "MarkerObservation",
        "observe_markers",
        "placed_markers",
        "vector",
    )
}

__all__ = names(_HOMES)
__getattr__ = lazily(__name__, _HOMES)
