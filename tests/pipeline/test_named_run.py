"""A run's folder is called by what it computes, not by how that was typed."""

from dataclasses import replace
from pathlib import Path

import pytest

from validate.errors import UsageError
from validate.parameters import with_values
from validate.pipeline.bodies.choices import MeasuredBody, SeenOf
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.find import find
from validate.pipeline.experiment.options import Options, folder_of, mesh_files
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.run.job import run_folder, run_name, tag
from validate.scene.geometries.specification import MeshFile
from validate.scene.material import Material
from validate.scene.scene import Scene


def name(experiment: Experiment, *, quick: bool = False, methods: str = "", **values: str) -> str:
    given = {path.replace("__", "."): text for path, text in values.items()}
    return run_name(experiment, Options(given, tuple(methods.split(",")) if methods else (), quick))


def test_the_plain_run_keeps_the_name(phantom: Experiment) -> None:
    assert name(phantom) == "fluid_phantom"
    assert name(phantom, material__E="15200") == "fluid_phantom"
    assert name(phantom, material__E="15.2kPa") == "fluid_phantom"
    assert name(phantom, methods=",".join(reversed(phantom.methods))) == "fluid_phantom"


def test_what_differs_is_in_the_name_and_in_the_hash(phantom: Experiment) -> None:
    soft = name(phantom, material__E="14000")
    assert soft.startswith("fluid_phantom+material.E-")
    assert len(soft.rpartition("-")[2]) == 6
    assert soft == name(phantom, material__E="14kPa")
    others = [
        name(phantom, material__E="14001"),
        name(phantom, methods__p1_loop__tolerance="0.1%"),
        name(phantom, quick=True),
        name(phantom, quick=True, material__E="14000"),
        name(phantom, methods="p1_loop"),
        name(phantom, methods="p1_loop,p1_dry"),
        name(phantom, recording="elsewhere/fluid_phantom.mcap"),
        "fluid_phantom",
    ]
    assert len({soft, *others}) == len(others) + 1
    assert [o.rpartition("-")[0] for o in others[1:6]] == [
        "fluid_phantom+methods.p1_loop.tolerance", "fluid_phantom+quick",
        "fluid_phantom+quick+material.E", "fluid_phantom+methods", "fluid_phantom+methods",
    ]  # fmt: skip


def test_what_a_script_changes_of_the_file_is_in_the_name(phantom: Experiment) -> None:
    """Limits, accepted methods, further methods and values; the same change has the same name."""
    stricter = replace(phantom.accept[0], limit=1e-6)
    method = next(iter(phantom.methods.values()))
    changed = {
        "accept": replace(phantom, accept=(stricter, *phantom.accept[1:])),
        "accepted": replace(phantom, accepted=("p1_fluid",)),
        "methods": replace(phantom, methods={**phantom.methods, "mine": method}),
        "material.E": replace(
            phantom, parameters=with_values(phantom.parameters, {"material.E": "14kPa"})
        ),
    }
    names = {word: name(of) for word, of in changed.items()}
    assert {n.rpartition("-")[0] for n in names.values()} == {f"fluid_phantom+{w}" for w in changed}
    assert names["material.E"] == name(phantom, material__E="14kPa")
    assert name(replace(changed["accept"])) == names["accept"]
    looser = replace(phantom, accept=(replace(stricter, limit=1e-5), *phantom.accept[1:]))
    assert name(looser) != names["accept"]


def test_the_order_of_what_is_given_does_not_count(phantom: Experiment) -> None:
    one = name(phantom, material__E="14000", material__nu="0.48", methods="p1_dry,p1_loop")
    other = name(phantom, material__nu="0.48", material__E="14000", methods="p1_loop,p1_dry")
    assert one == other


def test_unknown_values_are_refused_before_a_folder_is_named(phantom: Experiment) -> None:
    with pytest.raises(UsageError, match=r"nearest: material\.E"):
        run_folder(phantom, Options({"material.EE": "1"}), Path("out"))


def test_many_words_are_counted_and_odd_signs_replaced() -> None:
    long = tag([f"material.number_{i}" for i in range(30)], "x")
    assert long.startswith("+material.number_0+material.number_1+material.number_2+27_more-")
    assert len(long) < 90
    assert tag(["a b/ü"], 1).startswith("+a_b_ü-")
    assert tag([], "x") == ""


def test_meshes_that_parameters_name(project_root: Path, tmp_path: Path) -> None:
    cube = find("ekf_cube", project_root)
    assert [f.name for f in mesh_files(cube.parameters, folder_of(cube))] == ["cube.npz"]
    gone = with_values(cube.parameters, {"body.file": str(tmp_path / "gone.npz")})
    assert mesh_files(gone, tmp_path) == ()


def test_files_of_a_measured_body_lie_beside_the_experiment(tmp_path: Path) -> None:
    """Its mesh, what that includes, and the layout of its markers: another one is another run."""
    (tmp_path / "deck.INP").write_text('*Include, input = nodes.inc\n*ELSET, INPUT="b c.inc"\n')
    (tmp_path / "nodes.inc").write_text("*NODE, input=more.inc\n*include,input=deck.INP\n")
    for name in ("more.inc", "b c.inc", "points.fcsv"):
        (tmp_path / name).write_text("1\n")
    (tmp_path / "more.inc").write_text("1, 0., 0., 0.\n")
    scene = Scene(MeshFile("deck.INP"), Material(1.0, 0.3))
    p = Tree("", scene, MeasuredBody(SeenOf(layout="points.fcsv")))
    found = {f.name for f in mesh_files(p, tmp_path)}
    assert found == {"deck.INP", "nodes.inc", "more.inc", "b c.inc", "points.fcsv"}
