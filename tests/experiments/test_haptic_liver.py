"""A tool on the liver of paper 003, section 3.5: body, path, what is told, live and replayed."""

import os
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from beside import beside
from beside import experiment as shipped_experiment

from experiments.ekf_liver.body import LiverBody, generated_liver
from validate.arrays import Floats
from validate.errors import RecordingError, SceneError
from validate.parameters import with_given
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.options import Options
from validate.pipeline.live import RecordedPath, live, prepared, written
from validate.pipeline.live.clock import _first_too
from validate.pipeline.run.pipeline import compare
from validate.recording.mcap.read import read_recording
from validate.recording.mcap.write import write_recording
from validate.recording.types import Markers, Recording, Source
from validate.scene.mesh import Mesh
from validate.scene.mesh_files.mesh_file import write_mesh
from validate.solve.haptic.loop import HapticStepper

# private: _LIVE_SECONDS: replaced by a small number: a short test.
# private: _first_too: asks the system for a priority: not in a test.

TWIN = beside("haptic_liver", "twin")
STOPS, ToolPath = TWIN.STOPS, TWIN.ToolPath
follows, place, touched_place, way = TWIN.follows, TWIN.place, TWIN.touched_place, TWIN.way


def silent(_: str) -> None:
    pass


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """What sets a coarse body and 0.6 s of its path."""
    file = tmp_path_factory.mktemp("liver") / "small.npz"
    write_mesh(generated_liver((5, 4, 3)), file)
    return {"body.body": "data", "body.file": str(file), "path.seconds": "0.6"}


@cache
def mesh() -> Mesh:
    made: Mesh = TWIN.touchable(LiverBody("generated").resolved(Path()))
    return made


def experiment() -> Experiment:
    return shipped_experiment("haptic_liver")


class Turned:
    """A clock that stands until it is waited for."""

    now = 0.0

    def __call__(self) -> float:
        return self.now

    def wait(self, seconds: float) -> None:
        self.now += seconds


# --- body and path --------------------------------------------------------------------------------


def test_all_of_the_surface_may_be_touched_but_what_is_held() -> None:
    sets = mesh().facets
    assert len(sets["surface"]) + len(sets["held"]) == len(mesh().surface)
    both = {tuple(sorted(f)) for f in sets["surface"].tolist()}
    assert not both & {tuple(sorted(f)) for f in sets["held"].tolist()}
    at = touched_place(mesh())
    assert at[2] > 0.6 * mesh().nodes[:, 2].max()


def test_the_hand_ends_where_it_began_and_goes_as_deep_as_it_says() -> None:
    above = np.array([0.01, 0.02, 0.05])
    t, x = way(ToolPath(tremor=0.0), above)
    assert x[0] == pytest.approx(x[-1], abs=2e-9)
    assert x[0, 2] - above[2] == pytest.approx(0.003, abs=2e-9)
    assert above[2] - x[:, 2].min() == pytest.approx(0.006, abs=2e-9)
    assert np.diff(t) == pytest.approx(1e-3)
    assert t[-1] == STOPS[-1][0]
    shaken = way(ToolPath(tremor=2e-5), above)[1] - x
    assert 1e-5 < shaken.std() < 3e-5
    assert len(way(ToolPath(seconds=0.5), above)[0]) == 501


@pytest.mark.parametrize("wrong", [{"depth": 0.0}, {"rate": -1.0}, {"seconds": 3.0}])
def test_a_path_that_cannot_be_walked_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(SceneError, match="tool path"):
        way(replace(ToolPath(), **wrong), np.zeros(3))


def test_the_shipped_recording_is_the_twin_of_the_generated_body(project_root: Path) -> None:
    shipped = read_recording(project_root / "recordings" / "haptic_liver.mcap")
    p = experiment().parameters
    t, x = way(p.settings.path, touched_place(mesh()))
    tip = np.hstack([shipped.signals[f"tip.{a}"].y for a in "xyz"])
    assert tip == pytest.approx(x, abs=1e-12)
    force = shipped.signals["force.z"]
    assert force.t == pytest.approx(t[::5])
    assert 2.5 < force.y.max() < 3.5
    file = project_root / "recordings" / "haptic_liver.mcap"
    other = with_given(p, {"body.body": "data", "recording": str(file)})
    with pytest.raises(RecordingError, match=r"body\.body=generated"):
        experiment().load(other, TWIN.FOLDER)


def _path(x: Floats, t: Floats) -> Recording:
    tip = Markers(t, ("tip",), x[:, None], 1e-5, "liver")
    return Recording("own", Source("own", "", 0, ""), 1, markers={"tip": tip})


def test_a_path_of_ones_own_sets_the_tick_and_says_what_was_left_out(small: dict[str, str]) -> None:
    p = with_given(experiment().parameters, {"body.body": "data", "body.file": small["body.file"]})
    t = np.arange(40) / 500
    t[20:] += 0.1
    x = np.tile(touched_place(p.scene.body.resolved(Path())) + [0, 0, 0.01], (40, 1))
    x[5] = np.nan
    recording = _path(x, t)
    scene = experiment().build(recording, p, None)
    seen = place(recording, p, scene)
    assert len(seen.t) == 39
    assert experiment().sets(p, seen)["dt"] == 0.002
    first, second = seen.findings
    assert "1 of 40 samples is not visible" in first
    assert "every sample is taken as one tick" in second
    assert follows(experiment(), (recording,), p).accept == ()
    with pytest.raises(RecordingError, match="0 of 40 samples"):
        place(_path(np.full((40, 3), np.nan), t), p, scene)


