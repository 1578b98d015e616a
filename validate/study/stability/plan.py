"""Plan of a stability map: variants of a body along each axis and along pairs of axes."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.engine.store import key_of
from validate.pipeline.ladder.ladder import StabilityBody, Turned
from validate.pipeline.run.job import Job

NU = (0.0, 0.2, 0.3, 0.4, 0.45, 0.47, 0.49, 0.495, 0.499, 0.4999)
E = (200.0, 600.0, 2e3, 6e3, 2e4, 6e4, 2e5, 6e5, 1e6)  # Pa
# Mass damping 1/s and stiffness damping s, from none to beyond all that the papers print.
DAMPING = ((0.0, 0.0), (1.0, 0.0), (100.0, 0.0), (0.0, 1e-3), (0.0, 0.01), (1.0, 0.1), (0.0, 1.0))
DECADES = 6  # of time steps, half of them on each side of the paper's
PER_DECADE = 4
# What must be refused: another value of one field, and the word that the reason holds.
IMPOSSIBLE: tuple[tuple[str, float, str], ...] = (
    ("nu", 0.5, "Poisson"), ("nu", -1.0, "Poisson"), ("nu", 0.6, "Poisson"),
    ("E", 0.0, "modulus"), ("E", -1e3, "modulus"), ("rho", 0.0, "density"),
    ("rho", -1.0, "density"), ("quality", 0.0, "altitude"),
)  # fmt: skip
_PAIR_NU = (0.0, 0.45, 0.49, 0.4999)
_PAIR_E = (200.0, 6e3, 1e6)

Pairs = tuple[Mapping[str, Any], ...]


@dataclass(frozen=True)
class StabilityCell:
    """One variant with all schemes and steps (s) on it; `key` names all that makes its numbers.

    `drift`: 1e5 steps are taken, too. `expected` is the word of the reason it must be refused for.
    """

    variant: Turned
    steps: tuple[float, ...]
    drift: bool = False
    expected: str = ""
    key: str = ""
    timed: bool = False

    @property
    def label(self) -> str:
        v = self.variant
        return f"mesh {v.mesh}, E {v.E:.3g} Pa, nu {v.nu:g}, all schemes at {len(self.steps)} steps"


def step_grid(dt: float, quick: bool = False) -> Floats:
    """Return the steps (k,) s over six decades, `dt` in the middle."""
    per = 2 if quick else PER_DECADE
    exponents = np.arange(DECADES * per + 1) / per - DECADES / 2
    return np.asarray(dt * 10.0**exponents)


def stability_cells(
    base: StabilityBody, job: Job, quick: bool = False
) -> tuple[StabilityCell, ...]:
    """Every variant once: the base, the papers', sweeps of one and two axes, the impossible.

    `quick`: axes alone, every second value.
    """
    steps = tuple(step_grid(base.dt, quick).tolist())
    drifting = drift_variant(base)
    wanted = [base.base, *(p.variant for p in base.papers), drifting, *_swept(base, quick)]
    impossible = {replace(base.base, **{k: v}): word for k, v, word in IMPOSSIBLE}  # type: ignore[arg-type]
    impossible[replace(base.base, mesh=2 * base.meshes[-1])] = "unknowns"
    # A printed material of nu = 0.5 must be refused.
    bare = (
        StabilityCell(v, steps, v == drifting, impossible.get(v, "Poisson" if v.nu >= 0.5 else ""))
        for v in dict.fromkeys([*wanted, *impossible])
    )
    return tuple(replace(c, key=key_of(job, c)) for c in bare)


def drift_variant(base: StabilityBody) -> Turned:
    """Return the undamped body on the coarsest mesh: what 1e5 steps are taken of."""
    return replace(base.base, mesh=base.meshes[0], mass_damping=0.0, stiffness_damping=0.0)


def axis(base: StabilityBody, name: str) -> tuple[Turned, ...]:
    """Return the variants along one axis from the base: nu, E, damping, quality or mesh."""
    return tuple(replace(base.base, **changes) for changes in _axes(base)[name])


def _axes(base: StabilityBody) -> dict[str, Pairs]:
    return {
        "nu": tuple({"nu": v} for v in NU),
        "E": tuple({"E": v} for v in E),
        "damping": tuple({"mass_damping": a, "stiffness_damping": b} for a, b in DAMPING),
        "quality": tuple({"quality": v} for v in base.qualities),
        "mesh": tuple({"mesh": v} for v in base.meshes),
    }


def _swept(base: StabilityBody, quick: bool) -> Iterator[Turned]:
    every = 2 if quick else 1
    for changes in _axes(base).values():
        yield from (replace(base.base, **c) for c in changes[::every])
    if quick:
        return
    axes = _axes(base) | {
        "nu": tuple({"nu": v} for v in _PAIR_NU), "E": tuple({"E": v} for v in _PAIR_E)
    }  # fmt: skip
    pairs = (("nu", "E"), ("nu", "damping"), ("nu", "quality"), ("nu", "mesh"), ("E", "damping"))
    for one, other in pairs:
        for a, b in product(axes[one], axes[other]):
            yield replace(base.base, **{**a, **b})
