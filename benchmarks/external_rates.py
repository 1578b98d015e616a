"""Time of a step at equal error, internal and external: the silicone beam and the hanging bar.

OMP_NUM_THREADS=1 python benchmarks/external_rates.py            prints the tables (ten minutes)
OMP_NUM_THREADS=1 python benchmarks/external_rates.py --write  writes docs/explanation/results.md

Every simulator solves the same scene on several meshes of each cell type. The time at an error
level is the smallest one on the lines through neighbouring meshes of one type (time over error,
both logarithmic). A level has no time if no mesh reaches it, or if a finer mesh leaves it again:
such an agreement is accidental. Times are wall times on one thread without set-up, the smallest of
three. For the released beam they are means over steps of 5 ms (hex27/2: two steps). The time of
CalculiX includes start and files, because it reports no other. Errors are relative to the converged
solution of finer internal meshes.
"""

import argparse
import shlex
import sys
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter

import numpy as np

from validate.arrays import Floats
from validate.compare.convergence import richardson
from validate.fem.system import build
from validate.numbers import significant
from validate.pipeline import load
from validate.scene.geometries.box import box, grid
from validate.scene.material import Material
from validate.scene.mesh import Mesh
from validate.scene.scene import Scene, Support, Weight
from validate.solve.dynamic.implicit import NewtonDynamics
from validate.solve.external.scheme import ExternalSimulator
from validate.solve.static.newton import StaticNewton

ROOT = Path(__file__).resolve().parents[1]
BEGIN, END = "<!-- rates: begin -->", "<!-- rates: end -->"
LEVELS = (0.03, 0.01, 0.003, 0.001)  # of the converged motion
SWING_LEVELS = (0.2, 0.1, 0.05, 0.02)
REPEATS = 3
G, SIZE = 9.80709, (0.1, 0.03, 0.03)
SILICONE = Material(263_824.0, 0.499, "neo_hooke", 1070.0)
BAR = load("hanging_bar").parameters.scene
SPAN, FRAME = 0.25, 5e-3  # s of the swing, and between what is compared
BEAMS = {
    "hex8": ((6, 2, 2), (10, 3, 3), (14, 4, 4), (20, 6, 6), (26, 8, 8)),
    "tet10": ((5, 2, 2), (8, 3, 3)),
    "hex27": ((2, 1, 1), (3, 1, 1), (4, 2, 2), (6, 2, 2), (8, 4, 4), (10, 4, 4), (12, 6, 6)),
}
BARS = {
    "hex8": (2, 4, 6, 8, 10),
    "tet10": (2, 4, 6),
    "hex27": (1, 2, 3, 4, 6),
}
SWINGS = {
    "hex8": ((6, 2, 2), (10, 3, 3), (14, 4, 4), (20, 6, 6)),
    "hex27": ((2, 1, 1), (3, 1, 1), (4, 2, 2), (6, 2, 2)),
}
PARTS = (1, 2, 4)  # of a frame
SIMULATORS = {
    "FElupe": "felupe_simulator.py", "CalculiX": "calculix_simulator.py",
    "MuJoCo": "mujoco_simulator.py",
}  # fmt: skip
CARRIED = {"hex8": tuple(SIMULATORS), "tet10": ("FElupe", "CalculiX")}  # of the cells here
CUT = {"MuJoCo": "tet4"}  # its script cuts hexahedra into linear tetrahedra
MOVING = ("CalculiX", "MuJoCo")


@dataclass(frozen=True)
class Point:
    """One mesh of a simulator: relative error, seconds of a step, bytes of an external one."""

    who: str
    cells: str
    unknowns: int
    error: float
    seconds: float
    memory: int = 0


def cells_of(who: str, kind: str) -> str:
    """The cells that a simulator really solves on a mesh of this kind."""
    return CUT.get(who, kind)


def head() -> list[str]:
    """The columns, each with the cells that were tried."""
    tried = {w: [cells_of(w, k) for k in BEAMS if w in CARRIED.get(k, ())] for w in SIMULATORS}
    columns = {"ours, ms": list(BEAMS), **tried}
    return ["scene", "error", *(f"{who}: {', '.join(kinds)}" for who, kinds in columns.items())]


