"""u_num by the observed order: exact truths, what has no order, and how often it covers."""

import numpy as np
import pytest

from validate.arrays import Floats, rms
from validate.compare.convergence import GridConvergence, Numerical, convergence, observed_order
from validate.errors import ComparisonError

H = (2.0, 1.5, 1.0, 0.7)


def scalars(h: tuple[float, ...], p: float, a: float = 1.0) -> list[Floats]:
    return [np.array([[5.0 + a * x**p]]) for x in h]


@pytest.mark.parametrize("h", [(2.0, 1.0, 0.5), (1.9, 1.0, 0.8), H, (0.7, 2.0, 1.0, 1.5)])
@pytest.mark.parametrize("p", [1.0, 1.4, 2.0])
def test_a_pure_power_gives_its_order_and_the_error_of_the_judged_mesh(
    h: tuple[float, ...], p: float
) -> None:
    """The error of the mesh of size 1 is 3, whatever finer one there is: u is half of 1.25 x 3."""
    found = convergence(h, scalars(h, p, 3.0), h.index(1.0), p)
    assert found.order == pytest.approx(p, abs=1e-4)
    assert (found.conduct, found.safety, found.asymptotic) == ("monotone", 1.25, True)
    assert found.u == pytest.approx(1.25 * 3.0 / 2, rel=1e-3)


def test_the_judged_mesh_is_not_the_finest() -> None:
    coarse, fine = (convergence((2.0, 1.0, 0.5), scalars((2.0, 1.0, 0.5), 2.0), j, 2.0).u
                    for j in (0, 2))  # fmt: skip
    assert coarse == pytest.approx(16 * fine, rel=1e-3)


def test_arrays_share_one_order_and_their_rms_stands_for_the_error() -> None:
    a = np.array([[3.0, -4.0], [0.0, 5.0]])
    found = convergence(H, [a * x**2 for x in H], 2, 2.0)
    assert found.order == pytest.approx(2.0, abs=1e-4)
    assert found.u == pytest.approx(1.25 * rms(a) / 2, rel=1e-3)


@pytest.mark.parametrize(("p", "safety"), [(0.7, 1.25), (1.2, 1.25), (2.9, 1.25), (3.2, 3.0)])
def test_an_order_far_above_the_formal_one_has_the_larger_factor(p: float, safety: float) -> None:
    found = convergence(H, scalars(H, p), 2, 2.0)
    assert found.safety == safety
    assert found.u > 0.999 * safety / 2


def test_an_order_above_the_formal_one_is_not_believed() -> None:
    """Richardson by order 4 would give the error 1; the formal order gives more."""
    found = convergence((2.0, 1.0, 0.5), scalars((2.0, 1.0, 0.5), 4.0), 1, 2.0)
    assert found.u > 3.0 * 1.0 / 2


def test_the_weights_that_leave_least_count() -> None:
    """Scatter of the coarse answers: brute force over the order, equal weights and 1/h."""
    h = np.array((4.0, 3.0, 2.5, 1.0, 0.75))
    y = h**1.5 + np.array((0.1, -0.3, 0.3, 0.0, 0.0))
    fits = []
    for w in (np.ones(5), 5 / h / np.sum(1 / h)):
        for p in np.linspace(0.5, 3.0, 5001):
            A = np.stack([np.ones(5), h**p], axis=1) * np.sqrt(w)[:, None]
            (f0, a), *_ = np.linalg.lstsq(A, np.sqrt(w) * y, rcond=None)
            left = y - f0 - a * h**p
            sd = float(np.sqrt(np.sum(w * left**2) / 2))  # 5 answers, 3 parameters
            fits.append((sd, p, 1.25 * abs(a) + sd + abs(left[3])))
    equal, weighted = min(fits[:5001]), min(fits[5001:])
    assert weighted[0] < 0.9 * equal[0]
    found = convergence(h.tolist(), [np.array([[v]]) for v in y], 3, 2.0)
    assert found.order == pytest.approx(weighted[1], abs=2e-3)
    assert 2 * found.u == pytest.approx(weighted[2], rel=2e-3)


