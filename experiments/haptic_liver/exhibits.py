"""What `haptic_liver` shows: forces between answers, their energy, periods, ticks against 1 kHz."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats
from validate.compare.exhibit import Chart, Entry, Exhibit, NodeMap, NumberTable, Series
from validate.fem.critical import CriticalStep
from validate.fem.system import build as build_system
from validate.pipeline.experiment.experiment import Progress, ReportAdditions
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.live import RecordedPath
from validate.pipeline.run.method_run import Cases, MethodRun
from validate.scene.mesh import Mesh
from validate.scene.scene import Scene
from validate.solve.haptic.loop import HapticLoop
from validate.solve.haptic.rates import RealTime, TickTimes

from .held_force import HeldForce
from .twin import AXES, EACH_TICK, TOOL, sets

REFERENCE, JUDGED = "every_tick", "linear"
PERIODS = (2, 5, 10, 20, 33, 50)  # ticks between readings
_LIVE = {
    "every tick, at once": EACH_TICK,
    "every 10th tick, at once, linear": HapticLoop(late=0),
    "every 10th tick, in a separate thread, linear": HapticLoop(background=True),
}
_LIVE_SECONDS = 1.2
_MILLI, _MICRO, _PERCENT = 1e3, 1e6, 100.0
_ZOOM = 0.06  # s on each side
_TRUE = "reference: simulated at every tick"
_EXTRAPOLATIONS = {
    "held": HapticLoop(extrapolation="hold"),
    "linear": HapticLoop(extrapolation="linear"),
    "second order": HapticLoop(extrapolation="quadratic"),
}


@dataclass(frozen=True)
class Felt:
    """A method's force on the hand beside that of every tick: with its energy, `jumps` N where
    answers correct it, and `hz` of the simulation."""

    label: str
    t: Floats
    held: HeldForce
    jumps: Floats
    hz: float

    @property
    def up(self) -> Floats:
        """The force's vertical part (nt,) N."""
        return np.asarray(self.held.given[:, 2])


def tell(tree: Tree, cases: Cases, progress: Progress) -> ReportAdditions:
    """All exhibits, of the methods that came to the end of the path."""
    main = cases[""]
    felt = felt_by(main)
    if not felt:
        return ReportAdditions()
    progress("periods")
    reference = felt[REFERENCE]
    periods = _periods_exhibit(reference)
    progress("live")
    ticks = _ticks_exhibit(tree, main[REFERENCE])
    numbers = {f"peak.{name}": share_off(f) for name, f in felt.items()}
    numbers |= {f"least.{name}": f.held.least for name, f in felt.items()}
    force = _force_exhibit(felt, _shape(main[REFERENCE], reference))
    return ReportAdditions((force, _energy_exhibit(felt, main[REFERENCE]), periods, ticks), numbers)


def felt_by(main: Mapping[str, MethodRun]) -> dict[str, Felt]:
    """By method, what was felt along the whole path; nothing without the reference."""
    whole = {name: f for name, f in main.items() if f.whole}
    if REFERENCE not in whole:
        return {}
    true = _forces(whole[REFERENCE])
    return {name: _felt(f, true) for name, f in whole.items()}


def _felt(followed: MethodRun, true: Floats) -> Felt:
    run = followed.run
    x = np.column_stack([run.traces[f"{TOOL}.{a}"].y for a in AXES])
    dt = float(np.median(np.diff(run.t)))
    apart = np.median(np.diff(np.flatnonzero(run.traces[f"{TOOL}.answered"].y)))
    held = HeldForce(x, _forces(followed), true, dt)
    return Felt(followed.label, run.t, held, run.traces[f"{TOOL}.jump"].y, 1 / (dt * float(apart)))


def _forces(followed: MethodRun) -> Floats:
    return np.column_stack([followed.run.traces[f"{TOOL}.force.{a}"].y for a in AXES])


