"""Paper 002's Newmark update as it is printed, and the step up to which it is stable."""

import numpy as np

from validate.arrays import Floats
from validate.fem.system import System
from validate.solve.explicit_linear import highest_frequency
from validate.solve.newmark_rule import rule_of
from validate.solve.step_maps import newmark_maps
from validate.solve.stepping import Rates


def misprinted_maps(r: Rates) -> Floats:
    """Return the step map of the printed update."""
    return newmark_maps(rule_of("average", 1.0), r.c("full"), r.x**2, misprinted=True)


def misprint_limit(w: float, c: float) -> float:
    """Largest stable step s of the misprinted update for a mode of w 1/s, damped by c 1/s.

    Jury's criterion on its cubic leaves 3 w^4 h^3 - c w^2 h^2 - (4 w^2 + 2 c^2) h - 4 c <= 0, which
    is w h = 2/sqrt(3) undamped.
    """
    y = c / w  # of x = w h
    roots = np.roots([3.0, -y, -(4 + 2 * y * y), -4 * y])
    return float(roots.real.max()) / w


def misprint_step(system: System) -> float:
    """Largest stable step s, by the highest frequency of consistent masses."""
    w = highest_frequency(system, "consistent")
    m = system.scene.material
    return misprint_limit(w, m.mass_damping + m.stiffness_damping * w * w)
