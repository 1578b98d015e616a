"""The frequency that size, modulus and hung mass let expect: a doubt of the mass that was given.

A cantilever that bends as under a force at its end (Rayleigh's quotient): k = 3 E I / L^3 against
the hung mass and 33/140 of the beam's own. Its first frequency is then 1.5 % too high without a
mass, less with one.
"""

import numpy as np

from validate.errors import ComparisonError
from validate.identify.recorded_motion import Ringing
from validate.parameters import known
from validate.pipeline.experiment.tree import Tree
from validate.recording.types import Recording

from .recording import SWING, fallen
from .settings import TIPS, ReleasedBeam, hung

_OWN = 33 / 140  # of the beam's mass swings at its end
_FAR = 0.15  # relative: relaxation stiffens by some 5 %, a modulus is uncertain by as much


def stiffness(tree: Tree) -> float:
    """N/m at the free end."""
    length, width, height = tree.scene.body.size
    E = known(tree.scene.material.E, "material.E")
    return float(E * width * height**3 / (4 * length**3))


def swinging(tree: Tree) -> float:
    """kg of the beam's own that swing at its end."""
    length, width, height = tree.scene.body.size
    return float(_OWN * known(tree.scene.material.rho, "material.rho") * length * width * height)


def expected(tree: Tree) -> float:
    """Hz at which the beam should ring with what hangs there."""
    return float(np.sqrt(stiffness(tree) / (swinging(tree) + hung(tree))) / (2 * np.pi))


def doubted(recording: Recording, tree: Tree) -> tuple[str, ...]:
    """A sentence where the recording rings far from what is expected; none where it does not
    ring."""
    seen = _ringing(recording, tree.settings)
    if seen is None or abs(seen / expected(tree) - 1) <= _FAR:
        return ()
    mass = stiffness(tree) / (2 * np.pi * seen) ** 2 - swinging(tree)
    none = mass < -_FAR * swinging(tree)
    meant = (
        "no mass gives this frequency, but a stiffer beam does"
        if none
        else (f"{1e3 * max(mass, 0):.0f} g would")
    )
    return (
        f"{recording.name} rings at {seen:.2f} Hz, where a beam with masses.load.mass = "
        f"{1e3 * hung(tree):g} g should at {expected(tree):.2f} Hz; {meant}: check "
        "masses.load.mass, material.E, body.size",
    )


def _ringing(recording: Recording, p: ReleasedBeam) -> float | None:
    """Hz of the tips' motion along their fall."""
    moving = recording.marker(SWING)
    z = fallen(moving.x[:, : len(TIPS)] - moving.x[0, : len(TIPS)])
    kept = (moving.t >= p.swing.ringing) & (moving.t <= p.swing.length) & np.isfinite(z)
    try:
        return Ringing.of(moving.t[kept], z[kept]).frequency
    except ComparisonError:
        return None
