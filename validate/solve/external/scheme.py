"""External simulator as a scheme: writes a job, reads the answer, checks both.

Release of a body in an external simulator: vibration by one job, final rest by another.
"""

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import ClassVar, cast

import numpy as np
from scipy.interpolate import CubicSpline

from validate.arrays import Floats, Ints
from validate.errors import SceneError, UsageError
from validate.fem.assembly.locate import probe_rows
from validate.parameters import quantity
from validate.scene.material import Prony
from validate.scene.scene import Scene
from validate.solve.dynamic.release import joined
from validate.solve.external.exchange import (
    ExternalAnswer,
    ExternalJob,
    NoAnswerError,
    read_answer,
    write_job,
)
from validate.solve.external.program import Ended, Limits, run_program, size_of, words
from validate.solve.handles import LARGE, Handles, require_handled
from validate.solve.march import given_traces, probe_traces, step_times
from validate.solve.types import Ending, Outcome, Run, Trace

# --- Requested times, and the run at all times from the answers at these.
#
# An elastic body in equilibrium knows its inputs and no history, so that statics need not be
# asked again where the inputs are the same, nor everywhere where one input alone changes.


@dataclass(frozen=True)
class Asked:
    """Times t (k,) s with inputs (k, l), and what makes their run one of all times."""

    t: Floats
    inputs: Floats
    answered: Callable[[Run], Run]


def plain_questions(t: Floats, inputs: Floats) -> Asked:
    """Every time."""
    return Asked(t, inputs, lambda run: run)


def changes(t: Floats, inputs: Floats) -> Asked:
    """Return the times at t (nt,) s whose inputs (nt, l) are others than before."""
    new = np.concatenate([[True], np.any(np.diff(inputs, axis=0) != 0, axis=1)])[: len(t)]
    kept = np.flatnonzero(new)
    return Asked(t[kept], inputs[kept], lambda run: _repeated(run, kept, t))


def _repeated(run: Run, kept: Ints, t: Floats) -> Run:
    """Each time with the last answer before it; one that gave up ends before the next."""
    upto = len(t) if len(run.t) == len(kept) else int(kept[len(run.t)])
    of = np.searchsorted(kept, np.arange(upto), side="right") - 1
    traces = {name: replace(trace, y=trace.y[of]) for name, trace in run.traces.items()}
    return _at_all(run, t[:upto], run.u[of], traces)


def at_levels(t: Floats, inputs: Floats, levels: int) -> Asked:
    """Even levels from 0 to the input (nt, 1) of the largest size, and splines through them."""
    y = inputs[:, 0]
    peak, other = float(y[np.argmax(np.abs(y))]), float(np.min(y * np.sign(np.sum(y))))
    if peak == 0 or other < -abs(peak) / levels:  # to both sides: no one path to the largest
        return changes(t, inputs)
    grid = peak * np.arange(1, levels + 1) / levels
    return Asked(np.arange(1.0, levels + 1), grid[:, None], lambda run: _between(run, grid, t, y))


def _between(run: Run, grid: Floats, t: Floats, y: Floats) -> Run:
    """Splines of fields and traces through the levels, through nothing at 0; up to the first time
    beyond what was reached."""
    reached = grid[: len(run.t)]
    if not len(reached):
        return run
    sign = np.sign(reached[-1])
    beyond = np.abs(y) > np.abs(reached[-1]) * (1 + 1e-9)
    upto = int(np.argmax(beyond)) if beyond.any() else len(t)
    at, knots = sign * y[:upto], np.concatenate([[0.0], np.abs(reached)])

    def spline(values: Floats) -> Floats:
        through = np.concatenate([np.zeros((1, *values.shape[1:])), values])
        return np.asarray(CubicSpline(knots, through)(at))

    traces = {n: replace(trace, y=spline(trace.y)) for n, trace in run.traces.items()}
    words = f"solved at {len(grid)} levels of its input, with splines between them"
    run = replace(run, said=(*run.said, words))
    return _at_all(run, t[:upto], spline(run.u), traces)


def _at_all(run: Run, t: Floats, u: Floats, traces: Mapping[str, Trace]) -> Run:
    outcome = replace(run.outcome, step=len(t))
    return replace(
        run, t=t, at=np.arange(len(t)), u=u, traces=traces, outcome=outcome, seconds=None
    )


def at_rest(scene: Scene) -> Scene:
    """Return the scene whose stress has relaxed, where its statics stand for that."""
    material = getattr(scene, "material", None)
    if material is None or material.prony.statics != "relaxed":
        return scene
    return replace(scene, material=replace(material, prony=Prony()))


# -------------------------------------------------------------------------------------------------

_FOLDER = "validate-external-"


