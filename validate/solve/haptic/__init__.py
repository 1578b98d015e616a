"""Probes and needles at haptic rate on a body that is simulated at its own rate.

Start with `loop`.
"""

from validate.exports import lazily, names

_HOMES = {
    "rates": (
        "RealTime",
        "TickTimes",
    )
}

__all__ = names(_HOMES)
__getattr__ = lazily(__name__, _HOMES)
