"""Do identified moduli hold their truth, and are wrong laws named? Synthetic compression logs.

python benchmarks/identified_logs.py [COUNT] [--curve docs/pictures/law_detection.svg]

COUNT is 200 logs; the slow test takes 20.

A log is a function of its seed: law and contact, aspect ratio, Poisson ratio, sizes, share of
friction, scale of the load cell, noise (white, or remembering .7 of its last sample), contact
point. Its truth is none of the package's solvers: uniaxial closed forms for slipping plates, and an
axisymmetric finite-element model of biquadratic cells for bonded ones. Every log goes through what
`validate run` does with a user's log. Where the run declares an input, the log's true value is
drawn about the declared one with the declared standard uncertainty.

The second table has truths that stiffen more and more (Yeoh) and neo-Hooke fitted to them: how
often the wrong law is named, against the size of its effect in u_val.
"""

import argparse
import sys
import tempfile
from collections import Counter
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
import skfem
from scipy.optimize import brentq
from scipy.sparse.linalg import spsolve
from skfem.helpers import grad

from validate.arrays import Floats, rms
from validate.compare.verdict import Accept
from validate.identify.budget import IdentifiedValue
from validate.identify.scaled_curve import UnitCurve, fit_scaled
from validate.pipeline import run_in_memory
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.options import Options
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.plates.compression import compression
from validate.pipeline.plates.scene import BONDED_PLATES, Compression, CompressionRanges
from validate.pipeline.run.pipeline import set_out
from validate.recording.mcap.write import write_recording
from validate.recording.types import Recording, Signal, Source
from validate.scene.geometries.specification import Cylinder
from validate.scene.material import Material
from validate.scene.scene import Drive, Scene, Support
from validate.solve.fluid.cavities import NoFluid
from validate.solve.static.load_table import Tabulated
from validate.solve.static.newton import StaticNewton

Case = Literal["linear slip", "neo_hooke slip", "linear bonded"]
CASES: tuple[Case, ...] = ("linear slip", "neo_hooke slip", "linear bonded")
RANGES = CompressionRanges()
LIMIT, FIT_TO = 0.10, 0.05  # strains
SAMPLES, MEMORY = 300, 0.7
EFFECTS = (0.0, 0.5, 1.0, 2.0, 3.0, 4.0, 6.0)  # of a wrong law, u_val
LEAST, WIDEST = 0.92, 0.98  # of the truths in their 95 % intervals


# --- truths ---------------------------------------------------------------------------------------


def uniaxial_neo_hooke(strain: Floats, nu: float) -> Floats:
    """Nominal stress over E between slipping plates, W = mu/2 (I1 J^(-2/3) - 3) + kappa/2 (J-1)^2;
    the stretch across leaves no stress there."""
    mu, kappa = 1 / (2 * (1 + nu)), 1 / (3 * (1 - 2 * nu))

    def slopes(along: float, across: float) -> tuple[float, float]:
        I1, J = along**2 + 2 * across**2, along * across**2
        iso, p = mu / 2 * J ** (-2 / 3), kappa * (J - 1)
        return (
            iso * (2 * along - 2 / 3 * I1 / along) + p * across**2,
            iso * (4 * across - 4 / 3 * I1 / across) + 2 * p * along * across,
        )

    def stress(e: float) -> float:
        across = brentq(lambda a: slopes(1 - e, a)[1], 0.5, 2.0, xtol=1e-14)
        return -slopes(1 - e, across)[0]

    return np.array([stress(float(e)) for e in strain])


def uniaxial_yeoh(strain: Floats, stiffening: float) -> Floats:
    """Nominal stress over E of an incompressible Yeoh solid, C2 = `stiffening` C1, C1 = E / 6."""
    along = 1 - strain
    I1 = along**2 + 2 / along
    return -2 * (along - along**-2) * (1 + 2 * stiffening * (I1 - 3)) / 6


