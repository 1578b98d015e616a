"""Rates against the size of the mesh: paper 003, Figs. 4 and 7, with what its figures leave out.

A rate says nothing without its step: each row carries dt, the critical step and the real-time
factor. The paper compares its filter with an assembled implicit solve; here every integrator and
the filter run on the same meshes in the same run.
"""

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

import numpy as np
from scipy import sparse

from validate.arrays import Floats
from validate.compare.exhibit import Chart, Entry, Exhibit, NumberTable, Series
from validate.estimate.measurements import Measurements
from validate.fem.critical import CriticalStep
from validate.fem.system import System, build
from validate.scene.geometries.box import box
from validate.scene.material import Material
from validate.scene.scene import Load, Scene, Support
from validate.solve.haptic.rates import RealTime
from validate.solve.types import Stepper

VISUAL_HZ = 30.0  # images per second (paper 003, 3.3)
_SAFE = 0.9  # of the critical step
_SECONDS = 0.4  # of stepping per row, enough for a median


@dataclass(frozen=True)
class Integrator:
    """`make` prepares steps of dt s on a system; `dt` None: as explicit schemes may. It is run on
    meshes of `least` to `most` cells."""

    label: str
    make: Callable[[System, Measurements, float], Stepper]
    dt: float | None = None
    least: int = 1
    most: int = 200_000


@dataclass(frozen=True)
class Rate:
    """One integrator on one mesh."""

    label: str
    cells: int
    nodes: int
    times: RealTime


def measured_rates(
    material: Material, side: float, edges: tuple[int, ...], integrators: tuple[Integrator, ...]
) -> tuple[Rate, ...]:
    """Median step times on cubes of `side` m with 6 n^3 cells; none where a limit forbids it."""
    found = []
    for n in edges:
        system = build(_cube(material, side, n))
        critical = _critical(system)
        given = _looks(system, _SAFE * critical)
        for one in integrators:
            if not one.least <= len(system.scene.mesh.cells) <= one.most:
                continue
            dt = one.dt or _SAFE * critical
            seconds = _timed(one.make(system, given, dt), len(system.scene.inputs))
            times = RealTime(1 / seconds, dt, critical)
            mesh = system.scene.mesh
            found.append(Rate(one.label, len(mesh.cells), len(mesh.nodes), times))
    return tuple(found)


def _cube(material: Material, side: float, n: int) -> Scene:
    mesh = box((side, side, side), (n, n, n))
    push = Load("push", "x0", (1.0, 0.0, 0.0))
    return Scene(mesh, material, (Support("z0", (0, 1, 2)),), loads=(push,))


def _critical(system: System) -> float:
    free = system.free
    K = sparse.csr_array(system.K[free][:, free])
    return CriticalStep.by_lanczos(lambda x: K @ x, system.masses[free]).limit


def _looks(system: System, dt: float) -> Measurements:
    """A node at the loaded face's middle, seen unmoved at every one of many steps."""
    mesh = system.scene.mesh
    node = mesh.nearest_node(np.array([0.0, 0.5, 0.7]) * mesh.nodes.max())
    H = sparse.csr_array((np.ones(3), (range(3), range(3 * node, 3 * node + 3))),
                         shape=(3, mesh.nodes.size))  # fmt: skip
    t: Floats = dt * np.arange(1, 4001, dtype=np.float64)
    names = ("A.x", "A.y", "A.z")
    return Measurements(t, H, np.zeros((len(t), 3)), np.full(3, 1e-5), names)


def _timed(stepper: Stepper, inputs: int) -> float:
    """Median seconds of a step at rest under no load, which costs what any other does."""
    state, still, seconds = stepper.rest(), np.zeros(inputs), list[float]()
    begin = perf_counter()
    while len(seconds) < 3 or (perf_counter() - begin < _SECONDS and len(seconds) < 2000):
        start = perf_counter()
        state = stepper.step(state, still)
        seconds.append(perf_counter() - start)
    return float(np.median(seconds[1:]))


def rates_exhibit(rates: tuple[Rate, ...]) -> Exhibit:
    """Table and chart, with the visual and haptic thresholds."""
    rows: list[tuple[Entry, ...]] = [
        (r.label, r.cells, r.nodes, r.times.rate_hz, 1e3 * r.times.dt, 1e3 * r.times.critical_dt,
         r.times.ratio, r.times.factor)
        for r in rates
    ]  # fmt: skip
    heads = (
        "integrator", "tetrahedra", "nodes", "rate / Hz", "dt / ms", "critical dt / ms",
        "dt over critical / 1", "real-time factor / 1",
    )  # fmt: skip
    table = NumberTable("rates", "Steps a second against the size of the mesh.", heads, tuple(rows))
    series = tuple(
        Series(label, *_line([r for r in rates if r.label == label]))
        for label in dict.fromkeys(r.label for r in rates)
    )
    chart = Chart(
        "rates", "Rate against tetrahedra", "tetrahedra", "steps a second / Hz", series,
        levels=(("30 Hz, visual", VISUAL_HZ), ("1 kHz, haptic", RealTime.haptic_hz)), log="xy",
        caption="Paper 003, Figs. 4 and 7, print rates without their steps; the table has both.",
    )  # fmt: skip
    words = (
        "Real time needs a real-time factor of 1: steps a second times dt. The step of a "
        "filter contains the plain explicit step, so it cannot be faster.",
    )
    return Exhibit("rates", "Rates against the size of the mesh", words, (table,), (chart,))


def _line(rates: list[Rate]) -> tuple[Floats, Floats]:
    return np.array([float(r.cells) for r in rates]), np.array([r.times.rate_hz for r in rates])


def cells_at(rates: tuple[Rate, ...], label: str, hz: float) -> float | None:
    """Tetrahedra at which an integrator falls to a rate, between its meshes on log axes; None when
    all its meshes are on one side."""
    mine = sorted((r for r in rates if r.label == label), key=lambda r: -r.times.rate_hz)
    cells = np.log([float(r.cells) for r in mine])
    logs = np.log([r.times.rate_hz for r in mine])
    if not len(mine) or not logs[-1] <= np.log(hz) <= logs[0]:
        return None
    return float(np.exp(np.interp(-np.log(hz), -logs, cells)))
