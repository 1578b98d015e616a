"""Finite viscoelasticity at a point: relaxation, limits of the rate, order, dissipation."""

from dataclasses import replace

import numpy as np
import pytest
from law_samples import SPLIT, sample

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.laws.law import law_of, parts_of, stiffened
from validate.fem.laws.plane_stress import response
from validate.fem.laws.viscoelasticity import Lagged, branches_of, second_stress
from validate.scene.laws import Coefficients
from validate.scene.material import Material, Prony
from validate.scene.meshless import MaterialPoint, StretchMode

LAWS = [n for n in SPLIT if n != "svk"]
SERIES = Prony((0.8, 0.4), (0.05, 1.0))
MODES: tuple[StretchMode, ...] = ("uniaxial", "equibiaxial", "pure_shear")


def viscous(name: str, nu: float = 0.45, series: Prony = SERIES) -> Material:
    return replace(sample(name, nu=nu), prony=series)


def pulled(material: Material, t: Floats, stretch: Floats) -> Floats:
    return response(MaterialPoint(material, "uniaxial"), stretch, t)["nominal_stress"]


@pytest.mark.parametrize("name", LAWS)
def test_relaxation_after_a_step_is_the_prony_series(name: str) -> None:
    """At a held F the isochoric stress falls as 1 + sum g exp(-t/tau), the volumetric one stays."""
    law, shape = law_of(sample(name)), law_of(sample(name), isochoric=True)
    branches, H = branches_of(viscous(name)), np.array([[[0.3, 0.2, 0], [0, -0.1, 0.1], [0, 0, 0]]])
    memory = branches.at_rest((1,))
    P, S, t, dt = shape.stress(H), second_stress(shape, H), 0.0, 0.0
    for _ in range(40):
        lagged = Lagged(shape, *branches.lag(memory, dt), law)
        series = sum(g * np.exp(-t / tau) for g, tau in zip(SERIES.g, SERIES.tau, strict=True))
        exact = law.stress(H) + series * P
        assert lagged.stress(H) == pytest.approx(exact, rel=1e-13, abs=1e-12 * np.abs(P).max())
        memory, dt = branches.advanced(memory, S, dt), 0.03
        t += dt


@pytest.mark.parametrize("mode", MODES)
def test_a_held_stretch_relaxes_from_the_instantaneous_to_the_relaxed_stress(
    mode: StretchMode,
) -> None:
    """A point near nu = .5: its lateral stretch does not move, so that the stress is the series."""
    material = viscous("mooney_rivlin", 0.4999)
    t = np.array([0.0, 0.01, 0.1, 1.0, 30.0])
    found = response(MaterialPoint(material, mode), np.full(5, 1.4), t)["nominal_stress"]
    series = 1 + sum(g * np.exp(-t / tau) for g, tau in zip(SERIES.g, SERIES.tau, strict=True))
    assert found / found[-1] == pytest.approx(series, rel=2e-3)
    # Over the last, long step the lateral stretch moves a little, which is remembered.
    for limit, at, off in (("instantaneous", 0, 1e-10), ("relaxed", 4, 1e-5)):
        static = replace(material, prony=replace(SERIES, statics=limit))
        exact = response(MaterialPoint(static, mode), np.array([1.4]))["nominal_stress"][0]
        assert found[at] == pytest.approx(exact, rel=off)


def test_fast_is_instantaneous_and_slow_is_relaxed() -> None:
    material = viscous("yeoh")
    stretch = np.linspace(1.0, 1.5, 51)
    for limit, duration, off in (("instantaneous", 1e-7, 1e-5), ("relaxed", 1e7, 1e-5)):
        static = replace(material, prony=replace(SERIES, statics=limit))
        exact = response(MaterialPoint(static, "uniaxial"), stretch)["nominal_stress"]
        found = pulled(material, duration * np.linspace(0, 1, 51), stretch)
        assert found == pytest.approx(exact, abs=off * exact.max())


@pytest.mark.slow
@pytest.mark.parametrize("name", ["neo_hooke", "ogden"])
def test_the_recursion_is_of_order_two(name: str) -> None:
    material = viscous(name, series=Prony((1.0,), (0.2,)))

    def last(n: int) -> float:
        t = np.linspace(0, 1.0, n + 1)
        return float(pulled(material, t, 1 + 0.4 * np.sin(2.0 * t) ** 2)[-1])

    values = [last(n) for n in (20, 40, 80, 160)]
    steps = np.abs(np.diff(values))
    assert steps[0] / steps[1] == pytest.approx(4, rel=0.1)
    assert steps[1] / steps[2] == pytest.approx(4, rel=0.05)


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.slow
def test_closed_cycles_take_energy(name: str) -> None:
    """The work over one period, after the first ones: never negative at any rate."""
    for period in (1e-3, 0.3, 3.0, 300.0):
        n = 30
        t = period * np.arange(3 * n + 1) / n
        stretch = 1 + 0.35 * np.sin(2 * np.pi * t / period)
        P = pulled(viscous(name), t, stretch)
        middle, steps = (P[1:] + P[:-1]) / 2, np.diff(stretch)
        work = float((middle * steps)[2 * n :].sum())
        assert work > -1e-6 * np.abs(P).max()
        if 0.01 < period < 10:
            assert work > 1e-3 * np.abs(P).max()


