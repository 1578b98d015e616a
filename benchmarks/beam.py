"""The silicone beam under gravity: error against the converged answer over time, with peers.

OMP_NUM_THREADS=1 python benchmarks/beam.py [--peers PYTHON] [--quick]
    [--picture docs/pictures/beam.png]

A block of 100 x 30 x 30 mm, clamped at one end, E 263 824 Pa, nu .499, 1070 kg/m3. Statics: from
rest to the whole weight in one step; the answer is the mean vertical motion of the end. Swing: the
weight is there from t = 0, no damping, over 0.25 s (two periods). Times are of the processor, the
least of several on one thread, set-up apart, so that others on the machine count little.

`--peers`: a Python that has felupe and mujoco (the extra `peers`); they run in
processes of their own.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import matplotlib as mpl
import numpy as np

from validate.arrays import Floats
from validate.compare.convergence import convergence
from validate.fem.system import System, build
from validate.scene.geometries.box import box, grid
from validate.scene.material import Material
from validate.scene.mesh import Mesh
from validate.scene.scene import Dilatation, Scene, Support, Weight
from validate.solve.dynamic.implicit import NewtonDynamics
from validate.solve.explicit.central import CentralDifference
from validate.solve.static.newton import StaticNewton
from validate.solve.types import Stepper

G, SIZE = 9.80709, (0.1, 0.03, 0.03)
SILICONE = Material(263_824.0, 0.499, "neo_hooke", 1070.0)
DURATION, FRAME = 0.25, 1e-3  # s
ELEMENTS: tuple[tuple[str, Dilatation], ...] = (
    ("tet4", "pointwise"), ("tet4", "nodal_mean"), ("tet10", "pointwise"), ("tet10", "mixed"),
    ("hex8", "pointwise"), ("hex8", "mixed"), ("hex27", "pointwise"), ("hex27", "mixed"),
)  # fmt: skip
CELLS: dict[str, tuple[tuple[int, int, int], ...]] = {
    "tet4": ((10, 3, 3), (20, 6, 6)),
    "tet10": ((5, 2, 2), (10, 3, 3)),
    "hex8": ((8, 2, 2), (10, 3, 3), (20, 6, 6)),
    "hex27": ((3, 2, 2), (5, 2, 2), (7, 2, 2)),
}
REFERENCE = ((10, 3, 3), (14, 4, 4), (20, 6, 6), (27, 8, 8), (33, 10, 10))
CHECK = ((10, 3, 3), (17, 5, 5))  # hex27
LAWS = ("svk", "neo_hooke", "mooney_rivlin", "yeoh", "ogden")


@dataclass(frozen=True)
class Row:
    """One way to the answer: error mm, seconds, and how fast a swing is against real time."""

    what: str
    nodes: int
    error: float
    seconds: float
    rate: float | None = None


def beam(kind: str, cells: tuple[int, ...], dilatation: Dilatation, material: Material) -> Scene:
    mesh: Mesh = (box if kind.startswith("tet") else grid)(SIZE, cells)
    return Scene(
        mesh if kind in ("tet4", "hex8") else mesh.quadratic(),
        material,
        (Support("x0", (0, 1, 2)),),
        loads=(Weight("gravity", (0.0, 0.0, -1.0)),),
        dilatation=dilatation,
    )


def end(stepper: Stepper, field: Floats) -> float:
    """Mean vertical motion mm of the free end."""
    return 1e3 * float(field[stepper.scene.mesh.facet_nodes("x1"), 2].mean())


def still(system: System, repeats: int) -> tuple[float, float]:
    """The end under the whole weight, and the least time s of the step from rest."""
    best = np.inf
    for _ in range(repeats):
        stepper = StaticNewton().prepare(system)
        rest = stepper.rest()
        start = time.process_time()
        state = stepper.step(rest, np.array([G]))
        best = min(best, time.process_time() - start)
        if state.failure:
            raise SystemExit(f"{system.scene.mesh.kind}: {state.failure[1]}")
    return end(stepper, stepper.field(state)), best


def swing(scheme: NewtonDynamics | CentralDifference, system: System) -> tuple[Floats, float]:
    """The end mm at every millisecond (linear between steps), and the time s of all steps."""
    stepper = scheme.prepare(system)
    state, found = stepper.rest(), [0.0]
    start = time.process_time()
    for _ in range(round(DURATION / scheme.dt)):
        state = stepper.step(state, np.array([G]))
        if state.failure:
            raise SystemExit(state.failure[1])
        found.append(end(stepper, stepper.field(state)))
    spent = time.process_time() - start
    t = scheme.dt * np.arange(len(found))
    return np.interp(FRAME * np.arange(1, round(DURATION / FRAME) + 1), t, found), spent


def explicit(system: System) -> CentralDifference:
    """A march step a frame, in as many substeps as the critical step of the bent beam wants."""
    stepper = CentralDifference(FRAME, beyond_limit="run").prepare(system)
    limit = stepper.rest().numbers["critical_step"]
    return CentralDifference(FRAME, substeps=int(np.ceil(FRAME / (0.88 * limit))))


def static_rows(truth: float, repeats: int) -> Iterator[Row]:
    for kind, dilatation in ELEMENTS:
        for cells in CELLS[kind]:
            scene = beam(kind, cells, dilatation, SILICONE)
            mm, seconds = still(build(scene), repeats)
            name = f"{kind} {dilatation} {'x'.join(map(str, cells))}"
            yield Row(name, len(scene.mesh.nodes), mm - truth, seconds)
    for law in LAWS:
        c = {"mooney_rivlin": {"C01": 8e3}, "yeoh": {"C20": 2e3}}.get(law, {})
        material = SILICONE.of_law(law)  # type: ignore[arg-type]
        material = replace(material, coefficients=replace(material.coefficients, **c))
        scene = beam("hex8", (10, 3, 3), "mixed", material)
        mm, seconds = still(build(scene), repeats)
        yield Row(f"hex8 mixed 10x3x3, {law}", len(scene.mesh.nodes), mm - truth, seconds)


def swing_rows(truth: Floats) -> Iterator[Row]:
    cases: tuple[tuple[str, tuple[int, ...], float | None], ...] = (
        ("hex8", (8, 2, 2), None), ("hex8", (10, 3, 3), None),
        ("hex8", (8, 2, 2), 5e-3), ("hex27", (3, 2, 2), 5e-3), ("hex27", (5, 2, 2), 2e-3),
    )  # fmt: skip
    for kind, cells, dt in cases:
        system = build(beam(kind, cells, "mixed", SILICONE))
        scheme = explicit(system) if dt is None else NewtonDynamics(dt, tolerance=1e-5)
        mm, seconds = swing(scheme, system)
        if dt is None:
            seconds = min(seconds, *(swing(scheme, system)[1] for _ in range(2)))
        how = f"explicit, {scheme.substeps} substeps/ms" if isinstance(
            scheme, CentralDifference) else f"implicit, {1e3 * scheme.dt:g} ms"  # fmt: skip
        name = f"{kind} mixed {'x'.join(map(str, cells))}, {how}"
        apart = float(np.sqrt(((mm - truth) ** 2).mean()))
        yield Row(name, len(system.scene.mesh.nodes), apart, seconds, DURATION / seconds)


def peer(python: str, *arguments: str) -> dict[str, object] | None:
    """What a peer printed, or None with the reason on standard error."""
    script = str(Path(__file__).resolve().with_name("beam_peers.py"))
    with tempfile.TemporaryDirectory() as folder:  # MuJoCo leaves a log where it runs
        done = subprocess.run(
            [python, script, *arguments], capture_output=True, text=True, check=False, cwd=folder
        )
    if done.returncode:
        print(f"{arguments[0]}: {done.stderr.strip().splitlines()[-1]}", file=sys.stderr)
        return None
    found: dict[str, object] = json.loads(done.stdout.strip().splitlines()[-1])
    return found


def peer_rows(python: str, truth: float, moving: Floats) -> Iterator[Row]:
    for n in ((11, 4, 4), (21, 7, 7)):
        sides, nodes = [str(x) for x in n], int(np.prod(n))
        name = "x".join(str(x - 1) for x in n)
        found = peer(python, "felupe", *sides)
        if found:
            mm, ms = float(str(found["mm"])), float(str(found["ms"]))
            yield Row(f"FElupe mixed hexahedra {name}", nodes, mm - truth, ms / 1e3)
        found = peer(python, "mujoco", *sides)
        if found:
            z, hz = np.array(found["trace"], dtype=float), float(str(found["hz"]))
            apart = float(np.sqrt(((z - moving) ** 2).mean()))
            seconds = len(z) / hz
            name = f"MuJoCo linear tetrahedra {name}, nu .45, 1 ms"
            yield Row(name, nodes, apart, seconds, DURATION / seconds)


def converged(quick: bool) -> tuple[float, float]:
    """The end at rest mm and half its 95 % interval: hex8 extrapolated by its observed order.

    The clamp's edges are singular near nu = .5, so that every element converges slowly there;
    hex27 is printed as the check that it must pass.
    """
    found = [still(build(beam("hex8", c, "mixed", SILICONE)), 1)[0] for c in REFERENCE]
    sides = [c[1] for c in REFERENCE]
    answers = [np.array([[x]]) for x in found]
    fit = convergence([1 / n for n in sides], answers, len(found) - 1, 2.0)
    if fit.order is None:
        raise SystemExit(f"hex8: {fit.words}; take finer meshes")
    limit = found[-1] + (found[-1] - found[-2]) / ((sides[-1] / sides[-2]) ** fit.order - 1)
    check = CHECK[0 if quick else 1]
    other = still(build(beam("hex27", check, "mixed", SILICONE)), 1)[0]
    print(f"hex8: {', '.join(f'{x:.3f}' for x in found)} mm at {sides} cells; {fit.words}")
    print(f"converged: {limit:.3f} mm +- {2 * fit.u:.3f} mm (95 %); hex27 {check}: {other:.3f} mm")
    return limit, 2 * fit.u


def table(title: str, rows: list[Row]) -> None:
    print(
        f"\n| {title} | nodes | error / mm | CPU time / ms | times real time |\n"
        + "| --- " * 5
        + "|"
    )
    for r in rows:
        rate = "" if r.rate is None else f"{r.rate:.2g}"
        print(f"| {r.what} | {r.nodes} | {r.error:+.2f} | {1e3 * r.seconds:.3g} | {rate} |")


def picture(path: str, groups: dict[str, list[Row]]) -> None:
    """Error over time, one panel a task."""
    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, panels = plt.subplots(1, len(groups), figsize=(11, 4.5), layout="constrained")
    for axes, (title, rows) in zip(panels, groups.items(), strict=True):
        for family in dict.fromkeys(" ".join(r.what.split(" ")[:2]) for r in rows):
            own = [r for r in rows if r.what.startswith(family) and not r.what.endswith(LAWS)]
            spent, error = [1e3 * r.seconds for r in own], [abs(r.error) for r in own]
            axes.loglog(spent, error, "o-", label=family)
        axes.set(title=title, xlabel="time / ms", ylabel="error / mm")
        axes.grid(alpha=0.3)
        axes.legend(fontsize=7)
    figure.savefig(path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--peers", default=sys.executable, metavar="PYTHON")
    parser.add_argument("--picture", metavar="FILE.png")
    parser.add_argument("--quick", action="store_true", help="coarser check, two repeats")
    chosen = parser.parse_args()
    truth, _ = converged(chosen.quick)
    fine, coarse = (
        swing(NewtonDynamics(1e-3, tolerance=1e-6), build(beam("hex27", c, "mixed", SILICONE)))[0]
        for c in ((7, 2, 2), (5, 2, 2))
    )
    still_rows = list(static_rows(truth, 2 if chosen.quick else 7))
    moving_rows = list(swing_rows(fine))
    for row in peer_rows(chosen.peers, truth, fine):
        (still_rows if row.rate is None else moving_rows).append(row)
    apart = float(np.sqrt(((fine - coarse) ** 2).mean()))
    table("static, from rest", still_rows)
    reference = f"reference hex27 7x2x2 at 1 ms, {apart:.2f} mm from 5x2x2"
    table(f"swing of {DURATION:g} s, rms error ({reference})", moving_rows)
    if chosen.picture:
        picture(chosen.picture, {"static": still_rows, "swing": moving_rows})


if __name__ == "__main__":
    main()