def bonded_factor(aspect: float, nu: float, cells: int = 24) -> float:
    """Stiffness of a bonded cylinder over that of a slipping one, linear; `aspect` is height over
    diameter. Axisymmetric biquadratic cells, half of the height, graded to the bonded corner."""
    s = np.linspace(0, 1, cells + 1)
    mesh = skfem.MeshQuad.init_tensor(1 - (1 - s) ** 2, aspect * (1 - (1 - s) ** 2))
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementQuad2()), intorder=6)
    lam, mu = nu / ((1 + nu) * (1 - 2 * nu)), 1 / (2 * (1 + nu))

    @skfem.BilinearForm
    def stiffness(u: Any, v: Any, w: Any) -> Any:
        r, du, dv = w.x[0], grad(u), grad(v)
        eu = (du[0, 0], du[1, 1], u[0] / r)
        ev = (dv[0, 0], dv[1, 1], v[0] / r)
        shear = mu * (du[0, 1] + du[1, 0]) * (dv[0, 1] + dv[1, 0])
        return r * (lam * sum(eu) * sum(ev) + 2 * mu * sum(map(np.multiply, eu, ev)) + shear)

    K = stiffness.assemble(basis)
    top = basis.get_dofs(lambda x: np.isclose(x[1], aspect))
    axis = basis.get_dofs(lambda x: np.isclose(x[0], 0)).all("u^1")
    middle = basis.get_dofs(lambda x: np.isclose(x[1], 0)).all("u^2")
    u = np.zeros(K.shape[0])
    u[top.all("u^2")] = -aspect  # a strain of one
    held = np.unique(np.concatenate([top.all(), axis, middle]))
    free = np.setdiff1d(np.arange(len(u)), held)
    u[free] = spsolve(K[free][:, free].tocsc(), -(K[free] @ u))
    # Twice the energy over the volume of the half, 2 pi left out, is E_apparent.
    return float(u @ (K @ u)) / (aspect / 2)


@dataclass(frozen=True)
class Truth:
    """One log's specimen, and what the run is told of it."""

    case: Case
    E: float
    told: Tree
    recording: Recording


def reflected(nu: float) -> float:
    """Below .4999, mirrored there."""
    return nu if nu < 0.4999 else 2 * 0.4999 - nu


def log(seed: int) -> Truth:
    """A log and its truth."""
    rng = np.random.default_rng(seed)
    case = CASES[seed % 3]
    law, contact = case.split()
    E, diameter = 10 ** rng.uniform(3.5, 5.5), rng.uniform(0.015, 0.04)
    height = diameter * rng.uniform(0.4, 1.5)
    nu = rng.uniform(0.3, 0.4999)
    true_nu = reflected(nu + rng.normal(0, RANGES.nu))
    D, H = (size * (1 + rng.normal(0, sd))
            for size, sd in ((diameter, RANGES.diameter), (height, RANGES.height)))  # fmt: skip
    share = abs(rng.normal(0, RANGES.friction))
    cell = 1 + rng.normal(0, RANGES.load)
    t = np.linspace(0.0, 60.0, SAMPLES)
    approach = rng.uniform(0.005, 0.02) * height
    d = np.linspace(0.0, 1.15 * LIMIT * height + approach, SAMPLES) - approach
    strain = np.maximum(d, 0.0) / H
    curve = uniaxial_neo_hooke(strain, true_nu) if law == "neo_hooke" else strain
    factor = bonded_factor(H / D, true_nu)
    held = share if contact == "slip" else 1 - share
    force = cell * E * np.pi * D**2 / 4 * curve * (1 + held * (factor - 1))
    noise = rng.uniform(0.001, 0.01) * force.max()
    force = force + remembering(rng, noise, MEMORY * (seed % 2)) + rng.normal(0, 5 * noise)
    told = cylinder(diameter, height, nu, (3, 3))
    return Truth(case, E, told, recorded(t, d + approach, force))


def cylinder(diameter: float, height: float, nu: float, cells: tuple[int, int]) -> Tree:
    """What a run is told of a specimen between plates."""
    scene = Scene(
        Cylinder(diameter, height, cells, "tet10", "quarter"), Material(None, nu),
        (Support("lower_plate", (2,)),),
        drives=(Drive("stage", "upper_plate", (0.0, 0.0, -1.0)),),
    )  # fmt: skip
    return Tree("log.mcap", scene, Compression())


