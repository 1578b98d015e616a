"""Every time-stepping scheme as its step map per mode, and the limit that is predicted for it.

A mode is q'' + c q' + w^2 q = 0. Maps are taken in units of the step (w h, c h), which keeps their
entries of order 1 whatever the step. Linear solvers (direct, CG, Gauss-Seidel) share one map.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats
from validate.fem.critical import lanczos_step
from validate.fem.matrices import DampingTerms, MassName
from validate.fem.system import System
from validate.scene.mesh import Kind
from validate.solve.amplification import explicit_maps, newmark_maps, spectral_radii
from validate.solve.explicit_linear import (
    ExplicitLinear,
    UpdateName,
    highest_frequency,
    stable_step,
)
from validate.solve.newmark_rule import RuleName, rule_of

Radii = Callable[["Rates"], Floats]


@dataclass(frozen=True)
class Rates:
    """All modes in units of a step: `x` = w h (r,), `alpha` h, and `beta`/h of the damping."""

    x: Floats
    alpha: float
    beta: float

    def c(self, terms: DampingTerms) -> Floats:
        """Dampings c h (r,)."""
        full = terms == "full"
        return self.alpha + (self.beta * self.x**2 if full else np.zeros_like(self.x))


@dataclass(frozen=True)
class Stepping:
    """A scheme: its `maps` (r, m, m) per mode with the masses `mass`, and its predicted `limit` s.

    Without `limit` it is predicted to be stable at every step. `kinds`: the meshes it is for (none:
    all). `conserves`: undamped it keeps an energy exactly, that of half steps where it is explicit.
    `rounding`: how far above 1 a radius may lie by rounding alone; defective double
    eigenvalues, as undamped implicit rules have at large steps, cost half of the digits.
    """

    name: str
    words: str
    mass: MassName
    maps: Radii
    limit: Callable[[System], float] | None = None
    kinds: tuple[Kind, ...] = ()
    rounding: float = 1e-9
    explicit: bool = False
    conserves: bool = False

    def radius(self, h: float, omegas: Floats, alpha: float, beta: float) -> float:
        """Spectral radius of a step of h s over all modes (r,) 1/s."""
        return float(spectral_radii(self.maps(Rates(omegas * h, alpha * h, beta / h))).max())


def _implicit(rule: RuleName) -> Radii:
    unit = rule_of(rule, 1.0)
    return lambda r: newmark_maps(unit, r.c("full"), r.x**2)


def _misprinted(r: Rates) -> Floats:
    return newmark_maps(rule_of("average", 1.0), r.c("full"), r.x**2, misprinted=True)


def _explicit(terms: DampingTerms, update: UpdateName) -> Radii:
    return lambda r: explicit_maps(1.0, r.c(terms), r.x**2, update)


def _central(lagged: bool) -> Radii:
    """Of (u, d), d the last increment: d' = keep d - gain (K u + lag K d), paper 003, eq 18."""

    def maps(r: Rates) -> Floats:
        keep, gain = (1 - r.alpha / 2) / (1 + r.alpha / 2), 1 / (1 + r.alpha / 2)
        k = gain * r.x**2
        d = keep - (r.beta * k if lagged else 0 * k)
        return np.stack([np.stack([1 - k, d], axis=-1), np.stack([-k, d], axis=-1)], axis=1)

    return maps


def _exact(r: Rates) -> Floats:
    """Larger |e^(lambda h)| of every mode (r, 1, 1), its real root without cancellation."""
    c, k = r.c("full"), r.x**2
    root = np.sqrt(np.maximum(c * c - 4 * k, 0.0))
    real = np.where(root > 0, -2 * k / (c + root + (root == 0)), -c / 2)
    return np.asarray(np.exp(real))[:, None, None]


def _still(r: Rates) -> Floats:
    return np.zeros((len(r.x), 1, 1))


