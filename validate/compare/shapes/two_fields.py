"""All metrics of two displacement fields in one call (paper 002, III)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from validate.arrays import Floats
from validate.compare.score import Counted, Metric, Score
from validate.compare.shapes.pair import Common, Field, FieldPair, count_outside, pair
from validate.compare.shapes.shape_error import OF_BODIES, SHAPE_METRICS
from validate.errors import ComparisonError, UsageError
from validate.fem.assembly.assemble import rule, values_at, volumes_at
from validate.parameters import nearest_names
from validate.scene.mesh import Mesh
from validate.scene.scene import Scene

# --- Interior error E_i: how far apart two fields put the points of a body (paper 002, III C).
#
# The paper integrates the distance over the body at rest and divides by the root of the area (the
# cube root of the volume), which leaves m^2 (m^3); divided by the area (volume) it is a mean
# distance in m. Both are given.
#
# Departures: integrated by quadrature. The paper's sum over nodes is an upper bound for linear
# elements, needs the weights w_a (it prints none; an unweighted sum grows with the mesh), and
# fails for quadratic tetrahedra, whose vertex weights are negative.

_SAMPLED = 4  # Gauss points along an axis; the distance has a kink where the fields agree


def printed(pair: FieldPair) -> float:
    """E_i with the paper's normaliser: integral of |u' - u| over |M0|^(1/d); m^2 (2-D), m^3."""
    distance, volume = _integrals(pair)
    return distance / float(volume ** (1 / pair.on.dimension))


def mean_distance(pair: FieldPair) -> float:
    """Integral of |u' - u| over the volume (area), m."""
    distance, volume = _integrals(pair)
    return distance / volume


def _integrals(pair: FieldPair) -> tuple[float, float]:
    points = rule(pair.on, _SAMPLED)
    dv = volumes_at(pair.on, points)
    distance = np.linalg.norm(values_at(pair.on, points, pair.difference), axis=2)
    return float((dv * distance).sum()), float(dv.sum())


_POINTS_OF: Counted[FieldPair] = Counted(
    "quadrature points", lambda p: len(p.on.cells) * len(rule(p.on, _SAMPLED).weights)
)

INTERIOR_METRICS: tuple[Metric[FieldPair], ...] = (
    Metric(
        "E_i",
        printed,
        "m^{dimension}",
        "interior error as printed (paper 002, III C): integral of |u' - u| over the body at rest, "
        "over the square root of its area (cube root of its volume)",
        _POINTS_OF,
        symmetric=True,
    ),
    Metric(
        "E_i.mean",
        mean_distance,
        "m",
        "mean distance: integral of |u' - u| over the body at rest, over its area (volume)",
        _POINTS_OF,
        symmetric=True,
    ),
)


# --- Norms of the difference of two displacement fields (paper 002, III A).
#
# The paper's "energy norm" sums squares over nodes: it depends on where the nodes lie. The L2
# norm weighs by mass; the energy norm proper, root of e^T K e, is the strain energy of the
# difference.

_POINTS = 3  # Gauss points along an axis: degree 5 holds the square of a quadratic field


def relative_nodal_norm(pair: FieldPair) -> float:
    """E_n = |u' - u| / |u| over all nodal components (paper 002, eq 1); 0/0 at rest is refused."""
    return _relative(
        float(np.linalg.norm(pair.difference)), float(np.linalg.norm(pair.u_other)), pair, "E_n"
    )


def relative_l2_norm(pair: FieldPair) -> float:
    """Root of (integral of rho |u' - u|^2) over (integral of rho |u|^2)."""
    top, bottom = _l2(pair, pair.difference), _l2(pair, pair.u_other)
    return _relative(top, bottom, pair, "the L2 norm")


def rms_difference(pair: FieldPair) -> float:
    """Root of (integral of rho |u' - u|^2) over the mass, m."""
    ones = np.ones((len(pair.on.nodes), 1))
    return _l2(pair, pair.difference) / _l2(pair, ones)


def relative_energy_norm(pair: FieldPair) -> float:
    """Root of (e^T K e) over (u^T K u), e = u' - u."""
    return _relative(
        energy_norm(pair, pair.difference), energy_norm(pair, pair.u_other), pair, "the energy norm"
    )


def energy_norm_of_difference(pair: FieldPair) -> float:
    """Root of e^T K e, J^(1/2)."""
    return energy_norm(pair, pair.difference)


def energy_norm(pair: FieldPair, u: Floats) -> float:
    """Root of u^T K u, J^(1/2), of a field u (n, d) m on the pair's mesh.

    Raises `ComparisonError` without a scene, which holds the moduli.
    """
    v = u.ravel()
    # Rounding can leave a rigid motion a hair below zero.
    return float(np.sqrt(max(0.0, float(v @ (pair.common.K @ v)))))


