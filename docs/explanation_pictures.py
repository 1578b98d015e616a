"""Figures of docs/explanation from today's code: locking, u_num and its terms, process noise.

python docs/explanation_pictures.py    writes docs/pictures/*.svg (some five minutes)

A cantilever of 100 x 30 x 30 mm under its weight, by linear statics, gives locking and u_num.
`fluid_phantom` gives the terms of u_val, `kf_cube` the error of a filter over its process noise.
"""

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib as mpl
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import validate
from validate.compare.convergence import convergence
from validate.scene.geometries.box import box, grid
from validate.scene.material import Material
from validate.scene.mesh import Mesh
from validate.scene.scene import Dilatation, Scene, Support, Weight
from validate.solve.march import run_scheme
from validate.solve.static.quasi_static import QuasiStatic

PICTURES = Path(__file__).resolve().parent / "pictures"
SIZE, G = (0.1, 0.03, 0.03), 9.80709  # m, m/s2
NU = (0.3, 0.4, 0.45, 0.49, 0.499, 0.4999)
FINE = (20, 6, 6)  # cells of the converged answer
CELLS: dict[str, tuple[Callable[[], Mesh], Dilatation, str]] = {
    "tet4": (lambda: box(SIZE, (10, 3, 3)), "pointwise", "o-"),
    "tet4, nodal mean": (lambda: box(SIZE, (10, 3, 3)), "nodal_mean", "o--"),
    "hex8": (lambda: grid(SIZE, (10, 3, 3)), "pointwise", "s-"),
    "hex8, mixed": (lambda: grid(SIZE, (10, 3, 3)), "mixed", "s--"),
    "tet10": (lambda: box(SIZE, (10, 3, 3)).quadratic(), "pointwise", "^-"),
    "tet10, mixed": (lambda: box(SIZE, (10, 3, 3)).quadratic(), "mixed", "^--"),
}


def drop(mesh: Mesh, dilatation: Dilatation, nu: float) -> float:
    """Return the mean vertical motion mm of the free end under the weight."""
    scene = Scene(
        mesh, Material(260e3, nu, "linear", 1070.0), (Support("x0", (0, 1, 2)),),
        loads=(Weight("gravity", (0.0, 0.0, -1.0)),), dilatation=dilatation,
    )  # fmt: skip
    run = run_scheme("still", QuasiStatic(), scene, np.array([1.0]), np.array([[G]]), np.arange(1))
    return 1e3 * float(run.u[-1][mesh.facet_nodes("x1"), 2].mean())


def locking() -> None:
    figure, ax = plt.subplots(figsize=(7.2, 3.6), layout="constrained")
    finest = grid(SIZE, (10, 3, 3)).quadratic()
    converged = [drop(finest, "mixed", nu) for nu in NU]
    for label, (mesh, dilatation, style) in CELLS.items():
        share = [drop(mesh(), dilatation, nu) / c for nu, c in zip(NU, converged, strict=True)]
        ax.plot(0.5 - np.array(NU), 100 * np.array(share), style, label=label)
    ax.axhline(100, color="black", lw=0.8)
    ax.set(xscale="log", xlabel="0.5 − Poisson ratio / 1", ylabel="deflection / % of converged")
    ax.invert_xaxis()
    ax.legend(fontsize="small", ncols=2)
    save(figure, "locking")


def u_num() -> None:
    figure, (left, right) = plt.subplots(1, 2, figsize=(7.2, 3.2), layout="constrained")
    family(left)
    terms(right)
    save(figure, "u_num")


def family(ax: Axes) -> None:
    """Answers of similar meshes and the band of the coarsest, beside the converged answer."""
    per_axis = (3, 4, 5)
    sizes = [1e3 * SIZE[1] / n for n in per_axis]
    answers = [-drop(grid(SIZE, (3 * n, n, n)), "mixed", 0.45) for n in per_axis]
    band = 2 * convergence(sizes, [np.array([[a]]) for a in answers], 0, 2.0).u
    ax.plot(sizes, answers, "o", label="similar meshes")
    ax.errorbar(sizes[0], answers[0], band, color="C1", capsize=4, label="± 2 u_num")
    ax.axhline(-drop(grid(SIZE, FINE).quadratic(), "mixed", 0.45), color="black", label="converged")
    ax.set(xlim=(0, 11), xlabel="cell size / mm", ylabel="deflection / mm")
    ax.legend(fontsize="small")


def terms(ax: Axes) -> None:
    """Shares of the three terms in u_val² of each check of the phantom at 3 mm."""
    with TemporaryDirectory() as folder:
        result = validate.run("fluid_phantom", methods=["p2_fluid"], quick=True, out=folder)
        table = result.to_pandas(part="check.u_*")
    squares = table.assign(value=table["value"] ** 2)
    squares = squares.pivot_table(index="quantity", columns="part", values="value")
    shares = 100 * squares.div(squares.sum(axis=1), axis=0)
    start = np.zeros(len(shares))
    for name in ("u_D", "u_num", "u_input"):
        share = shares[f"check.{name}"].to_numpy()
        ax.barh(list(shares.index), share, left=start, label=name)
        start += share
    ax.set(xlim=(0, 100), xlabel="share of u_val² / %")
    ax.legend(fontsize="small", ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0))


def process_noise() -> None:
    sweep = ["methods.kf_load.settings.Q=log:1e-16:1e-4:13", "case=recorded,stiff_model"]
    with TemporaryDirectory() as folder:
        found = validate.study(
            "filters", "kf_cube", quick=True, methods=["kf_load", "fem"], sweep=sweep,
            seeds=[1, 2], out=folder,
        ).to_pandas()  # fmt: skip
    figure, ax = plt.subplots(figsize=(7.2, 3.4), layout="constrained")
    Q = "methods.kf_load.settings.Q"
    for case, words, color in (
        ("recorded", "right model", "C0"), ("stiff_model", "model 20 % too stiff", "C1"),
    ):  # fmt: skip
        rows = found[found["case"] == case]
        swept = rows[rows["method"] == "kf_load"].sort_values(Q)
        ax.plot(swept[Q], 1e3 * swept["all.rmse_m"], "o-", color=color, label=f"filter, {words}")
        alone = float(rows[rows["method"] == "fem"]["all.rmse_m"].iloc[0])
        if alone > 0:
            ax.axhline(1e3 * alone, color=color, ls="--", label=f"{words}, without measurements")
    held = found[(found["method"] == "last measurement, held") & (found["case"] == "recorded")]
    ax.axhline(
        1e3 * float(held["all.rmse_m"].iloc[0]), color="0.5", ls=":", label=held["method"].iloc[0]
    )
    ax.set(xscale="log", xlabel="variance of the process noise Q / m²")
    ax.set(yscale="log", ylabel="rms error of all nodes / mm")
    ax.legend(fontsize="small")
    save(figure, "process_noise")


def save(figure: Figure, name: str) -> None:
    figure.savefig(PICTURES / f"{name}.svg", metadata={"Date": None}, facecolor="white")
    plt.close(figure)


if __name__ == "__main__":
    mpl.use("svg")
    mpl.rcParams |= {"svg.hashsalt": "validate", "svg.fonttype": "none", "font.size": 9}
    locking()
    u_num()
    process_noise()