def test_a_trusted_order_above_the_formal_one_is_replaced_by_it() -> None:
    """Three answers of order 2.4: the fit by order 2 says f0 + a with its scatter and distance."""
    h, y = np.array((2.0, 1.0, 0.5)), np.array((2.0, 1.0, 0.5)) ** 2.4
    found = convergence(h.tolist(), [np.array([[v]]) for v in y], 1, 2.0)
    bands = []
    for w in (np.ones(3), 3 / h / np.sum(1 / h)):
        A = np.stack([np.ones(3), h**2], axis=1) * np.sqrt(w)[:, None]
        f0, a = np.linalg.lstsq(A, np.sqrt(w) * y, rcond=None)[0]
        left = y - f0 - a * h**2
        sd = np.sqrt(np.sum(w * left**2))  # 3 - 2 degrees of freedom
        bands.append((sd, 1.25 * abs(a) + sd + abs(left[1])))
    assert found.order == pytest.approx(2.4, abs=1e-3)
    assert 2 * found.u == pytest.approx(min(bands)[1], rel=1e-6)


@pytest.mark.parametrize(
    ("values", "conduct"),
    [
        ((1.0, -0.8, 0.64), "no order"),
        ((0.0, 1.0, 0.9), "no order"),
        ((0.0, 0.1, 1.0), "no order"),
        ((0.0, 1.0, 2.1), "no order"),
        ((1.0, 0.9, 0.8), "no order"),  # halved twice, the same step again: order 0
    ],
)
def test_the_band_of_what_has_no_order_is_finite_and_wide(
    values: tuple[float, ...], conduct: str
) -> None:
    """As wide as the answers differ, at least; three times the distance by the formal order."""
    found = convergence((2.0, 1.0, 0.5), [np.array([[v]]) for v in values], 1, 2.0)
    assert (found.conduct, found.order, found.asymptotic) == (conduct, None, False)
    assert np.isfinite(found.u)
    assert 2 * found.u > np.ptp(values)
    assert found.safety >= 3.0
    assert "no order over 3 sizes" in found.words


def test_scatter_that_hides_the_trend_widens_the_band_by_its_share_of_the_range() -> None:
    """Eca & Hoekstra's bad fit: 3 s / D times (e + s + r), by an independent fit of the mean."""
    rng, h = np.random.default_rng(2), np.array((2.0, 1.5, 1.0, 0.75, 0.5))
    wide = 0
    for _ in range(20):
        y = rng.normal(size=5)
        found = convergence(h.tolist(), [np.array([[v]]) for v in y], 2, 2.0)
        if found.safety > 3.0:
            wide += 1
            assert 2 * found.u > 3.0 * np.ptp(y) / 4
        assert np.isfinite(found.u)
    assert wide > 3


def test_differences_below_rounding_are_the_uncertainty() -> None:
    answers = [np.array([[7.0 + d]]) for d in (2e-12, 0.0, -3e-12)]
    found = convergence((2.0, 1.0, 0.5), answers, 1, 2.0, rounding=1e-11)
    assert (found.conduct, found.asymptotic) == ("at rounding", True)
    assert found.u == pytest.approx(3e-12, rel=1e-2)
    alike = convergence((2.0, 1.0, 0.5), [np.ones((1, 1))] * 3, 1, 2.0)
    assert (alike.u, alike.deciding(1.0)) == (0.0, 1.0)


@pytest.mark.parametrize("h", [(1.0,), (1.0, 1.0), (1.0, 0.5, 0.0)])
def test_a_single_mesh_is_refused(h: tuple[float, ...]) -> None:
    with pytest.raises(ComparisonError, match="u_num needs at least two different ones"):
        convergence(h, scalars(h, 2.0), 0, 2.0)


@pytest.mark.parametrize("h", [(1.0, 0.5), (0.5, 1.0), (1.0, 0.5, 0.5)])
def test_two_meshes_have_the_error_of_the_formal_order_and_the_larger_factor(
    h: tuple[float, ...],
) -> None:
    """f = 1 + h^2: the error of the judged mesh is h^2, and the band three times that."""
    found = convergence(h, scalars(h, 2.0), 0, 2.0)
    assert found.u == pytest.approx(3 * h[0] ** 2 / 2)
    assert (found.conduct, found.asymptotic, found.order) == ("two sizes", False, None)
    assert found.words == "two sizes, formal order 2 assumed, safety 3"
    assert 0 < found.deciding(found.u) < 1


@pytest.mark.parametrize("h", [(2.0, 1.4, 1.0), (1.27, 1.0, 0.79), (2.0, 1.0, 0.5), H])
@pytest.mark.parametrize("p", [1.0, 2.0])
@pytest.mark.parametrize("scatter", [0.0, 0.03])
@pytest.mark.slow
def test_twice_u_covers_the_true_error_in_95_of_100(
    h: tuple[float, ...], p: float, scatter: float
) -> None:
    """h^p + b h^(p + 1) with b normal, and meshes that are not quite similar."""
    rng, judged, size = np.random.default_rng(5), h.index(1.0), np.array(h)
    covered = []
    for b in rng.normal(size=80):
        error = size**p * (1 + b * size + scatter * rng.normal(size=len(h)))
        found = convergence(h, [np.array([[e]]) for e in error], judged, p)
        covered.append(abs(error[judged]) <= 2 * found.u)
    assert np.mean(covered) >= 0.95


