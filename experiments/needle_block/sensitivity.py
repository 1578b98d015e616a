"""How E_n, E_s and E_i follow material and mesh (paper 002, section VII: left to the future).

Two questions share their runs. What does an input that is a little off cost: the implicit answer
with it against the one without. And how do the solvers' own errors, each against the implicit run
of its own scene, follow the input: d ln E / d ln p, by a difference across the input.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import Entry, Exhibit, NumberTable
from validate.compare.shapes.two_fields import FieldScores
from validate.fem.system import build
from validate.scene.geometries.box import grid
from validate.scene.mesh import Mesh
from validate.scene.scene import Scene
from validate.solve.march import march
from validate.solve.types import Run

from .benchmark import FIVE
from .body import STEP
from .errors import DRAWN, errors_of

AT = (1.0, 2.0, 5.0)  # s; a metric is the mean over these
SHIFT = 0.2  # of a cell: how far inner nodes are moved at most, along each axis
SHARE = 0.1  # by which a material's number is turned, each way
_STEPS = round(AT[-1] / STEP)
_FRAMES = np.array([round(t / STEP) - 1 for t in AT])
RIVALS = ("explicit", "explicit_lumped", "quasi_static")  # implicit lumped is as explicit lumped
Means = Mapping[str, float | None]  # of the metrics over the instants, by name


@dataclass(frozen=True)
class Turn:
    """An input p, `nominal` in `unit`, and the scenes in which it is `low` and `high`."""

    name: str
    unit: str
    nominal: float
    low: tuple[float, Scene]
    high: tuple[float, Scene]

    @property
    def off(self) -> tuple[float, Scene]:
        """The end that is further from the nominal value."""
        return max(self.low, self.high, key=lambda end: abs(np.log(end[0] / self.nominal)))


@dataclass(frozen=True)
class TurnedBench:
    """A benchmark whose inputs are turned: `inputs` (nt, k) of times (nt,) s, the turns, and scenes
    that only stand beside it (another material, moved nodes), by name."""

    scene: Scene
    inputs: Callable[[Floats], Floats]
    turns: tuple[Turn, ...]
    beside: Mapping[str, Scene]


# --- turned scenes --------------------------------------------------------------------------------


def material_turns(scene: Scene, nu: float) -> tuple[Turn, ...]:
    """E, density and damping by a tenth each way, the Poisson ratio by the share `nu`."""
    shares = {"E": SHARE, "nu": nu, "rho": SHARE, "mass_damping": SHARE, "stiffness_damping": SHARE}
    words = {"mass_damping": "α", "stiffness_damping": "β", "nu": "ν", "rho": "ρ"}
    units = {"E": "Pa", "nu": "1", "rho": "kg/m3", "mass_damping": "1/s", "stiffness_damping": "s"}
    found = []
    for name, share in shares.items():
        p = float(getattr(scene.material, name))
        ends = [((1 + s) * p, _with(scene, name, (1 + s) * p)) for s in (-share, share)]
        found.append(Turn(words.get(name, name), units[name], p, ends[0], ends[1]))
    return tuple(found)


def _with(scene: Scene, name: str, value: float) -> Scene:
    changed: Any = {name: value}
    return replace(scene, material=replace(scene.material, **changed))


def mesh_turn(name: str, scene: Scene, first: tuple[int, ...], last: tuple[int, ...]) -> Turn:
    """The length m of cells along x by two other grids of the same body; either may be the
    scene's own."""
    length = float(np.ptp(scene.mesh.nodes[:, 0]))
    nominal = length / (len(np.unique(scene.mesh.nodes[:, 0].round(9))) - 1)
    fine, coarse = ((length / cells[0], _gridded(scene, cells)) for cells in (first, last))
    return Turn(name, "m", nominal, fine, coarse)


def _gridded(scene: Scene, cells: tuple[int, ...]) -> Scene:
    return replace(scene, body=grid(tuple(np.ptp(scene.mesh.nodes, axis=0).tolist()), cells))


def moved_nodes(scene: Scene, share: float = SHIFT) -> Scene:
    """The scene with its inner nodes moved by up to a share of a cell along every axis."""
    mesh = scene.mesh
    low, high = mesh.nodes.min(axis=0), mesh.nodes.max(axis=0)
    inner = ((mesh.nodes > low + 1e-9) & (mesh.nodes < high - 1e-9)).all(axis=1)
    cell = np.abs(mesh.nodes[mesh.cells[0, -1]] - mesh.nodes[mesh.cells[0, 0]])
    by = np.random.default_rng(2).uniform(-share, share, mesh.nodes.shape) * cell
    return replace(scene, body=Mesh(mesh.nodes + by * inner[:, None], mesh.cells, mesh.kind,
                                    mesh.facets))  # fmt: skip


# --- runs -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class SolvedScene:
    """The runs of the five methods in a scene, with fields at the instants; why not, by method."""

    scene: Scene
    runs: Mapping[str, Run]

    @property
    def refused(self) -> Mapping[str, str]:
        return {n: r.outcome.state for n, r in self.runs.items() if not r.finished}

    def against(self, truth: "SolvedScene", method: str = "implicit") -> Means:
        """Metrics of a method against the other's implicit run, on the other's mesh."""
        run, on = self.runs[method], truth.scene
        if not run.finished:
            return dict.fromkeys(DRAWN)
        found = errors_of(run, self.scene.mesh, truth.runs["implicit"].u, on,
                          DRAWN, range(len(AT)))  # fmt: skip
        return {n: None if np.isnan(y).any() else float(y.mean()) for n, y in found.values.items()}


