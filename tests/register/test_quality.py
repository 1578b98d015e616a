"""Registration of named markers: errors predicted and measured, and every way points go wrong."""

from dataclasses import FrozenInstanceError

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from validate.arrays import rms
from validate.errors import RegistrationError
from validate.register import Registration, Similarity, fit_similarity
from validate.register.markers.measures import (
    Reflection,
    chi_square_bound,
    find_outliers,
    fitted_scale,
    localisation_error,
    looks_mirrored,
    reflection,
    relabellings,
    robust_noise,
    target_covariance,
)

SD = 0.577e-3  # m per axis: the 1 mm of the hand-tracked markers of paper 000
UP = np.array([0.0, 0.0, 1.0])
NAMES = tuple(f"m{i:02d}" for i in range(42))
METHODS = ("rigid", "similarity", "two_step", "two_step_scaled")


def seeds(every, quick=4):
    """Seeds of which the first few are drawn by default, all of them with the long tests."""
    return [*range(quick), *(pytest.param(s, marks=pytest.mark.slow) for s in range(quick, every))]


def grid(jitter, seed=0):
    """42 markers (42, 3) m on the plane z = 0, 7 x 6 at 10 mm."""
    u, v = np.meshgrid(0.01 * np.arange(7), 0.01 * np.arange(6), indexing="ij")
    flat = np.stack([u.ravel(), v.ravel(), np.zeros(42)], axis=1)
    return flat + np.random.default_rng(seed).uniform(-jitter, jitter, (42, 3)) * [1, 1, 0]


def pose(rng):
    return Similarity(Rotation.random(rng=rng).as_matrix(), rng.uniform(-0.2, 0.2, 3))


def measured(y, seed, noise=SD):
    """The markers y as a tracker sees them in its own frame, and its T_target_from_source."""
    rng = np.random.default_rng(seed)
    T = pose(rng)
    return T.inverse().apply(y + rng.normal(0, noise, y.shape)), T


def cloud(seed, k=12, d=3):
    return np.random.default_rng(seed).uniform(-0.03, 0.03, (k, d))


def register(x, y, **options):
    return Registration.of(NAMES[: len(y)], x, y, **{"expected_sd": SD, **options})


def message(x, y, **options):
    with pytest.raises(RegistrationError) as caught:
        register(x, y, **options)
    assert "\n" not in str(caught.value)
    return str(caught.value)


# --- the fit and its numbers ---


@pytest.mark.parametrize("method", METHODS)
def test_exact_markers_register_without_findings(method):
    y = grid(0.003)
    x, T = measured(y, 1, noise=0)
    found = register(x, y, method=method, expected_sd=0)
    np.testing.assert_allclose(found.transform.matrix, T.matrix, atol=1e-12)
    assert found.fre < 1e-14
    assert (found.findings, found.outliers, found.names) == ((), (), NAMES)


def test_numbers_by_hand():
    y = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]])
    x = y + 0.1 * np.array([[0, 0, 1], [0, 0, 1], [0, 0, -1], [0, 0, -1]])
    found = register(x, y, expected_sd=0.1)  # the twist is no rotation: residuals stay
    np.testing.assert_allclose(found.residuals, x - y, atol=1e-15)
    assert found.fre == pytest.approx(0.1)
    assert found.fle == pytest.approx(0.1 / np.sqrt(1 - 2 / 4))
    assert found.k_effective == 4


def test_predicted_tre_by_hand():
    """Cross of arms a: f = a/sqrt 2 about each arm, a about the normal; point h below."""
    a, h, fle = 2.0, 3.0, 0.1
    cross = a * np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]])
    below, out = target_covariance(np.array([[0, 0, -h], [h, 0, 0]]), cross, fle)
    each = fle**2 / 12
    lever = h**2 / (a**2 / 2)
    np.testing.assert_allclose(below, each * np.diag([1 + lever, 1 + lever, 1]), atol=1e-15)
    np.testing.assert_allclose(out, each * np.diag([1, 1 + h**2 / a**2, 1 + lever]), atol=1e-15)
    scaled = target_covariance(np.array([[h, 0, 0]]), cross, fle, scaled=True)[0]
    np.testing.assert_allclose(scaled - out, each * np.diag([h**2 / a**2, 0, 0]), atol=1e-15)