def misprint_limit(w: float, c: float) -> float:
    """Largest stable step s of the misprinted update for a mode of w 1/s, damped by c 1/s.

    Jury's criterion on its cubic leaves 3 w^4 h^3 - c w^2 h^2 - (4 w^2 + 2 c^2) h - 4 c <= 0, which
    is w h = 2/sqrt(3) undamped.
    """
    y = c / w  # of x = w h
    roots = np.roots([3.0, -y, -(4 + 2 * y * y), -4 * y])
    return float(roots.real.max()) / w


def _misprint_step(system: System) -> float:
    w = highest_frequency(system, "consistent")
    m = system.scene.material
    return misprint_limit(w, m.mass_damping + m.stiffness_damping * w * w)


def _explicit_step(settings: ExplicitLinear) -> Callable[[System], float]:
    return lambda system: stable_step(system, settings)


def _central_step(lagged: bool) -> Callable[[System], float]:
    """As the scheme takes it: by Lanczos, with sqrt(h^2 + beta^2) - beta for lagged damping."""

    def limit(system: System) -> float:
        free = system.free
        K = system.K[free][:, free]
        h = lanczos_step(lambda x: K @ x, system.masses[free]).limit
        beta = system.scene.material.stiffness_damping if lagged else 0.0
        # The same as hypot(h, beta) - beta, without its cancellation.
        return float(h * h / (np.hypot(h, beta) + beta))

    return limit


def _linear_explicit(
    name: str, mass: MassName, terms: DampingTerms, update: UpdateName
) -> Stepping:
    settings = ExplicitLinear(1.0, mass, terms, update)
    maps = _explicit(terms, update)
    return Stepping(
        name,
        settings.treatment,
        mass,
        maps,
        _explicit_step(settings),
        explicit=True,
        conserves=True,
    )


_LOOSE = 1e-6  # rounding of double eigenvalues, squared and some more
_TETS: tuple[Kind, ...] = ("tet4",)

STEPPINGS: tuple[Stepping, ...] = (
    Stepping(
        "newmark_average", "average acceleration, consistent mass", "consistent",
        _implicit("average"), conserves=True, rounding=_LOOSE,
    ),
    Stepping(
        "newmark_lumped", "average acceleration, lumped mass", "lumped",
        _implicit("average"), conserves=True, rounding=_LOOSE,
    ),
    Stepping(
        "backward_euler", "backward Euler", "consistent", _implicit("backward_euler"),
        rounding=_LOOSE,
    ),
    Stepping(
        "generalised_alpha", "generalised alpha, rho_inf .8", "consistent",
        _implicit("generalised_alpha"), rounding=_LOOSE,
    ),
    Stepping(
        "newmark_misprinted", "paper 002's update as printed", "consistent", _misprinted,
        _misprint_step,
    ),
    _linear_explicit("explicit_consistent", "consistent", "full", "printed"),
    _linear_explicit("explicit_consistent_lagged", "consistent", "full", "lagged"),
    _linear_explicit("explicit_lumped", "lumped", "mass", "printed"),
    _linear_explicit("explicit_lumped_lagged", "lumped", "full", "lagged"),
    Stepping(
        "central", "central difference at rest, C = alpha M", "lumped", _central(lagged=False),
        _central_step(lagged=False), _TETS, explicit=True, conserves=True,
    ),
    Stepping(
        "central_lagged", "central difference at rest, lagged C", "lumped", _central(lagged=True),
        _central_step(lagged=True), _TETS, explicit=True, conserves=True,
    ),
    Stepping(
        "newton_dynamics", "Newton's average acceleration at rest, lumped mass", "lumped",
        _implicit("average"), None, _TETS, conserves=True, rounding=_LOOSE,
    ),
    Stepping("modal", "all modes, each exactly", "consistent", _exact),
    Stepping("quasi_static", "statics: no memory of the last step", "consistent", _still),
)  # fmt: skip


def steppings_for(kind: Kind) -> tuple[Stepping, ...]:
    """Those that know such meshes."""
    return tuple(s for s in STEPPINGS if not s.kinds or kind in s.kinds)
