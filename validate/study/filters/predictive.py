"""Predictive likelihood of methods without one: plain FEM and the last measurement.

A Gaussian about the prediction, of variance R + q per measured component: R is the noise of one
measurement, q >= 0 the variance of the model. Its maximum-likelihood estimate over errors e is
q = max(0, mean(e^2) - R). It is taken on all blocks of time but the one that it scores, so a
baseline is shown at its best and never sees the block that is reported.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from validate.engine.cell import Record
from validate.study.filters.blocks import Blocks, blocks_of
from validate.study.filters.plan import FilterCell
from validate.study.filters.score import LOG_LOSS, FilterScores
from validate.study.filters.withheld_errors import Innovations, PredictionErrors

Records = Mapping[str, Record[FilterScores]]


def with_likelihoods(cells: Sequence[FilterCell], records: Records) -> Records:
    """Return the records, with a likelihood for the methods without innovations of every
    condition."""
    scored = dict(records)
    for condition in dict.fromkeys(c.condition for c in cells):
        values = {
            c.key: value
            for c in cells
            if c.condition == condition and (value := records[c.key].value) is not None
        }
        blocks = blocks_of(values)
        for key, value in values.items():
            scored[key] = replace(records[key], value=with_likelihood(value, blocks))
    return scored


def with_likelihood(value: FilterScores, blocks: Blocks | None) -> FilterScores:
    """The same, with the log loss of its predictive Gaussian where it has no innovations."""
    if value.predictions is None or value.innovations is not None or blocks is None:
        return value
    likelihood = predictive_likelihood(value.predictions, blocks)
    if likelihood is None:
        return value
    loss = -likelihood.log_likelihood.sum(axis=1) / likelihood.dof.sum(axis=1)
    return replace(
        value,
        innovations=likelihood,
        scores={**value.scores, LOG_LOSS: tuple(loss.tolist())},
        units={**value.units, LOG_LOSS: "1"},
    )


def predictive_likelihood(errors: PredictionErrors, blocks: Blocks) -> Innovations | None:
    """Log-likelihood by segment, each block under the variance that all others give; None where a
    component has no sample outside of a block that has some, or none at all."""
    counts, squares = blocks.sums(errors.counts), blocks.sums(errors.squares)
    others = counts.sum(axis=-1, keepdims=True) - counts
    if not (counts.sum(axis=(1, 2)) > 0).all() or ((counts > 0) & (others == 0)).any():
        return None
    outside = squares.sum(axis=-1, keepdims=True) - squares
    mean = np.divide(outside, others, out=np.zeros_like(outside), where=others > 0)
    block = np.searchsorted(blocks.starts, np.arange(errors.counts.shape[-1]), side="right") - 1
    variance = np.maximum(np.asarray(mean[..., block]), errors.noise)
    density = errors.counts * np.log(2 * np.pi * variance) + errors.squares / variance
    return Innovations(-0.5 * density.sum(axis=1), errors.counts.sum(axis=1), None, None)
