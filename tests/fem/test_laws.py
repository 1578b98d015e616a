"""Every law at a point: derivatives, invariance, linear limit, closed forms, equal stretches."""

from collections.abc import Callable
from typing import get_args

import numpy as np
import pytest
from law_samples import NAMES, sample

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.laws.law import law_of
from validate.fem.laws.plane_stress import response
from validate.scene.laws import LAWS, Coefficients, VolumetricName, ogden_terms
from validate.scene.material import LawName, Material
from validate.scene.meshless import MaterialPoint, StretchMode
from validate.testing.laws import law_contract, rotation

every = pytest.mark.parametrize("name", NAMES)
EYE = np.eye(3)


def turned(seed: int) -> Floats:
    return rotation(np.random.default_rng(seed))


def test_there_is_a_sample_of_every_law_and_form() -> None:
    assert get_args(LawName) == ("linear", *(kind.name for kind in LAWS))
    forms = {(k.name, form) for k in LAWS for form in k.volumetric or ("split",)}
    made = {(sample(n).law, sample(n).coefficients.volumetric) for n in NAMES}
    assert made == forms


@every
@pytest.mark.parametrize("check", law_contract, ids=lambda check: check.__name__)
def test_a_law_keeps_its_contract(check: Callable[[Material], None], name: str) -> None:
    check(sample(name))


@pytest.mark.parametrize("form", ["split", "coupled"])
@pytest.mark.parametrize("gap", [0.0, 1e-15, 1e-12, 1e-9, 1e-6, 1e-3])
def test_equal_stretches_are_no_special_case(form: VolumetricName, gap: float) -> None:
    """Ogden with powers 2 and -2 is Mooney-Rivlin, with 2 alone neo-Hooke: they know no principal
    stretches."""
    mu, nu = 5_000.0, 0.45
    if form == "split":
        mine = law_of(Material.ogden((0.76 * mu, -0.24 * mu), (2.0, -2.0), nu))
        other = law_of(Material.mooney_rivlin(0.38 * mu, 0.12 * mu, nu))
    else:
        mine = law_of(Material.ogden((0.6 * mu, 0.4 * mu), (2.0, 2.0), nu, form))
        other = law_of(Material.mooney_rivlin(mu / 2, 0.0, nu, form))
    for stretches in ([1.3, 1.3 + gap, 0.8], [1.2, 1.2 + gap, 1.2 - gap], [1.0, 1.0 + gap, 1.0]):
        H = turned(1) @ np.diag(stretches) @ turned(2) - EYE
        assert mine.stress(H) == pytest.approx(other.stress(H), abs=1e-13 * other.kappa)
        assert mine.tangent(H) == pytest.approx(other.tangent(H), abs=1e-13 * other.kappa)


@pytest.mark.parametrize("name", ["ogden", "ogden_coupled"])
def test_the_tangent_of_three_terms_at_equal_stretches(name: str) -> None:
    law, h = law_of(sample(name)), 1e-6
    dH = np.random.default_rng(3).normal(size=(3, 3))
    for stretches in ([1.3, 1.3, 0.8], [1.2, 1.2, 1.2], [0.7, 1.0, 0.7]):
        H = turned(1) @ np.diag(stretches) @ turned(2) - EYE
        slope = (law.stress(H + h * dH) - law.stress(H - h * dH)) / (2 * h)
        change = np.einsum("JijK,jK->iJ", law.tangent(H), dH)
        assert slope == pytest.approx(change, abs=1e-8 * np.abs(change).max())


def test_published_coefficients_are_what_they_are() -> None:
    """Treloar's rubber by Ogden (1972): mu .63, .0012, -.01 MPa, alpha 1.3, 5, -2: mu .4225 MPa."""
    treloar = Material.ogden(
        (0.63e6, 0.0012e6, -0.01e6), (1.3, 5.0, -2.0), 0.4995, stretches=(0.2, 7.0)
    )
    assert treloar.shear_modulus == pytest.approx(0.4225e6, rel=1e-12)
    terms = ogden_terms(treloar.coefficients, treloar.shear_modulus)
    assert np.ravel(terms) == pytest.approx([0.63e6, 1.3, 0.0012e6, 5.0, -0.01e6, -2.0], rel=1e-12)
    assert law_of(Material.mooney_rivlin(3e3, 1e3, 0.4)).mu == pytest.approx(8e3)
    assert law_of(Material.yeoh(3e3, 100.0, 5.0, 0.4, rho=1000.0)).mu == pytest.approx(6e3)


