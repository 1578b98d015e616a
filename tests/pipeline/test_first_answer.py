"""What a first answer of a body runs: meshes, load steps and stand-ins that fit into its time."""

import json
from pathlib import Path

import numpy as np
import pytest
from command_line import called

from validate.commands.run import _refined
from validate.pipeline.bodies.mesh import unknowns_of
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.find import load_file
from validate.pipeline.experiment.options import Options, folder_of
from validate.pipeline.run import cost
from validate.pipeline.run.cost import affordable, linear_seconds, newton_seconds, states_within
from validate.pipeline.run.estimate import estimated
from validate.recording.mcap.write import write_recording
from validate.recording.types import Recording, Signal, Source
from validate.scene.geometries.box import box, grid
from validate.scene.mesh import Mesh
from validate.scene.mesh_files.mesh_file import write_mesh

# private: _refined: the options of a run that takes minutes.

T = np.linspace(0, 1, 40)
ANSWERS = """
experiment = "body"
body = {shape = "file", file = "FILE"}
held.all = "zmin"
material = {E = "15kPa", nu = 0.49}
law = "neo_hooke"
motion.how = "static"
moved = {by = "displacement", along = "-z", place = "zmax", sideways = "true"}
indenter.shape = "none"
seen = {force = "force"}
accept = {force = "0.05N"}
why = {force = "of a test"}
ranges = {E = "1%", nu = 0.005, load = "0.1%"}
"""


def declared(folder: Path, mesh: Mesh) -> tuple[Experiment, str]:
    """A body of a mesh file between plates, as its recordings have it, and what `new` prints."""
    file = f"{folder.name}.npz"  # read once a process
    write_mesh(mesh, folder / file)
    move = Signal(T, (3e-3 * T)[:, None], "m", 1e-6, "stage")
    force = Signal(T, (2 * T)[:, None], "N", 1e-3, "cell")
    log = Recording("log", Source("x", "", 0, "x"), 0,
                    signals={"displacement": move, "force": force})  # fmt: skip
    write_recording(log, folder / "log.mcap")
    (folder / "a.toml").write_text(ANSWERS.replace("FILE", file), "utf-8")
    code, said = called("new", "mine", "--from", "log.mcap", "--answers", "a.toml")
    assert code == 0, said
    made = load_file(folder / "experiments" / "mine.py")
    return made.follows(made, made.load(made.parameters, folder_of(made)), made.parameters), said


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


SIZE = (0.03, 0.03, 0.03)


@pytest.mark.parametrize(
    ("mesh", "order", "levels"),
    [
        pytest.param(box(SIZE, (5, 5, 5)), 2, 1, id="few tetrahedra"),
        pytest.param(box(SIZE, (9, 9, 9)), 1, 1, id="many tetrahedra", marks=pytest.mark.slow),
    ],
)
def test_a_mesh_file_is_refined_as_far_as_a_first_answer_allows(
    tmp_path: Path, mesh: Mesh, order: int, levels: int
) -> None:
    made, said = declared(tmp_path, mesh)
    assert made.parameters.scene.body.element == ("quadratic" if order == 2 else "linear")
    assert made.uncertainty is not None
    assert made.uncertainty.mesh is not None
    assert len(made.uncertainty.mesh.levels) == levels
    p = made.parameters
    N = unknowns_of(p, order, folder_of(made))
    assert 8 <= p.settings.seen.states <= 30
    assert p.settings.seen.states * newton_seconds(N) <= cost.RUNS or p.settings.seen.states == 8
    assert (made.uncertainty.draws == 0) == (16 * linear_seconds(N) > cost.INPUTS)
    expected = estimated(tmp_path / "experiments" / "mine.py")
    assert expected is not None
    assert expected.unknowns == pytest.approx(8**levels * N, rel=0.01)
    assert f"{expected.unknowns:.0f} unknowns at most" in said
    assert made.refine is not None
    finer = made.refine(p, folder_of(made))
    assert (finer["mesh.budget"], finer["seen.states"]) == ("false", "30")
    assert ("body.element" in finer) == (order == 1 and not mesh.bricks)
    used = _refined(made, Options({"seen.states": "9"}))
    assert used.values == {**finer, "seen.states": "9"}  # what the user sets stays


def test_the_linear_method_of_the_same_element_stands_in_on_the_meshes(tmp_path: Path) -> None:
    made, _ = declared(tmp_path, box(SIZE, (3, 3, 3)))
    assert made.uncertainty is not None
    assert made.uncertainty.stand_in == {"solid": "linear"}


@pytest.mark.slow
def test_a_large_mesh_file_is_filled_anew_coarser_and_refine_takes_its_own(
    tmp_path: Path,
) -> None:
    """6 859 nodes at large strain: a first answer is on fewer, its u_num by the file's own mesh."""
    own = grid(SIZE, (18, 18, 18))
    made, said = declared(tmp_path, own)
    p, folder = made.parameters, folder_of(made)
    assert p.scene.body.halvings == -1
    assert "--refine takes the file's own" in " ".join(said.split())
    assert unknowns_of(p, 1, folder) < own.nodes.size / 3
    assert made.uncertainty is not None
    assert made.uncertainty.mesh is not None
    (level,) = made.uncertainty.mesh.levels
    assert unknowns_of(level(p), 1, folder) == own.nodes.size
    assert made.uncertainty.mesh.size(level(p)) < made.uncertainty.mesh.size(p)
    assert made.refine is not None
    assert made.refine(p, folder)["body.halvings"] == "0"


@pytest.mark.slow
def test_a_file_that_cannot_be_halved_has_a_coarser_mesh_for_its_bound(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cost, "MESHES", 0.2)  # s: halved, this small mesh takes 0.8 s
    declared(tmp_path, grid(SIZE, (8, 8, 8)))
    own = ("--set", "seen.states=6", "--set", "body.halvings=0")
    code, said = called("run", "mine", "--methods", "linear,solid", *own)
    assert code == 1
    assert "no bound" not in said
    (file,) = (tmp_path / "reports").glob("mine*/results.json")
    stored = json.loads(file.read_text("utf-8"))
    checks = [c for method in stored["methods"] for c in method["checks"]]
    (checked,) = [c for c in checks if c["name"] == "force.max@high"]
    assert "one of them coarser" in checked["numerical"]
    assert 0 < checked["u_num"] < 1  # N, of cells as large as an eighth of the edge


def test_levels_fit_into_memory_before_they_fit_into_time(monkeypatch: pytest.MonkeyPatch) -> None:
    assert affordable("ab", [1e4, 1e6], budget=True) == ("a",)
    assert affordable("ab", [1e4, 1e5], budget=False) == ("a", "b")
    monkeypatch.setattr(cost, "free_memory", lambda: 2e8)
    assert affordable("ab", [1e4, 1e5], budget=False) == ("a",)
    assert states_within(12.0, 1e3, 30) == 30
    assert states_within(12.0, 1e6, 30) == 8
    assert states_within(12.0, 1e6, 5) == 5