def beam(kind: str, cells: tuple[int, ...], power: float = 1.5) -> Scene:
    """Cells shrink towards the clamp and the sides."""
    mesh: Mesh = (box if kind == "tet10" else grid)(SIZE, cells)
    x = mesh.nodes / SIZE
    x[:, 0] **= power
    x[:, 1:] = _inwards(x[:, 1:], power)
    mesh = replace(mesh, nodes=x * np.array(SIZE))
    mixed = kind != "tet10"
    return Scene(
        mesh.quadratic() if kind != "hex8" else mesh, SILICONE, (Support("x0", (0, 1, 2)),),
        loads=(Weight("gravity", (0.0, 0.0, -1.0)),),
        dilatation="mixed" if mixed else "pointwise",
    )  # fmt: skip


def bar(kind: str, across: int) -> Scene:
    """Cells shrink towards the held end and the sides, as the converged mesh's do, but less."""
    cells = (across, across, 2 * across)
    size = np.array(BAR.body.size)
    mesh: Mesh = (box if kind == "tet10" else grid)(tuple(size), cells)
    x = mesh.nodes / size
    x[:, :2] = _inwards(x[:, :2], 2.0)
    x[:, 2] = 1 - (1 - x[:, 2]) ** 2
    mesh = replace(mesh, nodes=x * size)
    whole = replace(BAR, body=replace(BAR.body, symmetry=()))
    return whole.resolved(mesh if kind == "hex8" else mesh.quadratic())


def end(scene: Scene, u: Floats) -> Floats:
    """Mean vertical motion m of the free end (..., )."""
    return np.asarray(u[..., scene.mesh.facet_nodes("x1"), 2].mean(axis=-1))


def drop(scene: Scene, u: Floats) -> Floats:
    return np.asarray(u[..., 2].min(axis=-1))


READ = {"beam": end, "bar": drop}


def ours(scene: Scene, pull: float) -> tuple[Floats, float]:
    """The field and the least seconds of the step from rest."""
    system, best = build(scene), np.inf
    for _ in range(REPEATS):
        stepper = StaticNewton("none").prepare(system)
        start = perf_counter()
        state = stepper.step(stepper.rest(), np.array([pull]))
        best = min(best, perf_counter() - start)
        if state.failure:
            raise SystemExit(state.failure[1])
    return stepper.field(state), best


def ours_swinging(scene: Scene, parts: int) -> tuple[Floats, float]:
    """Fields (nt, n, 3) m at every frame, and seconds of one, of so many steps each."""
    stepper = NewtonDynamics(FRAME / parts, mass="consistent").prepare(build(scene))
    stepper = replace(stepper, held=np.array([G]))
    state, fields = stepper.rest(), []
    start = perf_counter()
    for _ in range(round(SPAN / FRAME)):
        for _ in range(parts):
            state = stepper.step(state, np.array([G]))
        fields.append(stepper.field(state))
    return np.array(fields), (perf_counter() - start) / len(fields)


def theirs(
    who: str, scene: Scene, t: Floats, pull: float, *, moving: bool
) -> tuple[Floats, float, int] | None:
    """Fields, least seconds of a step and bytes; None, with a line, where it has no answer."""
    script = ROOT / "benchmarks" / "external" / SIMULATORS[who]
    simulator = ExternalSimulator(shlex.join([sys.executable, str(script)]), inertia=moving)
    best, run = np.inf, None
    for _ in range(1 if moving else REPEATS):
        run = simulator.solve(scene, t, np.full((len(t), 1), pull))
        if not run.finished or run.step_s is None:
            print(f"{who}: {run.outcome.state}: {run.outcome.why}", flush=True)
            return None
        best = min(best, run.step_s.p50)
    assert run is not None
    return run.u, best, run.memory


# --- points ---------------------------------------------------------------------------------------


def still_points(name: str, truth: float) -> list[Point]:
    make, sizes = (beam, BEAMS) if name == "beam" else (bar, BARS)
    pull, found = (G if name == "beam" else BAR.gravity), []
    for kind, levels in sizes.items():
        for level in levels:
            scene = make(kind, level)  # type: ignore[operator]
            u, seconds = ours(scene, pull)
            answers = {"ours": (u, seconds, 0)}
            for who in CARRIED.get(kind, ()):
                solved = theirs(who, scene, np.ones(1), pull, moving=False)
                answers |= {who: (solved[0][0], *solved[1:])} if solved else {}
            for who, (field, s, memory) in answers.items():
                error = abs(float(READ[name](scene, field)) / truth - 1)
                cells = f"{cells_of(who, kind)} {level}"
                found.append(Point(who, cells, scene.mesh.nodes.size, error, s, memory))
                print(found[-1], flush=True)
    return found


