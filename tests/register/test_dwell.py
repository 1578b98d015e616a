"""A tip that stands: when, where, and how well that is known; which place is which landmark."""

import numpy as np
import pytest

from experiments.stylus_phantom.touched_landmarks import tip_path
from validate.arrays import Floats
from validate.errors import RegistrationError
from validate.register.markers.transform import Similarity
from validate.register.tools.landmarks import Digitised, Dwell, _joined, match_landmarks, sd_of_mean

# private: _joined: spans of a known gap.

A, B = np.array([0.0, 0.0, 0.0]), np.array([0.05, 0.0, 0.0])


def path(*parts: Floats) -> tuple[Floats, Floats]:
    x = np.vstack(parts)
    return np.arange(len(x)) / 10, x


def still(at: Floats, count: int) -> Floats:
    return np.tile(at, (count, 1))


def test_a_dwell_is_where_the_tip_stands_without_its_coming_and_leaving() -> None:
    way = np.linspace(A, B, 12)[1:-1]
    t, x = path(still(A, 30), way, still(B, 20), way[::-1], still(A, 5))
    first, second = Dwell.of_path(t, x, 3e-3, 1.5)
    assert (first.begin, first.end) == (0, 30)
    assert (second.begin, second.end) == (40, 60)
    np.testing.assert_allclose(second.centre, B, atol=1e-12)
    assert second.wander == pytest.approx(0, abs=1e-12)


def test_a_noisy_path_widens_the_radius() -> None:
    noise = np.random.default_rng(5).normal(0, 2e-3, (60, 3))
    t, x = path(still(A, 30), still(B, 30))
    assert [(d.begin, d.end) for d in Dwell.of_path(t, x + noise, 1e-3, 2.0)] == [(0, 30), (30, 60)]


def test_a_single_false_sample_parts_no_dwell() -> None:
    x = still(A, 40)
    x[20] = [1.0, 1.0, 1.0]
    t = np.arange(40) / 10
    (whole,) = Dwell.of_path(t, x, 3e-3, 1.5)
    assert (whole.begin, whole.end) == (0, 40)


def test_the_first_touch_is_the_first_part_in_which_the_tip_holds() -> None:
    drift = np.linspace(0, 2e-3, 11)[:, None] * [1.0, 0.0, 0.0]
    t, x = path(drift, still(drift[-1], 20), drift[-1] + drift[::-1])
    (whole,) = Dwell.of_path(t, x, 5e-3, 1.0)
    touch = whole.touch(1.0, 0.3e-3)
    assert len(touch.x) == 10
    np.testing.assert_allclose(touch.centre[0], 2e-3, atol=0.2e-3)
    assert whole.begin <= touch.begin < whole.begin + 12


def test_white_noise_averages_and_a_slow_wander_does_not() -> None:
    rng, t = np.random.default_rng(2), np.arange(400) / 10
    white = rng.normal(0, 1e-3, (400, 3))
    (d,) = Dwell.of_path(t, white, 10e-3, 1.0)
    assert sd_of_mean((d,), (d,)) == pytest.approx(1e-3 / 20, rel=0.15)
    slow = 1e-3 * np.sin(np.linspace(0, 4 * np.pi, 400))[:, None] * [1.0, 1.0, 1.0]
    (d,) = Dwell.of_path(t, slow, 10e-3, 1.0)
    assert sd_of_mean((d,), (d,)) == pytest.approx(1e-3 / np.sqrt(2), rel=0.05)


def test_a_tip_is_seen_from_a_reference_that_moves() -> None:
    """Stylus and reference ride on one arm: the tip stands still between them."""
    t = np.arange(5) / 10
    turns = [Similarity(_about_z(a), np.array([a, 0.0, 1.0])).matrix for a in np.linspace(0, 1, 5)]
    arm = np.array(turns)[:, :3]
    tip = np.array([0.01, 0.02, 0.03])
    at, x = tip_path(("a", "b"), (t, arm), (t[1:], arm[1:]), tip)
    np.testing.assert_array_equal(at, t[1:])
    np.testing.assert_allclose(x, np.tile(tip, (4, 1)), atol=1e-12)
    with pytest.raises(RegistrationError, match="never visible at the same time"):
        tip_path(("a", "b"), (t, arm), (t + 9, arm), tip)


