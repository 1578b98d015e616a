"""Free stretches of a law: plane stress, and stress-stretch curves at a point.

At every point P_33(H_33) = 0 is solved by secants in the logarithm of that stretch, and the tangent
is condensed: A_iJjK - A_iJ33 A_33jK / A_3333. No pressure is left in the sheet, so that nothing
locks as nu nears .5.

Exact stress-stretch curves of a law at a material point (uniaxial, biaxial, shear). F =
diag(stretch, second, free), the free stretches found so that their stress vanishes: Newton on
S_33(h) = P_33/F_33, h = F_33 - 1, which has no root at a collapsed point as P_33 has.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats, checked
from validate.errors import SceneError
from validate.fem.laws.energies import volume_change
from validate.fem.laws.law import Law, instant, law_of
from validate.fem.laws.viscoelasticity import Lagged, branches_of, second_stress
from validate.scene.material import Material
from validate.scene.meshless import MaterialPoint, StretchMode

_ITERATIONS = 50
_SETTLED = 1e-13  # of kappa + mu: the stress across that is rounding
_STEP = 0.5  # the longest step in the logarithm of the stretch


@dataclass(frozen=True)
class PlaneStress:
    """`law` and its volumetric part of `bulk` Pa as one; H (..., 3, 3) has no component across but
    H_33, which `completed` finds. Nothing is left to a volumetric law of its own."""

    law: Law
    bulk: float

    @property
    def mu(self) -> float:
        return self.law.mu

    @property
    def kappa(self) -> float:
        return self.bulk

    @property
    def least_stretch(self) -> float:
        return self.law.least_stretch

    @property
    def most_stretch(self) -> float:
        return self.law.most_stretch

    def completed(self, H: Floats) -> Floats:
        """H with the H_33 that leaves no stress across; -1 (no thickness) where there is none."""
        flat = volume_change(H)
        sound = flat > -1
        out = np.where(sound[..., None, None], H, 0.0)
        nu = (3 * self.bulk - 2 * self.mu) / (2 * (3 * self.bulk + self.mu))
        log = -nu / (1 - nu) * np.log1p(np.where(sound, flat, 0.0))
        slope = np.full_like(log, self.bulk + 4 * self.mu / 3)  # at rest, then by secants
        before, step = np.zeros_like(log), np.zeros_like(log)
        for _ in range(_ITERATIONS):
            out[..., 2, 2] = np.expm1(log)
            P = self.stress(out)[..., 2, 2]
            left = np.abs(P) > _SETTLED * (self.bulk + self.mu)
            if not left.any():
                break
            moved = left & (step != 0) & (before != P)
            slope = np.where(moved, (P - before) / np.where(moved, step, 1.0), slope)
            step = np.where(left, np.clip(-P / slope, -_STEP, _STEP), 0.0)
            before, log = P, log + step
        out[..., :2, :2] = H[..., :2, :2]
        out[..., 2, 2] = np.where(sound & ~left, out[..., 2, 2], -1.0)
        return out

    def energy(self, H: Floats) -> Floats:
        s, _ = self.law.dilatation(H)
        return np.asarray(self.law.energy(H) + self.law.volumetric(s, self.bulk)[0])

    def stress(self, H: Floats) -> Floats:
        s, slope = self.law.dilatation(H)
        p = self.law.volumetric(s, self.bulk)[1]
        return np.asarray(self.law.stress(H) + p[..., None, None] * slope)

    def tangent(self, H: Floats) -> Floats:
        # The tangent (..., J, i, j, K) Pa in three dimensions
        s, slope = self.law.dilatation(H)
        _, p, stiff = self.law.volumetric(s, self.bulk)
        A = self.law.tangent(H) + p[..., None, None, None, None] * self.law.curvature(H)
        A = np.asarray(A + np.einsum("...,...iJ,...jK->...JijK", stiff, slope, slope))
        across = A[..., 2, 2, 2, 2][..., None, None, None, None]
        toward, away = A[..., :, :, 2, 2], A[..., 2, 2, :, :]
        return np.asarray(A - np.einsum("...Ji,...jK->...JijK", toward, away) / across)

    def dilatation(self, H: Floats) -> tuple[Floats, Floats]:
        return np.zeros(H.shape[:-2]), np.zeros(H.shape)

    def curvature(self, H: Floats) -> Floats:
        return np.broadcast_to(0.0, (*H.shape, 3, 3))

    def volumetric(self, s: Floats, kappa: float) -> tuple[Floats, Floats, Floats]:
        return s, s, s


# Of the free stretch; Newton squares its error, so that one more step is rounding.
_FREE_SETTLED = 1e-14
_COLLAPSED = 1e-6  # a free stretch on its way to none
_ONE, _TWO, _THREE = (np.diag(row) for row in np.eye(3))
# What each stretch that is given, and the free stretch, move of H.
_MOVES: Mapping[StretchMode, tuple[tuple[Floats, ...], Floats]] = {
    "uniaxial": ((_ONE,), _TWO + _THREE),
    "equibiaxial": ((_ONE + _TWO,), _THREE),
    "pure_shear": ((_ONE,), _THREE),
    "biaxial": ((_ONE, _TWO), _THREE),
}


def response(point: MaterialPoint, stretches: Floats, t: Floats | None = None) -> dict[str, Floats]:
    """What the point answers to stretches (nt,), or (nt, k) of its k inputs: each (nt,), by name.

    With a Prony series the stress depends on the times t (nt,) s, and without them is the limit
    that its `statics` says. Before the first one the point was at rest, the first stretch is a
    jump; between times the isochoric stress is linear, so that a course wants times as fine as the
    shortest relaxation that matters.

    "nominal_stress" Pa, force over the area at rest, tension positive; "second_stress" Pa, that of
    the second direction; "free_stretch" -, of the third; "volume_ratio" -. Raises `SceneError` for
    a law without large strain, a stretch below the law's least, and where no free stretch is
    without stress (St. Venant-Kirchhoff pulled far).
    """
    law = law_of(instant(point.material))
    moves, free = _MOVES[point.mode]
    each = np.asarray(stretches).reshape(len(stretches), -1)
    stretch = checked(each, "stretches", (None, len(moves)), error=SceneError)
    for value in (stretch.min(), stretch.max()) if len(stretch) else ():
        if not law.least_stretch < value <= law.most_stretch:
            ends = f"above {law.least_stretch:.4g}"
            ends += f" up to {law.most_stretch:.4g}" if law.most_stretch < np.inf else ""
            raise SceneError(f"stretch {value:.4g}: the law '{point.material.law}' is valid {ends}")
    driven = np.einsum("nk,kiJ->niJ", stretch - 1, np.stack(moves))
    # h of logarithmic strains that are as in small strain
    nu = point.material.nu
    one = nu / (1 - nu)
    shares = {"uniaxial": nu, "equibiaxial": 2 * one, "pure_shear": one, "biaxial": one}
    guess = np.asarray(np.expm1(-shares[point.mode] * np.log(stretch).sum(axis=1)))
    if t is not None and point.material.prony.g:
        h, stress = _relaxing(point.material, driven, free, guess, t)
    else:
        h = _free_strain(law, driven, free, guess)
        stress = law.stress(driven + h[:, None, None] * free)
    ratio = 1 + volume_change(driven + h[:, None, None] * free)
    first, second = (np.asarray(stress[:, i, i]) for i in range(2))
    return {
        "nominal_stress": first, "second_stress": second, "free_stretch": 1 + h,
        "volume_ratio": ratio,
    }  # fmt: skip


def _relaxing(
    material: Material, driven: Floats, free: Floats, guess: Floats, t: Floats
) -> tuple[Floats, Floats]:
    """h (nt,) and P (nt, 3, 3) Pa, time after time; the first one is a jump from rest."""
    law, shape = law_of(material), law_of(material, isochoric=True)
    branches = branches_of(material)
    memory, h, P = branches.at_rest((1,)), guess.copy(), np.empty_like(driven)
    for k, dt in enumerate(np.diff(t, prepend=t[0])):
        lagged = Lagged(shape, *branches.lag(memory, dt), law)
        h[k : k + 1] = _free_strain(lagged, driven[k : k + 1], free, h[max(k - 1, 0)][None])
        H = driven[k : k + 1] + h[k] * free
        P[k] = lagged.stress(H)[0]
        memory = branches.advanced(memory, second_stress(shape, H), dt)
    return h, P


def _free_strain(law: Law, driven: Floats, free: Floats, h: Floats) -> Floats:
    """h (nt,) without stress P_33 at F = I + driven + h free."""
    largest = 1 + np.abs(driven).max(axis=(1, 2))
    for _ in range(_ITERATIONS):
        H = driven + h[:, None, None] * free
        # S_33 = P_33/F_33 (nt,) Pa and its slope along `free`
        length = 1 + h
        P = law.stress(H)[:, 2, 2]
        dP = np.einsum("njK,jK->n", law.tangent(H)[:, 2, 2], free)
        stress, slope = P / length, (dP - P / length) / length
        # A step may not cross zero length.
        change = np.maximum(-stress / slope, -0.9 * (1 + h))
        h = h + change
        # Principal stretches come from F^T F, whose rounding is that of the largest one squared.
        rounding = np.maximum(largest / (1 + h), 1.0) ** 2
        if (np.abs(change) <= _FREE_SETTLED * rounding * (1 + h)).all():
            return h
        if (1 + h < _COLLAPSED).any():
            break
    worst = int(np.argmax(np.abs(change) / (1 + h)))
    raise SceneError(
        f"at stretch {1 + driven[worst, 0, 0]:.4g} no lateral stretch gives zero stress, so "
        "the law has no state there; use a smaller stretch"
    )
