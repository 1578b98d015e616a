"""Uncertain model parameters that a filter can estimate together with its state.

    stiffness        of every cell            stiffness.<region>  of a region's cells
    stiffness.body   of cells of no region    support.<facets>    of a foundation (or its number)
    load.<load>      the given load, scaled   bias.<load>         a force in N besides the given

Scales are estimated as logarithms, so that no estimate turns negative; a bias is one itself. All
coordinates x are 0 where the model stands.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats
from validate.errors import UsageError
from validate.scene.scene import Foundation, Load, Scene

Kind = Literal["stiffness", "support", "load", "bias"]
_BODY = "body"


@dataclass(frozen=True)
class Doubtful:
    """A parameter: `nominal` in `unit` is the model's own, `sd` that of its coordinate at the
    start, `cells` (e,) those that it scales; `index` counts loads or foundations."""

    name: str
    kind: Kind
    nominal: float
    unit: str
    sd: float
    cells: NDArray[np.bool_]
    index: int = -1

    def value(self, x: float) -> float:
        """Return the parameter in its unit, of its coordinate."""
        return x if self.kind == "bias" else float(self.nominal * np.exp(x))


@dataclass(frozen=True)
class Doubts:
    """The parameters (p,) of one filter."""

    parameters: tuple[Doubtful, ...]

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(p.name for p in self.parameters)

    @property
    def sd(self) -> Floats:
        return np.array([p.sd for p in self.parameters])

    def columns(self, *kinds: Kind) -> tuple[int, ...]:
        return tuple(j for j, p in enumerate(self.parameters) if p.kind in kinds)

    def stiffest(self, x: Floats) -> float:
        """Return the largest factor on any stiffness among members x (s, p): no part has a larger
        one."""
        return float(np.exp((x @ self._factors).max(initial=0.0)))

    @cached_property
    def _factors(self) -> Floats:
        """(p, k): the coordinates that the logarithm of every factor on a stiffness is the sum of,
        of cells, then of supports."""
        masks = np.zeros((len(self.parameters), len(self.parameters[0].cells)))
        for j in self.columns("stiffness"):
            masks[j] = self.parameters[j].cells
        supports = np.eye(len(self.parameters))[:, list(self.columns("support"))]
        return np.hstack([np.unique(masks, axis=1), supports])

    def loads(self, x: Floats, given: Floats) -> Floats:
        """Every member's loads (s, l) N from the given ones (l,)."""
        loads = np.tile(given, (len(x), 1))
        for j, p in enumerate(self.parameters):
            if p.kind == "load":
                loads[:, p.index] *= np.exp(x[:, j])
        for j in self.columns("bias"):
            loads[:, self.parameters[j].index] += x[:, j]
        return loads


@dataclass(frozen=True)
class StiffnessPart:
    """Part of the stiffness that a few coordinates scale: cells of one body, or a foundation's
    springs.

    `mask` (p,) are the coordinates whose sum is the logarithm of its factor; `scene` has the part
    alone (springs: none, but `foundation`).
    """

    mask: Floats
    scene: Scene | None = None
    foundation: Foundation | None = None

    def factor(self, x: Floats) -> Floats:
        """(s,) of members x (s, p)."""
        return np.asarray(np.exp(x @ self.mask))


def doubts(scene: Scene, names: Sequence[str], sd: Sequence[float], bias_sd: float) -> Doubts:
    """By name; `sd` of scales is one for all or one each, `bias_sd` N that of every bias.

    Raises `UsageError` for a name that the scene has nothing for, one twice, and an sd <= 0.
    """
    twice = [n for n in names if list(names).count(n) > 1]
    if twice:
        raise UsageError(f"parameter '{twice[0]}' is named twice; name each parameter once")
    if len(sd) not in (1, len(names)) or min(sd, default=0.0) <= 0 or bias_sd <= 0:
        raise UsageError(
            f"sd {list(sd)} and bias_sd {bias_sd:g} N of {len(names)} parameters: expected "
            "values above 0, one sd for all or one for each"
        )
    known, each = {p.name: p for p in _known(scene)}, list(sd) * (len(names) // len(sd))
    odd = [n for n in names if n not in known]
    if odd:
        raise UsageError(f"parameter '{odd[0]}': not in this scene, which has {', '.join(known)}")
    found = (known[n] for n in names)
    return Doubts(
        tuple(
            replace(p, sd=bias_sd if p.kind == "bias" else s)
            for p, s in zip(found, each, strict=True)
        )
    )


def _known(scene: Scene) -> Iterator[Doubtful]:
    """Every parameter that a scene has, without an sd."""
    every, none = (np.full(len(scene.mesh.cells), b) for b in (True, False))
    body, E = every.copy(), scene.material.E
    yield Doubtful("stiffness", "stiffness", E, "Pa", 0.0, every)
    for region in scene.regions:
        cells = none.copy()
        cells[region.cells] = True
        body &= ~cells
        yield Doubtful(f"stiffness.{region.name}", "stiffness", region.material.E, "Pa", 0.0, cells)
    if scene.regions:
        yield Doubtful(f"stiffness.{_BODY}", "stiffness", E, "Pa", 0.0, body)
    for i, f in enumerate(scene.foundations):
        name = f"support.{f.facets if isinstance(f.facets, str) else i}"
        yield Doubtful(name, "support", f.stiffness, "N/m^3", 0.0, none, i)
    for i, load in enumerate(scene.loads):
        yield Doubtful(f"load.{load.name}", "load", 1.0, "1", 0.0, none, i)
        if isinstance(load, Load):
            yield Doubtful(f"bias.{load.name}", "bias", 0.0, "N", 0.0, none, i)


def parts(scene: Scene, of: Doubts) -> tuple[StiffnessPart, ...]:
    """Return the scene's stiffness in parts: one for every group of cells that the parameters tell
    apart, then one for every foundation."""
    p = len(of.parameters)
    masks = np.zeros((len(scene.mesh.cells), p))
    for j in of.columns("stiffness"):
        masks[:, j] = of.parameters[j].cells
    groups, inverse = np.unique(masks, axis=0, return_inverse=True)
    found = [
        StiffnessPart(mask, _alone(scene, np.ravel(inverse) == g)) for g, mask in enumerate(groups)
    ]
    for i, foundation in enumerate(scene.foundations):
        mask = np.zeros(p)
        mask[[j for j in of.columns("support") if of.parameters[j].index == i]] = 1.0
        found.append(StiffnessPart(mask, foundation=foundation))
    return tuple(found)


def _alone(scene: Scene, cells: NDArray[np.bool_]) -> Scene:
    """Some cells of a scene on all its nodes, free of everything else."""
    number = np.cumsum(cells) - 1
    regions = tuple(
        replace(r, cells=number[r.cells[cells[r.cells]]])
        for r in scene.regions
        if cells[r.cells].any()
    )
    mesh = replace(scene.mesh, cells=scene.mesh.cells[cells], facets={})
    return Scene(
        mesh, scene.material, regions=regions, dilatation=scene.dilatation, plane=scene.plane,
        thickness=scene.thickness,
    )  # fmt: skip