def _l2(pair: FieldPair, values: Floats) -> float:
    """Root of the integral of rho |values (n, c)|^2."""
    points = rule(pair.on, _POINTS)
    square = (values_at(pair.on, points, values) ** 2).sum(axis=2)
    per_cell = (volumes_at(pair.on, points) * square).sum(axis=1)
    return float(np.sqrt(per_cell @ pair.common.density))


def _relative(top: float, bottom: float, pair: FieldPair, what: str) -> float:
    if bottom == 0:
        raise ComparisonError(
            f"{what} is {'0' if top == 0 else f'{top:.3g}'}/0: {pair.other.name} does not move "
            "there (rest, t = 0); compare a later time or take an absolute metric"
        )
    return top / bottom


_NODES: Counted[FieldPair] = Counted("nodes", lambda p: len(p.on.nodes))

FIELD_METRICS: tuple[Metric[FieldPair], ...] = (
    Metric(
        "E_n",
        relative_nodal_norm,
        "1",
        "relative norm of paper 002, eq 1: root of the sum over nodes of |u' - u|^2 over that "
        "of |u|^2, as printed; it is unweighted and depends on the mesh",
        _NODES,
    ),
    Metric(
        "L2.relative",
        relative_l2_norm,
        "1",
        "mass-weighted L2 norm of u' - u over that of u, by quadrature; equal densities cancel",
        _NODES,
    ),
    Metric(
        "L2.rms",
        rms_difference,
        "m",
        "root mean square of |u' - u| over the mass, by quadrature",
        _NODES,
        symmetric=True,
    ),
)

ENERGY_METRICS: tuple[Metric[FieldPair], ...] = (
    Metric(
        "energy.relative",
        relative_energy_norm,
        "1",
        "energy norm of u' - u over that of u: root of e^T K e over u^T K u, linear elasticity",
        _NODES,
    ),
    Metric(
        "energy",
        energy_norm_of_difference,
        "J^(1/2)",
        "energy norm of u' - u: root of e^T K e, twice the strain energy of the difference",
        _NODES,
        symmetric=True,
    ),
)


# -------------------------------------------------------------------------------------------------

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

    @classmethod
    def of(
        cls,
        one: Field,
        other: Field,
        onto: "Mesh | Scene | Common | FieldScores | None" = None,
        metrics: Sequence[str] | None = None,
    ) -> Self:
        """Compare the run `one` with the reference `other`, also on different meshes, by metrics of
        these names (none: all that exist).

        Norms and E_i are taken on the mesh `onto` (default: the reference's), boundaries on each
        field's own mesh. A scene as `onto` adds densities and the energy norms; earlier scores
        stand for their mesh, which is then prepared once for all frames. Raises `UsageError` for
        an unknown metric.
        """
        common = onto.pair.common if isinstance(onto, FieldScores) else onto
        by_name = {m.name: m for m in METRICS_OF_FIELDS}
        if unknown := [name for name in metrics or () if name not in by_name]:
            raise UsageError(f"no metric '{unknown[0]}'; {nearest_names(unknown[0], set(by_name))}")
        chosen = None if metrics is None else tuple(by_name[name] for name in metrics)
        between = pair(one, other, common)
        found = compared(between, chosen)
        return cls(between, found.scores, found.refused)

    def whole(self) -> tuple[Score, ...]:
        """Return all scores; raises `ComparisonError` where one of the metrics does not exist, with
        its name and the reason."""
        if self.refused:
            name, reason = self.refused[0]
            raise ComparisonError(
                f"{len(self.refused)} metrics of {self.pair.one.name} against "
                f"{self.pair.other.name} are not defined; {name}: {reason}"
            )
        return self.scores

    @staticmethod
    def units(dimension: int) -> dict[str, str]:
        """Return the unit of every metric in 2-D or 3-D, by name."""
        return {m.name: m.unit.format(dimension=dimension) for m in METRICS_OF_FIELDS}


def compared(between: FieldPair, metrics: Sequence[Metric[FieldPair]] | None = None) -> FieldScores:
    """Every metric that exists for the pair; the rest (0/0 at rest, crossings) by reason.

    Without a scene on the common mesh the energy norms are left out, as they have no moduli.
    """
    scores, refused = [], []
    if metrics is None:
        bodies = between.common.scene is not None
        metrics = tuple(m for m in METRICS_OF_FIELDS if bodies or m not in ENERGY_METRICS)
    for metric in metrics:
        try:
            scores.append(metric.score(between))
        except ComparisonError as error:
            refused.append((metric.name, str(error)))
    return FieldScores(between, tuple(scores), tuple(refused))
