"""All metrics of two displacement fields, in one tuple and behind one call (paper 002, III)."""

from collections.abc import Sequence
from dataclasses import dataclass

from validate.compare.field_norms import ENERGY_METRICS, FIELD_METRICS
from validate.compare.interior_error import INTERIOR_METRICS
from validate.compare.metric import Counted, Metric
from validate.compare.pair import Common, Field, FieldPair, count_outside, pair
from validate.compare.score import Score
from validate.compare.shape_error import OF_BODIES, SHAPE_METRICS
from validate.errors import ComparisonError
from validate.scene.mesh import Mesh
from validate.scene.scene import Scene

_CARRIED: Counted[FieldPair] = Counted("nodes carried from another mesh", lambda p: len(p.outside))

CHECKS: tuple[Metric[FieldPair], ...] = (
    Metric(
        "inverted",
        lambda p: float(len(p.one.soundness.inverted)),
        "1",
        "cells of the deformed run whose Jacobian is not positive at a node or Gauss point",
        Counted("cells", lambda p: p.one.soundness.cells),
    ),
    Metric(
        "inverted.reference",
        lambda p: float(len(p.other.soundness.inverted)),
        "1",
        "cells of the deformed reference whose Jacobian is not positive at a node or Gauss point",
        Counted("cells", lambda p: p.other.soundness.cells),
    ),
    Metric(
        "crossings",
        lambda p: float(p.one.soundness.crossings + p.other.soundness.crossings),
        "1",
        "pairs of crossing boundary pieces of either deformed body; E_s exists if it is 0",
        OF_BODIES,
        symmetric=True,
    ),
    Metric(
        "outside",
        lambda p: float(count_outside(p)),
        "1",
        "nodes of the common mesh outside the mesh from which they are interpolated; they "
        "take its nearest point",
        _CARRIED,
        symmetric=True,
    ),
    Metric(
        "outside.max",
        lambda p: float(p.outside.max(initial=0.0)),
        "m",
        "largest distance of a node of the common mesh from the mesh from which it is interpolated",
        _CARRIED,
        symmetric=True,
    ),
)

METRICS_OF_FIELDS: tuple[Metric[FieldPair], ...] = (
    *CHECKS,
    *FIELD_METRICS,
    *ENERGY_METRICS,
    *INTERIOR_METRICS,
    *SHAPE_METRICS,
)


@dataclass(frozen=True)
class FieldScores:
    """Scores of a pair, and the metrics that do not exist there with the reason of each."""

    pair: FieldPair
    scores: tuple[Score, ...]
    refused: tuple[tuple[str, str], ...]


def compared(between: FieldPair, metrics: Sequence[Metric[FieldPair]] | None = None) -> FieldScores:
    """Every metric that exists for the pair; the rest (0/0 at rest, crossings) by reason.

    Without a scene on the common mesh the energy norms are left out, as they have no moduli.
    """
    scores, refused = [], []
    for metric in _default(between) if metrics is None else metrics:
        try:
            scores.append(metric.score(between))
        except ComparisonError as error:
            refused.append((metric.name, str(error)))
    return FieldScores(between, tuple(scores), tuple(refused))


def compare_fields(
    one: Field,
    other: Field,
    onto: Mesh | Scene | Common | None = None,
    metrics: Sequence[Metric[FieldPair]] | None = None,
) -> tuple[Score, ...]:
    """Scores of the run `one` against the reference `other`, also on different meshes.

    Norms and E_i are taken on the mesh `onto` (default: the reference's), boundaries on each
    field's own mesh. A scene as `onto` adds densities and the energy norms.
    Raises `ComparisonError` where one of the metrics does not exist, with its name and the reason.
    """
    found = compared(pair(one, other, onto), metrics)
    if found.refused:
        name, reason = found.refused[0]
        raise ComparisonError(
            f"{len(found.refused)} metrics of {one.name} against {other.name} are not defined; "
            f"{name}: {reason}"
        )
    return found.scores


def _default(between: FieldPair) -> tuple[Metric[FieldPair], ...]:
    if between.common.scene is not None:
        return METRICS_OF_FIELDS
    return tuple(m for m in METRICS_OF_FIELDS if m not in ENERGY_METRICS)
