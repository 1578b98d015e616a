"""Forces between answers: exact polynomials, orders of error, the schedule."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from validate.errors import UsageError
from validate.solve.haptic.loop import NAMES, HapticLoop, answers_of, extrapolated


@given(
    st.lists(st.floats(-3, 3), min_size=3, max_size=3),
    st.lists(st.integers(1, 20), min_size=3, max_size=3),
    st.integers(0, 40),
)
def test_a_polynomial_of_its_order_is_exact_at_any_times(
    terms: list[float], steps: list[int], beyond: int
) -> None:
    t = np.cumsum(steps).astype(float)
    for p, name in enumerate(NAMES):
        own = t[-answers_of(name) :]
        y = np.polyval(terms[: p + 1], own)[:, None]
        wanted = np.polyval(terms[: p + 1], t[-1] + beyond)
        size = 3 * (t[-1] + beyond) ** 2 * beyond**2
        assert extrapolated(own, y, t[-1] + beyond)[0] == pytest.approx(
            wanted, abs=1e-12 * (1 + size)
        )


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("late", [0, 3, 5])
def test_ticks_between_answers_are_exact_once_enough_answers_are_there(
    name: str, late: int
) -> None:
    order, k = NAMES.index(name), np.arange(200.0)  # type: ignore[arg-type]
    y = np.column_stack([k**order, 3 - 2 * k**order])
    got = HapticLoop(every=5, late=late, extrapolation=name).between_answers(y)  # type: ignore[arg-type]
    begun = 5 * order + late
    assert got[begun:] == pytest.approx(y[begun:], rel=1e-9)
    if order:
        assert np.abs(got[:begun] - y[:begun]).max() > 0


@pytest.mark.slow
@pytest.mark.parametrize(("name", "order"), [("hold", 1), ("linear", 2), ("quadratic", 3)])
def test_the_error_on_a_sine_falls_by_its_order_and_is_the_known_one(name: str, order: int) -> None:
    """Peak error of order p at a distance a behind readings T apart: w^p a (a + T) .. / p!."""
    h, w, late = 1e-4, 2 * np.pi, 0
    y = np.sin(w * h * np.arange(20_000))[:, None]
    errors = {}
    for every in (20, 40):
        got = HapticLoop(every=every, late=late, extrapolation=name).between_answers(y)  # type: ignore[arg-type]
        errors[every] = np.abs(got - y)[5 * every :].max()
        T, a = every * h, (every - 1) * h
        known = w**order * np.prod([a + i * T for i in range(order)]) / np.prod(range(1, order + 1))
        assert errors[every] == pytest.approx(known, rel=0.02)
    assert np.log2(errors[40] / errors[20]) == pytest.approx(order, abs=0.12)


def test_no_answer_stands_before_its_time_and_the_first_is_held() -> None:
    y = np.arange(12.0)[:, None]
    assert (
        HapticLoop(every=4, late=4, extrapolation="hold").between_answers(y)[:, 0].tolist()
        == [0] * 8 + [4] * 4
    )
    assert (
        HapticLoop(every=4, late=1, extrapolation="hold").between_answers(y)[:, 0].tolist()
        == [0] * 5 + [4] * 4 + [8] * 3
    )
    assert HapticLoop(every=1, late=0, extrapolation="quadratic").between_answers(
        y
    ) == pytest.approx(y)


@pytest.mark.parametrize(("every", "late"), [(0, 0), (4, 5), (4, -1)])
def test_a_schedule_that_cannot_be_kept_is_refused(every: int, late: int) -> None:
    with pytest.raises(UsageError, match="no later than the next reading"):
        HapticLoop(every=every, late=late, extrapolation="hold").between_answers(np.zeros((3, 1)))
