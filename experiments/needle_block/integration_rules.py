"""The rules that paper 002 prints, by their amplification: its condition and its misprint."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import Chart, Entry, Exhibit, NumberTable, Series
from validate.fem.critical import Modes
from validate.fem.system import build as build_system
from validate.solve.dynamic.newmark_rule import Rule
from validate.solve.march import march

from ..bending_rod.body import bending_rod, gravity_inputs
from .benchmark import IMPLICIT
from .body import MP1, MP2, needle_block

_AVERAGE = Rule.of("average", 1.0)
#: beta = .25, gamma = .5 in the paper's notation, where beta is twice the usual one.
_QUARTER = Rule(1.0, 0.5 * (1 - 0.25), 0.5 * 0.25, 0.5, 0.5)
_DAMPING = (0.0, 0.1, 0.3)
_ROUNDING = 1e-9


def _radius(rule: Rule, xi: float, *, misprinted: bool = False) -> Callable[[Floats], Floats]:
    def radius(wh: Floats) -> Floats:
        maps = rule.maps(2 * xi * wh, wh**2, misprinted=misprinted)
        return np.asarray(np.abs(np.linalg.eigvals(maps)).max(axis=-1))

    return radius


def limit_of(radius: Callable[[Floats], Floats]) -> float:
    """The first w h at which the radius leaves 1, by bisection."""
    grid = np.linspace(0.01, 6.0, 600)
    above = radius(grid) > 1 + _ROUNDING
    if not above.any():
        return float("inf")
    high = float(grid[int(np.argmax(above))])
    low = high - float(grid[1] - grid[0])
    for _ in range(40):
        middle = 0.5 * (low + high)
        if radius(np.array([middle]))[0] > 1 + _ROUNDING:
            high = middle
        else:
            low = middle
    return low


def rules_exhibit() -> tuple[Exhibit, dict[str, float]]:
    """Radius against w h of the sound rule, the clash of notations and the misprint."""
    rules = {
        "β = γ = 0.5, as used": _radius(_AVERAGE, 0.0),
        "β = 0.25, γ = 0.5 in the paper's notation": _radius(_QUARTER, 0.0),
        **{
            f"update as misprinted, damping ratio {xi:g}": _radius(_AVERAGE, xi, misprinted=True)
            for xi in _DAMPING
        },
    }
    wh = np.linspace(0.02, 4.0, 200)
    chart = Chart(
        "rules", "Amplification of one step", "ω h / 1", "spectral radius / 1",
        tuple(Series(name, wh, np.minimum(radius(wh), 2.0)) for name, radius in rules.items()),
        levels=(("stable below", 1.0),), caption="Radii above 2 are drawn at 2.",
    )  # fmt: skip
    limits = {name: limit_of(radius) for name, radius in rules.items()}
    rows: list[tuple[Entry, ...]] = [
        (name, limit if np.isfinite(limit) else None) for name, limit in limits.items()
    ]
    table = NumberTable(
        "rules", "Largest stable w h of the implicit rules.", ("rule", "limit / 1"), tuple(rows),
        "None: stable at every step.",
    )  # fmt: skip
    found = list(limits.values())
    numbers = {"order": observed_order(), "clash": found[1], "misprint.0": found[2],
               "misprint.1": found[3], "misprint.3": found[4]}  # fmt: skip
    words = (
        "'2 beta >= gamma >= 1/2' is the rule for the usual beta; the paper's beta is twice "
        "as large, so beta = .25, gamma = .5 passes it and is unstable beyond w h = "
        f"{found[1]:.3f}.",
        "The printed update of u uses v at the new time instead of the old one: unstable from "
        f"w h = {found[2]:.3f} without damping. The damping of the benchmarks hides this "
        "(radii below 1 in the second table), and the path is wrong.",
    )
    tables = (table, _misprint_table())
    return Exhibit("rules", "Stability rules as printed", words, tables, (chart,)), numbers


def observed_order() -> float:
    """log2 of how the change of the implicit rod's tip at 1 s shrinks as the step halves, twice."""
    system, tips = build_system(bending_rod(1)), []
    for steps in (30, 60, 120):
        t: Floats = np.arange(1, steps + 1, dtype=np.float64) / steps
        stepper = replace(IMPLICIT, dt=1 / steps).prepare(system)
        run = march("halved", stepper, t, gravity_inputs(t), np.array([0]), 0.0)
        tips.append(float(run.traces["tip.z"].y[-1]))
    return float(np.log2((tips[0] - tips[1]) / (tips[1] - tips[2])))


def _misprint_table() -> NumberTable:
    scenes = {
        "block, MP1, n = 10": needle_block(10, MP1),
        "block, MP2, n = 10": needle_block(10, MP2),
        "rod, MP3, n = 2": bending_rod(2),
    }
    rows: list[tuple[Entry, ...]] = []
    for name, scene in scenes.items():
        modes, rule = Modes.of(build_system(scene)), Rule.of(IMPLICIT.rule, IMPLICIT.dt)
        both = (rule.maps(modes.damping, modes.omega**2, misprinted=m) for m in (False, True))
        rows.append((name, *(float(np.abs(np.linalg.eigvals(m)).max()) for m in both)))
    return NumberTable(
        "misprint", "Spectral radius of an implicit step of 1/30 s on the benchmarks.",
        ("scene", "as used", "as misprinted"), tuple(rows),
    )  # fmt: skip
