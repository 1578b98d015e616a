"""Asynchronous regions (paper 004): a fast region around a touched place, slow ones elsewhere.

Start with `scheme`.
"""

from validate.exports import lazily, names

_HOMES = {
    "scheme": (
        "AsyncRegions",
        "RegionTick",
        "RegionStepper",
    )
}

__all__ = names(_HOMES)
__getattr__ = lazily(__name__, _HOMES)
