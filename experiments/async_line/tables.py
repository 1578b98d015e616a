"""Tables of both experiments of paper 004: forces and ticks of every method, borders' energies."""

from collections.abc import Mapping

from validate.arrays import Floats
from validate.compare.exhibit import Entry, NumberTable
from validate.pipeline.run.method_run import MethodRun
from validate.scene.scene import Scene
from validate.solve.regions.krylov import TouchedKrylov
from validate.solve.regions.scheme import AsyncRegions
from validate.solve.types import Run

from .probe import PROBE
from .runs import off, peak, pushed

FORCE = f"{PROBE}.force.x"
_UNTIMED = 20  # ticks: regions are made and caches settle
ENERGY = (
    "Created energy is the energy of body and spring minus the work of the hand plus the "
    "dissipation; lost energy is its negative part. The full solve creates energy because the "
    "spring uses the force at the start of a tick, and by its time steps. The borders create "
    "or remove the rest."
)


def force_table(
    name: str, title: str, main: Mapping[str, MethodRun], middle: float, within: float
) -> tuple[NumberTable, dict[str, float]]:
    """Peak (in `middle` +- `within` s), error, phase and ticks of every method, and as numbers."""
    runs = {key: f.run for key, f in main.items() if f.run.finished}
    whole = runs.get("whole")
    rows: list[tuple[Entry, ...]] = []
    numbers: dict[str, float] = {}
    for key, run in runs.items():
        top = peak(run.traces[FORCE].y, run.t, middle, within)
        mean, *_, worst = ticks = _ticks(run)
        row: list[Entry] = [main[key].label, top, None, None, *(1e3 * s for s in ticks)]
        numbers |= {f"peak.{key}": top, f"tick.{key}": 1e3 * mean, f"worst.{key}": 1e3 * worst}
        if whole is not None:
            error = 100 * (top / peak(whole.traces[FORCE].y, whole.t, middle, within) - 1)
            row[2:4] = [error, 100 * off(run.traces[FORCE].y, whole.traces[FORCE].y)]
            gain = 100 * (1 - mean / _ticks(whole)[0])
            numbers |= {f"error.{key}": error, f"gain.{key}": gain}
        rows.append(tuple(row))
    heads = ("method", "peak / N", "error / %", "rms / %", "mean tick / ms", "median tick / ms",
             "slow ticks (p99) / ms", "worst tick / ms")  # fmt: skip
    return NumberTable(name, title, heads, tuple(rows)), numbers


def _ticks(run: Run) -> tuple[float, float, float, float]:
    """Mean, median, 99th percentile and longest tick, s."""
    assert run.step_s is not None
    assert run.seconds is not None
    mean = float(run.seconds[_UNTIMED:].mean())
    return mean, run.step_s.p50, run.step_s.p99, run.step_s.max


def energy_table(
    title: str, scene: Scene, rivals: Mapping[str, AsyncRegions | TouchedKrylov], path: Floats
) -> NumberTable:
    """What borders make and lose, in runs of their own along `path` (nt,) or (nt, d) m."""
    rows: list[tuple[Entry, ...]] = []
    for label, settings in rivals.items():
        found = pushed(scene, settings, path, account=True)
        amounts = (1e3 * x for x in (found.made, found.lost, found.put))
        rows.append((label, *amounts, "; ".join(found.words)))
    heads = ("method", "made at most / mJ", "lost at most / mJ", "put in at most / mJ", "said")
    return NumberTable("energy", title, heads, tuple(rows), below="said")