# Closed forms in the incompressible limit: P = (l - l^p) times a factor of the law.

MODES: tuple[StretchMode, ...] = ("uniaxial", "equibiaxial", "pure_shear")
STRETCHES = np.array([0.6, 0.8, 1.0, 1.2, 1.5, 2.0])
POWER = {"uniaxial": -0.5, "equibiaxial": 1.0, "pure_shear": 0.0}  # of the second stretch


def incompressible(material: Material, mode: StretchMode) -> Floats:
    """Nominal stress: dW/dl along the mode, half of it where two directions are pulled."""
    l, c, mu = STRETCHES, material.coefficients, material.shear_modulus
    second = POWER[mode]
    powers = (1.0, second, -1 - second)
    terms = ogden_terms(c, mu)
    if material.law != "ogden":
        terms = ((mu - 2 * c.C01, 2.0), (-2 * c.C01, -2.0))
    slope = sum(m * k * l ** (k * a - 1) for m, a in terms for k in powers)
    if material.law == "yeoh":
        I1 = sum(l ** (2 * k) for k in powers)
        dI1 = sum(2 * k * l ** (2 * k - 1) for k in powers)
        slope = slope + (2 * c.C20 * (I1 - 3) + 3 * c.C30 * (I1 - 3) ** 2) * dI1
    return np.asarray(slope / (2 if mode == "equibiaxial" else 1))


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", [n for n in NAMES if n != "svk"])
def test_the_incompressible_curves_are_reached(name: str, mode: StretchMode) -> None:
    """The gap to the closed form falls with 1 - 2 nu, in both volumetric forms."""
    gaps = []
    for nu in (0.4999, 0.49999):
        material = sample(name, nu=nu)
        found = response(MaterialPoint(material, mode), STRETCHES)["nominal_stress"]
        exact = incompressible(material, mode)
        gaps.append(np.abs(found - exact).max() / np.abs(exact).max())
    assert gaps[1] < 5e-3
    assert gaps[1] == pytest.approx(gaps[0] / 10, rel=0.05)


@pytest.mark.parametrize("name", [n for n in NAMES if n != "svk"])
def test_simple_shear_has_its_closed_form(name: str) -> None:
    """F = I + g e1 e2 keeps the volume: P_12 of every law, whatever nu and volumetric form."""
    material, g = sample(name, nu=0.3), 0.7
    law, c, mu = law_of(material), material.coefficients, material.shear_modulus
    found = float(law.stress(g * np.outer([1, 0, 0], [0, 1, 0]))[0, 1])
    if material.law == "ogden":
        l = g / 2 + np.sqrt(1 + g * g / 4)
        slope = sum(m * (l**a - l**-a) for m, a in ogden_terms(c, mu)) / (l + 1 / l)
        assert found == pytest.approx(slope, rel=1e-12)
    else:
        more = 4 * c.C20 * g**3 + 6 * c.C30 * g**5
        assert found == pytest.approx(mu * g + more, rel=1e-12)


def test_volume_work_of_both_forms() -> None:
    """F = l I: P is kappa/2 (l^6 - 1)/l of the split form, mu (l - 1/l) + 3 lambda ln l/l of the
    coupled one."""
    E, nu, l = 15_200.0, 0.3, 1.3
    split = law_of(Material(E, nu, "neo_hooke"))
    coupled = law_of(Material(E, nu, "neo_hooke", coefficients=Coefficients(volumetric="coupled")))
    H = (l - 1) * EYE
    lam = split.kappa - 2 * split.mu / 3
    assert split.stress(H) == pytest.approx(split.kappa / 2 * (l**6 - 1) / l * EYE, rel=1e-13)
    exact = split.mu * (l - 1 / l) + 3 * lam * np.log(l) / l
    assert coupled.stress(H) == pytest.approx(exact * EYE, rel=1e-13)


def test_what_has_no_form_at_large_strain_or_no_isochoric_part_is_refused() -> None:
    with pytest.raises(SceneError, match="law 'linear' has no large-strain form"):
        law_of(Material(1.0, 0.3))
    coupled = Material(1.0, 0.3, "neo_hooke", coefficients=Coefficients(volumetric="coupled"))
    with pytest.raises(SceneError, match=r"'neo_hooke'.*coupled"):
        law_of(coupled, isochoric=True)
