"""What a mesh file of a specimen holds is not asked again, by `validate new` or a run."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from command_line import here, refused

from validate.commands.questions import new
from validate.commands.questions.scene import answered_mesh
from validate.pipeline import run_in_memory
from validate.pipeline.experiment.experiment import Uncertainty
from validate.pipeline.experiment.find import load_file
from validate.pipeline.experiment.origins import opened
from validate.pipeline.plates.scene import pressed_size
from validate.recording.mcap.write import write_recording
from validate.recording.types import Recording, Signal, Source
from validate.scene.geometries.box import box, grid
from validate.scene.mesh_files.mesh_file import write_mesh

# private: _FIRST: replaced by a small number: a short test.

pytestmark = pytest.mark.usefixtures("one_picture")

SIDES, E = (0.06, 0.045, 0.07), 20e3
ANSWERS = {"test": "compression", "accept.force": "0.1N", "why.force": "felt"}
SIZES = {
    "body.diameter": 2 * np.sqrt(SIDES[0] * SIDES[1] / np.pi), "body.height": SIDES[2],
}  # fmt: skip


def force_log(**specimen: str) -> Recording:
    """A block of 60 x 45 x 70 mm and 20 kPa between slipping plates, to 8 % strain."""
    t = np.arange(200) / 10
    d = 0.08 * SIDES[2] * t / t[-1]
    noise = np.random.default_rng(1).normal(0, 5e-3, len(t))
    force = E * SIDES[0] * SIDES[1] * d / SIDES[2] + noise
    signals = {
        "displacement": Signal(t, d[:, None], "m", 0.0, "machine"),
        "force": Signal(t, force[:, None], "N", 0.005, "machine"),
    }
    return Recording("block", Source("x", "", 0, "x"), 0, signals=signals,
                     metadata={"specimen": specimen} if specimen else {})  # fmt: skip


def block(
    divisions: int = 2, make: Any = box, names: tuple[str, ...] = ("z0", "z1"),
    sides: tuple[float, ...] = SIDES,
) -> Any:  # fmt: skip
    mesh = make(sides, (divisions,) * 3)
    plates = zip(("lower_plate", "upper_plate"), names, strict=False)
    return replace(mesh, facets={plate: mesh.facets[name] for plate, name in plates})


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    write_recording(force_log(), tmp_path / "log.mcap")
    write_mesh(block(), tmp_path / "block.npz")
    mesh = block()
    sets = {name: mesh.facet_nodes(name) for name in mesh.facets}
    foreign = meshio.Mesh(1e3 * mesh.nodes, [("tetra", mesh.cells)], point_sets=sets)
    foreign.write(tmp_path / "block.inp")
    return tmp_path


def answers(folder: Path, **given: str) -> None:
    lines = {"experiment": "plates", **ANSWERS, **given}
    text = "\n".join(f'{key} = "{value}"' for key, value in lines.items())
    (folder / "a.toml").write_text(text, "utf-8")


@pytest.mark.parametrize("mesh", [
    {"body.file": "block.npz"}, {"body.file": "block.inp", "body.unit": "mm"},
])  # fmt: skip
def test_the_sizes_of_a_mesh_are_not_asked(folder: Path, mesh: Mapping[str, Any]) -> None:
    answers(folder, **mesh)
    arguments = ("new", "mine", "--from", "log.mcap", "--answers", "a.toml")
    assert "body.height" not in here(*arguments, "--questions")[1]
    code, _, err = here(*arguments)
    assert (code, "body." in err) == (0, False), err
    mine = load_file(folder / "experiments" / "mine.py")
    used = pressed_size(opened(mine, mine.parameters).parameters, folder / "experiments")
    assert used.diameter == pytest.approx(SIZES["body.diameter"], rel=1e-5)
    assert used.height == pytest.approx(SIZES["body.height"], rel=1e-5)
    if "body.unit" not in mesh:  # the same body: one runs
        return
    code, out, err = here("run", "mine", "--quick", "--methods", "slip")
    assert code == 0, err
    assert "1 of 1 requirements are met" in " ".join(out.split())


def test_a_run_takes_the_sizes_from_the_mesh_that_it_is_given(folder: Path) -> None:
    """It asked for body.diameter of a block whose mesh was given; a path is from the file's
    folder."""
    answers(folder)
    assert here("new", "mine", "--from", "log.mcap", "--answers", "a.toml")[0] == 0
    assert "body.diameter (m) is not set" in refused("run", "mine", "--quick")
    (folder / "block.npz").rename(folder / "other.npz")
    write_mesh(block(sides=(0.03, 0.045, 0.07)), folder / "block.npz")
    answers(folder, **{"body.file": "block.npz"})
    assert here("new", "mine", "--from", "log.mcap", "--answers", "a.toml", "--force")[0] == 0
    mine = replace(
        load_file(folder / "experiments" / "mine.py"), uncertainty=Uncertainty(surrogate="slip")
    )
    moduli = []
    for mesh in ({}, {"body.file": "../other.npz"}):
        found = run_in_memory(mine, mesh, methods=("slip",), quick=True).parameters
        moduli.append(next(p.default for p in found if p.path == "material.E"))
    assert moduli[0] == pytest.approx(2 * moduli[1], rel=1e-3)  # half the area


def test_a_size_of_the_header_that_the_mesh_does_not_have_is_named(folder: Path) -> None:
    write_recording(force_log(height_m="0.08"), folder / "log.mcap")
    answers(folder, **{"body.file": "block.npz"})
    err = here("new", "mine", "--from", "log.mcap", "--answers", "a.toml")[2]
    assert "body.height: 80 mm in the header, 70 mm in block.npz, which counts" in " ".join(
        err.split()
    )


@pytest.mark.parametrize(("mesh", "words"), [
    (block(make=grid), "expected tetrahedra; for hexahedra answer experiment = body"),
    (block(names=("z0",)), "no facet set upper_plate; there are lower_plate; name both"),
    (block(names=("x0", "x1")), "expected flat plates normal to z: turn the mesh"),
    (block(names=("z1", "z0")), "upper_plate is 70 mm below lower_plate"),
])  # fmt: skip
def test_a_mesh_that_plates_cannot_press_is_refused(folder: Path, mesh: Any, words: str) -> None:
    write_mesh(mesh, folder / "block.npz")
    answers(folder, **{"body.file": "block.npz"})
    assert words in refused("new", "mine", "--from", "log.mcap", "--answers", "a.toml")


def test_a_mesh_file_that_changed_is_read_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another file of the same name, in another folder or later, had the sides of the first."""
    found = {"body.shape": "file", "body.file": "b.npz"}
    for side in (0.02, 0.03):
        folder = tmp_path / str(side)
        folder.mkdir()
        monkeypatch.chdir(folder)
        write_mesh(box((side, side, side), (1, 1, 1)), folder / "b.npz")
        mesh = answered_mesh(found)
        assert mesh is not None
        assert np.ptp(mesh.nodes[:, 0]) == pytest.approx(side)


