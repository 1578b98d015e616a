"""The likelihood of plain FEM and of the last measurement held, against closed forms."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from study_samples import experiment_file

from validate.engine.cell import Record, Where
from validate.pipeline.experiment.find import load_file
from validate.study.filters import page as filter_page
from validate.study.filters.ranking import rankings
from validate.study.filters.score import LOG_LOSS, Blocks, FilterScores, cut
from validate.study.filters.study import predictive_likelihood, study, with_likelihood
from validate.study.filters.withheld_errors import PredictionErrors, Segments, prediction_errors

SAMPLES, SEGMENTS = 40_000, 100
T = np.arange(1.0, SAMPLES + 1)
CUT = Segments(np.linspace(0.0, SAMPLES, SEGMENTS + 1))
BLOCKS = cut(SEGMENTS, 1.0, 1.0, "kf")


def entropy(variance: float) -> float:
    """Differential entropy of a Gaussian, nats."""
    return float(0.5 * np.log(2 * np.pi * np.e * variance))


def loss(errors: PredictionErrors, blocks: Blocks = BLOCKS) -> float:
    found = predictive_likelihood(errors, blocks)
    assert found is not None
    return float(-found.log_likelihood.sum() / found.dof.sum())


def test_persistence_of_a_random_walk_has_the_entropy_of_its_steps() -> None:
    """y_k = y_{k-1} + N(0, s^2): no predictor has less log loss than the entropy of a step."""
    rng, sd = np.random.default_rng(3), np.array([0.2, 5.0])
    walk = np.cumsum(sd * rng.standard_normal((SAMPLES, 2)), axis=0)
    errors = np.diff(walk, axis=0, prepend=0.0)
    found = prediction_errors(T, errors, np.full(2, 1e-12), CUT)
    expected = np.mean([entropy(s**2) for s in sd])
    assert loss(found) == pytest.approx(expected, abs=3 / np.sqrt(4 * SAMPLES))


def test_an_exact_model_has_the_entropy_of_the_noise_and_never_less_variance() -> None:
    rng, R = np.random.default_rng(4), 0.01
    noise = prediction_errors(T, 0.1 * rng.standard_normal((SAMPLES, 1)), np.array([R]), CUT)
    assert loss(noise) == pytest.approx(entropy(R), abs=3 / np.sqrt(2 * SAMPLES))
    exact = prediction_errors(T, np.zeros((SAMPLES, 1)), np.array([R]), CUT)
    assert loss(exact) == pytest.approx(0.5 * np.log(2 * np.pi * R))


def test_a_block_is_scored_under_the_variance_of_the_other_blocks() -> None:
    """Two blocks of mean squares 1 and 4: each is scored under the other's variance."""
    errors = PredictionErrors(
        np.array([[[1.0, 4.0]]]), np.ones((1, 1, 2)), np.full((1, 1, 2), 1e-9)
    )
    found = predictive_likelihood(errors, Blocks((0, 1), 1.0, 1.0, "kf"))
    assert found is not None
    variances = np.array([4.0, 1.0])
    expected = -0.5 * (np.log(2 * np.pi * variances) + np.array([1.0, 4.0]) / variances)
    assert found.log_likelihood[0] == pytest.approx(expected)


def test_without_samples_in_two_blocks_a_baseline_has_no_likelihood() -> None:
    once = PredictionErrors(
        np.array([[[1.0, 0.0]]]), np.array([[[1.0, 0.0]]]), np.full((1, 1, 2), 1e-9)
    )
    blocks = Blocks((0, 1), 1.0, 1.0, "kf")
    assert predictive_likelihood(once, blocks) is None
    bare = FilterScores({"e": (1.0,)}, {"e": "m"}, predictions=once)
    assert with_likelihood(bare, blocks) is bare
    assert with_likelihood(bare, None) is bare


def test_plain_fem_and_persistence_are_ranked_by_likelihood(tmp_path: Path) -> None:
    """The twin is the models' own model: plain FEM is off by the noise alone, 1e-10 m2."""
    pulled = load_file(experiment_file(tmp_path))
    found = study(
        pulled, ["methods.kf.Q=1e-12,1e-11"], methods=("kf", "plain"), seeds=1, by=LOG_LOSS,
        out=tmp_path, where=Where(workers=0),
    )  # fmt: skip
    (ranking,) = found.rankings
    places = {r.cell.name: r for r in ranking.rows}
    assert not ranking.failed
    assert set(places) == {"kf", "plain", "last measurement, held"}
    plain, held = places["plain"], places["last measurement, held"]
    assert plain.score.mean == pytest.approx(entropy(1e-10), abs=0.15)
    assert held.score.mean > plain.score.mean + 0.5
    assert (plain.score.half is not None, plain.score.count) == (True, ranking.blocks.count)  # type: ignore[union-attr]
    assert "-10.12 ± 0.14 (" in filter_page.sentence(found)  # a number without a unit
    assert ranking.nested is not None
    assert ranking.nested.error.mean == pytest.approx(ranking.rows[0].score.mean)
    assert ranking.nested.beside == pytest.approx(
        {"plain": plain.score.mean, "last measurement, held": held.score.mean}
    )


def test_a_baseline_without_a_likelihood_is_listed_with_the_reason(tmp_path: Path) -> None:
    pulled = load_file(experiment_file(tmp_path))
    found = study(
        pulled, methods=("kf", "plain"), seeds=1, by=LOG_LOSS, out=tmp_path, where=Where(workers=0)
    )
    bare = {
        c.key: Record(c.key, replace(r.value, scores={}, innovations=None))
        if c.method == "plain" and (r := found.done.records[c.key]).value
        else found.done.records[c.key]
        for c in found.plan.cells
    }
    (ranking,) = rankings(found.plan.cells, bare, LOG_LOSS)
    assert [(c.name, why) for c, why in ranking.failed] == [
        ("plain", "no log_loss: its variance needs samples in two blocks of time"),
    ]  # fmt: skip