def share_off(felt: Felt) -> float:
    """Largest error over the largest force."""
    return felt.held.peak / float(np.linalg.norm(felt.held.true, axis=1).max())


# --- forces ---------------------------------------------------------------------------------------


def _force_exhibit(felt: Mapping[str, Felt], shape: NodeMap) -> Exhibit:
    reference = felt[REFERENCE]
    others = {k: f for k, f in felt.items() if k != REFERENCE}
    steady, touch = _moments(felt)
    charts = (
        _chart("force", "Force on the hand, vertical", felt, None),
        _chart("push", "The same, in the push", felt, steady),
        _chart("contact", "The same, where contact begins in the poke", felt, touch),
        Chart(
            "off", "Error against the force of every tick", "time / s", "error of the force / N",
            tuple(Series(f.label, f.t, f.held.off) for f in others.values()),
        ),
    )  # fmt: skip
    most = float(np.linalg.norm(reference.held.true, axis=1).max())
    rows: list[tuple[Entry, ...]] = []
    for f in felt.values():
        corrected = f.jumps[f.jumps > 0]
        jumps = (
            (float(corrected.max()), float(np.median(corrected))) if len(corrected) else (0.0,) * 2
        )
        peak = f.held.peak
        rows.append((f.label, f.hz, float(np.abs(f.up).max()), peak, _PERCENT * peak / most,
                     f.held.rms, *jumps, len(corrected)))  # fmt: skip
    table = NumberTable(
        "forces", f"Forces at 1 kHz against the same simulation at every tick, of {most:.3g} N.",
        ("method", "simulation / Hz", "largest force / N", "peak error / N", "of the largest / %",
         "rms error / N", "largest jump / N", "median jump / N", "jumps"), tuple(rows),
        "A jump is the correction of the extrapolated force by a new answer, at the same place.",
    )  # fmt: skip
    words = (
        "The peak error is that of contact: a simulation that reads the tool every 10 ms and "
        "answers 10 ms later detects a contact up to 20 ms late, whatever is extrapolated.",
    )
    return Exhibit("forces", "Force between answers", words, (table,), charts, (shape,))


def _moments(felt: Mapping[str, Felt]) -> tuple[float, float]:
    """Times s: of the steepest rise of the first push, and of the largest error."""
    reference, judged = felt[REFERENCE], felt.get(JUDGED, felt[REFERENCE])
    first = reference.t < reference.t[-1] / 3
    rise = np.gradient(reference.up) * first
    return float(reference.t[np.argmax(rise)]), float(judged.t[np.argmax(judged.held.off)])


def _chart(name: str, title: str, felt: Mapping[str, Felt], around: float | None) -> Chart:
    lines = []
    for f in felt.values():
        seen = np.abs(f.t - around) <= _ZOOM if around is not None else f.t >= 0
        given = f is felt[REFERENCE]
        lines.append(Series(_TRUE if given else f.label, f.t[seen], f.up[seen]))
    return Chart(name, title, "time / s", "force / N", tuple(lines))


def _shape(followed: MethodRun, felt: Felt) -> NodeMap:
    """The body at the output frame of the largest force."""
    run, mesh = followed.run, followed.body.mesh
    k = int(np.argmax(felt.up[run.at]))
    u, force, at = run.u[k], felt.up[run.at[k]], run.t[run.at[k]]
    return NodeMap(
        "pushed", f"The liver under the tool: {force:.3g} N at {at:.3g} s",
        Mesh(mesh.nodes + u, mesh.cells, mesh.kind), _MILLI * np.linalg.norm(u, axis=1), "mm",
        "displacements", "the deformed body",
    )  # fmt: skip


# --- energy ---------------------------------------------------------------------------------------


