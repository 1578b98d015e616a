"""The needle of paper 000, section 5.2: its path, what of a path can be walked, energy, replays."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from beside import beside, experiment

from experiments.needle_pocket.hand import STOPS, Hand, closed, moved
from validate.arrays import Floats
from validate.errors import RecordingError, SceneError, UsageError
from validate.parameters import with_given
from validate.pipeline.experiment.options import Options
from validate.pipeline.experiment.tree import Tree, mesh_of
from validate.pipeline.run.pipeline import compare
from validate.recording.mcap.read import read_recording
from validate.recording.mcap.write import write_recording
from validate.recording.types import Markers, Recording, Signal, Source
from validate.scene.mesh import Mesh

NAME = "needle_pocket"
twin_module, loops, pocket = (beside(NAME, module) for module in ("twin", "loops", "pocket"))
LAWS, around, turn_energy = loops.LAWS, loops.around, loops.turn_energy
build, place, record = pocket.build, pocket.place, twin_module.record
follows, half = beside(NAME, "recording").follows, beside(NAME, "exhibits").half
walkable = beside(NAME, "recording").walkable
DECLARED: Tree = experiment(NAME).parameters
COARSE = with_given(DECLARED, {"body.plane": 10, "twin.plane": 10})
SOLID = with_given(DECLARED, {"body.space": "solid", "body.solid": 6, "twin.solid": 6})
SHIPPED = Path(__file__).parents[2] / "recordings" / "needle_pocket.mcap"


def silent(_: str) -> None:
    pass


@cache
def block() -> Mesh:
    return mesh_of(None, COARSE, Path())


def path_of(x: Floats, t: Floats | None = None) -> Recording:
    """A recording of nothing but a path x (nt, d) m."""
    x = np.asarray(x, dtype=np.float64)
    at = np.arange(len(x)) / 512 if t is None else t
    signals = {f"tip.{a}": Signal(at, x[:, [c]], "m", 0.0, "b") for c, a in zip(
        range(x.shape[1]), "xyz", strict=False)}  # fmt: skip
    return Recording("own", Source("own", "", 0, ""), 1, signals=signals)


def down(*ys: float) -> Floats:
    return np.column_stack([np.full(len(ys), 0.0031), ys])


# --- the hand ---------------------------------------------------------------------------------


def test_a_move_of_least_jerk_starts_and_ends_at_rest_and_is_halfway_in_the_middle() -> None:
    x = moved(np.array([0.0, 1e-4, 0.5, 1 - 1e-4, 1.0]), np.array([0.0, 1.0]),
              np.array([[0.0], [2.0]]))[:, 0]  # fmt: skip
    assert x[[0, 2, 4]] == pytest.approx([0, 1, 2], abs=1e-15)
    assert x[1] == pytest.approx(0, abs=1e-10)
    assert x[3] == pytest.approx(2, abs=1e-10)


def test_the_hand_ends_where_it_began_and_its_seed_counts() -> None:
    hand = Hand(0.006, (0.003, 0.0), 512.0, 2e-5, 1)
    t, x = hand.path()
    assert x[0] == pytest.approx(x[-1], abs=1e-15)
    assert np.diff(t) == pytest.approx(1 / 512)
    assert t[-1] == pytest.approx(STOPS[-1][0], abs=1 / 512)
    still = replace(hand, tremor=0.0).path()[1]
    assert -still[:, 1].min() == pytest.approx(0.006, rel=1e-4)
    assert np.std(x - still) == pytest.approx(2e-5, rel=0.35)
    assert not np.array_equal(replace(hand, seed=2).path()[1], x)


def test_a_closed_path_is_closed() -> None:
    x = closed((0.003, 0.0), 0.006, 1, 64.0)
    assert x[0] == pytest.approx(x[-1], abs=1e-15)
    assert x[:, 1].min() == pytest.approx(-0.006)


# --- paths of others --------------------------------------------------------------------------


def test_what_of_a_path_cannot_be_walked_is_counted() -> None:
    """Inside at first, unseen, far away, with a gap, and out through the lower side."""
    y = [-0.01, 0.001, np.nan, -0.002, 1e3, -0.003, -0.07, 0.001]
    t = np.array([0, 1, 2, 3, 4, 5, 6, 60]) / 512
    x = np.column_stack([np.full(8, 0.0031), y])[:, None]
    seen = Recording("own", Source("own", "", 0, ""), 1,
                     markers={"tip": Markers(t, ("tip",), x, 1e-5, "b")})  # fmt: skip
    path = walkable(seen, block())
    assert path.x[:, 1].tolist() == [0.001, -0.002, -0.003, -0.07, 0.001]
    said = "; ".join(path.findings)
    for words in (
        "1 of 8 samples is not visible", "1 of 8 samples lies over 50 mm outside",
        "1 of 8 samples lies inside the body before", "1 gaps", "it left the mesh",
        "1 of 5 samples is deeper than 15 %",
    ):  # fmt: skip
        assert words in said, words


def test_a_path_out_of_reach_is_a_finding_and_a_run() -> None:
    recording = path_of(down(0.01, 0.02, 0.01))
    scene = build(recording, COARSE)
    seen = place(recording, COARSE, scene)
    assert "nearest 10 mm" in "".join(seen.findings)
    assert seen.inputs[0].tolist() == [0, 0]


@pytest.mark.parametrize(
    ("recording", "words"),
    [
        (path_of(down(-0.01, -0.02, -0.01)), "0 of 3 samples .* begin outside"),
        (path_of(np.zeros((3, 3))), "--set body.space=solid"),
        (Recording("own", Source("own", "", 0, ""), 1,
                   signals={"f": Signal(np.zeros(1), np.zeros((1, 1)), "N", 0, "b")}),
         "no signals tip.x"),
    ],
)  # fmt: skip
def test_a_path_of_no_use_is_one_line(recording: Recording, words: str) -> None:
    with pytest.raises(RecordingError, match=words):
        walkable(recording, block())


def test_a_pocket_that_the_mesh_cannot_hold_is_refused() -> None:
    with pytest.raises(SceneError, match="touch the outside"):
        mesh_of(None, with_given(COARSE, {"body.pocket": 0.05}), Path())


# --- energy -----------------------------------------------------------------------------------


def test_over_a_closed_path_the_exact_law_is_passive_and_the_papers_is_not() -> None:
    """The device gives back no more than it took; the paper's dead band and force give more."""
    recording = path_of(down(0.003, 0.002))
    scene = build(recording, COARSE)
    ways = {name: around(scene, law, 0.006) for name, law in LAWS.items()}
    turns = {name: turn_energy(way) / way.stored.max() for name, way in ways.items()}
    exact, _, paper, coarse = turns.values()
    assert abs(exact) < 1e-12
    assert abs(paper) > 1e-5
    assert abs(coarse) > abs(paper)
    way = ways["exact pressure, force of the energy"]
    free = way.taken - way.stored
    assert (np.maximum.accumulate(free) - free).max() < 1e-4 * way.stored.max()
    assert (way.taken > -1e-9 * way.stored.max()).all()