def solve(
    scene: Scene, inputs: Callable[[Floats], Floats], methods: tuple[str, ...]
) -> SolvedScene:
    t: Floats = STEP * np.arange(1, _STEPS + 1, dtype=np.float64)
    at = np.asarray(_FRAMES, dtype=np.int64)
    system = build(scene)  # one for all: its matrices are assembled once
    steppers = {n: FIVE[n].settings.prepare(system) for n in methods}
    return SolvedScene(scene, {n: march(n, s, t, inputs(t), at, 0.0) for n, s in steppers.items()})


def slope(low: float | None, high: float | None, ratio: float) -> float | None:
    """d ln E / d ln p from E at two inputs, p_high / p_low = `ratio`; None where either is none."""
    if not low or not high:
        return None
    return float(np.log(high / low) / np.log(ratio))


def sensitivity_exhibit(bench: TurnedBench) -> Exhibit:
    """What inputs that are off cost, and how the solvers' errors follow them."""
    every = ("implicit", *RIVALS)
    own = solve(bench.scene, bench.inputs, every)
    ends = {
        t.name: tuple(solve(scene, bench.inputs, every) for _, scene in (t.low, t.high))
        for t in bench.turns
    }
    beside = {n: solve(s, bench.inputs, ("implicit",)) for n, s in bench.beside.items()}
    off = {t.name: ends[t.name][int(t.off is t.high)].against(own) for t in bench.turns}
    solvers = {n: own.against(own, n) for n in RIVALS}
    costs = _costs(bench, off, {n: s.against(own) for n, s in beside.items()}, solvers)
    slopes = _slopes(bench, ends, solvers)
    return Exhibit(
        "sensitivity", "Influence of material and mesh on the metrics", _words(bench, off, solvers),
        (costs, slopes),
    )  # fmt: skip


# --- tables ---------------------------------------------------------------------------------------


def _costs(bench: TurnedBench, off: Mapping[str, Means], beside: Mapping[str, Means],
           solvers: Mapping[str, Means]) -> NumberTable:  # fmt: skip
    rows: list[tuple[Entry, ...]] = []
    for t in bench.turns:
        p, means = t.off[0], off[t.name]
        by = abs(float(np.log(p / t.nominal)))
        per = [None if v is None else v / by for v in (means[m] for m in DRAWN)]
        rows.append((f"{t.name} / {t.unit}", t.nominal, p, *(means[m] for m in DRAWN), *per))
    for name, means in (*beside.items(), *((FIVE[n].label, m) for n, m in solvers.items())):
        rows.append((name, None, None, *(means[m] for m in DRAWN), None, None, None))
    units = FieldScores.units(bench.scene.mesh.dimension)
    heads = (
        "what differs", "nominal", "changed to", *(f"{m} / {units[m]}" for m in DRAWN),
        *(f"{m} per ln p / {units[m]}" for m in DRAWN),
    )  # fmt: skip
    return NumberTable(
        "sensitivity_costs",
        f"Against the implicit run of the nominal scene ({_mesh(bench)}), mean over "
        f"{', '.join(f'{t:g}' for t in AT)} s: implicit runs with one input changed, then other "
        "solvers of the nominal scene.",
        heads, tuple(rows),
        "Per ln p: the metric over |ln(changed/nominal)|, to first order the change caused by "
        "an input that is wrong by a factor of e. It is a distance between solutions, not the "
        "growth of an error.",
    )  # fmt: skip


def _slopes(bench: TurnedBench, ends: Mapping[str, tuple[SolvedScene, ...]],
            solvers: Mapping[str, Means]) -> NumberTable:  # fmt: skip
    rows: list[tuple[Entry, ...]] = []
    found = {(t, n): [s.against(s, n) for s in ends[t]] for t in ends for n in RIVALS}
    for n in RIVALS:
        for m in DRAWN:
            line = []
            for t in bench.turns:
                low, high = found[t.name, n]
                line.append(slope(low[m], high[m], t.high[0] / t.low[0]))
            rows.append((FIVE[n].label, m, solvers[n][m], *line))
    turned = tuple(f"{t.name} ({t.low[0]:.4g} to {t.high[0]:.4g} {t.unit})" for t in bench.turns)
    gone = {f"{t}: {n} is {why}" for t in ends for s in ends[t] for n, why in s.refused.items()}
    return NumberTable(
        "sensitivity_slopes",
        "d ln E / d ln p of the solvers' errors, each against the implicit run of the same "
        "scene (1: the error is proportional to the input).",
        ("method", "metric", "nominal", *turned), tuple(rows),
        f"Without a value: {'; '.join(sorted(gone))}." if gone else "",
    )  # fmt: skip


def _mesh(bench: TurnedBench) -> str:
    mesh = bench.scene.mesh
    return f"{len(mesh.cells)} {mesh.kind} cells"


def _words(
    bench: TurnedBench, off: Mapping[str, Means], solvers: Mapping[str, Means]
) -> tuple[str, ...]:
    by = {t.name: f"{t.name} {100 * (t.off[0] / t.nominal - 1):+.3g} %" for t in bench.turns}
    costs = sorted(((means["E_n"] or 0.0, by[n]) for n, means in off.items()), reverse=True)
    worst = solvers["explicit_lumped"]["E_n"] or 0.0
    above = [f"{words} ({cost:.2g})" for cost, words in costs if cost > worst]
    return (
        f"Explicit steps with lumped masses have a mean E_n of {worst:.2g}. A wrong input has "
        f"a larger effect: {', '.join(above)}; the other inputs have a smaller one."
        if above
        else "No input has an effect as large as explicit steps with lumped masses, E_n "
        f"{worst:.2g}.",
    )
