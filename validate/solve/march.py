"""Time loop of all schemes: steps, timing, traces, and stop at a failed step."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from time import perf_counter

import numpy as np

from validate.arrays import Floats, Ints
from validate.errors import ComparisonError
from validate.fem.assembly.locate import Rows, probe_rows
from validate.fem.system import build
from validate.scene.meshless import AnyScene
from validate.scene.scene import Load, Pressure, Scene, Weight
from validate.solve.handles import require_handled
from validate.solve.types import (
    Listening,
    Noticing,
    Outcome,
    Run,
    SceneSolver,
    Scheme,
    Smoothing,
    State,
    Stepper,
    StepTimes,
    Trace,
    Uncertain,
)

_UNTIMED = 20  # first steps left out of the step times: caches and allocators settle
_TOLD = 100  # times in a run that a step is told of: what is told costs time between the steps
_AXES = "xyz"
_GIVEN = {Load: ("force", "N"), Weight: ("acceleration", "m/s^2"), Pressure: ("pressure", "Pa")}
RUNAWAY = 100.0  # body sizes: a displacement beyond has left all bounds

Tell = Callable[[str], None]  # what is being done, in words


def _untold(_: str) -> None:
    pass


def run_scheme(
    name: str,
    settings: Scheme | SceneSolver,
    scene: AnyScene,
    t: Floats,
    inputs: Floats,
    at: Ints,
    tell: Tell = _untold,
    points: Rows | None = None,
) -> Run:
    """Return a run by what steps through a scene, or by what solves it as a whole.

    Raises `SceneError` for what the settings cannot handle.
    """
    if isinstance(settings, SceneSolver):
        whole = settings.solve(scene, t, inputs)
        kept = np.isin(whole.at, at)
        sd = None if whole.sd is None else whole.sd[kept]
        x = None if points is None else np.array([points.apply(u) for u in whole.u])
        return replace(whole, method=name, at=whole.at[kept], u=whole.u[kept], sd=sd, points=x)
    require_handled(scene, settings)
    assert isinstance(scene, Scene)
    start = perf_counter()
    stepper = settings.prepare(build(scene))
    return march(name, stepper, t, inputs, at, perf_counter() - start, tell, points)


def march(
    method: str,
    stepper: Stepper,
    t: Floats,
    inputs: Floats,
    at: Ints,
    setup_s: float,
    tell: Tell = _untold,
    points: Rows | None = None,
) -> Run:
    """Step through inputs (nt, k) at times t (nt,) s; keeps full fields at the steps `at`, and the
    displacements of `points` at every step.

    `tell` is given the step, now and then.

    Inputs are drives in m, then loads in N, m/s^2 or Pa. Inputs, the numbers of the states and the
    scene's probes are traced at every step. A filter that smooths is stepped twice and has no
    times: it is none for real time.
    """
    if len(t) == 0 or len(at) == 0:
        raise ComparisonError(
            f"{method}: {len(t)} steps and {len(at)} output frames; both must be above 0"
        )
    smooths = isinstance(stepper, Smoothing) and stepper.smooth
    frames = frozenset(at.tolist())
    shown = _smoothed(stepper, inputs, frames) if smooths else lambda state: state
    walk, outcome = _walk(stepper, inputs, frames, tell, shown, points)
    if outcome.state == "finished" and isinstance(stepper, Listening):
        # A filter that no measurement reached is its model under another name.
        why = stepper.unheard(walk.numbers)
        outcome = Outcome("invalid", outcome.step, why) if why else outcome
    done = len(walk.updates)
    traces = {"updates": Trace(np.array(walk.updates, dtype=np.float64), "1")}
    traces |= given_traces(stepper.scene, inputs[:done])
    for name, unit in stepper.units.items():
        traces[name] = Trace(np.array([numbers[name] for numbers in walk.numbers]), unit)
    # `<set>.force.<axis>` N of sets that follow tracked points: the sum over the points
    scene = stepper.scene
    totals = {}
    for part in scene.tracked:
        for c, axis in enumerate(_AXES[: part.places.shape[1]]):
            of = [traces.get(f"{name}.force") for name in part.inputs[c :: part.places.shape[1]]]
            forces = [trace.y for trace in of if trace is not None]
            if forces:
                totals[f"{part.name}.force.{axis}"] = Trace(np.sum(forces, axis=0), "N")
    traces |= totals
    traces |= probe_traces(stepper.scene, np.array(walk.probes))
    for name, trace in traces.items():
        if trace.unit == "N":  # the unit that the scene has for forces: schemes know numbers alone
            traces[name] = replace(trace, unit=stepper.scene.force_unit)
    seconds = None if smooths else np.array(walk.seconds)[:done]
    times = step_times(seconds)
    u = np.array(walk.fields).reshape(-1, *stepper.scene.mesh.nodes.shape)
    sd = np.array(walk.sd).reshape(u.shape) if isinstance(stepper, Uncertain) else None
    at = at[at < done]
    # (nt, p, d), of no steps too
    x = (
        None
        if points is None
        else np.array(walk.points).reshape(done, points.weights.shape[0], u.shape[2])
    )
    return Run(
        method, t[:done], at, u, traces, outcome, setup_s, times, sd, seconds, tuple(walk.said),
        points=x,
    )  # fmt: skip


@dataclass(frozen=True)
class _Kept:
    """What is kept of the steps: numbers, seconds, probes (p, d) m, fields at the frames, words."""

    updates: list[int] = field(default_factory=list)
    numbers: list[Mapping[str, float]] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    probes: list[Floats] = field(default_factory=list)
    points: list[Floats] = field(default_factory=list)
    fields: list[Floats] = field(default_factory=list)
    sd: list[Floats] = field(default_factory=list)
    said: list[str] = field(default_factory=list)


def _smoothed(stepper: Stepper, inputs: Floats, at: frozenset[int]) -> Callable[[State], State]:
    """The first of two walks, whose measurements say what the second one shows of every step."""
    assert isinstance(stepper, Smoothing)
    notes, state = [], stepper.rest()
    for i, value in enumerate(inputs):
        state = stepper.step(state, value)
        if state.failure:
            break
        notes.append(stepper.note(state, i in at))
    return stepper.smoother(notes)


def _walk(
    stepper: Stepper,
    inputs: Floats,
    at: frozenset[int],
    tell: Tell,
    shown: Callable[[State], State],
    points: Rows | None,
) -> tuple[_Kept, Outcome]:
    scene, walk, state = stepper.scene, _Kept(), stepper.rest()
    rows = probe_rows(scene.mesh, scene.probes) if scene.probes else None
    often = -(-len(inputs) // _TOLD)
    # Asked once: of a protocol with data the answer takes as long as a small step.
    noticing = stepper if isinstance(stepper, Noticing) else None
    uncertain = stepper if isinstance(stepper, Uncertain) else None
    filtering = isinstance(stepper, Listening | Uncertain)  # schemes know their own limits
    for i, value in enumerate(inputs):
        if i % often == 0:
            tell(f"step {i + 1} of {len(inputs)}")
        start = perf_counter()
        try:
            state = stepper.step(state, value)
        except np.linalg.LinAlgError as singular:
            return walk, Outcome("diverged", i, f"a matrix became singular: {singular}")
        walk.seconds.append(perf_counter() - start)
        if noticing:
            walk.said.extend(w for w in noticing.notices(state) if w not in walk.said)
        if state.failure:
            return walk, Outcome(state.failure[0], i, state.failure[1])
        seen = shown(state)
        if filtering and (why := _run_away(stepper, seen, rows, shown=i in at)):
            return walk, Outcome("diverged", i, why)
        walk.updates.append(seen.updates)
        walk.numbers.append(seen.numbers)
        if rows is not None:
            walk.probes.append(rows.apply(stepper.field(seen)))
        if points is not None:
            walk.points.append(points.apply(stepper.field(seen)))
        if i in at:
            walk.fields.append(stepper.field(seen))
            if uncertain:
                walk.sd.append(uncertain.sd(seen))
    return walk, Outcome("finished", len(inputs))


def _run_away(stepper: Stepper, state: State, rows: Rows | None, *, shown: bool) -> str:
    """Why a filter's displacements at the probes, or at every node where a field is kept, are no
    result."""
    if rows is None and not shown:
        return ""
    u = stepper.field(state)
    found = float(np.abs(u if shown or rows is None else rows.apply(u)).max())
    size = float(np.ptp(stepper.scene.mesh.nodes, axis=0).max())
    if found <= RUNAWAY * size:
        return ""
    words = "not a finite number" if not np.isfinite(found) else f"{found:.3g} m"
    return f"a displacement of {words}, above {RUNAWAY:g} times the body's {size:.3g} m"


def given_traces(scene: Scene, inputs: Floats) -> dict[str, Trace]:
    """`<drive>.displacement` m, `<load>.force` N (with `per_node` that at each node, else the
    total), `<weight>.acceleration` m/s^2, `<pressure>.pressure` Pa, of a rigid body
    `<contact>.displacement` m, and `<needle>.x`.. m of its tip."""
    traces = {
        f"{d.name}.displacement": Trace(y, "m")
        for d, y in zip(scene.drives, inputs.T, strict=False)
    }
    for load, y in zip(scene.loads, inputs.T[len(scene.drives) :], strict=False):
        kind, unit = _GIVEN[type(load)]
        traces[f"{load.name}.{kind}"] = Trace(y, unit)
    paths = [name for tool in scene.tools for name in tool.inputs]
    columns = inputs.T[: inputs.shape[1] - len(paths)]
    traces |= {name: Trace(y, "m") for name, y in zip(paths, inputs.T[len(columns) :], strict=True)}
    for mover, y in zip(scene.movers[::-1], columns[::-1], strict=False):
        traces[f"{mover.name}.displacement"] = Trace(y, "m")
    return traces


def probe_traces(scene: Scene, values: Floats) -> dict[str, Trace]:
    """`<probe>.x`, `.y`, `.z` m of the scene's probes, from their displacements (nt, p, d) m."""
    probes, d = scene.probes, scene.mesh.dimension
    u = values.reshape(len(values), len(probes), d)
    return {
        f"{probe.name}.{_AXES[c]}": Trace(u[:, j, c], "m")
        for j, probe in enumerate(probes)
        for c in range(d)
    }


def output_frames(steps: int, frames: int) -> Ints:
    """Evenly spaced steps whose fields are kept, the last one among them."""
    return np.unique(np.linspace(0, steps - 1, min(frames, steps)).round().astype(np.int64))


def step_times(seconds: Floats | None) -> StepTimes | None:
    """Of steps that took (nt,) s, without the first ones; None where none was timed."""
    if seconds is None or not len(seconds):
        return None
    seconds = seconds[_UNTIMED if len(seconds) > 2 * _UNTIMED else 0 :]
    p50, p99 = np.quantile(seconds, [0.5, 0.99])
    return StepTimes(float(p50), float(p99), float(seconds.max()), len(seconds))
