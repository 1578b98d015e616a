"""The frequency that size, modulus and hung mass let expect: a doubt of the mass that was given.

A cantilever that bends as under a force at its end (Rayleigh's quotient): k = 3 E I / L^3 against
the hung mass and 33/140 of the beam's own. Its first frequency is then 1.5 % too high without a
mass, less with one.
"""

import numpy as np

from validate.errors import ComparisonError
from validate.identify.ringing import ringing
from validate.papers.released_beam.cards import TIPS, ReleasedBeam
from validate.papers.released_beam.recorded import SWING, fallen
from validate.parameters import known
from validate.recording.types import Recording

_OWN = 33 / 140  # of the beam's mass swings at its end
_FAR = 0.15  # relative: relaxation stiffens by some 5 %, a modulus is uncertain by as much


def stiffness(p: ReleasedBeam) -> float:
    """N/m at the free end."""
    s = p.size
    return known(p.material.E, "material.E") * s.width * s.height**3 / (4 * s.length**3)


def swinging(p: ReleasedBeam) -> float:
    """kg of the beam's own that swing at its end."""
    s = p.size
    return _OWN * p.material.rho * s.length * s.width * s.height


def expected(p: ReleasedBeam) -> float:
    """Hz at which the beam should ring with what hangs there."""
    return float(np.sqrt(stiffness(p) / (swinging(p) + p.load.mass)) / (2 * np.pi))


def doubted(recording: Recording, p: ReleasedBeam) -> tuple[str, ...]:
    """A sentence where the recording rings far from what is expected; none where it does not
    ring."""
    seen = _ringing(recording, p)
    if seen is None or abs(seen / expected(p) - 1) <= _FAR:
        return ()
    mass = stiffness(p) / (2 * np.pi * seen) ** 2 - swinging(p)
    none = mass < -_FAR * swinging(p)
    meant = (
        "no mass gives this frequency, but a stiffer beam does"
        if none
        else (f"{1e3 * max(mass, 0):.0f} g would")
    )
    return (
        f"{recording.name} rings at {seen:.2f} Hz, where a beam with load.mass = "
        f"{1e3 * p.load.mass:g} g should at {expected(p):.2f} Hz; {meant}: check load.mass, "
        "material.E, size",
    )


def _ringing(recording: Recording, p: ReleasedBeam) -> float | None:
    """Hz of the tips' motion along their fall."""
    moving = recording.marker(SWING)
    z = fallen(moving.x[:, : len(TIPS)] - moving.x[0, : len(TIPS)])
    kept = (moving.t >= p.swing.ringing) & (moving.t <= p.swing.length) & np.isfinite(z)
    try:
        return ringing(moving.t[kept], z[kept]).frequency
    except ComparisonError:
        return None
