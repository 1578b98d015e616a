"""Finite viscoelasticity: isochoric stress of a law and the state of its branches.

Every branch follows dQ_i/dt + Q_i/tau_i = g_i dS/dt, with S the second Piola-Kirchhoff stress of
the isochoric law; the whole stress is S_vol + S + sum of Q_i (Holzapfel 2000, 6.10; Simo & Hughes
1998, ch. 10). In material tensors that is objective; S changes linearly over a step, for which the
recursion is exact: Q_i' = exp(-x) Q_i + g_i (1 - exp(-x))/x (S' - S), x = dt/tau_i. A step of no
length is a jump, answered with the instantaneous modulus.

Departures: Holzapfel takes exp(-x/2) in place of (1 - exp(-x))/x, which is of order two as well.
At finite strain this linear evolution is known to dissipate for proportional stress paths, and is
tested on closed cycles; it is not proven for all.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from validate.arrays import Floats
from validate.fem.laws.energies import EYE, cofactor, outer, volume_change
from validate.fem.laws.law import Law, stiffened
from validate.scene.material import Material
from validate.scene.scene import Scene


@dataclass(frozen=True)
class Remembered:
    """Isochoric stress S (..., 3, 3) Pa after the last step and the branches' Q (k, ..., 3, 3)."""

    S: Floats
    Q: Floats


@dataclass(frozen=True)
class Branches:
    """g and tau s (k, ...) of every point, broadcast to the points' shape."""

    g: Floats
    tau: Floats

    def at_rest(self, shape: tuple[int, ...]) -> Remembered:
        return Remembered(np.zeros((*shape, 3, 3)), np.zeros((len(self.g), *shape, 3, 3)))

    def factors(self, dt: float) -> tuple[Floats, Floats]:
        """exp(-x) and g (1 - exp(-x))/x (k, ...), 1 and g for a jump."""
        x = dt / self.tau
        ramp = -np.expm1(-x) / x if dt > 0 else np.ones_like(x)
        return np.exp(-x), self.g * ramp

    def lag(self, memory: Remembered, dt: float) -> tuple[Floats, Floats]:
        """share (...) and rest (..., 3, 3) Pa: the sum of Q after dt is share S' + rest."""
        decay, gain = self.factors(dt)
        share = gain.sum(axis=0)
        kept = (decay[..., None, None] * memory.Q).sum(axis=0)
        return share, kept - share[..., None, None] * memory.S

    def advanced(self, memory: Remembered, S: Floats, dt: float) -> Remembered:
        """After a step at whose end the isochoric stress is S (..., 3, 3) Pa."""
        decay, gain = (f[..., None, None] for f in self.factors(dt))
        return Remembered(S, decay * memory.Q + gain * (S - memory.S))


def branches_of(material: Material) -> Branches:
    """(k, 1) of one material."""
    prony = material.prony
    return Branches(np.array(prony.g)[:, None], np.array(prony.tau)[:, None])


def cell_branches(scene: Scene) -> Branches | None:
    """(k, e, 1) of a scene's cells, or None where nothing relaxes; shorter series are filled up
    with branches of no modulus."""
    most = max(len(m.prony.g) for m in scene.materials)
    if not most:
        return None
    g = [scene.per_cell(partial(_modulus, i)) for i in range(most)]
    tau = [scene.per_cell(partial(_time, i)) for i in range(most)]
    return Branches(np.array(g)[..., None], np.array(tau)[..., None])


def _modulus(i: int, m: Material) -> float:
    return m.prony.g[i] if i < len(m.prony.g) else 0.0


def _time(i: int, m: Material) -> float:
    return m.prony.tau[i] if i < len(m.prony.tau) else 1.0


def relaxed(scene: Scene) -> Scene:
    """Return the scene whose statics are the relaxed limit: what branches are added to."""
    return _made(scene, lambda m: replace(m, prony=replace(m.prony, statics="relaxed")))


def taut(scene: Scene) -> Scene:
    """Return the scene with all branches taut: its instantaneous moduli."""
    return _made(scene, lambda m: stiffened(m, m.prony.instant))


def _made(scene: Scene, of: Callable[[Material], Material]) -> Scene:
    regions = tuple(replace(r, material=of(r.material)) for r in scene.regions)
    return replace(scene, material=of(scene.material), regions=regions)


def second_stress(law: Law, H: Floats) -> Floats:
    """S = F^-1 P (..., 3, 3) Pa."""
    F = H + EYE
    J = (1 + volume_change(H))[..., None, None]
    return np.asarray(np.swapaxes(cofactor(F), -1, -2) @ law.stress(H) / J)


@dataclass(frozen=True)
class Lagged:
    """An isochoric law at the end of a step: P + share P + F rest. Its energy is the relaxed one.

    `whole`, if any, has the volumetric part besides: the law of a material point.
    """

    law: Law
    share: Floats
    rest: Floats
    whole: Law | None = None

    @property
    def mu(self) -> float:
        return self.law.mu

    @property
    def kappa(self) -> float:
        return self.law.kappa

    @property
    def least_stretch(self) -> float:
        return self.law.least_stretch

    @property
    def most_stretch(self) -> float:
        return self.law.most_stretch

    def energy(self, H: Floats) -> Floats:
        return (self.whole or self.law).energy(H)

    def stress(self, H: Floats) -> Floats:
        P = self.law.stress(H)
        own = P if self.whole is None else self.whole.stress(H)
        return np.asarray(own + self.share[..., None, None] * P + (H + EYE) @ self.rest)

    def tangent(self, H: Floats) -> Floats:
        A = self.law.tangent(H)
        own = A if self.whole is None else self.whole.tangent(H)
        lag = self.share[..., None, None, None, None] * A + outer("ij,JK->JijK", EYE, self.rest)
        return np.asarray(own + lag)

    def dilatation(self, H: Floats) -> tuple[Floats, Floats]:
        return self.law.dilatation(H)

    def curvature(self, H: Floats) -> Floats:
        return self.law.curvature(H)

    def volumetric(self, s: Floats, kappa: float) -> tuple[Floats, Floats, Floats]:
        return self.law.volumetric(s, kappa)