@settings(max_examples=50)
@given(seed=st.integers(0, 2**32 - 1))
def test_tre_is_fitzpatricks_formula_in_any_frame(seed):
    rng = np.random.default_rng(seed)
    markers, r = rng.normal(size=(8, 3)), rng.normal(size=3)
    centred = markers - markers.mean(axis=0)
    axes = np.linalg.svd(centred)[2]
    f2 = [np.mean((np.cross(centred, e) ** 2).sum(axis=1)) for e in axes]
    d2 = [(np.cross(r - markers.mean(axis=0), e) ** 2).sum() for e in axes]
    expected = 0.3**2 / 8 * (1 + sum(d / f for d, f in zip(d2, f2, strict=True)) / 3)
    found = np.trace(target_covariance(r[None], markers, 0.3)[0])
    assert found == pytest.approx(expected, rel=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize(("d", "scaled"), [(3, False), (3, True), (2, False), (2, True)])
def test_fre_and_tre_match_their_prediction_over_many_draws(d, scaled):
    """42 planar markers, 0.577 mm per axis; in 3-D the inclusion lies 22.5 mm below the plane."""
    rng = np.random.default_rng(11)
    y = grid(0.002)[:, :d]
    target = y.mean(axis=0) + ([0, 0, -0.0225] if d == 3 else [0.03, 0.02])
    fit = fit_similarity if scaled else Similarity.rigid
    fre2, tre2 = [], []
    for _ in range(1500):
        x = y + rng.normal(0, SD, y.shape)
        T = fit(x, y)
        fre2.append(rms(T.apply(x) - y) ** 2)
        tre2.append((T.apply(target) - target) ** 2)
    fle = SD * np.sqrt(d)
    assert localisation_error(np.sqrt(np.mean(fre2)), 42, d, scaled) == pytest.approx(fle, rel=0.01)
    predicted = np.diag(target_covariance(target[None], y, fle, scaled)[0])
    np.testing.assert_allclose(np.sqrt(np.mean(tre2, axis=0)), np.sqrt(predicted), rtol=0.05)
    if d == 3 and not scaled:
        assert np.mean(fre2) == pytest.approx((1 - 2 / 42) * fle**2, rel=0.01)
        total = np.sqrt(np.sum(np.mean(tre2, axis=0)))
        assert total == pytest.approx(np.sqrt(predicted.sum()), rel=0.05)
        assert np.sqrt(np.mean(fre2)) == pytest.approx(0.978e-3, rel=0.01)  # reconstruction: .978


def test_tre_at_the_inclusion_of_paper_000():
    """An independent reconstruction gives 0.218 mm for 42 markers, 22.5 mm above the inclusion."""
    y = grid(0)
    covariance = target_covariance(y.mean(axis=0)[None] - 0.0225 * UP, y, SD * np.sqrt(3))[0]
    assert np.sqrt(np.trace(covariance)) == pytest.approx(0.218e-3, abs=0.0005e-3)


def test_one_registration_predicts_its_tre() -> None:
    """Far above the inclusion: more than where no lever acts, fle / sqrt(k)."""
    y = grid(0.002)
    found = register(measured(y, 12)[0], y)
    assert found.fle == pytest.approx(SD * np.sqrt(3), rel=0.15)
    assert found.tre_at([y.mean(axis=0)]) == pytest.approx(found.fle / np.sqrt(42), rel=1e-3)
    below = y.mean(axis=0)[None] - 0.0225 * UP
    covariance = target_covariance(below, y, found.fle)[0]
    assert found.tre_at(below) == pytest.approx(np.sqrt(np.trace(covariance)))


@pytest.mark.parametrize(
    ("d", "scaled", "left"),
    [(3, False, 1 - 2 / 10), (3, True, 1 - 7 / 30), (2, False, 1 - 3 / 20), (2, True, 1 - 4 / 20)],
)
def test_localisation_error_by_hand(d, scaled, left):
    assert localisation_error(0.1, 10, d, scaled) == pytest.approx(0.1 / np.sqrt(left))


def test_too_few_points_have_no_localisation_error():
    assert np.isnan(localisation_error(0.1, 2, 3))


def test_bounds_and_robust_noise_by_hand():
    assert chi_square_bound(2, 0.05) == pytest.approx(-2 * np.log(0.05))
    assert robust_noise(np.array([[3.0, 4], [0, 5], [50, 0]])) == pytest.approx(
        5 / np.sqrt(2 * np.log(2))
    )


# --- markers left out ---


def test_unseen_markers_are_left_out_and_named():
    y = grid(0.002)
    x = measured(y, 2)[0]
    gaps = x.copy()
    gaps[3, 1] = np.nan
    gaps[7] = np.nan
    found = register(gaps, y)
    assert found.missing == ("m03", "m07")
    assert found.findings == ("2 of 42 markers not visible (NaN), left out: m03, m07",)
    kept = np.delete(np.arange(42), [3, 7])
    np.testing.assert_allclose(found.transform.matrix, Similarity.rigid(x[kept], y[kept]).matrix)
    assert found.residuals.shape == (40, 3)
    assert found.names == tuple(NAMES[i] for i in kept)


def test_excluded_markers_are_left_out_and_named():
    y = grid(0.002)
    found = register(measured(y, 2)[0], y, exclude=["m05"])
    assert found.excluded == ("m05",)
    assert found.k_effective == 41
    assert found.findings == ("1 of 42 markers excluded on request: m05",)


def test_fewer_than_four_left_is_an_error():
    y = cloud(1, 5)
    x = y.copy()
    x[0] = np.nan
    assert "3 of 5 usable (1 not visible, 1 excluded)" in message(x, y, exclude=["m04"])


def test_wrong_inputs_are_refused():
    y = cloud(1)
    assert "no marker 'm3' among 12; nearest is ['m03']" in message(y, y, exclude=["m3"])
    assert "source markers [m]: shape (3, 12), expected (12, any)" in message(y.T, y)
    assert "target markers [m]: shape (12, 2)" in message(y, y[:, :2])
    assert "expected_sd -1 m" in message(y, y, expected_sd=-1)
    assert "expected_sd nan m" in message(y, y, expected_sd=np.nan)
    assert "method 'affine'" in message(y, y, method="affine")
    assert "not finite" in message(np.where(y == y[0, 0], np.inf, y), y)
    with pytest.raises(RegistrationError, match="4 names, 3 different"):
        Registration.of(["a", "b", "c", "a"], y[:4], y[:4], expected_sd=SD)


# --- degenerate sets ---


def test_coincident_and_collinear_markers_are_refused():
    line = np.linspace(0, 0.06, 8)[:, None] * [1, 1, 0]
    assert "8 collinear points" in message(line, line)
    assert "8 coincident points" in message(np.full((8, 3), 0.1), line)


@pytest.mark.parametrize("seed", range(10))
def test_a_line_is_refused_when_noise_makes_it_look_wider(seed):
    """Its FRE is small and its rotation about the line is pure noise."""
    line = np.linspace(0, 0.06, 42)[:, None] * [1.0, 0, 0]
    noisy = [line + np.random.default_rng(seed + i).normal(0, SD, line.shape) for i in (0, 99)]
    assert "on a line within the noise" in message(*noisy)


# --- mirrored ---


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("seed", range(5))
def test_a_mirrored_cloud_is_refused_with_both_residuals(d, seed):
    y = cloud(seed, d=d)
    x = (y + np.random.default_rng(seed).normal(0, SD, y.shape)) * ([-1, 1, 1][:d])
    said = message(x, y)
    assert "seem mirrored" in said
    found = reflection(x, y, Similarity.rigid, np.eye(d)[1])
    assert f"{1e3 * found.proper:.3g} mm by a rotation" in said
    assert f"{1e3 * found.improper:.3g} mm by a reflection" in said
    assert found.improper < 1.5 * SD * np.sqrt(d) < found.proper


@pytest.mark.parametrize(
    ("proper", "improper", "mirrored"),
    [
        (0.9, 0.1, False),  # within the noise: nothing to explain
        (1.7, 1.0, True),  # 1.5 times better, and within the noise
        (1.4, 1.0, False),
        (4.0, 2.0, False),  # beyond the noise either way: three times better is asked for
        (7.0, 2.0, True),
    ],
)
def test_what_looks_mirrored_at_a_bound_of_one(proper, improper, mirrored):
    assert looks_mirrored(Reflection(proper, improper), 1.0) == mirrored


def test_a_side_may_be_declared_along_any_axis():
    for axis in np.eye(3):
        y = grid(0.002) @ Rotation.align_vectors([axis], [UP])[0].as_matrix().T
        mirror = np.ones(3) - 2 * np.roll(axis, 1)
        x = y * mirror + np.random.default_rng(3).normal(0, SD, y.shape)
        assert "seem mirrored" in message(x, y, up=(axis, axis))


def test_the_residual_of_a_reflection_does_not_depend_on_the_mirror():
    x, y = cloud(1), cloud(2)
    found = [
        reflection(x, y, Similarity.rigid, np.array(n)).improper for n in ([1.0, 0, 0], [3, -2, 1])
    ]
    assert found[0] == pytest.approx(found[1], rel=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_a_plane_mirrored_within_itself_shows_only_when_its_side_is_declared(method):
    y = grid(0.002)
    x, T = measured(y * [-1, 1, 1], 3)
    assert register(x, y, method=method).findings == ()  # cannot be seen: turned over, it fits
    said = message(x, y, method=method, up=(UP @ T.R, UP))
    assert "seem mirrored" in said
    assert register(x, y * [-1, 1, 1], method=method, up=(UP @ T.R, UP)).findings == ()


@pytest.mark.parametrize("method", ["rigid", "two_step"])
def test_a_declared_side_changes_nothing_when_it_is_right(method):
    y = grid(0.002)
    x, T = measured(y, 4)
    with_up = register(x, y, method=method, up=(UP @ T.R, UP))
    without = register(x, y, method=method)
    np.testing.assert_allclose(with_up.transform.matrix, without.transform.matrix, atol=1e-15)
    assert with_up.reflection.improper > 10 * with_up.reflection.proper
    assert without.reflection.improper == pytest.approx(without.reflection.proper, rel=0.05)


# --- permuted ---


@pytest.mark.parametrize("seed", range(5))
def test_two_swapped_markers_are_named(seed):
    y = grid(0.002, seed)
    x = measured(y, seed)[0]
    x[[3, 7]] = x[[7, 3]]
    said = message(x, y)
    before = 1e3 * rms(Similarity.rigid(x, y).apply(x) - y)
    assert said.startswith(f"markers m03 and m07 seem swapped: residual {before:.3g} -> ")


def test_three_permuted_markers_are_named():
    y = cloud(5, d=2)
    x = y + np.random.default_rng(5).normal(0, SD, y.shape)
    x[[1, 4, 9]] = x[[4, 9, 1]]
    assert "markers m01, m04 and m09 seem permuted" in message(x, y)


@pytest.mark.slow
@pytest.mark.parametrize("seed", seeds(8))
def test_any_permutation_of_a_jittered_grid_is_found(seed):
    y = grid(0.003, seed)
    x, _ = measured(y, seed)
    order = np.random.default_rng(seed).permutation(42)
    said = message(x[order], y)
    assert "seem permuted" in said
    assert "ambiguous" not in said
    found = relabellings(x[order], y, Similarity.rigid, SD)
    assert len(found) == 1
    np.testing.assert_array_equal(found[0].order, order)
    assert found[0].rms == pytest.approx(rms(Similarity.rigid(x, y).apply(x) - y))


def test_a_permuted_regular_grid_is_called_ambiguous():
    y = grid(0)
    x, _ = measured(y, 6)
    order = np.random.default_rng(6).permutation(42)
    said = message(x[order], y)
    assert "4 labellings fit equally well" in said  # a rectangle has four rotations onto itself
    assert "ambiguous" in said


def test_labels_wrong_by_a_symmetry_cannot_be_seen():
    y = grid(0)
    assert register(measured(y, 7)[0][::-1], y).findings == ()


@pytest.mark.parametrize("seed", range(5))
def test_swapped_markers_are_found_beside_an_outlier_and_under_a_scale(seed):
    y = grid(0.002)
    x = measured(y, seed)[0] * 1.5
    x[[3, 7]] = x[[7, 3]]
    x[20] += [0, 0.02, 0.02]
    assert "markers m03 and m07 seem swapped" in message(x, y, method="similarity")


def test_outliers_do_not_blur_which_markers_are_swapped():
    y = grid(0.002)
    x, T = measured(y, 14)
    x[[3, 7]] = x[[7, 3]]
    x[[10, 30]] += 0.03 * T.R.T @ [0, 0.6, 0.8]
    assert "markers m03 and m07 seem swapped" in message(x, y)


# --- outliers and excess ---


def test_an_outlier_is_named_with_its_distance_and_stays_in_the_fit():
    y, size = grid(0.002), 0.005
    x, T = measured(y, 9)
    x[5] += size * T.R.T @ [0, 0.6, 0.8]
    found = register(x, y)
    (outlier,) = found.outliers
    assert outlier.name == "m05"
    assert outlier.residual == pytest.approx(size, abs=4 * SD)
    assert len(found.findings) == 1
    assert found.findings[0].startswith(
        f"marker m05 is an outlier: {1e3 * outlier.residual:.3g} mm from the position predicted "
        f"by the others"
    )
    np.testing.assert_allclose(found.transform.matrix, Similarity.rigid(x, y).matrix)
    assert register(x, y, exclude=["m05"]).outliers == ()


def test_an_outlier_that_moves_the_result_is_refused_with_its_effect_and_both_settings():
    """Far beyond twice the 0.22 mm that 42 markers leave at themselves."""
    y = grid(0.002)
    x, T = measured(y, 9)
    x[5] += 0.1 * T.R.T @ [0, 0.6, 0.8]
    said = message(x, y)
    others = np.delete(np.arange(42), 5)
    moved = Similarity.rigid(x, y).apply(x[others]) - Similarity.rigid(x[others], y[others]).apply(
        x[others]
    )
    assert said.startswith("outliers among the markers (m05 by 1")
    assert f"shift the others by {1e3 * rms(moved):.3g} mm, twice" in said
    assert said.endswith("set registration.exclude=m05 or registration.robust=true")
    without = Similarity.rigid(x[others], y[others]).matrix
    np.testing.assert_allclose(register(x, y, exclude=["m05"]).transform.matrix, without)


def test_a_robust_fit_leaves_outliers_out_and_names_them():
    y = cloud(10, 8)
    x, T = measured(y, 10)
    x[[2, 5]] += 0.02 * T.R.T @ [0, 0.6, 0.8]
    assert "set registration.exclude=m02,m05 or" in message(x, y)
    found = register(x, y, robust=True)
    kept = [0, 1, 3, 4, 6, 7]
    assert found.rejected == ("m02", "m05") == tuple(o.name for o in found.outliers)
    assert found.names == tuple(NAMES[i] for i in kept)
    assert found.findings[0].endswith("it is left out by the robust fit")
    np.testing.assert_allclose(found.transform.matrix, Similarity.rigid(x[kept], y[kept]).matrix)
    clean = measured(y, 10)[0]
    np.testing.assert_allclose(
        register(clean, y, robust=True).transform.matrix, Similarity.rigid(clean, y).matrix
    )


# --- scale ---


def test_the_scale_is_fitted_whether_it_is_used_or_not():
    y = grid(0.002)
    x = measured(y, 21)[0]
    for method in METHODS:
        found = register(x, y, method=method)
        assert found.scale.value == pytest.approx(1, abs=found.scale.half)
        assert found.findings == ()
    large = register(1.05 * x, y)
    assert large.scale.value == pytest.approx(1.05, abs=large.scale.half)
    assert "not used; check units and calibration" in large.findings[0]
    assert f"are {large.scale.value:.5f} +- {large.scale.half:.2g} times" in large.findings[0]
    assert "and this scale is used" in register(1.05 * x, y, method="similarity").findings[0]


def test_the_scales_interval_is_that_of_many_draws():
    """3.29 standard deviations; by hand sd / (sqrt(k) f)."""
    y, rng = grid(0.002), np.random.default_rng(4)
    found = [fitted_scale(y + rng.normal(0, SD, y.shape), y, SD) for _ in range(200)]
    half = 3.2905 * SD / (np.sqrt(42) * rms(y - y.mean(axis=0)))
    assert np.mean([s.half for s in found]) == pytest.approx(half, rel=0.1)
    values = np.array([s.value for s in found])
    assert values.std() * 3.2905 == pytest.approx(half, rel=0.15)
    assert values.mean() == pytest.approx(1, abs=half / 10)


@pytest.mark.slow
def test_clean_markers_raise_no_alarm():
    """Each bound is set to one false alarm in a thousand sets."""
    alarms = 0
    for seed in range(300):
        y = cloud(seed, 6)
        alarms += bool(register(measured(y, seed)[0], y).findings)
    assert alarms <= 4


@pytest.mark.slow
def test_understated_noise_makes_few_outliers():
    """Judged at the noise of the markers left and the TRE; without the TRE they are 20."""
    named = 0
    for seed in range(200):
        y = cloud(seed, 8)
        named += bool(find_outliers(NAMES[:8], measured(y, seed)[0], y, SD / 5))
    assert named <= 13


def test_an_unexplained_excess_is_stated_against_the_declared_noise():
    y = grid(0.002)
    found = register(measured(y, 13)[0], y, expected_sd=SD / 3)
    per_axis = found.fle / np.sqrt(3)
    assert found.findings[0].startswith(
        f"residual {1e3 * per_axis:.3g} mm per axis is {per_axis / (SD / 3):.3g} times the noise"
    )
    assert found.outliers == ()


@pytest.mark.slow
def test_unrelated_points_are_an_excess_not_a_permutation():
    for seed in range(5):
        said = register(cloud(seed, 42) * [1, 1, 0], grid(0.003, seed)).findings[-1]
        assert "times the noise of 0.577 mm" in said


@pytest.mark.parametrize("seed", seeds(20))
def test_few_unrelated_points_are_no_permutation(seed):
    """Relabelling brings them 3 times closer now and then, but not within their spacing."""
    flat = np.array([1, 1, 0])
    found = register(cloud(seed + 1000, 6) * flat, cloud(seed, 6) * flat, robust=True)
    assert "times the noise of 0.577 mm" in found.findings[-1]


@pytest.mark.parametrize("seed", seeds(20))
def test_noise_of_the_size_of_the_spacing_is_no_permutation(seed):
    y = cloud(seed, 42) * [1, 1, 0]
    x = y + np.random.default_rng(seed).normal(0, 2 * SD, y.shape)
    assert "times the noise of 0.577 mm" in register(x, y).findings[-1]


def test_the_result_is_frozen():
    y = cloud(1)
    found = register(y, y)
    with pytest.raises(FrozenInstanceError):
        found.expected_sd = 1.0
    with pytest.raises(ValueError, match="read-only"):
        found.residuals[0, 0] = 1


@pytest.mark.parametrize(("method", "parameters"), [*zip(METHODS, (6, 7, 6, 7), strict=True)])
def test_localisation_error_of_a_fit_counts_its_scale(method, parameters):
    """FLE^2 = FRE^2 / (1 - p/(3 k)): six numbers are fitted, with a scale seven."""
    y = grid(0.003)
    found = register(measured(y, 3)[0], y, method=method)
    share = 1 - parameters / (3 * 42)
    assert found.fle == pytest.approx(found.fre / np.sqrt(share), rel=1e-12)


@pytest.mark.parametrize("method", ["similarity", "two_step_scaled"])
def test_predicted_error_of_a_fit_with_a_scale_has_its_part(method):
    """A relative scale of variance FLE^2/(3 k f^2) moves a point at a distance r by r of it."""
    y = grid(0.003)
    found = register(measured(y, 3)[0], y, method=method)
    r = np.array([0.2, 0.0, 0.0])
    rigid = target_covariance((y.mean(axis=0) + r)[None], y, found.fle)[0]
    part = found.fle**2 / (3 * 42) * 0.2**2 / np.mean(((y - y.mean(axis=0)) ** 2).sum(axis=1))
    expected = np.sqrt(np.trace(rigid) + part)
    assert found.tre_at([y.mean(axis=0) + r]) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("scaled", [False, True])
def test_predicted_error_in_the_plane_by_hand(scaled):
    """Four arms of 2 m, FLE 0.1 m: each axis has FLE^2/8, a turn r^2/4 of it across r."""
    cross = 2.0 * np.array([[1.0, 0], [-1, 0], [0, 1], [0, -1]])
    found = target_covariance(np.array([[3.0, 0.0]]), cross, 0.1, scaled=scaled)[0]
    along = 1 + 9 / 4 if scaled else 1
    np.testing.assert_allclose(found, 0.01 / 8 * np.diag([along, 1 + 9 / 4]), atol=1e-16)


def test_swapped_names_in_the_plane_are_found():
    x = np.array([[0.0, 0], [0.03, 0], [0.01, 0.02], [0.04, 0.035], [-0.02, 0.05]])
    y = x[[1, 0, 2, 3, 4]]
    assert "markers m00 and m01 seem swapped" in message(x, y, expected_sd=1e-5)
