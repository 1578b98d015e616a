"""Tables and figures of `needle_pocket`: volume, updates, ticks, deformed shapes."""

from collections.abc import Mapping

import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import Chart, Entry, Exhibit, NodeMap, NumberTable, Series
from validate.pipeline.experiment.experiment import Progress, ReportAdditions
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.run.method_run import Cases, MethodRun
from validate.register.signals import SignalObservation
from validate.scene.mesh import Mesh
from validate.solve.haptic.rates import TickTimes

from .hand import DEVICE_HZ
from .loops import energy_exhibit, hysteresis_exhibit
from .pocket import TOOL
from .scene import POCKET

_PAPER = "paper"
_PERCENT = 100.0


def tell(p: Tree, cases: Cases, progress: Progress) -> ReportAdditions:
    """All exhibits of the needle, and the numbers of its printed figures."""
    main = cases[""]
    progress("volume and updates")
    scope, numbers = _scope(main)
    ticks, met = _ticks(main)
    progress("closed paths")
    loop, lost = hysteresis_exhibit(p, main["p1_exact"].body)
    energy, back = energy_exhibit(p, main)
    shapes = Exhibit("tension", "Compression and tension", _shape_words(p), (), (),
                     tuple(_shapes(main)))  # fmt: skip
    exhibits = (shapes, scope, ticks, loop, energy, *_given(main))
    return ReportAdditions(exhibits, {**numbers, **met, **lost, **back})


# --- volume, updates, contact: the scope of Fig. 10 -----------------------------------------------


def _scope(main: Mapping[str, MethodRun]) -> tuple[Exhibit, dict[str, float]]:
    wet = {k: f for k, f in main.items() if f"{POCKET}.volume_ratio" in f.run.traces}
    off = {k: _PERCENT * (f.run.traces[f"{POCKET}.volume_ratio"].y - 1) for k, f in wet.items()}
    volume = Chart(
        "volume", "Volume of the pocket, as on the scope of Fig. 10", "time / s",
        "V/V0 - 1 / %", tuple(Series(f.label, f.run.t, off[k]) for k, f in wet.items()),
        levels=(("tolerance", 0.1), ("tolerance", -0.1)),
    )  # fmt: skip
    updates = Chart(
        "iterations", "Updates of the pressure in a tick", "time / s", "updates / 1",
        tuple(Series(f.label, f.run.t, f.run.traces["updates"].y) for f in wet.values()),
        levels=(("the paper's claim", 1.0),),
        caption="Updates of the exact pressure are Newton steps on one number; those of the "
                "paper evaluate the full wall.",
    )  # fmt: skip
    heads = ("method", "largest volume error / %", "rms / %", "ticks", "without update",
             "with one", "with more", "in contact", "changes of contact", "limited")  # fmt: skip
    rows = tuple(_counted(f, off.get(k)) for k, f in main.items())
    table = NumberTable("loop", "Ticks along the recorded path.", heads, rows,
                        "Without fluid the volume is not kept constant.")  # fmt: skip
    paper = wet.get(_PAPER)
    numbers: dict[str, float] = {}
    if paper is not None and len(off[_PAPER]):
        made = paper.run.traces["updates"].y
        numbers = {
            "volume.kept": float((np.abs(off[_PAPER]) <= 0.1).mean()),
            "volume.largest": float(np.abs(off[_PAPER]).max()) / _PERCENT,
            "updates.most": float(made.max()),
        }
    words = (
        "The paper's law stops within 0.1 % and leaves the rest to the next tick. The exact "
        "pressure is the root of the volume's polynomial.",
    )
    return Exhibit("scope", "Volume and updates", words, (table,), (volume, updates)), numbers


def _counted(followed: MethodRun, off: Floats | None) -> tuple[Entry, ...]:
    traces = followed.run.traces
    made = traces["updates"].y
    of = (traces[f"{TOOL}.{k}"].y.sum() for k in ("contact", "changed", "clipped"))
    worst: tuple[Entry, ...] = (None, None)
    if off is not None and len(off):
        worst = (float(np.abs(off).max()), float(np.sqrt((off**2).mean())))
    counts = (len(made), int((made == 0).sum()), int((made == 1).sum()), int((made > 1).sum()))
    return (followed.label, *worst, *counts, *(int(n) for n in of))


# --- times ----------------------------------------------------------------------------------------


