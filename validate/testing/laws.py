"""Contract of a law at large strain, at a point: derivatives, invariance, linear limit, split."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from validate.arrays import Floats
from validate.fem.laws.law import law_of
from validate.scene.material import Material
from validate.testing.pulled_cube import require

_EYE = np.eye(3)
_DRAWS = 25


def stress_and_tangent_are_derivatives(material: Material) -> None:
    """P is the slope of W and A that of P, to 1e-7; A is symmetric: there is an energy."""
    law, h = law_of(material), 1e-6
    for H, rng in _gradients(1e-8, 0.3):
        dH = rng.normal(size=(3, 3))
        P, A = law.stress(H), law.tangent(H)
        change = np.einsum("JijK,jK->iJ", A, dH)
        slope = (law.stress(H + h * dH) - law.stress(H - h * dH)) / (2 * h)
        work = (law.energy(H + h * dH) - law.energy(H - h * dH)) / (2 * h)
        unit = law.mu + law.kappa
        _near(slope, change, 1e-7 * np.abs(change).max(), "the tangent is not the stress's slope")
        _near(work, (P * dH).sum(), 1e-7 * unit, "the stress is not the energy's slope")
        transposed = np.einsum("JijK->jKiJ", A)
        _near(np.moveaxis(A, 0, 1), transposed, 1e-12 * unit, "the tangent is not symmetric")


def it_is_objective_and_isotropic(material: Material) -> None:
    """A rotation of the body, before or after, changes nothing but the stress's frame."""
    law = law_of(material)
    for H, rng in _gradients(1e-3, 0.3):
        Q, R, unit = rotation(rng), rotation(rng), law.mu + law.kappa
        moved = Q @ (H + _EYE) @ R - _EYE
        _near(law.energy(moved), law.energy(H), 1e-13 * unit, "a rotation changes the energy")
        turned = Q @ law.stress(H) @ R
        _near(law.stress(moved), turned, 1e-13 * unit, "a rotation changes the stress")


def small_strains_are_linear(material: Material) -> None:
    """Hooke's law with the material's E and nu; 1e-11 of strain keeps its digits."""
    nearly = replace(material, nu=0.4999)
    law = law_of(nearly)
    _near(law.mu, nearly.shear_modulus, 1e-14 * law.mu, "mu is not the material's")
    _near(law.kappa, nearly.bulk_modulus, 1e-11 * law.kappa, "kappa is not the material's")
    H = 1e-11 * np.random.default_rng(4).normal(size=(3, 3))
    E, lam = (H + H.T) / 2, law.kappa - 2 * law.mu / 3
    linear = 2 * law.mu * E + lam * np.trace(E) * _EYE
    # The strain squared is left: 1e-11 of the largest stress.
    _near(law.stress(H), linear, 1e-9 * np.abs(linear).max(), "the stress is not Hooke's")
    hooke = lam * np.einsum("iJ,jK->JijK", _EYE, _EYE)
    hooke += law.mu * np.einsum("iK,jJ->JijK", _EYE, _EYE)
    hooke += law.mu * np.einsum("ij,JK->JijK", _EYE, _EYE)
    rest = np.zeros((3, 3))
    _near(law.tangent(rest), hooke, 1e-12 * law.kappa, "the tangent at rest is not Hooke's")
    require(not law.stress(rest).any(), "there is stress at rest")


def isochoric_and_volumetric_part_add_up(material: Material) -> None:
    """Of a split law: P = P_isochoric + U'(s) ds/dF, so also energy and tangent.

    Elements with a mean dilatation take the parts one by one.
    """
    if material.coefficients.volumetric != "split":
        return
    law, isochoric = law_of(material), law_of(material, isochoric=True)
    for H, _ in _gradients(1e-3, 0.3):
        s, slope = law.dilatation(H)
        U, p, stiff = law.volumetric(s, law.kappa)
        unit = law.mu + law.kappa
        _near(law.energy(H), isochoric.energy(H) + U, 1e-12 * unit, "the energies do not add up")
        P = isochoric.stress(H) + p * slope
        _near(law.stress(H), P, 1e-12 * unit, "the stresses do not add up")
        A = p * law.curvature(H) + stiff * np.einsum("iJ,jK->JijK", slope, slope)
        _near(law.tangent(H), isochoric.tangent(H) + A, 1e-11 * unit, "tangents do not add up")


def many_points_are_as_one(material: Material) -> None:
    """H (2, 3, 3, 3) of several cells and points gives what each H gives."""
    law = law_of(material)
    H = 0.1 * np.random.default_rng(5).uniform(-1, 1, (2, 3, 3, 3))
    for function in (law.energy, law.stress, law.tangent):
        each = np.array([[function(point) for point in cell] for cell in H])
        what = f"{function.__name__} of several points"
        _near(function(H), each, 1e-13 * (law.mu + law.kappa), what)


def rotation(rng: np.random.Generator) -> Floats:
    """A random rotation (3, 3)."""
    Q, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    return np.asarray(Q * np.sign(np.linalg.det(Q)))


def _gradients(low: float, high: float) -> Iterator[tuple[Floats, np.random.Generator]]:
    """Displacement gradients (3, 3) of sizes between two, of fixed seeds, and the generator."""
    for seed in range(_DRAWS):
        rng = np.random.default_rng(seed)
        size = 10 ** rng.uniform(np.log10(low), np.log10(high))
        yield size * rng.uniform(-1, 1, (3, 3)), rng


def _near(found: Floats | float, expected: Floats | float, within: float, what: str) -> None:
    off = float(np.abs(np.asarray(found) - np.asarray(expected)).max())
    require(off <= within, f"{what}: {off:.3g} apart, expected {within:.3g} at most")


#: Checks of a material with the law.
law_contract: tuple[Callable[[Material], None], ...] = (
    stress_and_tangent_are_derivatives,
    it_is_objective_and_isotropic,
    small_strains_are_linear,
    isochoric_and_volumetric_part_add_up,
    many_points_are_as_one,
)
