"""How much the plates of paper 000's phantom rub, from how far its markers rise."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.compare.residual import Residual
from validate.compare.score import Score
from validate.parameters import with_given
from validate.pipeline.experiment.experiment import Identified, Variant
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.plates.inclusion import InclusionTest

from .effects import MESHES, finest
from .friction_profile import Interval, profile_interval

_LINEAR = {"body.element": "linear"}  # of mean dilatation
_SAFETY = 3.0 / 2  # two meshes: Roache's factor 3 on the difference is a 95 % band, half of it u
#: Solves variants side by side and returns the residuals of each by name.
SolvesVariants = Callable[[Sequence[Variant]], Sequence[Mapping[str, Residual]]]
SHARES = np.array([0.0, 0.03, 0.08, 0.15, 0.3, 0.5, 0.75, 1.0])


def friction_from_rise(parameters: Tree, method: str, solves: SolvesVariants) -> Identified:
    """Plate friction from the vertical rise of the markers, by one method of the experiment."""

    def rises(shares: Floats, p: Tree) -> list[list[Residual]]:
        found = solves([Variant(method, partial(_rubbing, p, share)) for share in shares.tolist()])
        return [[r for r in f.values() if r.quantity == "marker.vertical"] for f in found]

    risen = rises(SHARES, parameters)
    weighed = np.array([_weighed(found) for found in risen])
    chi_square = (weighed**2).sum(axis=1)
    best = int(np.argmin(chi_square))
    refined = finest(parameters)
    finer = _weighed(rises(SHARES[best : best + 1], refined)[0])
    ratio = parameters.scene.body.cell_size / refined.scene.body.cell_size
    mesh = _mesh_share(weighed, best, finer, ratio**MESHES.order - 1)
    fit = profile_interval(SHARES, chi_square, sum(r.count for r in risen[-1]), mesh)
    return Identified(parameters, _scores(fit), (_said(fit),))


def _rubbing(p: Tree, share: float, _: Tree) -> Any:
    return with_given(InclusionTest.rubbing(p, share), _LINEAR)


def _weighed(found: Sequence[Residual]) -> Floats:
    """All residuals (n,) over their standard deviations."""
    return np.concatenate([r.values.ravel() / r.sd for r in found])


def _mesh_share(weighed: Floats, best: int, finer: Floats, refinement: float) -> float:
    """How far the share moves, by least squares, when the mesh's error is taken off the rise.

    `weighed` (g, n) at every share, `finer` (n,) at the best one on the finer mesh; `refinement` is
    r^p - 1 of the two meshes.
    """
    slope = np.gradient(weighed, SHARES, axis=0)[best]
    moved = float(slope @ (finer - weighed[best])) / float(slope @ slope)
    return _SAFETY * abs(moved) / refinement


def _scores(fit: Interval) -> tuple[Score, ...]:
    words = "tangential plate stiffness k as k/(k + 4 E/x): 0 slips, 1 bonds; from the rise"
    rows = {"share": fit.best, "share.low": fit.low, "share.high": fit.high}
    rows["share.mesh"] = fit.mesh
    rows["chi_square"] = fit.chi_square
    return tuple(
        Score(f"friction.{name}", value, "1", fit.count, "measured markers", words)
        for name, value in rows.items()
    )


def _said(fit: Interval) -> str:
    return (
        f"Plate friction from the markers' vertical rise ({fit.count} values): share "
        f"{fit.best:.2f}, between {fit.low:.2f} and {fit.high:.2f} (two standard deviations, "
        f"one of {fit.mesh:.1g} from the mesh among them), where 0 is slipping, 1 bonded and 0.5 a "
        "tangential stiffness of 4 E/x."
    )