def _ticks(main: Mapping[str, MethodRun]) -> tuple[Exhibit, dict[str, float]]:
    """Times of ticks against the deadline, changes of contact apart."""
    deadline = 1 / DEVICE_HZ
    rows: list[tuple[Entry, ...]] = []
    numbers: dict[str, float] = {}
    for name, followed in main.items():
        run = followed.run
        if run.seconds is None or not len(run.seconds):
            continue
        changed = run.traces[f"{TOOL}.changed"].y > 0
        for what, which in (("all", changed | True), ("changes of contact", changed)):
            if which.any():
                times = TickTimes(run.seconds[which])
                missed = times.missed(deadline)
                rows.append((followed.label, what, len(times.seconds),
                             *(1e6 * q for q in times.quantiles), missed,
                             _PERCENT * missed / len(times.seconds)))  # fmt: skip
        numbers[f"median.{name}"] = float(np.median(run.seconds) <= deadline)
    heads = ("method", "ticks", "number", *(f"{_PERCENT * q:g} % / us" for q in TickTimes.shares),
             "longest / us", "missed", "missed / %")  # fmt: skip
    table = NumberTable("ticks", f"Times of a tick; the deadline is {1e6 * deadline:.0f} us.",
                        heads, tuple(rows))  # fmt: skip
    words = (
        "A tick is contact search, low-rank change of the condensed body, pressure and force. "
        "The first changes compile code for later ones; `validate live needle_pocket` does "
        "this before it starts.",
    )
    return Exhibit("ticks", "Timing of ticks at 512 Hz", words, (table,)), numbers


# --- shapes ---------------------------------------------------------------------------------------


def _shape_words(p: Tree) -> tuple[str, ...]:
    spread = "grows as the logarithm of" if p.scene.body.space == "plane" else "falls with"
    return (
        f"The tip is a point: its stiffness is that of the mesh around it, which {spread} the "
        "cell size, so force and pressure do not converge with finer meshes. The paper's "
        "needle is one node of its mesh.",
    )


def _shapes(main: Mapping[str, MethodRun]) -> list[NodeMap]:
    found = []
    for name in ("p2_exact", _PAPER):
        followed = main.get(name)
        if followed is None or not len(followed.run.at):
            continue
        up = followed.run.traces[f"{TOOL}.force.y"].y[followed.run.at]
        for what, k in (("compression", int(np.argmax(up))), ("tension", int(np.argmin(up)))):
            found.append(_shape(name, followed, what, k, float(up[k])))
    return found


def _shape(name: str, followed: MethodRun, what: str, k: int, force: float) -> NodeMap:
    run, mesh = followed.run, followed.body.mesh
    unit = "N/m" if mesh.dimension == 2 else "N"
    cut = ", cut at the needle" if mesh.dimension == 3 else ""
    mesh, u = half(mesh, run.u[k], followed.body.tools[0].tip[-1])
    return NodeMap(
        f"{what}_{name}",
        f"{followed.label}, {what}: {force:.3g} {unit} on the hand at {run.t[run.at[k]]:.3g} s",
        Mesh(mesh.nodes + u, mesh.cells, mesh.kind), 1e3 * np.linalg.norm(u, axis=1), "mm",
        f"displacements in {what}", f"the deformed body{cut}",
    )  # fmt: skip


def half(mesh: Mesh, u: Floats, z: float) -> tuple[Mesh, Floats]:
    """In 3-D what lies behind the layer of nodes nearest to z m, with y turned up."""
    if mesh.dimension == 2:
        return mesh, u
    layers = np.unique(mesh.nodes[mesh.facets["top"], 2].round(9))
    plane = layers[np.argmin(np.abs(layers - z))]
    behind = mesh.nodes[mesh.cells].mean(axis=1)[:, 2] < plane
    used, cells = np.unique(mesh.cells[behind], return_inverse=True)
    turn = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # x, -z, y of a row x, y, z
    shown = Mesh(mesh.nodes[used] @ turn, cells.reshape(-1, mesh.cells.shape[1]), mesh.kind)
    return shown, u[used] @ turn


# --- a live loop replayed -------------------------------------------------------------------------


def _given(main: Mapping[str, MethodRun]) -> tuple[Exhibit, ...]:
    """How far each method is from the force that a live loop gave, where the recording has it."""
    rows: list[tuple[Entry, ...]] = []
    for followed in main.values():
        for o in followed.seen.of(SignalObservation):
            if o.name.startswith("given.") and len(followed.run.t) == len(o.t):
                y = o.y[:, 0]
                off = followed.run.traces[f"{TOOL}.force.{o.name[-1]}"].y - y
                rows.append((followed.label, o.name, len(y), float(np.abs(off).max())))
    if not rows:
        return ()
    table = NumberTable(
        "given",
        "Replayed force minus the force of the live loop.",
        ("method", "signal", "ticks", "largest difference / N"),
        tuple(rows),
    )
    return (Exhibit("given", "Forces of the live loop", (), (table,)),)
