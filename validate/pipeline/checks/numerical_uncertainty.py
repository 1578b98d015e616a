"""Numerical uncertainty u_num of the accepted methods, from their declared meshes and steps."""

from collections.abc import Mapping
from dataclasses import replace
from math import inf, isfinite

import numpy as np

from validate.arrays import Floats, rms
from validate.compare.convergence import GridConvergence, Numerical, convergence
from validate.compare.residual import Residual
from validate.errors import ComparisonError, SceneError
from validate.numbers import text
from validate.pipeline.experiment.experiment import Uncertainty, Variant
from validate.pipeline.run.runs import ExperimentRuns, Varied

# Below, differences need no order, and the largest is u: of the largest number compared (rounding),
# or of the limit (solvers, and points that meshes interpolate apart).
_ROUNDING, _IMMATERIAL = 1e-9, 1e-3


def variants(uncertainty: Uncertainty, name: str) -> dict[str, list[Variant]]:
    """By part of u_num: the method (or its stand-in) as it is, and on every level."""
    own = Variant(uncertainty.stand_in.get(name, name))
    found = {}
    if uncertainty.mesh:
        found["mesh"] = [own, *(replace(own, change=c) for c in uncertainty.mesh.levels)]
    if uncertainty.steps:
        own = Variant(name)
        found["time step"] = [own, *(replace(own, split=n) for n in uncertainty.steps.splits)]
    return found


class Refined:
    """Convergence of a method's residuals, by part of u_num; of the meshes and steps that ran."""

    def __init__(self, runs: ExperimentRuns, uncertainty: Uncertainty, name: str) -> None:
        self._uncertainty = uncertainty
        self._stands_in = uncertainty.stand_in.get(name, "")
        self._runs = {
            part: [_solved(runs, v) for v in levels]
            for part, levels in variants(uncertainty, name).items()
        }
        self._sizes = {part: self._size_of(part, runs, name) for part in self._runs}

    def of(self, residual: Residual, limit: float) -> dict[str, GridConvergence | None]:
        """By part; None where fewer than two meshes or steps compare the same points."""
        immaterial = _IMMATERIAL * limit if isfinite(limit) else 0.0
        ends = (residual.simulated or 0.0, residual.measured or 0.0)
        rounding = max(_ROUNDING * float(max(rms(residual.values), *np.abs(ends))), immaterial)
        return {part: self._converged(part, residual, rounding) for part in self._runs}

    def numerical(self, residual: Residual, limit: float = inf) -> Numerical:
        """Return the parts of u_num, how each was found, and what would decide within `limit`."""
        found = self.of(residual, limit)
        deciding = {part: self._deciding(part, c, limit) for part, c in found.items() if c}
        lost = [part for part, c in found.items() if c is None or not c.asymptotic]
        words = [f"{part}: {self._words(part, c)}" for part, c in found.items()]
        words += [f"{deciding[part]} would decide" for part in lost if part in deciding]
        parts = {part: c.u if c else inf for part, c in found.items()}
        return Numerical(parts, "; ".join(words), deciding)

    def _size_of(self, part: str, runs: ExperimentRuns, name: str) -> list[float]:
        """m or s of every level, as it is first."""
        mesh = self._uncertainty.mesh
        if part == "mesh" and mesh:
            changed = [v.change(runs.parameters) for v in variants(self._uncertainty, name)[part]]
            sizes = [mesh.size(p) for p in changed]
        else:
            own = self._nominal(part)
            sizes = [
                own.until / (own.steps * v.split)
                for v in variants(self._uncertainty, name)["time step"]
            ]
        if len(set(sizes)) < min(2, len(sizes)):
            raise ComparisonError(
                f"{name}, {part}: sizes {', '.join(f'{s:.3g}' for s in sizes)}; u_num needs two "
                "different sizes; declare more mesh or step sizes"
            )
        return sizes

    def _nominal(self, part: str) -> Varied:
        found = self._runs[part][0]
        assert found is not None
        return found

    def _converged(self, part: str, residual: Residual, rounding: float) -> GridConvergence | None:
        answers: dict[float, Floats] = {}
        meshes: set[int] = set()
        for size, run in zip(self._sizes[part], self._runs[part], strict=True):
            mine = run.residuals.get(residual.name) if run else None
            if run is None or mine is None or mine.values.shape != residual.values.shape:
                continue
            # A method whose own settings fix its mesh is no ladder, whatever the sizes say.
            nodes = run.nodes if part == "mesh" else len(meshes)
            if nodes not in meshes:
                answers.setdefault(size, mine.values)
            meshes.add(nodes)
        if len(answers) < 2 or self._sizes[part][0] not in answers:
            return None
        ladder = self._uncertainty.mesh if part == "mesh" else self._uncertainty.steps
        assert ladder is not None
        return convergence(list(answers), list(answers.values()), 0, ladder.order, rounding)

    def _words(self, part: str, found: GridConvergence | None) -> str:
        if found is None:
            if len(self._runs[part]) == 1:
                return "no second mesh fits into the time of a first answer; add --refine"
            return "fewer than two different sizes compare the same points"
        by = f" by {self._stands_in} in its place" if part == "mesh" and self._stands_in else ""
        # A mesh file that is too large to be halved is filled anew with larger cells.
        only = found.conduct == "two sizes" and found.finest == 1 and part == "mesh"
        return found.words + by + (", one of them coarser" if only else "")

    def _deciding(self, part: str, found: GridConvergence, limit: float) -> str:
        share = found.deciding(limit)
        size = share * self._sizes[part][0]
        if part != "mesh":
            return f"a step of {1e3 * size:.2g} ms"
        own = self._nominal(part)
        unknowns = float(f"{own.nodes * own.dimension / share**own.dimension:.1g}")
        return f"cells of {1e3 * size:.2g} mm (about {text(unknowns)} unknowns)"


def _solved(runs: ExperimentRuns, variant: Variant) -> Varied | None:
    """None for a mesh too coarse to hold the body's shape."""
    try:
        return runs.varied(variant)
    except SceneError:
        if variant == Variant(variant.method):
            raise
        return None


def mesh_errors(refined: Refined | None, residuals: Mapping[str, Residual]) -> dict[str, float]:
    """u_num of every residual, its unit; zero where nothing is discretised anew."""
    return {k: refined.numerical(r).u if refined else 0.0 for k, r in residuals.items()}
