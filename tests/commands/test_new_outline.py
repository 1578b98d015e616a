"""`validate new` from a log with outlines: what they show and where they lie is asked."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest
from command_line import here, refused

from validate.pipeline.experiment.find import load_file
from validate.pipeline.experiment.options import folder_of
from validate.pipeline.plates.scene import Compression
from validate.recording.mcap.write import write_recording
from validate.recording.types import Contours, Frames, Recording, Signal, Source
from validate.scene.geometries.box import box
from validate.scene.mesh_files.mesh_file import write_mesh

T = np.linspace(0.0, 10.0, 101)
PLACE = {"outline.origin": "-20mm,0mm,35mm", "outline.image_x": "+x", "outline.image_y": "-z",
         "outline.sd": "0.1mm", "accept.contour": "0.5mm"}  # fmt: skip


@pytest.fixture
def seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    ring = 0.02 + 0.005 * np.array([(1.0, 0), (0, 1), (-1, 0), (0, -1)])
    image = np.zeros((20, 20), np.uint8)
    pose = np.eye(4)
    recording = Recording(
        "gel", Source("x", "", 0, "x"), 0,
        signals={
            "displacement": Signal(T, 2e-4 * T[:, None], "m", 0.0, "machine"),
            "force": Signal(T, 0.1 * T[:, None], "N", 0.005, "machine"),
        },
        contours={"cyst": Contours(T[::10], (ring,) * 11, 1e-4, pose, "image", "us")},
        frames={"us": Frames(T[::10], (image,) * 11, (1e-4, 1e-4), pose, "image")},
        metadata={"specimen": {"diameter_m": "0.02", "height_m": "0.03", "test": "compression"}},
    )  # fmt: skip
    write_recording(recording, tmp_path / "gel.mcap")
    return tmp_path


def written(folder: Path, answers: Mapping[str, str]) -> tuple[str, str]:
    """What was said beside, and the file's text."""
    lines = (f'"{key}" = "{value}"' for key, value in {"experiment": "plates", **answers}.items())
    (folder / "a.toml").write_text("\n".join(lines).replace('"', "", 0), "utf-8")
    code, _, err = here("new", "mine", "--from", "gel.mcap", "--answers", "a.toml")
    assert code == 0, err
    return err, (folder / "experiments" / "mine.py").read_text("utf-8")


def test_the_place_of_the_images_is_open_until_it_is_said(seen: Path) -> None:
    (seen / "a.toml").write_text('experiment = "plates"\noutline.shows = "edge"\n', "utf-8")
    told = refused("new", "mine", "--from", "gel.mcap", "--answers", "a.toml")
    assert (
        "3 questions are open: outline.origin (position of the images' first pixel in the body's"
        in told
    )
    assert "outline.sd (standard uncertainty of that position" in told
    assert "1 question is open: outline.shows" in refused("new", "mine", "--from", "gel.mcap")


def test_the_edge_is_judged_as_answered(seen: Path) -> None:
    err, text = written(seen, {"outline.shows": "edge", **PLACE})
    assert "not used" not in err
    assert len(text.splitlines()) <= 60
    mine = load_file(seen / "experiments" / "mine.py")
    assert isinstance(mine.parameters.settings, Compression)
    card = mine.parameters.settings.outline
    assert (card.topic, card.surface, card.sd) == ("cyst", "surface", 1e-4)
    assert card.origin == pytest.approx((-0.02, 0.0, 0.035))
    assert [(a.quantity, a.limit) for a in mine.accept][1:] == [("contour", 0.5e-3)]
    assert mine.uncertainty is not None
    assert {i.name for i in mine.uncertainty.inputs} >= {"images along x", "height", "diameter"}


def test_what_the_model_does_not_have_is_left_out_and_named(seen: Path) -> None:
    err, text = written(seen, {"outline.shows": "other"})
    assert "'cyst' is not used by this experiment" in err
    assert "'us' is not used by this experiment" in err
    assert "outline" not in text.split("EXPERIMENT")[1]


def test_an_inclusion_wants_its_mesh_its_fluid_and_the_modulus(seen: Path) -> None:
    names = {"lower_plate": "z0", "upper_plate": "z1", "wall": "x0"}
    block = box((0.02, 0.02, 0.03), (2, 2, 2))
    sets = {name: block.facets[side] for name, side in names.items()}
    write_mesh(replace(block, facets=sets), seen / "cyst.npz")
    inside = {"outline.shows": "inclusion", "body.file": "cyst.npz", "outline.surface": "wall",
              "outline.fluid": "true", "material.E": "15kPa", **PLACE}  # fmt: skip
    _, text = written(seen, inside)
    assert len(text.splitlines()) <= 60
    mine = load_file(seen / "experiments" / "mine.py")
    scene, settings = mine.parameters.scene, mine.parameters.settings
    assert isinstance(settings, Compression)
    assert scene.cavities[0].facets == settings.outline.surface == "wall"
    assert scene.material.E == 15e3
    assert [type(m.settings).__name__ for m in mine.methods.values()] == ["ExactPressure"] * 2
    assert (scene.body.element, scene.dilatation) == ("quadratic", "pointwise")
    (seen / "experiments" / "mine.py").unlink()
    block = box((0.02, 0.02, 0.03), (10, 10, 10))
    sets = {name: block.facets[side] for name, side in names.items()}
    write_mesh(replace(block, facets=sets), seen / "cyst.npz")
    said, text = written(seen, inside)
    assert "cyst.npz has 6000 cells: linear ones are proposed (element=linear)" in said
    assert len(text.splitlines()) <= 60
    mine = load_file(seen / "experiments" / "mine.py")
    scene = mine.parameters.scene
    assert (scene.body.element, scene.dilatation) == ("linear", "nodal_mean")
    recordings = mine.load(mine.parameters, folder_of(mine))
    used = mine.follows(mine, recordings, mine.parameters).uncertainty
    assert used is not None
    assert used.mesh is not None
    assert len(used.mesh.levels) == 1  # halved twice it takes too long for a first answer


def test_a_specimen_of_an_unusual_size_is_a_question(seen: Path) -> None:
    mesh = box((0.02, 0.02, 0.03), (2, 2, 2))
    plates = {"lower_plate": mesh.facet_nodes("z0"), "upper_plate": mesh.facet_nodes("z1")}
    body = meshio.Mesh(mesh.nodes, [("tetra", mesh.cells)], point_sets=plates)
    body.write(seen / "cyst.inp")
    lines = ["experiment = 'plates'", "outline.shows = 'inclusion'", "body.file = 'cyst.inp'"]
    for unit, is_asked in (("mm", True), ("m", False)):
        text = "\n".join([*lines, f"body.unit = '{unit}'"])
        (seen / "a.toml").write_text(text, "utf-8")
        told = refused("new", "mine", "--from", "gel.mcap", "--answers", "a.toml")
        said = "body.size (largest side of the body, as 3mm, to confirm its unit"
        assert (said in told) == is_asked
