"""One variant on a worker: all modes once, then every scheme and step on them.

Radii, measured and predicted limits, condition numbers, locking, rounding and drift; or the one
line for which the variant is refused.
"""

import json
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from time import perf_counter
from typing import Any
from uuid import uuid4

import numpy as np
from scipy.linalg import eigh, eigvalsh

from validate.arrays import Floats
from validate.errors import ValidateError
from validate.fem.locking import locking_warning
from validate.fem.matrices import mass_of
from validate.fem.mixed import mixed_static
from validate.fem.system import System, build
from validate.solve.explicit_linear import ExplicitLinear, stable_step
from validate.study.base_scenes import BaseScene, Variant, base_scene
from validate.study.precision import Drift, Rounding, drift, rounding
from validate.study.stepping import Stepping, steppings_for
from validate.study.variants import VariantCell

_REACH = 8.0  # times the predicted limit, on both sides, that the measured one is sought in
_HALVINGS = 30  # of that interval's logarithm: 4e-9 of the limit
_DRIFT_SHARE = 0.5  # of the limit
_LEAST_NU = 1e-6  # of mixed elements, whose pressure has no equation at lambda = 0


@dataclass(frozen=True)
class SchemeResult:
    """Radii at the cell's steps; limits s: `predicted` None: none, `measured` None: not found."""

    scheme: str
    radii: tuple[float, ...]
    predicted: float | None
    measured: float | None


@dataclass(frozen=True)
class VariantResult:
    """`lowest`, `highest` frequency 1/s with consistent mass; condition numbers by matrix; locking
    factor; rounding; drift. `refused` is "" or why there is nothing; `warning` on locking or "".
    """

    key: str
    refused: str = ""
    failed: str = ""
    unknowns: int = 0
    lowest: float = 0.0
    highest: float = 0.0
    schemes: tuple[SchemeResult, ...] = ()
    conditions: dict[str, float] = field(default_factory=dict)
    locking: float | None = None
    rounding: Rounding | None = None
    drifts: tuple[Drift, ...] = ()
    warning: str = ""
    seconds: float = 0.0


def run_variant(cell: VariantCell) -> VariantResult:
    """A variant that cannot be is a result with the reason."""
    start = perf_counter()
    base = base_scene(cell.scene)
    try:
        system = build(base.build(cell.variant))
    except ValidateError as error:
        return VariantResult(cell.key, refused=" ".join(str(error).split()))
    try:
        found = _result(base, cell, system)
    except Exception as error:  # one variant must not end the study: it becomes a row
        found = VariantResult(cell.key, failed=" ".join(f"{type(error).__name__}: {error}".split()))
    return replace(found, seconds=perf_counter() - start)


def _result(base: BaseScene, cell: VariantCell, system: System) -> VariantResult:
    v = cell.variant
    modes = {mass: frequencies(system, mass) for mass in ("consistent", "lumped")}
    schemes = steppings_for(system.scene.mesh.kind)
    pulled = build(base.pulled(v))
    limit = stable_step(pulled, ExplicitLinear(1.0, "lumped", "mass"))
    return VariantResult(
        cell.key,
        unknowns=len(system.free),
        lowest=float(modes["consistent"][0]),
        highest=float(modes["consistent"][-1]),
        schemes=tuple(_scheme(s, system, modes[s.mass], v, cell.steps) for s in schemes),
        conditions=_conditions(system, base.dt),
        locking=_locking(base.name, v.nu, v.mesh, v.quality),
        rounding=rounding(pulled, limit),
        drifts=tuple(_drifts(base, system, schemes, modes)) if cell.drift else (),
        warning=locking_warning(system.scene) or "",
    )


def frequencies(system: System, mass: Any) -> Floats:
    """All frequencies (r,) 1/s, rising."""
    free = system.free
    K, M = (X[free][:, free].toarray() for X in (system.K, mass_of(system, mass)))
    return np.sqrt(np.maximum(eigh(K, M, eigvals_only=True), 0.0))


def _scheme(
    scheme: Stepping, system: System, omegas: Floats, v: Variant, steps: tuple[float, ...]
) -> SchemeResult:
    def radius(h: float) -> float:
        return scheme.radius(h, omegas, v.mass_damping, v.stiffness_damping)

    predicted = scheme.limit(system) if scheme.limit else None
    measured = measured_limit(radius, predicted, 1 + scheme.rounding) if predicted else None
    return SchemeResult(scheme.name, tuple(radius(h) for h in steps), predicted, measured)


def measured_limit(radius: Callable[[float], float], near: float, border: float) -> float | None:
    """The step s at which a radius crosses `border`, by bisection around `near`; None if none."""
    low, high = near / _REACH, near * _REACH
    if radius(low) > border or not radius(high) > border:
        return None
    for _ in range(_HALVINGS):
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if radius(middle) > border else (middle, high)
    return low


def _conditions(system: System, dt: float) -> dict[str, float]:
    """Of K, of the consistent M, and of Newmark's J = 4/h^2 M + 2/h C + K at the paper's step."""
    free = system.free
    K, M, C = (X[free][:, free].toarray() for X in (system.K, system.M, system.C))
    matrices = {"K": K, "M": M, "J": 4 / dt**2 * M + 2 / dt * C + K}
    found = {}
    for name, matrix in matrices.items():
        values = eigvalsh(matrix)
        if values[0] > 0:
            found[name] = float(values[-1] / values[0])
    return found


@lru_cache(maxsize=64)
def _locking(scene: str, nu: float, mesh: int, quality: float) -> float:
    """Compliance under the static load over that of mixed elements on the mesh; E has no part."""
    base = base_scene(scene)
    nu = max(nu, _LEAST_NU)
    pulled = base.pulled(replace(base.base, nu=nu, mesh=mesh, quality=quality))
    system = build(pulled)
    f = system.loads[system.free, 0]
    return float(f @ system.factor().solve(f)) / float(mixed_static(pulled).compliances[0])


def _drifts(
    base: BaseScene, system: System, schemes: tuple[Stepping, ...], modes: dict[str, Floats]
) -> Iterable[Drift]:
    """Schemes whose map knows its state: at half their limit, or at the paper's step."""
    for s in schemes:
        if s.name not in ("modal", "quasi_static"):
            h = _DRIFT_SHARE * s.limit(system) if s.limit else base.dt
            yield drift(s, h, modes[s.mass])


# --- kept ----------------------------------------------------------------------------------------


def write_variant(folder: Path, result: VariantResult) -> None:
    """Writes <key>.json whole or not at all."""
    fresh = folder / f".{result.key}.{uuid4().hex[:8]}"
    fresh.write_text(json.dumps(asdict(result), allow_nan=False), encoding="utf-8")
    fresh.replace(folder / f"{result.key}.json")


def read_variants(folder: Path, cells: Iterable[VariantCell]) -> dict[str, VariantResult]:
    """By key, those finished before; a damaged file counts as not finished."""
    found = {}
    for cell in cells:
        try:
            content = json.loads((folder / f"{cell.key}.json").read_text(encoding="utf-8"))
            found[cell.key] = _from_json(content)
        except (OSError, ValueError, TypeError, KeyError, AttributeError):
            continue
    return found


def _from_json(content: dict[str, Any]) -> VariantResult:
    schemes = (SchemeResult(**{**s, "radii": tuple(s["radii"])}) for s in content["schemes"])
    kept = content["rounding"]
    return VariantResult(
        **{
            **content,
            "schemes": tuple(schemes),
            "rounding": Rounding(**kept) if kept else None,
            "drifts": tuple(Drift(**d) for d in content["drifts"]),
        }
    )
