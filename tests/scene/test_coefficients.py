"""Coefficients of laws: who knows which, and where they lose positive energy."""

import numpy as np
import pytest
from law_samples import NAMES, sample

from validate.errors import SceneError
from validate.fem.laws.plane_stress import response
from validate.parameters import describe, with_values
from validate.scene.geometries.box import box
from validate.scene.laws import LAWS, Coefficients
from validate.scene.material import Material
from validate.scene.meshless import MaterialPoint
from validate.scene.scene import Scene


def test_coefficients_that_the_law_would_not_use_are_refused() -> None:
    with pytest.raises(SceneError, match=r"'neo_hooke'.*know C01 = 5.0.* mooney_riv"):
        Material(1e4, 0.4, "neo_hooke", coefficients=Coefficients(C01=5.0))
    with pytest.raises(SceneError, match="'svk' does not know volumetric = coupled"):
        Material(1e4, 0.4, "svk", coefficients=Coefficients(volumetric="coupled"))
    with pytest.raises(SceneError, match=r"'linear' does not know stretches"):
        Material(1e4, 0.4, coefficients=Coefficients(stretches=(0.5, 2.0)))
    with pytest.raises(SceneError, match=r"'yeoh' does not know C01 = 5.0"):
        Material(1e4, 0.4, "yeoh", coefficients=Coefficients(C01=5.0, C20=1.0))


def test_malformed_coefficients_are_refused() -> None:
    with pytest.raises(SceneError, match=r"2 powers \(2.0, 3.0\) and 0 moduli"):
        Coefficients(ogden_alpha=(2.0, 3.0))
    with pytest.raises(SceneError, match="none of them 0"):
        Coefficients(ogden_alpha=(0.0,))
    with pytest.raises(SceneError, match="nan among them"):
        Coefficients(C20=np.nan)
    for wrong in ((1.1, 2.0), (0.5,), (0.5, 0.9)):
        with pytest.raises(SceneError, match=r"between 0 and 1.*above 1"):
            Coefficients(stretches=wrong)
    with pytest.raises(SceneError, match="Ogden: 2 moduli for 1 powers"):
        Material.ogden((1.0, 2.0), (2.0,), 0.4)


def test_another_law_keeps_what_it_knows() -> None:
    card = sample("mooney_rivlin_coupled")
    assert card.of_law("mooney_rivlin") == card
    neo = card.of_law("neo_hooke")
    assert neo.coefficients == Coefficients(volumetric="coupled")
    assert (neo.E, neo.nu) == (card.E, card.nu)
    assert card.of_law("linear").coefficients == Coefficients()


@pytest.mark.parametrize("name", NAMES)
def test_every_sample_is_stable(name: str) -> None:
    assert sample(name).shear_modulus > 0


def test_a_mooney_rivlin_that_turns_soft_says_at_which_stretch() -> None:
    """Where the two pulled directions are equal, changing one against the other costs
    2 (C10 l^2 + C01/l^2): nothing left at l = (-C01/C10)^(1/4)."""
    C10, C01 = 1200.0, -200.0
    with pytest.raises(SceneError, match="C10 = 1200 Pa, C01 = -200 Pa loses") as refused:
        Material.mooney_rivlin(C10, C01, 0.45)
    assert "(equibiaxial)" in str(refused.value)
    assert at_stretch(str(refused.value)) == pytest.approx((-C01 / C10) ** 0.25, rel=3e-3)
    assert Material.mooney_rivlin(C10, C01, 0.45, stretches=(0.65, 1.5)).shear_modulus == 2000.0


def test_no_stretch_short_of_the_named_one_is_unstable() -> None:
    """Yeoh with C20 < 0: true stress rises along every curve up to the stretch that is refused."""
    with pytest.raises(SceneError, match="loses positive energy") as refused:
        Material.yeoh(1000.0, -100.0, 0.0, 0.4999)
    end = abs(np.log(at_stretch(str(refused.value))))
    ends = (float(np.exp(-0.98 * end)), float(np.exp(0.98 * end)))
    card = Material.yeoh(1000.0, -100.0, 0.0, 0.4999, stretches=ends)
    stretches = np.exp(np.linspace(-0.97 * end, 0.97 * end, 30))
    found = response(MaterialPoint(card, "uniaxial"), stretches)["nominal_stress"]
    assert (np.diff(found * stretches) > 0).all()


def at_stretch(words: str) -> float:
    return float(words.split("at stretch ")[1].split()[0])


def test_the_coupled_form_keeps_the_volume_stiff() -> None:
    with pytest.raises(SceneError, match="lambda - 4 C01 - 8 C20 >= 0, it is -"):
        Material.mooney_rivlin(1e3, 1e3, 0.1, "coupled")
    assert Material.mooney_rivlin(1e3, 1e3, 0.45, "coupled").nu == 0.45


def test_coefficients_are_reached_by_the_paths_of_the_material() -> None:
    card = with_values(sample("mooney_rivlin"), {"C01": "0.5kPa", "stretches": "0.5,2"})
    assert card.coefficients.C01 == 500.0
    units = {p.path: p.unit for p in describe(card)}
    assert {k: units[k] for k in ("E", "C01", "ogden_mu", "ogden_alpha", "rho")} == {
        "E": "Pa", "C01": "Pa", "ogden_mu": "Pa", "ogden_alpha": "1", "rho": "kg/m^3",
    }  # fmt: skip
    known = {name for kind in LAWS for name in kind.coefficients}
    assert known <= set(units)


def test_a_fit_may_pass_through_unstable_coefficients_and_a_body_may_not() -> None:
    """C10 1200, C01 -200 Pa: equal pulls lose their stiffness at (200/1200)^(1/4)."""
    c = Coefficients(C01=-200.0, stability="open")
    card = Material(2 * 1000 * 2 * 1.45, 0.45, "mooney_rivlin", coefficients=c)
    lost = c.lost_stability(card.law, card.shear_modulus)
    assert lost is not None
    assert (lost.mode, lost.stretch) == ("equibiaxial", pytest.approx(6**-0.25, rel=2e-3))
    assert Coefficients(C20=10.0).lost_stability("yeoh", 1000.0) is None
    pulled = response(MaterialPoint(card, "uniaxial"), np.array([1.0, 2.0]))["nominal_stress"]
    assert pulled[1] > 0
    with pytest.raises(SceneError, match="loses positive energy at stretch"):
        Scene(box((0.02, 0.02, 0.02), (1, 1, 1)), card)
