"""All metrics of two displacement fields, in one registry and behind one call (paper 002, III)."""

from collections.abc import Sequence
from dataclasses import dataclass

from validate.compare.fields import ENERGY_METRICS, FIELD_METRICS
from validate.compare.interior import INTERIOR_METRICS
from validate.compare.metric import Metric
from validate.compare.pair import Common, Field, Pair, count_outside, pair
from validate.compare.score import Score
from validate.compare.shape import SHAPE_METRICS
from validate.errors import ComparisonError
from validate.scene.mesh import Mesh
from validate.scene.scene import Scene

CHECKS: tuple[Metric, ...] = (
    Metric(
        "inverted",
        lambda p: float(len(p.one.soundness.inverted)),
        ("1", "1"),
        lambda p: p.one.soundness.cells,
        "cells",
        "cells whose Jacobian is not positive at a node or Gauss point of the deformed run",
        symmetric=False,
    ),
    Metric(
        "inverted.reference",
        lambda p: float(len(p.other.soundness.inverted)),
        ("1", "1"),
        lambda p: p.other.soundness.cells,
        "cells",
        "cells whose Jacobian is not positive at a node or Gauss point of the deformed reference",
        symmetric=False,
    ),
    Metric(
        "crossings",
        lambda p: float(p.one.soundness.crossings + p.other.soundness.crossings),
        ("1", "1"),
        lambda p: len(p.one.skin.pieces) + len(p.other.skin.pieces),
        "boundary segments or triangles of both",
        "pairs of boundary pieces of either deformed body that cross; E_s exists where it is 0",
        symmetric=True,
    ),
    Metric(
        "outside",
        lambda p: float(count_outside(p)),
        ("1", "1"),
        lambda p: len(p.outside),
        "nodes carried from another mesh",
        "nodes of the common mesh outside the mesh they read; they take its nearest point",
        symmetric=True,
    ),
    Metric(
        "outside.max",
        lambda p: float(p.outside.max(initial=0.0)),
        ("m", "m"),
        lambda p: len(p.outside),
        "nodes carried from another mesh",
        "largest distance of a node of the common mesh from the mesh it reads",
        symmetric=True,
    ),
)

METRICS_OF_FIELDS: tuple[Metric, ...] = (
    *CHECKS,
    *FIELD_METRICS,
    *ENERGY_METRICS,
    *INTERIOR_METRICS,
    *SHAPE_METRICS,
)


@dataclass(frozen=True)
class Compared:
    """Scores of a pair, and the metrics that do not exist there with the reason of each."""

    pair: Pair
    scores: tuple[Score, ...]
    refused: tuple[tuple[str, str], ...]


def compared(between: Pair, metrics: Sequence[Metric] | None = None) -> Compared:
    """Every metric that exists for the pair; the rest (0/0 at rest, crossings) by reason.

    Without a scene on the common mesh the energy norms are left out, as they have no moduli.
    """
    scores, refused = [], []
    for metric in _default(between) if metrics is None else metrics:
        try:
            scores.append(metric.score(between))
        except ComparisonError as error:
            refused.append((metric.name, str(error)))
    return Compared(between, tuple(scores), tuple(refused))


def compare_fields(
    one: Field,
    other: Field,
    onto: Mesh | Scene | Common | None = None,
    metrics: Sequence[Metric] | None = None,
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
            f"{len(found.refused)} metrics of {one.name} against {other.name} do not exist; "
            f"{name}: {reason}"
        )
    return found.scores


def _default(between: Pair) -> tuple[Metric, ...]:
    if between.common.scene is not None:
        return METRICS_OF_FIELDS
    return tuple(m for m in METRICS_OF_FIELDS if m not in ENERGY_METRICS)
