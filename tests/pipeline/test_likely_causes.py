"""Likely causes of a difference in motion: each planted one comes first, with its number."""

from dataclasses import replace

import numpy as np
import pytest

from validate.arrays import Floats
from validate.pipeline.checks.likely_causes import Difference, likely_causes
from validate.register.observation import History

T = np.linspace(0.0, 2.0, 401)
F = 2.8
SIZES = np.array([1.0, 0.6, 0.35])


def swing(t: Floats, f: float = F, damping: float = 0.03) -> Floats:
    """(nt,) of a body let go, 1 at last."""
    w = 2 * np.pi * f
    y = 1 - np.exp(-damping * w * np.clip(t, 0, None)) * np.cos(w * t)
    return np.where(t < 0, 0.0, y)


def motions(y: Floats, *, inertia: bool = True) -> Difference:
    """Three markers that move by their own sizes along z, mm; measured exactly as simulated."""
    x = np.zeros((len(T), 3, 3))
    x[:, :, 2] = 1e-3 * y[:, None] * SIZES
    return Difference(History("m", T, ("a", "b", "c"), x, x, "m", 0.0, each=True), inertia, F)


def changed(
    found: Difference, *, inertia: bool | None = None, first: float = 0.0, **arrays: object
) -> Difference:
    """With other arrays of its history."""
    history = replace(found.history, **arrays)  # type: ignore[arg-type]
    return Difference(history, found.inertia if inertia is None else inertia, first or found.first)


def first(found: Difference) -> tuple[str, str]:
    noise = np.random.default_rng(1).normal(0, 5e-6, found.measured.shape)
    cause = likely_causes(changed(found, measured=found.measured + noise))[0]
    return cause.name, cause.words


def test_statics_of_a_swing_is_inertia() -> None:
    found = motions(swing(T))
    still = motions(np.ones_like(T), inertia=False)
    name, words = first(changed(found, simulated=still.simulated, inertia=False))
    assert name == "inertia"
    assert "2.8 Hz" in words


def test_a_lag_is_the_clock() -> None:
    found = changed(motions(swing(T)), measured=motions(swing(T - 0.02)).measured)
    words = "the recorded motion comes 19.6 ms later than the simulated one"
    assert first(found) == ("clock", words)


@pytest.mark.parametrize(("factor", "name"), [(1000.0, "wrong unit"), (1.2, "load or modulus")])
def test_a_factor_is_a_unit_or_the_modulus(factor: float, name: str) -> None:
    found = motions(np.clip(T, 0, 1), inertia=False)
    assert first(changed(found, measured=factor * found.measured))[0] == name


def test_another_frequency_is_the_modulus_or_the_density() -> None:
    found = changed(motions(swing(T)), measured=motions(swing(T, f=1.1 * F)).measured)
    name, words = first(found)
    assert name == "modulus or density"
    assert "1.21 times" in words


def test_another_damping_is_named() -> None:
    found = changed(motions(swing(T)), measured=motions(swing(T, damping=0.08)).measured)
    assert first(found)[0] == "damping"


def test_exchanged_and_loose_markers_are_named() -> None:
    found = motions(swing(T))
    exchanged = found.measured[:, [1, 0, 2]]
    assert "'a' moves as 'b' should" in first(changed(found, measured=exchanged))[1]
    loose = found.measured * np.array([1.0, 1.0, 0.3])[:, None]
    name, words = first(changed(found, measured=loose))
    assert (name, "'c' is off by" in words) == ("wrong marker", True)


def test_a_loop_is_friction_and_a_cube_the_law() -> None:
    cycle = motions(np.sin(np.pi * T / 2) ** 2, inertia=False)
    u = cycle.simulated
    loop = u + 0.2 * np.abs(u) * np.sign(np.gradient(u, T, axis=0))
    assert first(changed(cycle, measured=loop, first=60.0))[0] == "contact or friction"
    cubed = u + 0.4e6 * u**3
    assert first(changed(cycle, measured=cubed, first=60.0))[0] in ("law", "load or modulus")
    assert "law" in {c.name for c in likely_causes(changed(cycle, measured=cubed, first=60.0))}


def test_noise_and_stillness_have_no_cause() -> None:
    found = motions(swing(T))
    noise = np.random.default_rng(2).normal(0, 1e-5, found.measured.shape)
    assert likely_causes(changed(found, measured=found.measured + noise, sd=1e-5)) == ()
    still = np.zeros_like(found.measured)
    assert likely_causes(changed(found, measured=still, simulated=still)) == ()


def of_a_force(measured: Floats, simulated: Floats) -> Difference:
    """One number in N over time."""
    y, u = (x[:, None, None] for x in (measured, simulated))
    return Difference(History("force", T, ("force",), y, u, "N", 0.01), False, 60.0)


RAMP = np.clip(T, 0.2, 1.8) - 0.2  # N


@pytest.mark.parametrize(("measured", "name", "words"), [
    (RAMP + 0.3, "zero", "a mean of 0.300 N"),
    (1000 * RAMP, "wrong unit", "near 1000"),
    (1.3 * RAMP, "load or modulus", "that multiple of the modulus"),
    (np.interp(T - 0.1, T, RAMP), "clock", "later than the simulated one"),
])  # fmt: skip
def test_a_force_alone_has_causes(measured: Floats, name: str, words: str) -> None:
    cause = likely_causes(of_a_force(measured, RAMP))[0]
    assert (cause.name, words in cause.words) == (name, True), cause


def test_a_force_that_rings_over_statics_is_inertia() -> None:
    found = of_a_force(swing(T), np.ones_like(T))
    assert likely_causes(Difference(found.history, False, F))[0].name == "inertia"


def test_places_of_an_outline_are_no_markers() -> None:
    """None of them can be exchanged or loose."""
    x = 1e-3 * swing(T)[:, None, None] * np.array([[1.0, 0.5], [0.2, 0.1]])
    exchanged = History("outline", T, ("a", "b"), x[:, ::-1], x, "m", 0.0)
    assert "wrong marker" not in {c.name for c in likely_causes(Difference(exchanged, True, F))}