@pytest.mark.slow
@pytest.mark.usefixtures("estimates")
def test_a_large_mesh_file_between_plates_is_filled_anew_coarser_and_refine_takes_its_own(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(new, "_FIRST", 0.0)  # s: as if it took long
    write_mesh(block(8), folder / "fine.npz")
    answers(folder, **{"body.file": "fine.npz"})
    code, out, _ = here("new", "mine", "--from", "log.mcap", "--answers", "a.toml")
    assert code == 0
    assert "its mesh is coarser" in out
    mine = load_file(folder / "experiments" / "mine.py")
    assert mine.parameters.scene.body.halvings < 0
    assert mine.refine is not None
    assert mine.refine(mine.parameters, folder)["body.halvings"] == "0"
    shown = mine.follows(mine, mine.load(mine.parameters, folder / "experiments"), mine.parameters)
    sizes = [shown.uncertainty.mesh.size(level(mine.parameters))
             for level in shown.uncertainty.mesh.levels]  # fmt: skip
    assert min(sizes) == pytest.approx(shown.uncertainty.mesh.size(
        mine.parameters.given({"body.halvings": 0})))  # fmt: skip


@pytest.mark.usefixtures("estimates")
def test_a_halved_mesh_of_nodal_mean_dilatation_is_as_dear_as_it_is(folder: Path) -> None:
    """Its rows reach two cells far: 82 000 unknowns of an inclusion took minutes of a first answer,
    of which 12 s were estimated. A coarser mesh bounds u_num instead."""
    write_mesh(block(14), folder / "fine.npz")
    answers(folder, **{"body.file": "fine.npz"})
    assert here("new", "mine", "--from", "log.mcap", "--answers", "a.toml")[0] == 0
    mine = load_file(folder / "experiments" / "mine.py")
    p = mine.parameters
    assert (p.scene.dilatation, p.scene.body.halvings) == ("nodal_mean", 0)
    shown = mine.follows(mine, mine.load(p, folder / "experiments"), p)
    assert [level(p).scene.body.halvings for level in shown.uncertainty.mesh.levels] == [-1]
    whole = p.given({"mesh.budget": False})
    shown = mine.follows(mine, mine.load(p, folder / "experiments"), whole)
    assert next(level(p).scene.body.halvings for level in shown.uncertainty.mesh.levels) == 1
