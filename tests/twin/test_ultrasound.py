"""The B-mode synthesiser: speckle statistics, levels, attenuation, shadows, grey scale."""

from dataclasses import replace

import numpy as np
import pytest

from validate.errors import SceneError
from validate.twin.ultrasound import Scanner, Target, compressed, envelope

QUIET = Scanner(width=300, height=300, attenuation=0.0, noise=-80.0)


def ring(x: float, y: float, r: float) -> np.ndarray:
    a = np.linspace(0, 2 * np.pi, 90, endpoint=False)
    return np.array([x, y]) + r * np.stack([np.cos(a), np.sin(a)], axis=1)


INCLUSION = ring(15e-3, 12e-3, 5e-3)


def made(target: Target, scanner: Scanner = QUIET, count: int = 6) -> np.ndarray:
    rng = np.random.default_rng(1)
    return np.array([envelope(scanner, target, rng) for _ in range(count)])


def db(power: np.ndarray) -> float:
    return float(10 * np.log10((power**2).mean()))


def test_uniform_tissue_is_fully_developed_speckle() -> None:
    e = made(Target(None))
    assert e.mean() / e.std() == pytest.approx(1.9131, abs=0.03)  # of a Rayleigh envelope
    assert (e**2).mean() == pytest.approx(1.0, abs=0.03)
    assert (20 * np.log10(e)).std() == pytest.approx(5.57, abs=0.1)


def test_point_spread_is_wider_across_than_along_depth() -> None:
    power = made(Target(None)) ** 2
    power -= power.mean()

    def lag(axis: int, px: int) -> float:
        return float((power * np.roll(power, px, axis)).mean() / power.var())

    # Correlation of Rayleigh power: that of the field squared, exp(-d^2 / 4 s^2)^2.
    assert lag(2, 3) == pytest.approx(np.exp(-(0.3**2) / (2 * 0.25**2)), abs=0.05)
    assert lag(1, 1) == pytest.approx(np.exp(-(0.1**2) / (2 * 0.12**2)), abs=0.05)
    assert lag(1, 3) < 0.15 < lag(2, 3)


def test_inclusion_second_region_and_plate_have_their_levels() -> None:
    target = Target(
        INCLUSION, level=-25.0, second=ring(25e-3, 25e-3, 3e-3), second_level=-10.0, plate=2e-3
    )
    e = made(target)
    assert db(e[:, 100:140, 130:170]) == pytest.approx(-25, abs=0.6)
    assert db(e[:, 240:260, 240:260]) == pytest.approx(-10, abs=0.8)
    assert db(e[:, 240:280, 20:80]) == pytest.approx(0, abs=0.5)
    assert db(e[:, 20, :]) == pytest.approx(20, abs=0.3)


def test_attenuation_falls_with_depth() -> None:
    e = made(Target(None), replace(QUIET, attenuation=400.0))
    assert db(e[:, 0:20]) - db(e[:, 250:270]) == pytest.approx(400 * 25e-3, abs=0.6)


def test_shadows_lie_under_the_lateral_edges_only() -> None:
    target = Target(INCLUSION, level=-25.0, shadow=10.0, enhancement=6.0)
    e = made(target)
    for edge in (100, 200):
        assert db(e[:, 200:290, edge - 1 : edge + 2]) == pytest.approx(-10, abs=1.2)
        assert db(e[:, 30:90, edge - 1 : edge + 2]) == pytest.approx(0, abs=1.2)
    assert db(e[:, 190:290, 135:165]) == pytest.approx(6, abs=0.6)
    assert db(e[:, 200:290, 20:60]) == pytest.approx(0, abs=0.6)


def test_noise_fills_the_inclusion() -> None:
    e = made(Target(INCLUSION, level=-70.0), replace(QUIET, noise=-30.0))
    assert db(e[:, 110:130, 140:160]) == pytest.approx(-30, abs=1.0)


def test_grey_levels_are_decibels() -> None:
    levels = np.array([[0.0, -30.0, -60.0, -90.0, 10.0]])
    image = compressed(replace(QUIET, gain=0.0, dynamic_range=60.0), 10 ** (levels / 20))
    assert image.dtype == np.uint8
    assert image.tolist() == [[255, 128, 0, 0, 255]]


def test_same_seed_same_image() -> None:
    one, two, other = (QUIET.b_mode(Target(INCLUSION), np.random.default_rng(s)) for s in (4, 4, 5))
    assert np.array_equal(one, two)
    assert not np.array_equal(one, other)


def test_an_outline_of_wrong_shape_is_refused() -> None:
    with pytest.raises(SceneError, match=r"outline \(2, 2\): expected at least 3"):
        QUIET.b_mode(Target(np.zeros((2, 2))), np.random.default_rng(0))
