"""Moduli fitted by each method as parameters, and their change with uncertain inputs.

A judged law has the modulus that the same law was identified with. So parameters hold one entry a
model: its name, its modulus Pa and the displacement m at which its load begins.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import hypot, sqrt
from typing import Any

import numpy as np
from scipy.special import chdtri

from validate.arrays import Floats, rms
from validate.compare.convergence import convergence
from validate.errors import ComparisonError, SceneError
from validate.identify.budget import MATERIAL, IdentifiedValue, Pattern
from validate.numbers import with_unit
from validate.pipeline.experiment.experiment import Input, MeshLadder

Entry = tuple[str, float, float]  # name of a model, modulus Pa, toe m
COMMON = "each uncertain input is varied, the modulus identified again and used for the prediction"
_ROUNDING = 1e-9  # relative, of moduli on several meshes
_SHOWN = 0.01  # of the combined uncertainty: smaller terms are named without a number
_NOTHING = 1e-6  # relative effect on a prediction that is left out


@dataclass(frozen=True)
class Moves:
    """What one standard uncertainty of an input does after identification, by model: `ratio` of
    its modulus, `toe` m added."""

    ratio: Mapping[str, float]
    toe: Mapping[str, float]

    def of(self, entries: tuple[Entry, ...], z: float) -> tuple[Entry, ...]:
        return tuple(
            (name, E * self.ratio.get(name, 1.0) ** z, toe + z * self.toe.get(name, 0.0))
            for name, E, toe in entries
        )


def modulus_in(entries: tuple[Entry, ...], name: str) -> float | None:
    """Return the modulus of a model; None where it was not identified."""
    return next((E for own, E, _ in entries if own == name), None)


def toe_in(entries: tuple[Entry, ...], name: str) -> float | None:
    """Where a model's load begins, m; None where it was not identified."""
    return next((toe for own, _, toe in entries if own == name), None)


def moving(p: Any, moves: Moves, z: float) -> Any:
    """Parameters with the moduli of every model moved."""
    return p.with_settings(by_method=moves.of(p.settings.by_method, z))


def with_move(
    name: str, doc: str, source: str, moves: Moves, also: Callable[[Any, float], Any] | None = None
) -> Input:
    """Return an input that moves the moduli as identification under it does, and what `also`
    moves."""

    def move(p: Any, z: float) -> Any:
        return moving(also(p, z) if also else p, moves, z)

    return Input(name, move, doc, source, identified=True, each=True)


def reidentified(ladder: MeshLadder, ratios: tuple[Mapping[str, float], ...]) -> MeshLadder:
    """Return the ladder whose meshes have the moduli that were identified on them."""

    def level(change: Callable[[Any], Any], ratio: Mapping[str, float]) -> Callable[[Any], Any]:
        return lambda p: moving(change(p), Moves(ratio, {}), 1.0)

    pairs = zip(ladder.levels, ratios, strict=True)
    return replace(ladder, levels=tuple(level(*pair) for pair in pairs))


@dataclass(frozen=True)
class OnMeshes:
    """A modulus on meshes of several sizes: standard uncertainty u of the judged one, relative,
    and its ratio on each level (1 on a level that could not be solved)."""

    u: float
    ratios: tuple[float, ...]


def on_meshes(p: Any, ladder: MeshLadder, own: float, modulus: Callable[[Any], float]) -> OnMeshes:
    """`own` is the modulus on the judged mesh, `modulus` identifies it with other parameters.

    A mesh's error has the same sign in every repetition, so all of it, not half of its band, is one
    standard uncertainty. Where three sizes show no order the largest difference stands for it; it
    is infinite where fewer than two can be solved.
    """
    sizes, found, ratios = [ladder.size(p)], [0.0], []
    for change in ladder.levels:
        try:
            changed = change(p)
            ratio = modulus(changed) / own
        except (SceneError, ComparisonError):  # too coarse a mesh
            ratios.append(1.0)
            continue
        ratios.append(ratio)
        sizes.append(ladder.size(changed))
        found.append(float(np.log(ratio)))
    if len(set(sizes)) < 2:
        return OnMeshes(float("inf"), tuple(ratios))
    answers = [np.array([[x]]) for x in found]
    conduct = convergence(sizes, answers, 0, ladder.order, _ROUNDING)
    if conduct.conduct == "two sizes":
        return OnMeshes(conduct.u, tuple(ratios))
    u = 2 * conduct.u / conduct.safety if conduct.asymptotic else conduct.range
    return OnMeshes(float(u), tuple(ratios))


def effect(before: Floats, after: Floats) -> float:
    """How much larger a predicted force (n,) became, relative rms with the sign of its mean."""
    off, size = after - before, rms(before[:, None])
    return float(np.copysign(rms(off[:, None]) / size, float(off @ before))) if size else 0.0


def counts(effect: float) -> bool:
    """Return whether a relative effect on a prediction is more than arithmetic."""
    return abs(effect) > _NOTHING


@dataclass(frozen=True)
class Misfit:
    """By how much a prediction is off beyond what was fitted, N rms without its noise, and the
    standard uncertainty of that, N: of the measurement and of what identification left."""

    size: float
    u: float


def misfit(residual: Floats, noise: float, u: float, times: float = 1.0) -> Misfit:
    """Of `residual` (n,) N beyond the fit, with a sensor's `noise` N of which `times` samples count
    as one; `u` N is the identification's.

    As for a check: what noise alone reaches in 5 % of repetitions is twice its uncertainty.
    """
    square = float(residual @ residual) / max(len(residual), 1) - noise**2
    n = max(len(residual) / times, 1.0)
    reach = noise * sqrt(max(float(chdtri(n, 0.05)) / n - 1, 0.0))
    return Misfit(sqrt(max(square, 0.0)), hypot(u, reach / 2))


def finding(law: str, pattern: Pattern | None, off: Misfit) -> str:
    """How the residual of a law is no noise; "" where it is, or changes no prediction."""
    if pattern is None or not pattern.significant or off.size < MATERIAL * off.u:
        return ""
    way = "faster" if pattern.stiffens else "slower"
    times = f", {off.size / off.u:.2g} times its uncertainty" if off.u else ""
    return (
        f"the law '{law}' does not follow the force: the residual bends with the load, at the "
        f"largest loads the measured force rises {way} than the law's; beyond the fit its error "
        f"is {with_unit(off.size, 'N')} rms{times} (by chance in "
        f"{max(100 * pattern.chance, 0.01):.2g} % of runs or fewer); try a law that stiffens "
        f"{'more' if pattern.stiffens else 'less'}, or a smaller strain limit"
    )


def sentence(one: IdentifiedValue) -> str:
    """Return the value, its 95 % half width, its terms in falling order, and what it rests on."""
    value = with_unit(one.value, one.unit, 4)
    low, high = one.interval
    terms = sorted(one.parts.items(), key=lambda item: -item[1])
    words = ", ".join(
        f"{name} {with_unit(u, one.unit, 2)}" for name, u in terms if u >= _SHOWN * one.u
    )
    below = [name for name, u in terms if u < _SHOWN * one.u]
    words += f"; below {100 * _SHOWN:g} %: {', '.join(below)}" if below else ""
    return (
        f"{one.name} = {value} ± {with_unit((high - low) / 2, one.unit, 2)} (95 %; standard "
        f"uncertainties: {words}), identified by {one.by} on {one.on}"
    )