# --- the recording ----------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("space", ["plane", "solid"])
def test_the_twin_is_felt_and_its_seed_repeats_it(space: str) -> None:
    p = with_given(COARSE if space == "plane" else SOLID, {"twin.rate": 64.0})
    made, again = record(p, silent), record(p, silent)
    up = made.signals["force.y"].y
    assert up.max() > 10 * made.signals["force.y"].sd
    assert up.min() < -10 * made.signals["force.y"].sd
    assert np.array_equal(up, again.signals["force.y"].y)
    assert ("tip.z" in made.signals) is (space == "solid")


def test_the_shipped_recording_holds_what_section_5_2_needs() -> None:
    for name, axes in (("needle_pocket", "xy"), ("needle_pocket_solid", "xyz")):
        file = SHIPPED.with_name(f"{name}.mcap")
        made = read_recording(file)
        assert set(made.signals) == {f"{k}.{a}" for k in ("tip", "force") for a in axes} | {
            "pressure"
        }
        t = made.signals["tip.x"].t
        assert 1 / np.median(np.diff(t)) == pytest.approx(512, rel=1e-6)
        assert file.stat().st_size < 500_000


def test_a_path_of_ones_own_is_run_and_judged_by_what_it_has(tmp_path: Path) -> None:
    file = tmp_path / "own.mcap"
    write_recording(path_of(down(0.002, 0.001, -0.001, -0.002, -0.002, 0.004)), file)
    values = {"recording": str(file), "body.plane": "10"}
    result = compare(experiment(NAME), Options(values, ("p1_exact",)))
    (method,) = result.methods
    assert method.runs[0].outcome.state == "finished"
    assert method.runs[0].traces["needle.contact"].y.tolist() == [0, 0, 1, 1, 1, 0]
    assert {f.verdict for f in result.published} <= {"other data"}
    assert result.kind == "measured"