def remembering(rng: np.random.Generator, sd: float, memory: float) -> Floats:
    """Noise (n,) of this sd, of which `memory` goes over to the next sample."""
    y = rng.normal(0, sd, SAMPLES)
    for i in range(1, SAMPLES):
        y[i] = memory * y[i - 1] + np.sqrt(1 - memory**2) * y[i]
    return np.asarray(y)


def recorded(t: Floats, d: Floats, force: Floats) -> Recording:
    signals = {
        "displacement": Signal(t, d[:, None], "m", 0.0, "machine"),
        "force": Signal(t, force[:, None], "N", 0.0, "machine"),
    }
    return Recording("log", Source("x", "", 0, "x"), 0, signals=signals)


# --- what a run makes of them ---------------------------------------------------------------------


def experiment(folder: Path, told: Tree, seen: Recording, law: str, contact: str,
               ) -> Experiment:  # fmt: skip
    write_recording(seen, folder / "log.mcap")
    solver: Any = NoFluid() if law == "linear" else Tabulated(StaticNewton("none"))
    changes = {"material.law": law, **(BONDED_PLATES if contact == "bonded" else {})}
    method = Method(f"{law}, {contact}", solver, changes)
    made = compression(
        "log", "log", "synthetic", told, {"judged": method}, ("judged",),
        (Accept("force", 1.0, "not judged"),), kind="twin",
    )  # fmt: skip
    return replace(made, path=folder / "log.py")


def identified(experiment: Experiment) -> IdentifiedValue:
    found = set_out(experiment, Options({}))
    assert found.identified is not None
    return found.identified.values[0]


@dataclass(frozen=True)
class Row:
    """One log: relative error, its interval's half width, whether it holds the truth, its terms."""

    case: Case
    error: float
    half: float
    holds: bool
    dominant: str
    named: bool


def row(seed: int) -> Row:
    truth = log(seed)
    law, contact = truth.case.split()
    with tempfile.TemporaryDirectory() as folder:
        one = identified(experiment(Path(folder), truth.told, truth.recording, law, contact))
    low, high = one.interval
    return Row(
        truth.case, one.value / truth.E - 1, (high - low) / 2 / truth.E, low <= truth.E <= high,
        one.dominant, bool(one.finding),
    )  # fmt: skip


def table(rows: list[Row]) -> list[str]:
    """Lines of the table of all logs and of each case."""
    lines = ["| logs | n | 95 % interval holds | rms error | median half width | over rms |",
             "| --- | --- | --- | --- | --- | --- |"]  # fmt: skip
    for name in ("all", *CASES):
        own = [r for r in rows if name in ("all", r.case)]
        if own:
            error = rms(np.array([[r.error] for r in own]))
            half = float(np.median([r.half for r in own]))
            share = np.mean([r.holds for r in own])
            lines.append(
                f"| {name} | {len(own)} | {100 * share:.1f} % | {100 * error:.2f} % | "
                f"{100 * half:.2f} % | {half / error:.2f} |"
            )
    return lines


def too_wide(rows: list[Row]) -> list[str]:
    """Cases whose intervals hold more than 98 %, with the term that is largest in most of them."""
    found = []
    for name in ("all", *CASES):
        own = [r for r in rows if name in ("all", r.case)]
        if own and np.mean([r.holds for r in own]) > WIDEST:
            ((term, count),) = Counter(r.dominant for r in own).most_common(1)
            found.append(f"{name}: too wide; '{term}' is the largest term of {count} of {len(own)}")
    return found


# --- wrong laws -----------------------------------------------------------------------------------

_DIAMETER, _HEIGHT, _E = 0.03, 0.02, 25e3
_NOISE = 0.01  # N


def wrong_law(seed: int, stiffening: float) -> Recording:
    """A Yeoh solid between slipping plates, pressed beyond the limit."""
    rng, t = np.random.default_rng(seed), np.linspace(0.0, 60.0, SAMPLES)
    d = np.linspace(-0.01, 1.15 * LIMIT, SAMPLES) * _HEIGHT
    curve = uniaxial_yeoh(np.maximum(d, 0.0) / _HEIGHT, stiffening)
    force = _E * np.pi * _DIAMETER**2 / 4 * curve + rng.normal(0, _NOISE, SAMPLES)
    return recorded(t, d - d[0], force)