def swing_points(truth: Floats) -> list[Point]:
    """Of the whole trace at every frame, rms over the reference's. Ours takes 1, 2 or 4 steps in a
    frame, CalculiX those that it chooses, MuJoCo five."""
    t, found = FRAME * np.arange(1, round(SPAN / FRAME) + 1), []
    for kind, levels in SWINGS.items():
        for level in levels:
            scene = beam(kind, level)
            answers = [("ours", kind if n == 1 else f"{kind}/{n}", (*ours_swinging(scene, n), 0))
                       for n in PARTS]  # fmt: skip
            for who in (who for who in CARRIED.get(kind, ()) if who in MOVING):
                if solved := theirs(who, scene, t, G, moving=True):
                    answers.append((who, cells_of(who, kind), solved))
            for who, cells, (u, s, memory) in answers:
                off = end(scene, u) - truth
                error = float(np.sqrt((off**2).mean() / (truth**2).mean()))
                name = f"{cells} {level}"
                found.append(Point(who, name, scene.mesh.nodes.size, error, s, memory))
                print(found[-1], flush=True)
    return found


def true_beam() -> float:
    """The end m of quadratic cells that shrink towards the clamp and the sides, extrapolated."""
    finest = [beam("hex27", n, 2.0) for n in FINE]
    found = [end(s, ours(s, G)[0]).reshape(1, 1) for s in finest]
    return float(richardson([1 / n[0] for n in FINE], found, 2.0).extrapolated[0, 0])


def _inwards(x: Floats, power: float) -> Floats:
    """Places in 0 .. 1, nearer to both ends."""
    return np.asarray(0.5 - 0.5 * np.sign(0.5 - x) * (1 - (1 - np.abs(1 - 2 * x)) ** power))


FINE = ((12, 6, 6), (8, 4, 4), (6, 3, 3))
TRUE_BAR = -44.0855e-3  # m: `validate run hanging_bar`


def true_swing() -> Floats:
    """Quadratic cells, ten steps in a frame."""
    scene = beam("hex27", (8, 2, 2))
    return end(scene, ours_swinging(scene, 10)[0])


# --- at equal error -------------------------------------------------------------------------------


def at_error(points: Iterable[Point], who: str, level: float) -> tuple[float, str] | None:
    """Least seconds at an error, and with which cells; None where no mesh is as near."""
    kinds: dict[str, list[Point]] = {}
    for p in points:
        if p.who == who:
            kinds.setdefault(p.cells.split()[0], []).append(p)
    found = [(s, kind) for kind, own in kinds.items() if (s := _between(own, level)) is not None]
    return min(found, default=None)


def _between(own: list[Point], level: float) -> float | None:
    """Where the line through neighbouring meshes crosses the level; of the coarsest its own time
    where that is near enough already."""
    own = sorted(own, key=lambda p: p.unknowns)
    outside = [i for i, p in enumerate(own) if p.error > level]
    if not outside:
        return own[0].seconds
    if outside[-1] == len(own) - 1:
        return None
    a, b = own[outside[-1] : outside[-1] + 2]
    share = np.log(a.error / level) / np.log(a.error / b.error)
    return float(a.seconds * (b.seconds / a.seconds) ** share)


def rows(scene: str, points: list[Point], levels: tuple[float, ...]) -> list[list[str]]:
    found = []
    for level in levels:
        at = {who: at_error(points, who, level) for who in ("ours", *SIMULATORS)}
        cells = [f"{significant(1e3 * x[0])} ({x[1]})" if x else "-" for x in at.values()]
        found.append([scene, f"{100 * level:g} %", *cells])
    return found


def markdown(table: list[list[str]]) -> str:
    lines = [head(), ["---"] * len(head()), *table]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true")
    write = parser.parse_args().write
    table = rows("beam at rest", still_points("beam", true_beam()), LEVELS)
    table += rows("hanging bar", still_points("bar", TRUE_BAR), LEVELS)
    table += rows("beam let go", swing_points(true_swing()), SWING_LEVELS)
    print(text := markdown(table))
    if write:
        page = ROOT / "docs" / "explanation" / "results.md"
        before, rest = page.read_text("utf-8").split(BEGIN)
        page.write_text(f"{before}{BEGIN}\n{text}\n{END}{rest.split(END)[1]}", "utf-8")


if __name__ == "__main__":
    main()
