"""A material point against closed forms: incompressible, St. Venant-Kirchhoff, small strain."""

import numpy as np
import pytest
from law_samples import NAMES, sample

from validate.errors import SceneError
from validate.fem.laws.law import law_of
from validate.fem.laws.plane_stress import response
from validate.scene.material import LawName, Material
from validate.scene.meshless import MaterialPoint, StretchMode

E, NU = 12_000.0, 0.4
STRETCHES = np.array([0.6, 0.8, 1.0, 1.2, 1.5])
MODES: tuple[StretchMode, ...] = ("uniaxial", "equibiaxial", "pure_shear")
#: Small-strain modulus over E by mode, and the power of the incompressible stress.
STIFFER = {"uniaxial": 1.0, "equibiaxial": 1 / (1 - NU), "pure_shear": 1 / (1 - NU**2)}
POWER = {"uniaxial": -2, "equibiaxial": -5, "pure_shear": -3}


def point(mode: StretchMode, law: LawName, nu: float = NU) -> MaterialPoint:
    return MaterialPoint(Material(E, nu, law), mode)


@pytest.mark.parametrize("mode", MODES)
def test_neo_hooke_tends_to_the_incompressible_form(mode: StretchMode) -> None:
    """mu (l - l^-2), mu (l - l^-5), mu (l - l^-3); the gap falls with 1 - 2 nu."""
    gaps = []
    for nu in (0.4999, 0.49999):
        found = response(point(mode, "neo_hooke", nu), STRETCHES)
        exact = E / (2 * (1 + nu)) * (STRETCHES - STRETCHES ** POWER[mode])
        gaps.append(np.abs(found["nominal_stress"] - exact).max() / E)
    assert gaps[1] < 1e-3
    assert gaps[1] == pytest.approx(gaps[0] / 10, rel=0.01)


@pytest.mark.parametrize("mode", MODES)
def test_saint_venant_kirchhoff_is_its_closed_form(mode: StretchMode) -> None:
    """P = E' l (l^2 - 1)/2 for every nu, E' the small-strain modulus of the mode."""
    stretches = np.array([0.6, 0.9, 1.0, 1.1, 1.3])
    found = response(point(mode, "svk"), stretches)["nominal_stress"]
    exact = STIFFER[mode] * E * stretches * (stretches**2 - 1) / 2
    assert found == pytest.approx(exact, rel=1e-12, abs=1e-12 * E)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("mode", MODES)
def test_small_strain_has_the_modulus_and_the_sign_of_the_strain(
    mode: StretchMode, name: str
) -> None:
    strain = np.array([-1e-8, 0.0, 1e-8])
    found = response(MaterialPoint(sample(name, E, NU), mode), 1 + strain)
    assert found["nominal_stress"] == pytest.approx(STIFFER[mode] * E * strain, rel=1e-6, abs=1e-12)
    assert (found["free_stretch"] - 1)[[0, 2]] @ strain[[0, 2]] < 0


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("mode", MODES)
def test_stress_is_the_slope_of_the_energy(mode: StretchMode, name: str) -> None:
    """With free faces without stress: dW/dl = P, twice that where two directions are pulled."""
    place, step = MaterialPoint(sample(name, E, NU), mode), 1e-5

    def energy(stretch: float) -> float:
        free = float(response(place, np.array([stretch]))["free_stretch"][0])
        second = {"uniaxial": free, "equibiaxial": stretch, "pure_shear": 1.0}[mode]
        H = np.diag([stretch, second, free])[None] - np.eye(3)
        return float(law_of(place.material).energy(H)[0])

    pulled = 2 if mode == "equibiaxial" else 1
    for stretch in (0.8, 1.2):
        slope = (energy(stretch + step) - energy(stretch - step)) / (2 * step)
        found = response(place, np.array([stretch]))["nominal_stress"][0]
        assert slope == pytest.approx(pulled * found, rel=1e-7)


def test_the_volume_follows_the_stretches() -> None:
    found = response(point("uniaxial", "neo_hooke"), STRETCHES)
    assert found["volume_ratio"] == pytest.approx(STRETCHES * found["free_stretch"] ** 2, rel=1e-14)
    assert point("uniaxial", "svk").inputs == ("stretch",)