@dataclass(frozen=True)
class ExternalSimulator:
    """Settings of an external simulator, called as `command FOLDER`.

    docs/how-to/external-simulators.md describes its files.

    The outcome of the run reports an unsupported scene, a missing program, a crash, a time-out and
    a wrong answer. In statics a Prony series becomes its relaxed limit. A time whose inputs equal
    those of the previous time is not requested again. With `levels` the job has so many even levels
    of one input in place of all times.
    """

    handles: ClassVar[Handles] = Handles(
        ("linear", *LARGE), inertia=True, cavities=False, contact=()
    )
    command: str = quantity(
        "", "1", "command line of the external simulator; the folder of the job is appended to it"
    )
    inertia: bool = quantity(
        False, "1", "inertia is included; otherwise every time is an equilibrium"
    )
    levels: int = quantity(
        0,
        "1",
        "levels of the one static input that are solved, with splines between them; 0: every time",
    )
    tolerance: float = quantity(1e-6, "1", "relative tolerance requested for its equations")
    seconds: float = quantity(600.0, "s", "wall time after which it is stopped")
    memory: float = quantity(8192.0, "1", "memory limit of each of its processes, MB")
    output: float = quantity(1024.0, "1", "limit of the data written into its folder, MB")

    def solve(self, scene: Scene, t: Floats, inputs: Floats) -> Run:
        """Under inputs (nt, k) at t (nt,) s, from rest at 0 s; refused where a job does not carry
        the scene, or there is no such program."""
        try:
            return self._asked(scene if self.inertia else at_rest(scene), t, inputs)
        except (SceneError, UsageError) as error:
            traces = {"updates": Trace(np.zeros(0), "1")}
            none = np.zeros(0)
            return Run("", none, none.astype(np.int64), np.zeros((0, 0, 3)), traces,
                       Outcome("refused", 0, f"cannot run: {error}"), 0.0, None)  # fmt: skip

    def _asked(self, scene: Scene, t: Floats, inputs: Floats) -> Run:
        require_handled(scene, self)
        command = words(self.command)
        with tempfile.TemporaryDirectory(prefix=_FOLDER, ignore_cleanup_errors=True) as place:
            folder = Path(place).resolve()
            if self.inertia:
                asked = plain_questions(t, inputs)
            elif self.levels and inputs.shape[1] == 1:
                asked = at_levels(t, inputs, self.levels)
            else:
                asked = changes(t, inputs)
            job = write_job(folder, scene, asked.t, asked.inputs, self.inertia, self.tolerance)
            most = size_of(folder) + int(self.output * 2**20)
            limits = Limits(self.seconds, int(self.memory * 2**20), most)
            ended = run_program(command, folder, limits)
            return asked.answered(run_of(folder, job, ended))


def run_of(folder: Path, job: ExternalJob, ended: Ended) -> Run:
    """Return a run of what came back, or one without steps that says why there is none."""
    if ended.why:
        return _none(job, "invalid", f"{ended.why}{ended.said and ': '}{ended.said}", ended)
    try:
        answer = read_answer(folder, job)
    except NoAnswerError as error:
        return _none(job, "invalid", str(error), ended)
    if answer.state == "cannot_run":
        return _none(job, "refused", f"cannot run: {answer.why}", ended, answer.findings)
    u, steps = answer.u, len(answer.u)
    said = [f"external: {answer.name}", *answer.findings]
    # Its own times are believed as far as they fit into the time that it took.
    told = answer.setup_s + (0.0 if answer.step_s is None else float(answer.step_s.sum()))
    if told > ended.seconds:
        said.append(f"reports that it took {told:.3g} s, but ran for {ended.seconds:.3g} s")
    return Run(
        "", job.times[:steps], np.arange(steps), u, _traces(job, answer),
        Outcome(cast(Ending, answer.state), steps, answer.why), answer.setup_s,
        step_times(answer.step_s), seconds=answer.step_s, said=tuple(said),
        memory=ended.memory,
    )  # fmt: skip


def _none(
    job: ExternalJob, state: Ending, why: str, ended: Ended, said: tuple[str, ...] = ()
) -> Run:
    shape = job.scene.mesh.nodes.shape
    traces = {"updates": Trace(np.zeros(0), "1")}
    at = np.zeros(0, dtype=np.int64)
    return Run("", job.times[:0], at, np.zeros((0, *shape)), traces, Outcome(state, 0, why),
               ended.seconds, None, said=said, memory=ended.memory)  # fmt: skip


def _traces(job: ExternalJob, answer: ExternalAnswer) -> dict[str, Trace]:
    """Inputs and probes; `<drive>.force` N of the whole body, compression positive, where told."""
    scene, steps = job.scene, len(answer.u)
    traces = {"updates": Trace(np.zeros(steps), "1")}
    traces |= given_traces(scene, job.inputs[:steps])
    if answer.reactions is not None:
        forces = scene.copies * answer.reactions.reshape(steps, len(job.system.moves))
        for drive, moves in zip(scene.drives, job.system.moves.T, strict=True):
            traces[f"{drive.name}.force"] = Trace(forces @ moves, scene.force_unit)
    if scene.probes:
        rows = probe_rows(scene.mesh, scene.probes)
        seen = np.array([rows.apply(field) for field in answer.u])
        traces |= probe_traces(scene, seen.reshape(steps, len(scene.probes), 3))
    return traces


@dataclass(frozen=True)
class ExternalLetGo(ExternalSimulator):
    """Settings as of `LetGo`: even steps of time, then statics at the last instant."""

    def solve(self, scene: Scene, t: Floats, inputs: Floats) -> Run:
        """Return the run under inputs (nt, k) at t (nt,) s; refused as by `ExternalSimulator`."""
        plain = ExternalSimulator(
            **{f.name: getattr(self, f.name) for f in fields(ExternalSimulator)}
        )
        moving = replace(plain, inertia=True).solve(scene, t[:-1], inputs[:-1])
        if not moving.finished:
            return moving
        still = replace(plain, inertia=False).solve(at_rest(scene), t[-1:], inputs[-1:])
        both = joined(moving, still, t)
        said = dict.fromkeys((*both.said, *(f"at rest: {w}" for w in still.said[1:])))
        return replace(both, said=tuple(said), memory=max(moving.memory, still.memory))