def _told() -> Tree:
    """In linear cells: many logs."""
    tree = cylinder(_DIAMETER, _HEIGHT, 0.4995, (2, 2))
    linear = replace(tree.scene.body, element="tet4")
    return tree.with_scene(body=linear, dilatation="nodal_mean")


def wrong(folder: Path, seed: int, stiffening: float) -> Experiment:
    return experiment(folder, _told(), wrong_law(seed, stiffening), "neo_hooke", "slip")


def misfit(stiffening: float) -> float:
    """N rms beyond the fit that neo-Hooke leaves of a Yeoh solid without noise."""
    strain = np.linspace(0.005, LIMIT, 400)
    force = _E * np.pi * _DIAMETER**2 / 4
    grid = np.linspace(0, 0.12, 61)
    curve = UnitCurve(grid, force / _E * uniaxial_yeoh(grid, 0.0), 1.0)
    truth, low = force * uniaxial_yeoh(strain, stiffening), strain <= FIT_TO
    fit = fit_scaled(curve, strain[low], truth[low], shifted=True)
    off = truth - fit.scale * curve(strain - fit.shift)
    return rms(off[~low, None])


@lru_cache(maxsize=1)
def u_val() -> float:
    """Of the force beyond the fit, N, of the right law."""
    with tempfile.TemporaryDirectory() as folder:
        result = run_in_memory(wrong(Path(folder), 0, 0.0))
    return next(c.u_val for c in result.checks if c.name.endswith("@beyond"))


def stiffening_of(effect: float) -> float:
    """The Yeoh coefficient whose misfit is `effect` u_val."""
    if effect == 0:
        return 0.0
    return float(brentq(lambda c: misfit(c) - effect * u_val(), 0.0, 50.0))


def detected(effect: float, seeds: range) -> float:
    """The share of logs in which the wrong law is named."""
    stiffening, named = stiffening_of(effect), []
    for seed in seeds:
        with tempfile.TemporaryDirectory() as folder:
            named.append(bool(identified(wrong(Path(folder), seed, stiffening)).finding))
    return float(np.mean(named))


def draw(effects: tuple[float, ...], shares: list[float], path: Path) -> None:
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot

    mpl.rcParams["svg.hashsalt"] = "detection"
    figure, axes = pyplot.subplots(figsize=(5, 3))
    axes.plot(effects, [100 * s for s in shares], "o-", color="#1f5fa8")
    axes.axvline(3, color="#888888", linewidth=0.8, linestyle="--")
    axes.set_xlabel("effect of the wrong law on the prediction / u_val")
    axes.set_ylabel("logs in which it is named, %")
    axes.set_ylim(-3, 103)
    figure.tight_layout()
    figure.savefig(path, metadata={"Date": None})


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("count", nargs="?", type=int, default=200)
    parser.add_argument("--curve", type=Path)
    asked = parser.parse_args()
    rows = []
    for seed in range(asked.count):
        rows.append(row(seed))
        r = rows[-1]
        print(f"{seed}: {r.case}, {100 * r.error:+.2f} %, half width {100 * r.half:.2f} %, "
              f"{'in' if r.holds else 'out'}, largest term {r.dominant}",
              file=sys.stderr)  # fmt: skip
    print("\n".join([*table(rows), *too_wide(rows)]))
    print(f"right laws named as wrong: {sum(r.named for r in rows)} of {len(rows)}")
    seeds = range(max(10, asked.count // 4))
    shares = [detected(effect, seeds) for effect in EFFECTS]
    print("\n| effect / u_val | named, % of logs | n |\n| --- | --- | --- |")
    for effect, share in zip(EFFECTS, shares, strict=True):
        print(f"| {effect:g} | {100 * share:.0f} | {len(seeds)} |")
    if asked.curve:
        draw(EFFECTS, shares, asked.curve)
    half = np.median([r.half for r in rows]) / rms(np.array([[r.error] for r in rows]))
    return 0 if np.mean([r.holds for r in rows]) >= LEAST and half <= 3 else 1


if __name__ == "__main__":
    sys.exit(main())
