"""Error growth per step: spectral radius of a linear scheme's map of (u, v, a).

With C = alpha M + beta K the modes of K and M decouple and the map is 3 x 3 for each of them: exact
and cheap. Radius 1 is the border: an undamped mode of average acceleration lies on it; above it,
however little, a run grows without end (heavily damped explicit ones by 1.0002 a step).
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.system import System, damping_of, mass_of
from validate.solve.dynamic.newmark import Newmark
from validate.solve.dynamic.newmark_rule import Rule
from validate.solve.explicit.linear import ExplicitLinear
from validate.solve.study_entries import explicit_maps, spectral_radii

DENSE_LIMIT = 2000  # free unknowns whose modes are all taken: some 10 s
_COUPLED = 1e-8  # of the damping, as in `fem.critical`


@dataclass(frozen=True)
class Amplification:
    """Spectral `radius` of the step, the frequency `omega` 1/s of the mode that has it; radii (r,)
    of all modes by rising `omegas` (r,) 1/s."""

    radius: float
    omega: float
    radii: Floats
    omegas: Floats


def amplification(system: System, scheme: Newmark | ExplicitLinear) -> Amplification:
    """Return the scheme's amplification by modes.

    Raises `SceneError` above 2000 free unknowns or where the damping couples the modes.
    """
    omegas, c = modes_with(system, scheme)
    if isinstance(scheme, ExplicitLinear):
        maps = explicit_maps(scheme.dt, c, omegas**2, scheme.update)
    else:
        rule = Rule.of(scheme.rule, scheme.dt, scheme.rho_inf)
        maps = rule.maps(c, omegas**2, misprinted=scheme.update == "misprinted")
    radii = spectral_radii(maps)
    worst = int(np.argmax(radii))
    return Amplification(float(radii[worst]), float(omegas[worst]), radii, omegas)


def modes_with(system: System, scheme: Newmark | ExplicitLinear) -> tuple[Floats, Floats]:
    """Frequencies and dampings c (r,) 1/s of all modes with the scheme's masses and damping."""
    free = system.free
    if len(free) > DENSE_LIMIT:
        raise SceneError(
            f"{len(free)} unknowns: all modes need at most {DENSE_LIMIT}; use a coarser mesh"
        )
    matrices = (
        system.K,
        mass_of(system, scheme.mass),
        damping_of(system, scheme.mass, scheme.damping_terms),
    )
    K, M, C = (X[free][:, free].toarray() for X in matrices)
    squares, shapes = eigh(K, M)
    modal = shapes.T @ C @ shapes
    c = np.diag(modal).copy()
    if np.abs(modal - np.diag(c)).max() > _COUPLED * max(float(np.abs(c).max()), 1e-300):
        raise SceneError("the damping couples the modes; use Rayleigh damping of one material")
    return np.sqrt(np.maximum(squares, 0.0)), c