def _energy_exhibit(felt: Mapping[str, Felt], reference: MethodRun) -> Exhibit:
    stored = float(reference.run.traces["energy.strain"].y.max())
    rows: list[tuple[Entry, ...]] = []
    for f in felt.values():
        h = f.held
        made, least = float(h.created[-1]), h.least
        verdict = "yes" if least >= 0 else f"no: {_MILLI * -least:.3g} mJ given that it never took"
        rows.append((f.label, _MILLI * made, _PERCENT * made / stored, _MILLI * float(h.taken[-1]),
                     _MILLI * least, verdict, h.damper))  # fmt: skip
    table = NumberTable(
        "energy", "Energy of the force that the device keeps constant between ticks, on a "
                  "closed path.",
        ("method", "created / mJ", "of the largest stored / %", "taken at the end / mJ",
         "least taken / mJ", "passive on this path", "damper that dissipates it / N s/m"),
        tuple(rows),
        "Created: energy given to the hand beyond the work of the true force. Taken: work of "
        "the hand; below 0 the device has given more energy than it received. The damper is "
        "the damping of hand or device that would dissipate the created energy.",
    )  # fmt: skip
    charts = (
        Chart("created", "Energy created by the extrapolated force", "time / s", "energy / mJ",
              tuple(Series(f.label, f.t, _MILLI * f.held.created) for f in felt.values())),
        Chart("taken", "Energy taken from the hand", "time / s", "energy / mJ",
              tuple(Series(f.label, f.t, _MILLI * f.held.taken) for f in felt.values()),
              levels=(("passive above", 0.0),)),
    )  # fmt: skip
    words = (
        "A constant force between answers lags behind the hand and creates energy, because it "
        "pushes less on the way in than on the way out. A spring k with period T creates k "
        "v^2 T/2 a second, and three times as much if the answer is a period late. With "
        "linear extrapolation the lag is of third order, but no polynomial predicts begin and "
        "end of contact. If the place of the spring is extrapolated, the force contains the "
        "motion of the hand at once and little energy is created.",
        "'Passive' applies to this path only. Keeping the force constant within a tick also "
        "creates energy, which the damping of the body covers here.",
    )
    return Exhibit("energy", "Energy and passivity", words, (table,), charts)


# --- periods --------------------------------------------------------------------------------------


def _periods_exhibit(reference: Felt) -> Exhibit:
    """The reference's own forces, read every so many ticks: the extrapolation alone."""
    true, dt, smooth = reference.held.true, reference.held.dt, _in_contact(reference)
    rows: list[tuple[Entry, ...]] = []
    lines: list[Series] = []
    within: list[Series] = []
    for name, loop in _EXTRAPOLATIONS.items():
        found, apart = [], []
        for every in PERIODS:
            loops = (replace(loop, every=every, late=wait) for wait in (0, every))
            at_once, late = (
                HeldForce(reference.held.x, one.between_answers(true), true, dt) for one in loops
            )
            found.append(late.rms)
            inside = float(np.sqrt(np.mean(late.off[smooth] ** 2))) if smooth.any() else None
            apart.append(inside or 0.0)
            rows.append((name, _MILLI * every * dt, *_counted(at_once), *_counted(late), inside))
        periods = _MILLI * dt * np.array(PERIODS, dtype=np.float64)
        lines.append(Series(name, periods, np.array(found)))
        if smooth.any():
            within.append(Series(name, periods, np.array(apart)))
    table = NumberTable(
        "periods", "Forces of every tick, sampled less often: answered at once, or a period late.",
        ("extrapolation", "period / ms", "at once: peak / N", "rms / N", "created / mJ",
         "least taken / mJ", "late: peak / N", "late: rms / N", "late: created / mJ",
         "late: least taken / mJ", "late, within a contact: rms / N"), tuple(rows), folded=True,
    )  # fmt: skip
    charts = tuple(
        Chart(name, f"Error of a force that is a period late, {where}", "period / ms",
              "rms error / N", tuple(shown), log="xy")
        for name, where, shown in (("periods", "whole path", lines),
                                   ("smooth", "within the first contact", within))
        if shown
    )  # fmt: skip
    words = (
        "Extrapolation only: the simulation is the same, but is sampled less often. Within a "
        "contact, linear extrapolation gains more at shorter periods. Where the contact "
        "changes, the order of a smooth force is lost and a higher order overshoots.",
    )
    return Exhibit("periods", "Periods", words, (table,), charts)