def _about_z(a: float) -> Floats:
    return np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1.0]])


# --- landmarks ------------------------------------------------------------------------------------

BOX = np.array([[a, b, c] for a in (0, 0.1) for b in (0, 0.06) for c in (0, 0.03)])
ODD = np.vstack([BOX[:6], [[0.13, 0.02, 0.05]]])


@pytest.mark.parametrize("lost", [(), (2,), (0, 4, 6)])
def test_landmarks_are_told_by_their_distances(lost: tuple[int, ...]) -> None:
    rng = np.random.default_rng(1)
    kept = [i for i in rng.permutation(len(ODD)) if i not in lost]
    seen = ODD[kept] @ _about_z(0.7).T + [1.0, 2.0, 3.0]
    others = rng.normal(0, 0.2, (4, 3))
    match = match_landmarks(ODD, np.vstack([others, seen]), 2e-3)
    assert dict(zip(match.known.tolist(), match.seen.tolist(), strict=True)) == {
        int(k): 4 + i for i, k in enumerate(kept)
    }
    assert match.rms < 1e-12


def test_a_body_like_itself_after_a_turn_is_told_by_the_order_of_touch() -> None:
    noise = np.random.default_rng(0).normal(0, 2e-4, BOX.shape)
    match = match_landmarks(BOX, BOX + noise, 3e-3)
    assert match.ordered
    np.testing.assert_array_equal(match.seen, np.arange(8))
    with pytest.raises(RegistrationError, match="none in the order of the list"):
        match_landmarks(BOX, (BOX + noise)[[7, 5, 6, 4, 3, 2, 1, 0]], 3e-3)


def test_too_few_landmarks_are_refused_with_their_count() -> None:
    with pytest.raises(RegistrationError, match="of 7 landmarks lie among the 3 places"):
        match_landmarks(ODD, ODD[:3], 2e-3)
    with pytest.raises(RegistrationError, match="0 of 7"):
        match_landmarks(ODD, 1e-3 * ODD, 1e-3)  # another unit


def test_a_short_disturbance_parts_no_dwell() -> None:
    """Two spans at one place are one again if they lie close in time; another place is another."""
    t = np.arange(300) / 10
    x = np.zeros((300, 3))
    x[200:] = [0.05, 0.0, 0.0]
    spans = [(0, 90), (92, 200), (200, 300)]
    assert _joined(t, x, spans, 1e-3) == [(0, 200), (200, 300)]
    late = np.where(np.arange(300) < 91, t, t + 60.0)
    assert _joined(late, x, spans, 1e-3) == spans
    assert _joined(t, x, [(0, 90), (90, 92), (92, 200)], 1e-3) == [(0, 200)]


def test_more_places_than_can_be_landmarks_are_refused() -> None:
    with pytest.raises(RegistrationError, match=r"61 places for 7 landmarks.*most 60"):
        match_landmarks(ODD, np.zeros((61, 3)), 2e-3)


def test_landmarks_along_another_path_have_its_places_and_its_scatter() -> None:
    noise = np.random.default_rng(8).normal(0, 0.1e-3, (20 * len(BOX), 3))
    t, x = path(*(still(place, 20) for place in BOX))
    stood = Dwell.of_path(t, x + noise, 3e-3, 1.0)
    found = Digitised.of(t, x + noise, stood, stood, tuple("abcdefgh"), BOX, 2e-3)
    other = found.along(x + [0.01, 0.0, 0.0] + 3 * noise)
    assert other.places == pytest.approx(BOX + [0.01, 0.0, 0.0], abs=0.3e-3)
    assert other.sd == pytest.approx(3 * found.sd, rel=1e-6)
