"""An experiment imports a module of the next experiment's folder, as modules of one package do."""

import shutil
import sys
from pathlib import Path

import pytest

from validate.catalogue import shipped
from validate.errors import UsageError
from validate.pipeline.experiment.find import load_file, package_name, sources_of

BLOCK = 'TITLE = "%s"\n'
OWN = """
from validate.pipeline.experiment.experiment import Experiment
from validate.scene.geometries.specification import Box
from validate.scene.material import Material
from validate.scene.scene import Scene
from ..block.body import TITLE
"""
DECLARED = """
EXPERIMENT = Experiment(
    name="mine", title=TITLE, source="a test", recording="a.mcap",
    scene=Scene(Box(("1 mm", "1 mm", "1 mm"), (1, 1, 1)), Material("1 kPa", 0.3)),
)
"""


def written(folder: Path, title: str) -> Path:
    """experiments/mine/experiment.py, with experiments/block/body.py that it imports from."""
    for name in ("block", "mine", "third"):
        (folder / name).mkdir(parents=True)
    (folder / "block" / "body.py").write_text(BLOCK % title)
    (folder / "block" / "further.py").write_text("from ..third.twin import NOISE\n")
    (folder / "third" / "twin.py").write_text("NOISE = 1\n")
    path = folder / "mine" / "experiment.py"
    path.write_text(OWN + DECLARED)
    return path


def test_a_neighbour_is_that_of_the_same_folder_and_is_read_again(tmp_path: Path) -> None:
    one, other = written(tmp_path / "a", "one"), written(tmp_path / "b", "other")
    assert (load_file(one).title, load_file(other).title) == ("one", "other")
    (tmp_path / "a" / "block" / "body.py").write_text(BLOCK % "edited by hand")
    assert load_file(one).title == "edited by hand"


def test_what_an_experiment_imports_from_is_part_of_its_sources(tmp_path: Path) -> None:
    path = written(tmp_path, "one")
    assert [f.relative_to(tmp_path).as_posix() for f in sources_of(path)] == [
        "mine/experiment.py", "block/body.py", "block/further.py", "third/twin.py",
    ]  # fmt: skip


def test_a_file_without_a_folder_imports_from_one(tmp_path: Path) -> None:
    written(tmp_path, "one")
    path = tmp_path / "flat.py"
    path.write_text((OWN + DECLARED).replace("..block", ".block").replace("mine", "flat"))
    assert load_file(path).title == "one"
    assert tmp_path / "block" / "body.py" in sources_of(path)


def test_a_file_that_fails_leaves_no_module(tmp_path: Path) -> None:
    path = written(tmp_path, "one")
    path.write_text(OWN + "EXPERIMENT = 1 / 0\n")
    with pytest.raises(UsageError, match="ZeroDivisionError"):
        load_file(path)
    assert not [name for name in sys.modules if name.startswith(package_name(path))]


def test_a_neighbour_that_is_not_there_is_the_shipped_one(tmp_path: Path) -> None:
    path = written(tmp_path, "one")
    shutil.rmtree(tmp_path / "block")
    text = (OWN + DECLARED).replace("..block.body import TITLE", "..kf_cube.scene import SCENE")
    path.write_text(text.replace("title=TITLE", "title=str(SCENE.body.size)"))
    assert load_file(path).title == "(0.004, 0.004, 0.007)"
    assert shipped() / "kf_cube" / "scene.py" in sources_of(path)