def _in_contact(felt: Felt) -> NDArray[np.bool_]:
    """Ticks (nt,) of the first contact, without those that extrapolate from before or beyond it."""
    touching = np.linalg.norm(felt.held.true, axis=1) > 0
    begin = int(np.argmax(touching))
    over = np.flatnonzero(~touching[begin:])
    end = begin + int(over[0]) if len(over) else len(touching)
    k = np.arange(len(touching))
    return np.asarray((k >= begin + 4 * max(PERIODS)) & (k < end))


def _counted(held: HeldForce) -> tuple[float, ...]:
    return held.peak, held.rms, _MILLI * float(held.created[-1]), _MILLI * held.least


# --- ticks ----------------------------------------------------------------------------------------


def _ticks_exhibit(tree: Tree, reference: MethodRun) -> Exhibit:
    """The live loop along the path, against the clock: quantiles of its ticks."""
    scene, seen = reference.body, reference.seen
    given = sets(tree, seen)
    system = build_system(scene)
    path = RecordedPath(seen.t, seen.inputs + np.array(scene.tools[0].tip))
    rows: list[tuple[Entry, ...]] = []
    for name, loop in _LIVE.items():
        done = path.live(replace(loop, **given).prepare(system), _LIVE_SECONDS)
        rows.append(_lived_row(name, TickTimes(done.late), TickTimes(done.work), given["dt"]))
    quantiles = tuple(f"{_PERCENT * q:g} %" for q in TickTimes.shares)
    table = NumberTable(
        "live", f"Ticks of the live loop along the path, paced at {1 / given['dt']:.4g} Hz.",
        ("loop", "ticks", "missed / %", *(f"late {q} / us" for q in quantiles), "latest / us",
         *(f"work {q} / us" for q in quantiles), "longest work / us"),
        tuple(rows),
        "Late: time from the due time of a tick to its force. Missed: later than the due time "
        "of the next tick. A recorded path skips no sample, so one long tick delays the next "
        "ones.",
    )  # fmt: skip
    return Exhibit(
        "live", "Timing of the live loop", (_pace(scene, reference, given["dt"]),), (table,)
    )


def _lived_row(name: str, late: TickTimes, work: TickTimes, dt: float) -> tuple[Entry, ...]:
    times = (_MICRO * q for q in (*late.quantiles, *work.quantiles))
    count = len(late.seconds)
    return (name, count, _PERCENT * late.missed(dt) / count, *times)


def _pace(scene: Scene, reference: MethodRun, dt: float) -> str:
    """What a tick of simulation takes, beside its step and the critical one."""
    run = reference.run
    assert run.seconds is not None
    substeps = float(np.median(run.traces["updates"].y))
    critical = CriticalStep.of(build_system(replace(scene, tools=()))).lanczos
    seconds = float(np.median(run.seconds))
    times = RealTime(substeps / seconds, dt / substeps, critical)
    return (
        f"A tick of {_MILLI * dt:.3g} ms is {substeps:.0f} explicit steps of "
        f"{_MICRO * times.dt:.3g} us ({times.ratio:.2f} of the critical step) on "
        f"{len(scene.mesh.cells)} tetrahedra and takes {_MILLI * seconds:.2g} ms: "
        f"{times.factor:.2g} times real time, on this machine and its load. Below 1 no "
        "extrapolation helps, because the simulated tissue is slower than real time. The "
        "median tick of a slower simulation is only an extrapolation. The paper's rates are "
        "steps a second without their step."
    )
