"""The loop over steps: counts, traces, output frames, and runs that end early."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import count

import numpy as np
import pytest
from phantoms import COARSE_GRID, phantom_responses

from validate.errors import ComparisonError, ValidateError
from validate.fem.system import Responses
from validate.scene.geometries.box import box
from validate.scene.material import Material
from validate.scene.scene import Drive, Scene, Support
from validate.solve import march as march_module
from validate.solve.fluid.cavities import ExactPressure, NoFluid
from validate.solve.fluid.pressure_loop import PressureLoop
from validate.solve.march import march, run_scheme
from validate.solve.types import Run, State, Stepper, Trace

STEPS = 60
T = np.linspace(0, 6, STEPS)
DRIVES = np.linspace(0, 0.009, STEPS)[:, None]
AT = np.array([0, 20, 40, 59])


@pytest.fixture(scope="module")
def coarse() -> Responses:
    return phantom_responses(COARSE_GRID)


@dataclass(frozen=True)
class Breaks:
    """A stepper that fails from one step on."""

    inner: Stepper
    at: float  # m of the first drive

    @property
    def scene(self) -> Scene:
        return self.inner.scene

    def field(self, state: State) -> np.ndarray:
        return self.inner.field(state)

    @property
    def units(self) -> Mapping[str, str]:
        return self.inner.units

    def rest(self) -> State:
        return self.inner.rest()

    def step(self, state: State, drives: np.ndarray) -> State:
        new = self.inner.step(state, drives)
        return replace(new, failure=("diverged", "as asked")) if drives[0] > self.at else new


def test_finished_run(coarse: Responses) -> None:
    run = march("exact", ExactPressure().on(coarse), T, DRIVES, AT, 1.5)
    assert run.finished
    assert (run.method, run.outcome.state, run.outcome.step) == ("exact", "finished", STEPS)
    assert run.setup_s == 1.5
    assert np.array_equal(run.t, T)
    assert np.array_equal(run.at, AT)
    assert run.u.shape == (4, len(coarse.scene.mesh.nodes), 3)
    assert sorted(run.traces) == [
        "cyst.pressure",
        "cyst.volume_ratio",
        "stage.displacement",
        "stage.force",
        "updates",
    ]
    assert all(len(trace.y) == STEPS for trace in run.traces.values())
    units = {name: trace.unit for name, trace in run.traces.items()}
    assert units["cyst.pressure"] == "Pa"
    assert units["stage.force"] == "N"
    assert units["stage.displacement"] == "m"


def test_traces_and_fields_are_those_of_single_steps(coarse: Responses) -> None:
    stepper = ExactPressure().on(coarse)
    run = march("exact", stepper, T, DRIVES, AT, 0.0)
    for frame, step in enumerate(AT):
        alone = stepper.step(stepper.rest(), DRIVES[step])
        assert run.traces["cyst.pressure"].y[step] == pytest.approx(
            alone.numbers["cyst.pressure"], abs=1e-7
        )
        force = float((coarse.reactions @ alone.inner.z)[0])
        assert run.traces["stage.force"].y[step] == pytest.approx(force, abs=1e-12)
        u = np.tensordot(alone.inner.z, coarse.fields, 1)
        assert run.u[frame] == pytest.approx(u, abs=1e-14)
    assert np.array_equal(run.traces["stage.displacement"].y, DRIVES[:, 0])
    assert run.traces["cyst.volume_ratio"].y == pytest.approx(1.0, abs=1e-13)
    assert run.traces["stage.force"].y[-1] > 0


def test_each_step_starts_from_the_last_state(coarse: Responses) -> None:
    stepper = PressureLoop(tolerance=1e-3).on(coarse)
    run = march("loop", stepper, T, DRIVES, AT, 0.0)
    state, updates = stepper.rest(), []
    for drives in DRIVES:
        state = stepper.step(state, drives)
        updates.append(state.updates)
    assert run.traces["updates"].y.tolist() == updates
    assert run.traces["cyst.pressure"].y[-1] == state.numbers["cyst.pressure"]


def test_run_that_breaks_keeps_what_was_done(coarse: Responses) -> None:
    broken = Breaks(ExactPressure().on(coarse), 0.0045)
    run = march("broken", broken, T, DRIVES, AT, 0.0)
    whole = march("whole", broken.inner, T, DRIVES, AT, 0.0)
    done = 30
    assert not run.finished
    assert (run.outcome.state, run.outcome.step, run.outcome.why) == ("diverged", done, "as asked")
    assert np.array_equal(run.t, T[:done])
    assert run.at.tolist() == [0, 20]
    assert run.seconds is not None
    assert run.seconds.shape == (done,)
    assert np.array_equal(run.u, whole.u[:2])
    for name, trace in run.traces.items():
        assert np.array_equal(trace.y, whole.traces[name].y[:done])


def test_run_that_breaks_at_once_is_empty_but_whole(coarse: Responses) -> None:
    run = march("broken", Breaks(NoFluid().on(coarse), -1.0), T, DRIVES, AT, 0.0)
    assert (run.outcome.state, run.outcome.step) == ("diverged", 0)
    assert run.t.shape == (0,)
    assert run.u.shape == (0, len(coarse.scene.mesh.nodes), 3)
    assert all(len(trace.y) == 0 for trace in run.traces.values())
    assert run.step_s is None  # the time of a step that failed is no step time


@pytest.mark.parametrize(
    ("steps", "frames", "message"),
    [(0, 1, "empty: 0 steps and 1 output frames"), (3, 0, "empty: 3 steps and 0 output frames")],
)
def test_empty_schedule_is_refused(
    coarse: Responses, steps: int, frames: int, message: str
) -> None:
    stepper = NoFluid().on(coarse)
    with pytest.raises(ComparisonError, match=message):
        march("empty", stepper, T[:steps], DRIVES[:steps], AT[:frames], 0.0)


@pytest.mark.parametrize(("steps", "timed"), [(1, 1), (40, 40), (41, 21), (60, 40)])
def test_first_steps_are_left_out_of_the_times(coarse: Responses, steps: int, timed: int) -> None:
    run = march("dry", NoFluid().on(coarse), T[:steps], DRIVES[:steps], AT[:1], 0.0)
    assert run.step_s is not None
    assert run.step_s.n == timed
    assert 0 < run.step_s.p50 <= run.step_s.p99 <= run.step_s.max
    assert run.step_s.rate_hz == 1 / run.step_s.p50


def test_run_and_traces_are_read_only_and_checked(coarse: Responses) -> None:
    run = march("dry", NoFluid().on(coarse), T, DRIVES, AT, 0.0)
    for array in (run.t, run.u, run.traces["updates"].y):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0
    with pytest.raises(TypeError):
        run.traces["updates"] = run.traces["stage.force"]  # type: ignore[index]
    with pytest.raises(ValidateError, match="trace: 1 of 2 values not finite"):
        Trace(np.array([0.0, np.nan]), "1")
    with pytest.raises(ValidateError, match=r"u \[m\]: shape \(4, \d+, 3\), .* \(2,"):
        Run("m", run.t, AT[:2], run.u, run.traces, run.outcome, 0.0, None)


def test_set_up_is_timed_from_the_scene_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """By a clock that moves on by a second at every look."""
    monkeypatch.setattr(march_module, "perf_counter", count(100.0).__next__)
    scene = Scene(
        box((1.0, 1.0, 1.0), (1, 1, 1)), Material(1e4, 0.3), (Support("z0", (0, 1, 2)),),
        drives=(Drive("press", "z1", (0.0, 0.0, -1.0)),),
    )  # fmt: skip
    t = np.array([1.0, 2.0])
    run = run_scheme("x", NoFluid(), scene, t, np.zeros((2, 1)), np.array([1]))
    assert run.setup_s == 1.0


@dataclass(frozen=True)
class Runs(Breaks):
    """A filter that goes on, but whose nodes are far away from one step on."""

    far: float = 0.0  # m

    def unheard(self, numbers: object) -> str:
        return ""

    def field(self, state: State) -> np.ndarray:
        return self.inner.field(state) + (self.far if state.numbers.get("far") else 0.0)

    def step(self, state: State, drives: np.ndarray) -> State:
        new = self.inner.step(state, drives)
        return replace(new, numbers={**new.numbers, "far": float(drives[0] > self.at)})


@pytest.mark.parametrize(("far", "words"), [(6e5, "6e+05 m"), (np.nan, "not a finite number")])
def test_a_state_that_runs_away_has_diverged(coarse: Responses, far: float, words: str) -> None:
    """Six hundred kilometres are no result: the run was called finished."""
    run = march("far", Runs(NoFluid().on(coarse), 0.003, far), T, DRIVES, AT, 0.0)
    assert run.outcome.state == "diverged"
    assert f"a displacement of {words}, above 100 times the body's 0.07 m" in run.outcome.why
    assert np.isfinite(run.u).all()
    assert len(run.u) == 1 + (run.outcome.step > 20)


@dataclass(frozen=True)
class Singular(Breaks):
    def step(self, state: State, drives: np.ndarray) -> State:
        if drives[0] > self.at:
            raise np.linalg.LinAlgError("S_yy (3, 3) is not positive definite")
        return self.inner.step(state, drives)


def test_a_matrix_that_becomes_singular_ends_the_run_with_the_reason(coarse: Responses) -> None:
    run = march("singular", Singular(NoFluid().on(coarse), 0.003), T, DRIVES, AT, 0.0)
    assert run.outcome.state == "diverged"
    assert run.outcome.why == "a matrix became singular: S_yy (3, 3) is not positive definite"
    assert len(run.t) == run.outcome.step > 0