# --- what is told ---------------------------------------------------------------------------------


@pytest.mark.slow
def test_what_is_told_of_a_coarse_liver(
    small: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(beside("haptic_liver", "exhibits"), "_LIVE_SECONDS", 0.01)
    result = compare(experiment(), Options(small))
    (check,) = result.checks
    assert check.verdict == "same model"
    found = {e.anchor: e for e in result.exhibits}
    forces = {row[0]: row for row in found["forces"].tables[0].rows}
    held, line, curve = (forces[f"100 Hz, {n}"] for n in ("held", "linear", "second order"))
    rates = [held[1], forces["simulated at every tick"][1]]
    assert rates == pytest.approx([100.0, 1000.0])
    assert curve[5] < line[5] < held[5]  # type: ignore[operator]
    energy = {row[0]: row for row in found["energy"].tables[0].rows}
    assert energy["100 Hz, held"][1] > energy["100 Hz, linear"][1] > 0  # type: ignore[operator]
    first = found["energy"].charts[0].series[0]
    assert len(first.x) == 601
    assert {c.name for c in found["periods"].charts} >= {"periods"}
    assert [row[1] for row in found["live"].tables[0].rows] == [10, 10, 10]
    step = next(b.values[0] for b in result.rows if b.row.quantity == "dt")
    assert 0 < step < 1e-3


def test_nothing_is_felt_without_the_reference() -> None:
    assert beside("haptic_liver", "exhibits").felt_by({}) == {}


# --- live -----------------------------------------------------------------------------------------


@pytest.mark.slow
def test_live_in_a_thread_of_its_own_replays_to_the_same_numbers(
    small: dict[str, str], tmp_path: Path
) -> None:
    made = prepared(experiment(), Options(small), "linear")
    assert isinstance(made.stepper, HapticStepper)
    assert made.stepper.threads == ()
    clock = Turned()
    path = RecordedPath(made.path.t[:600], made.path.x[:600])
    done = live(made.stepper, path, None, clock, clock.wait)
    assert (done.ticks, done.missed) == (600, 0)
    assert np.abs(done.F).max() > 0.5
    assert made.stepper.rate == pytest.approx(1000.0)
    (thread,) = made.stepper.threads
    assert thread != os.getpid()
    file = tmp_path / "live.mcap"
    write_recording(written(done, made, 10**18), file)
    again = compare(experiment(), Options({**small, "recording": str(file)}, ("linear",)))
    traces = again.methods[0].runs[0].traces
    force = np.column_stack([traces[f"tool.force.{a}"].y for a in "xyz"])
    assert np.array_equal(force[-len(done.F) :], done.F)
    assert {c.name for c in again.checks} == {f"given.{a}.max@all" for a in "xyz"}
    assert again.passed


@pytest.mark.skipif(not hasattr(os, "sched_setscheduler"), reason="no such scheduling here")
def test_a_loop_that_is_first_takes_its_simulation_along(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[int, int, int]] = []
    monkeypatch.setattr(
        os, "sched_setscheduler", lambda n, policy, p: asked.append((n, policy, p.sched_priority))
    )
    monkeypatch.setattr(os, "sched_getscheduler", lambda _: os.SCHED_OTHER)
    _first_too((7,))
    monkeypatch.setattr(os, "sched_getscheduler", lambda _: os.SCHED_FIFO | os.SCHED_RESET_ON_FORK)
    _first_too(())
    assert asked == []
    _first_too((7,))
    assert asked == [(7, os.SCHED_FIFO, os.sched_get_priority_min(os.SCHED_FIFO))]


def ended(*_: object) -> SimpleNamespace:
    """A run that did not reach its end."""
    return SimpleNamespace(finished=False, outcome=SimpleNamespace(why="diverged at step 3"))


def test_a_twin_that_ends_early_is_no_recording(monkeypatch: pytest.MonkeyPatch) -> None:
    t, x = np.arange(3.0), np.zeros((3, 3))
    loop = SimpleNamespace(prepare=lambda system: None)
    for name, found in (
        ("way", lambda *_: (t, x)), ("touched_place", lambda *_: None), ("march", ended),
        ("_BUILT", lambda *_: SimpleNamespace(mesh=None)), ("under", lambda *_: None),
        ("replace", lambda *_, **__: loop), ("build_system", lambda scene: None),
    ):  # fmt: skip
        monkeypatch.setattr(TWIN, name, found)
    hand = SimpleNamespace(spring=1, reach=1, pad=1, grip=1, limit=1)
    p = SimpleNamespace(path=SimpleNamespace(rate=500.0), hand=hand)
    tree = SimpleNamespace(settings=p)
    with pytest.raises(SceneError, match="the twin: diverged at step 3"):
        TWIN.record(tree, lambda what: None)