def test_states_that_a_law_does_not_have_are_refused() -> None:
    with pytest.raises(SceneError, match="law 'linear' has no large-strain form"):
        response(point("uniaxial", "linear"), STRETCHES)
    with pytest.raises(SceneError, match=r"stretch 0.5.*'svk'.*above 0.5774"):
        response(point("uniaxial", "svk"), np.array([0.5]))
    with pytest.raises(SceneError, match=r"stretch 0.*'neo_hooke'.*above 0"):
        response(point("uniaxial", "neo_hooke"), np.array([0.0]))
    with pytest.raises(SceneError, match=r"stretch 6.*'yeoh'.*above 0.2 up to 5"):
        response(point("uniaxial", "yeoh"), np.array([0.3, 6.0]))
    with pytest.raises(SceneError, match="at stretch 2 no lateral stretch gives"):
        response(point("uniaxial", "svk"), np.array([1.1, 2.0]))
    with pytest.raises(SceneError, match="stretches: 1 of 1 values not finite"):
        response(point("uniaxial", "svk"), np.array([np.nan]))


def test_two_stretches_have_the_incompressible_stresses() -> None:
    """P1 = 2 (l1 - l3^2/l1) (C10 + C01 l2^2), P2 with the indices changed, l3 = 1/(l1 l2)."""
    pairs = np.array([[1.1, 1.0], [1.6, 1.18], [2.2, 0.82], [0.8, 1.3]])
    (l1, l2), C10, C01 = pairs.T, 12e3, 3e3
    found = response(MaterialPoint(Material.mooney_rivlin(C10, C01, 0.499999), "biaxial"), pairs)
    free = 1 / (l1 * l2)
    first = 2 * (l1 - free**2 / l1) * (C10 + C01 * l2**2)
    second = 2 * (l2 - free**2 / l2) * (C10 + C01 * l1**2)
    assert found["nominal_stress"] == pytest.approx(first, rel=1e-4)
    assert found["second_stress"] == pytest.approx(second, rel=1e-4, abs=2.0)
    assert found["free_stretch"] == pytest.approx(free, rel=1e-5)


@pytest.mark.parametrize("mode", MODES)
def test_every_mode_is_a_pair_of_stretches(mode: StretchMode) -> None:
    """The second stretch of the mode given as an input: the same stresses."""
    material = sample("yeoh", E, NU)
    one = response(MaterialPoint(material, mode), STRETCHES)
    beside = {"uniaxial": one["free_stretch"], "equibiaxial": STRETCHES}
    second = beside.get(mode, np.ones(len(STRETCHES)))
    both = response(MaterialPoint(material, "biaxial"), np.stack([STRETCHES, second], axis=1))
    for name in one:
        assert both[name] == pytest.approx(one[name], rel=1e-9, abs=1e-9 * E)


def test_each_input_has_its_stretch() -> None:
    two = point("biaxial", "neo_hooke")
    assert two.inputs == ("stretch", "second")
    with pytest.raises(SceneError, match=r"stretches: .*\(3, 1\)"):
        response(two, np.array([1.0, 1.1, 1.2]))


@pytest.mark.parametrize("mode", MODES)
def test_a_law_of_powers_is_its_closed_form_far_out(mode: StretchMode) -> None:
    """G (2/a) (l^(a-1) - l3^a/l): at stretch 7 the third direction is down to a fiftieth."""
    G, a, l = 2e5, 2.4946, np.array([0.5, 3.0, 5.0, 7.0])
    free = {"uniaxial": l**-0.5, "equibiaxial": l**-2, "pure_shear": 1 / l}[mode]
    law = Material.ogden((2 * G / a,), (a,), 0.4999999, stretches=(1e-2, 10.0))
    found = response(MaterialPoint(law, mode), l)["nominal_stress"]
    assert found == pytest.approx(2 * G / a * (l ** (a - 1) - free**a / l), rel=1e-4)
