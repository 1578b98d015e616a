"""Declarations as JSON: exact over all experiments, and data where they hold no code."""

import ast
import json
from dataclasses import replace
from pathlib import Path

import pytest
from beside import experiment
from command_line import refused

from validate.catalogue import experiment_files, shipped
from validate.compare.verdict import Accept
from validate.errors import UsageError
from validate.estimate.filterpy.filters import FilterpyFilter
from validate.parameters import describe
from validate.pipeline.bodies.choices import MeasuredBody
from validate.pipeline.bodies.measured import solid
from validate.pipeline.experiment.declaration import from_json, to_json
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.find import load_file
from validate.pipeline.experiment.tree import Tree
from validate.scene.geometries.specification import Box
from validate.scene.material import Material
from validate.scene.scene import Scene, Support, Weight

NAMES = sorted(experiment_files(shipped().parent))


@pytest.mark.parametrize("name", NAMES)
def test_json_is_exact(name: str) -> None:
    declared = experiment(name)
    assert declared.path is not None
    text = to_json(declared)
    again = from_json(text, declared.path, declared)
    assert to_json(again) == text
    assert describe(again.parameters) == describe(declared.parameters)
    assert again.parameters == declared.parameters
    assert dict(again.methods) == dict(declared.methods)
    assert (again.accept, again.cases, again.expected) == (
        declared.accept, declared.cases, declared.expected
    )  # fmt: skip
    assert str(shipped().parent) not in text


@pytest.mark.parametrize("name", NAMES)
def test_a_shipped_experiment_is_one_short_declaration_of_its_scene(name: str) -> None:
    file = experiment_files(shipped().parent)[name]
    assert isinstance(experiment(name).parameters, Tree)
    text = file.read_text("utf-8")
    assert len(text.splitlines()) <= 150
    code = list(ast.walk(ast.parse(text)))
    assert not [node for node in code if isinstance(node, ast.Lambda | ast.ClassDef)]
    made = [t.id for n in code if isinstance(n, ast.Assign) for t in n.targets
            if isinstance(t, ast.Name)]  # fmt: skip
    assert made.count("EXPERIMENT") == 1


def body(**changes: object) -> Experiment:
    scene = Scene(
        Box((0.1, 0.02, 0.02), (5, 1, 1), "hex27"), Material(1e5, 0.45), (Support("xmin"),),
        loads=(Weight("gravity", "-z", 9.80665),), dilatation="by_element",
    )  # fmt: skip
    parameters = Tree("none.mcap", scene, MeasuredBody())
    methods = {"linear": solid("linear", "linear"), "large": solid("large strain")}
    accept = (Accept("marker.x", 1e-3, "a millimetre"),)
    return Experiment("body", "A beam", "made here", replace(parameters, **changes), methods,
                      ("linear",), accept)  # fmt: skip


def test_a_declaration_without_code_is_its_json_alone(tmp_path: Path) -> None:
    text = to_json(body())
    assert "code" not in text
    (tmp_path / "body.json").write_text(text, "utf-8")
    found = load_file(tmp_path / "body.json")
    assert (found.parameters, dict(found.methods)) == (body().parameters, dict(body().methods))
    assert found.complete
    assert to_json(found) == text  # what the library adds is no part of it
    line = refused("run", str(tmp_path / "body.json"), cwd=tmp_path)
    assert "none.mcap" in line


def test_a_declaration_with_a_former_class_name_is_read(tmp_path: Path) -> None:
    document = json.loads(to_json(body()))
    method = document["experiment"]["methods"]["items"]["linear"]
    method["settings"] = {"type": "FilterpyGuest", "modes": 3}
    (tmp_path / "body.json").write_text(json.dumps(document), "utf-8")
    assert load_file(tmp_path / "body.json").methods["linear"].settings == FilterpyFilter(modes=3)


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"type": "Popen", "args": "rm"}, "type 'Popen' is no part of a declaration"),
        *(
            ({"type": name, "command": "rm x"}, "parameters: 'ExternalSimulator' runs a program")
            for name in ("ExternalSimulator", "Guest")
        ),
        ({"code": "twin.record"}, "parameters: is code, which a JSON file does not hold"),
        ({"type": "MeasuredBody", "bodies": 1}, "parameters: 'bodies' is no field of MeasuredBody"),
        ({"like": "parameters"}, "is code"),
        ({"what": 1}, "expected one of type, like, items, code, array, number"),
        ({"type": "Scene", "body": 0, "material": {"type": "Material", "E": -1.0, "nu": 0.3}},
         "parameters.material: modulus E = -1 Pa: expected a positive number"),
    ],
)  # fmt: skip
def test_json_that_is_no_declaration_is_refused_by_its_path(
    changed: dict[str, object], says: str, tmp_path: Path
) -> None:
    document = json.loads(to_json(body()))
    document["experiment"]["parameters"] = changed
    (tmp_path / "body.json").write_text(json.dumps(document), "utf-8")
    with pytest.raises(UsageError) as refusal:
        load_file(tmp_path / "body.json")
    assert says in str(refusal.value)
    assert str(refusal.value).startswith("body.json: ")
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"format": 99, "experiment": {}}', "{"])
def test_other_json_is_no_declaration(text: str, tmp_path: Path) -> None:
    (tmp_path / "x.json").write_text(text, "utf-8")
    with pytest.raises(UsageError, match=r"x\.json: no "):
        load_file(tmp_path / "x.json")


OLDER = '''"""A test of older days."""
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.bodies.body_dynamics import HeldAt, MeasuredBody

PARAMETERS = MeasuredBody("log.mcap", held=HeldAt(all="zmin"))
EXPERIMENT = Experiment(name="older", title="older", source="mine", parameters=PARAMETERS)
'''


def test_a_file_of_the_older_form_is_refused_with_the_command_that_writes_it_anew(
    tmp_path: Path,
) -> None:
    (tmp_path / "older.py").write_text(OLDER, "utf-8")
    line = refused("run", str(tmp_path / "older.py"), cwd=tmp_path)
    assert "validate new older --from RECORDING --force" in line
    computed = (
        "from validate.pipeline.experiment.experiment import Experiment\n"
        "def declared(**given): return Experiment(**given)\n"
        "EXPERIMENT = declared(name='other', title='', source='', **{'parameters': 1})\n"
    )
    (tmp_path / "other.py").write_text(computed, "utf-8")
    with pytest.raises(UsageError, match="parameters of type int; declare"):
        load_file(tmp_path / "other.py")
