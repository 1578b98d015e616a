"""Energy at the hand of `needle_pocket`: over closed paths, and along the recorded one."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import Chart, Entry, Exhibit, NumberTable, Series
from validate.fem.system import build as build_system
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.run.method_run import MethodRun
from validate.scene.scene import Scene
from validate.solve.haptic.needle import NeedleLoop
from validate.solve.march import march
from validate.solve.types import Run

from .hand import DEVICE_HZ, closed
from .pocket import AXES, TOOL

_TURNS = 2
_FREE = 1e6  # N: a limit would dissipate
#: What a closed path is walked with: where the dead band's loop comes from, and where it does not.
LAWS: Mapping[str, NeedleLoop] = {
    "exact pressure, force of the energy": NeedleLoop(grip=None, limit=_FREE),
    "exact pressure, reaction, node": NeedleLoop(
        at="node", force="reaction", grip=None, limit=_FREE
    ),
    "the paper's law to .1 %": NeedleLoop(
        update="proportional", at="node", force="reaction", grip=None, limit=_FREE
    ),
    "the paper's law to 1 %": NeedleLoop(
        update="proportional", tolerance=1e-2, at="node", force="reaction", grip=None, limit=_FREE
    ),
}


@dataclass(frozen=True)
class Walked:
    """Tip x (nt, d) m, force on the hand F (nt, d) N, stored energy (nt,) J."""

    x: Floats
    F: Floats
    stored: Floats

    @property
    def taken(self) -> Floats:
        """(nt,) J that the hand has given since the start, by the trapezoidal rule."""
        steps = (self.F[1:] + self.F[:-1]) / 2 * np.diff(self.x, axis=0)
        return np.concatenate([[0.0], -np.cumsum(steps.sum(axis=1))])


def walked(run: Run, d: int) -> Walked:
    """What a run felt along its path."""
    x = np.column_stack([run.traces[f"{TOOL}.{a}"].y for a in AXES[:d]])
    F = np.column_stack([run.traces[f"{TOOL}.force.{a}"].y for a in AXES[:d]])
    return Walked(x, F, run.traces[f"{TOOL}.energy"].y)


def around(scene: Scene, law: NeedleLoop, depth: float) -> Walked:
    """A closed path at 512 Hz, with nothing let go: rest, turns within the body, rest."""
    x = closed((scene.tools[0].tip[0], *(0.0,) * (scene.mesh.dimension - 1)), depth, _TURNS,
               DEVICE_HZ)  # fmt: skip
    tool = replace(scene.tools[0], tip=tuple(x[0].tolist()))
    stepper = law.prepare(build_system(replace(scene, tools=(tool,))))
    t = np.arange(len(x)) / DEVICE_HZ
    run = march("closed", stepper, t, x - x[0], np.array([len(x) - 1]), 0.0)
    return walked(run, scene.mesh.dimension)


def turn_energy(way: Walked) -> float:
    """J that the device has taken in the last whole turn (below 0: given)."""
    n = round(DEVICE_HZ)
    end = n - 1 + _TURNS * n
    return float(way.taken[end] - way.taken[end - n])


def hysteresis_exhibit(p: Tree, scene: Scene) -> tuple[Exhibit, dict[str, float]]:
    """Force over depth around a closed path by every law, and the energy of a turn."""
    unit = "J/m" if p.scene.body.space == "plane" else "J"
    rows: list[tuple[Entry, ...]] = []
    lines: list[Series] = []
    numbers: dict[str, float] = {}
    for key, (name, law) in zip(("exact", "reaction", "paper", "coarse"), LAWS.items(),
                                strict=True):  # fmt: skip
        way = around(scene, law, p.settings.twin.depth)
        most, lost = float(way.stored.max()), turn_energy(way)
        left, least = float((way.taken - way.stored)[-1]), float((way.taken - way.stored).min())
        rows.append((name, most, lost, 100 * lost / most, left, least))
        lines.append(Series(name, 1e3 * -way.x[:, 1], way.F[:, 1]))
        numbers |= {f"turn.{key}": lost / most, f"closed.{key}": left / most}
    table = NumberTable(
        "hysteresis", "Energy at the hand along a closed path within the body.",
        ("law", f"largest stored / {unit}", f"taken in a turn / {unit}",
         "of the largest stored / %", f"taken less stored at the end / {unit}",
         f"least taken less stored / {unit}"),
        tuple(rows), "Below 0: the device returns more energy than it received and is not passive.",
    )  # fmt: skip
    chart = Chart(
        "hysteresis", "Force on the hand around a closed path", "way of the tip down / mm",
        "force along y / N" + ("/m" if p.scene.body.space == "plane" else ""), tuple(lines),
    )  # fmt: skip
    words = (
        "Down, two turns of an ellipse within the body and back at 512 Hz, linear elements, "
        "nothing let go: an elastic body returns exactly the energy that it received.",
        f"The exact pressure with the force of the energy takes {numbers['turn.exact']:.1e} of the "
        f"largest stored energy in a turn (rounding and the trapezoidal rule), the paper's law to "
        f".1 % {100 * numbers['turn.paper']:.3g} %, of which the reaction on normals that do not "
        f"turn alone is {100 * numbers['turn.reaction']:.3g} %.",
    )
    return Exhibit("hysteresis", "Force hysteresis", words, (table,), (chart,)), numbers


def energy_exhibit(p: Tree, main: Mapping[str, MethodRun]) -> tuple[Exhibit, dict[str, float]]:
    """Energy taken less stored along the recorded path: what is left was lost where it let go."""
    per = "/m" if p.scene.body.space == "plane" else ""
    lines: list[Series] = []
    rows: list[tuple[Entry, ...]] = []
    numbers: dict[str, float] = {}
    for name, followed in main.items():
        if not followed.whole:
            continue
        way, t = walked(followed.run, p.scene.body.dimension), followed.run.t
        free = way.taken - way.stored
        back = float((np.maximum.accumulate(free) - free).max())
        rows.append((followed.label, 1e3 * float(way.stored.max()), 1e3 * float(way.taken[-1]),
                     1e3 * float(free.min()), 1e3 * back))  # fmt: skip
        lines.append(Series(followed.label, t, 1e3 * free))
        numbers[f"back.{name}"] = back / float(way.stored.max()) if way.stored.any() else 0.0
    both: tuple[Series, ...] = ()
    if "p2_exact" in main and main["p2_exact"].whole:
        way, t = walked(main["p2_exact"].run, p.scene.body.dimension), main["p2_exact"].run.t
        both = (
            Series("taken from the hand", t, 1e3 * way.taken),
            Series("stored", t, 1e3 * way.stored),
        )
    charts = (
        Chart("energy", "Energy of the P2 body with exact pressure", "time / s",
              f"energy / mJ{per}", both),
        Chart("passivity", "Taken minus stored energy: never falls for a passive device",
            "time / s",
              f"energy / mJ{per}", tuple(lines)),
    )  # fmt: skip
    table = NumberTable(
        "energy", "Along the recorded path, work by the trapezoidal rule.",
        ("method", f"largest stored / mJ{per}", f"taken at the end / mJ{per}",
         f"least taken less stored / mJ{per}", f"largest fall of taken less stored / mJ{per}"),
        tuple(rows),
    )  # fmt: skip
    words = (
        "Taken minus stored energy rises where contact ends (stored energy is lost, not "
        "returned) and is constant in between. Where it falls, the device gave energy that it "
        "did not have.",
    )
    return Exhibit("energy", "Passivity", words, (table,), tuple(c for c in charts if c.series)), (
        numbers
    )