@pytest.mark.parametrize("scatter", [0.03, 0.3, 1.0])
def test_arrays_of_unlike_meshes_are_covered(scatter: float) -> None:
    """Every point has its own error, and its own scatter from mesh to mesh."""
    rng, size, covered = np.random.default_rng(6), np.array((2.0, 1.6, 1.3, 1.0, 0.8)), []
    for _ in range(60):
        a, noise = rng.normal(size=(20, 2)), scatter * rng.normal(size=(5, 20, 2))
        error = a * size[:, None, None] ** 2 + noise
        found = convergence(size.tolist(), list(error), 3, 2.0)
        covered.append(rms(error[3]) <= 2 * found.u)
    assert np.mean(covered) >= 0.95


def test_the_size_that_decides_is_extrapolated_by_the_order_at_hand() -> None:
    """At that size 2 u is half of the limit; without an order by half the formal one."""
    found = convergence(H, scalars(H, 2.0, 3.0), 2, 2.0)
    share = found.deciding(0.1)
    assert 2 * found.u * share**2 == pytest.approx(0.05, rel=1e-3)
    assert found.deciding(1e9) == 1.0
    lost = convergence((2.0, 1.0, 0.5), [np.array([[v]]) for v in (0.0, 0.1, 1.0)], 1, 2.0)
    assert lost.deciding(1e9) == 1.0
    assert lost.deciding(1e-2) == pytest.approx(1e-2 / 4 / lost.u)


def test_parts_add_in_squares_and_one_unbounded_part_leaves_none() -> None:
    assert Numerical({"mesh": 3.0, "time step": 4.0}).u == 5.0
    assert Numerical({"mesh": np.inf, "time step": 4.0}).u == np.inf
    assert Numerical().u == 0.0


def test_words_say_what_was_found() -> None:
    found = convergence(H, scalars(H, 2.0), 2, 2.0)
    assert found.words == "monotone over 4 sizes, order 2 of formal 2, safety 1.25"
    assert isinstance(found, GridConvergence)


def test_answers_that_differ_by_rounding_need_no_factor() -> None:
    """The largest difference is the uncertainty; just above the rounding an order is sought."""
    answers = [np.array([[5.0 + x]]) for x in (3e-9, 0.0, -1e-9)]
    found = convergence((2.0, 1.0, 0.5), answers, 1, 2.0, rounding=3.1e-9)
    assert (found.conduct, found.safety, found.order) == ("at rounding", 1.0, None)
    assert found.u == found.range == pytest.approx(3e-9, rel=1e-6)
    assert found.deciding(1e-3) == 1.0
    above = convergence((2.0, 1.0, 0.5), answers, 1, 2.0, rounding=2.9e-9)
    assert above.conduct != "at rounding"


@pytest.mark.parametrize(("e21", "e32"), [(0.0, 1.0), (1.0, 0.0), (0.0, 0.0), (1.0, 0.5)])
def test_differences_that_vanish_or_grow_have_no_order(e21: float, e32: float) -> None:
    assert observed_order(2.0, 2.0, e21, e32) is None
    assert observed_order(2.0, 2.0, 1.0, 4.0) == pytest.approx(2.0, abs=1e-9)


def test_scatter_of_many_numbers_is_not_counted_as_a_lost_order() -> None:
    """Meshes that cut a wall anew: 200 numbers with an error of second order and, on each mesh, its
    own scatter as large. The band holds the error of the judged one, and is not many times as wide.
    """
    rng = np.random.default_rng(8)
    h = np.array([1.55, 1.3, 1.15, 1.0, 0.8])
    shape = rng.normal(size=(200, 1))
    bands, ratios = [], []
    for _ in range(40):
        answers = [0.1 * x**2 * shape + 0.1 * rng.normal(size=(200, 1)) for x in h]
        found = convergence(h.tolist(), answers, 3, 2.0)
        bands.append(2 * found.u / 0.1)
        ratios.append(2 * found.u / float(np.sqrt(np.mean(answers[3] ** 2))))
    assert min(ratios) > 1
    assert float(np.median(ratios)) < 6
    # The trend (1.25), twice the scatter (2), and what the fit leaves (about .7).
    assert min(bands) > 1.25 + 2 + 0.7
