"""Energy of a held force: springs whose every joule is known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.haptic_liver.held_force import HeldForce
from validate.arrays import Floats
from validate.errors import ComparisonError
from validate.solve.haptic.loop import HapticLoop

K, A, H = 300.0, 0.01, 1e-3


def _swing(ticks: int, turns: int = 3) -> Floats:
    return A * np.sin(2 * np.pi * np.arange(turns * ticks + 1) / ticks)[:, None]


def _on_spring(x: Floats, every: int, late: int = 0, name: str = "hold") -> HeldForce:
    true = -K * x
    return HeldForce(
        x, HapticLoop(every=every, late=late, extrapolation=name).between_answers(true), true, H
    )  # type: ignore[arg-type]


@pytest.mark.parametrize("ticks", [50, 200, 1000])
def test_a_hold_on_a_closed_path_creates_half_k_times_the_squared_steps(ticks: int) -> None:
    """A sine of N holds a turn: k A^2 N sin^2(pi/N), which is k A^2 w T pi/2 for many of them."""
    for every in (1, 10):
        one = _on_spring(_swing(ticks), every)
        n = ticks // every
        exact = 3 * K * A**2 * n * np.sin(np.pi / n) ** 2
        assert one.created[-1] == pytest.approx(exact, rel=1e-12)
        assert one.created[-1] == pytest.approx(-one.taken[-1], rel=1e-9)
        T = every * H
        rate = 2 * np.pi / (ticks * H)
        assert exact == pytest.approx(3 * K * A**2 * np.pi * rate * T / 2, rel=(np.pi / n) ** 2)


def test_a_steady_push_of_a_held_spring_creates_k_v_squared_t_over_two_both_ways() -> None:
    v, ticks = 0.02, 400
    for way in (1, -1):
        x = way * v * H * np.arange(ticks + 1)[:, None]
        one = _on_spring(x, 8)
        assert one.created[-1] == pytest.approx(K * v**2 * 8 * H / 2 * ticks * H, rel=1e-12)
        assert one.damper == pytest.approx(K * 8 * H / 2, rel=1e-12)  # Colgate's k T/2


def test_a_delay_of_one_reading_creates_three_times_as_much() -> None:
    x = _swing(500)
    held, late = _on_spring(x, 10), _on_spring(x, 10, 10)
    assert late.created[-1] == pytest.approx(3 * held.created[-1], rel=0.02)


def test_a_line_creates_energy_in_the_third_order_of_its_distances() -> None:
    """pi k A^2 w^3 (a^3/3 + a^2 T/2 + a T^2/6) in a turn, a behind readings T apart, meaned, beyond
    what every tick's own hold creates."""
    x, w = _swing(500), 2 * np.pi / (500 * H)
    line, tick = _on_spring(x, 10, 10, "linear"), _on_spring(x, 1)
    turn = np.subtract(*(line.created - tick.created)[[1500, 1000]])
    a, T = H * np.arange(10, 20), 10 * H
    known = np.pi * K * A**2 * w**3 * np.mean(a**3 / 3 + a**2 * T / 2 + a * T**2 / 6)
    assert turn == pytest.approx(known, rel=0.1)


def test_a_true_force_held_from_tick_to_tick_is_not_passive_and_a_damper_makes_it_so() -> None:
    x = _swing(100)
    one = _on_spring(x, 1)
    assert one.peak == 0.0
    assert one.created[-1] > 0
    assert one.least < 0
    damped = -K * x - np.vstack([np.diff(x, axis=0), [[0.0]]]) / H * one.damper
    cured = HeldForce(x, damped, -K * x, H)
    assert cured.created[-1] == pytest.approx(0.0, abs=1e-12)


@given(st.integers(0, 2**32 - 1))
def test_what_is_given_is_what_was_not_taken(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, given_, true = rng.normal(size=(3, 30, 2))
    one = HeldForce(x, given_, true, H)
    same = HeldForce(x, true, true, H)
    assert one.created[-1] - same.created[-1] == pytest.approx(same.taken[-1] - one.taken[-1])


def test_what_cannot_be_counted_is_refused() -> None:
    with pytest.raises(ComparisonError, match="1 ticks of a held force"):
        HeldForce(np.zeros((1, 2)), np.zeros((1, 2)), np.zeros((1, 2)), H)
    with pytest.raises(ComparisonError, match="held force, given"):
        HeldForce(np.zeros((3, 2)), np.zeros((3, 1)), np.zeros((3, 2)), H)