@pytest.mark.slow
def test_small_oscillations_have_the_loss_factor_of_the_series() -> None:
    """G' = G (1 + sum g w^2 tau^2/(1 + w^2 tau^2)), G'' = G sum g w tau/(1 + w^2 tau^2)."""
    w, n, cycles = 7.0, 60, 12
    t = 2 * np.pi / w * np.arange(cycles * n) / n
    material = viscous("neo_hooke", 0.49999)
    stress = pulled(material, t, 1 + 1e-5 * np.sin(w * t))
    late = slice((cycles - 2) * n, None)
    inphase = 2 * np.mean(stress[late] * np.sin(w * t[late])) / 1e-5
    lost = 2 * np.mean(stress[late] * np.cos(w * t[late])) / 1e-5
    x = w * np.array(SERIES.tau)
    g, E = np.array(SERIES.g), 3 * material.shear_modulus
    assert inphase == pytest.approx(E * (1 + (g * x**2 / (1 + x**2)).sum()), rel=2e-3)
    assert lost == pytest.approx(E * (g * x / (1 + x**2)).sum(), rel=2e-3)


@pytest.mark.parametrize("name", LAWS)
def test_the_algorithmic_tangent_is_the_derivative(name: str) -> None:
    rng = np.random.default_rng(2)
    law, shape = law_of(sample(name)), law_of(sample(name), isochoric=True)
    branches, H = branches_of(viscous(name)), 0.3 * rng.uniform(-1, 1, (1, 3, 3))
    memory = branches.advanced(branches.at_rest((1,)), second_stress(shape, H.copy()), 0.02)
    H, dH, h = H + 0.1 * rng.uniform(-1, 1, (1, 3, 3)), rng.normal(size=(3, 3)), 1e-6
    for whole in (law, None):
        lagged = Lagged(shape, *branches.lag(memory, 0.02), whole)
        slope = (lagged.stress(H + h * dH) - lagged.stress(H - h * dH)) / (2 * h)
        change = np.einsum("nJijK,jK->niJ", lagged.tangent(H), dH)
        assert slope == pytest.approx(change, abs=1e-7 * np.abs(change).max())


@pytest.mark.parametrize("name", LAWS)
def test_a_stiffened_material_has_all_of_its_isochoric_part_stiffer(name: str) -> None:
    H = np.array([[0.3, 0.2, 0.0], [0.1, -0.2, 0.1], [0.0, 0.1, 0.1]])
    soft, hard = (law_of(m, isochoric=True) for m in (sample(name), stiffened(sample(name), 2.5)))
    assert hard.stress(H) == pytest.approx(2.5 * soft.stress(H), rel=1e-12, abs=1e-9)
    assert stiffened(sample(name), 2.5).bulk_modulus == pytest.approx(sample(name).bulk_modulus)
    taut = viscous(name, series=replace(SERIES, statics="instantaneous"))
    law, kappa = parts_of(taut, averaged=False)
    assert law.stress(H) == pytest.approx(2.2 * soft.stress(H), rel=1e-12, abs=1e-9)
    assert kappa == sample(name).bulk_modulus


def test_what_cannot_relax_is_refused() -> None:
    with pytest.raises(SceneError, match="2 moduli and 1 times"):
        Prony((1.0, 2.0), (0.1,))
    for wrong in ((-0.1,), (np.nan,)):
        with pytest.raises(SceneError, match="expected positive numbers, otherwise"):
            Prony(wrong, (0.1,))
    for law in ("linear", "svk"):
        with pytest.raises(SceneError, match=f"law '{law}' .* has no isochoric part"):
            Material(1e4, 0.4, law, prony=SERIES)  # type: ignore[arg-type]
    with pytest.raises(SceneError, match=r"'yeoh' .coupled. has no isochoric part"):
        Material(1e4, 0.4, "yeoh", coefficients=Coefficients(volumetric="coupled"), prony=SERIES)
    assert viscous("yeoh").of_law("linear").prony == Prony()
    assert viscous("yeoh").of_law("neo_hooke").prony == SERIES