@pytest.mark.slow
def test_space_is_chosen_by_a_parameter_and_the_shipped_path_with_it() -> None:
    values = {"body.space": "solid", "body.solid": "6"}
    (method,) = compare(experiment(NAME), Options(values, ("paper",))).methods
    assert method.runs[0].outcome.state == "finished"
    assert method.runs[0].traces["needle.force.z"].y.any()
    assert np.abs(method.runs[0].traces["pocket.volume_ratio"].y - 1).max() <= 1e-3


def test_limits_follow_the_space() -> None:
    made = read_recording(SHIPPED)
    plane = {a.quantity: a.limit for a in follows(experiment(NAME), [made], COARSE).accept}
    space = {a.quantity: a.limit for a in follows(experiment(NAME), [made], SOLID).accept}
    assert plane["force.y"] == 25 * space["force.y"]
    assert plane["pressure"] == space["pressure"]


def test_the_cube_is_drawn_cut_at_the_needle_and_turned_up() -> None:
    mesh = mesh_of(None, SOLID, Path())
    moved_up = np.tile([0.0, 1e-3, 0.0], (len(mesh.nodes), 1))
    shown, u = half(mesh, moved_up, 0.0)
    assert len(shown.cells) < 0.6 * len(mesh.cells)
    assert u == pytest.approx(np.tile([0.0, 0.0, 1e-3], (len(u), 1)))
    assert shown.nodes[:, 2].max() == pytest.approx(0, abs=1e-12)  # y = 0 is on top
    assert shown.cell_volumes().min() > 0
    same, v = half(block(), np.zeros_like(block().nodes), 0.0)
    assert same is block()
    assert v.shape == block().nodes.shape


def ended(*_: object) -> SimpleNamespace:
    """A run that did not reach its end."""
    return SimpleNamespace(finished=False, outcome=SimpleNamespace(why="diverged at step 3"))


def test_a_twin_that_ends_early_is_no_recording(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(twin_module, "march", ended)
    loop = SimpleNamespace(prepare=lambda system: None)
    monkeypatch.setattr(twin_module, "NeedleLoop", lambda **_: loop)
    monkeypatch.setattr(twin_module, "build_system", lambda scene: None)
    with pytest.raises(SceneError, match="the twin: diverged at step 3"):
        record(DECLARED, lambda what: None)


@pytest.mark.parametrize("bad", [{"depth": 0.0}, {"rate": 0.0}, {"tremor": -1e-3}])
def test_a_hand_that_does_not_move_is_refused(bad: dict[str, float]) -> None:
    with pytest.raises(UsageError, match=r"deep at .* Hz .* must be above 0"):
        replace(Hand(1e-3, 1e-3, 500.0, 0.0, 1), **bad)  # type: ignore[arg-type]
