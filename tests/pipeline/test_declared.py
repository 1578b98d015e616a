"""An experiment declared by its scene alone: names register it, paths vary it, JSON runs it."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from beside import experiment
from command_line import here

from validate.compare.verdict import Accept
from validate.errors import RegistrationError, SceneError, UsageError
from validate.parameters import with_given
from validate.pipeline import run_in_memory
from validate.pipeline.experiment.declaration import holds_code, require_paths, to_json
from validate.pipeline.experiment.experiment import Experiment, Uncertainty, free, vary
from validate.pipeline.experiment.find import load_file
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.options import Options, configure
from validate.pipeline.experiment.tree import changed_by
from validate.recording.mcap.write import write_recording
from validate.recording.types import Recording, Signal, Source
from validate.register.registration import Registered, as_declared
from validate.scene.geometries.specification import Box
from validate.scene.laws import Coefficients
from validate.scene.material import Material
from validate.scene.scene import Drive, Load, Scene, Support
from validate.solve.static.quasi_static import QuasiStatic

E, SIZE = 100e3, (0.02, 0.02, 0.05)
T = np.linspace(0.0, 4.0, 21)
PUSH = 1e-3 * T / 4
FORCE = E * SIZE[0] * SIZE[1] * PUSH / SIZE[2]  # nu = 0: exact on every mesh
BAR = Scene(
    body=Box(("20 mm", "20 mm", "5 cm"), cells=(2, 2, 4)),  # type: ignore[arg-type]
    material=Material("100 kPa", 0.0),  # type: ignore[arg-type]
    supports=(Support("zmin"),),
    drives=(Drive("stage", "zmax", "-z"),),  # type: ignore[arg-type]
)


def log(**other: Signal) -> Recording:
    signals = {
        "stage": Signal(T, PUSH[:, None], "m", 0.0, "stage"),
        "stage.force": Signal(T, FORCE[:, None], "N", 1e-4, "cell"),
    } | other
    return Recording("bar", Source("bar", "", 0, "made here"), 0, signals=signals)


def bar(**changes: object) -> Experiment:
    declared = Experiment(
        "bar", "A bar that is pushed", "made here", recording="bar.mcap", scene=BAR,
        variations=(vary("material.E", "relative 3 %", "modulus"), vary("body.cells", "x 0.5 2")),
        methods={"linear": Method("linear statics", QuasiStatic())},
        accepted=("linear",),
        accept=(Accept("stage.force", 0.1, "a tenth of the force"),),
        uncertainty=Uncertainty(surrogate="linear"),
    )  # fmt: skip
    return replace(declared, **changes)  # type: ignore[arg-type]


def test_it_runs_from_its_json_and_holds_no_code(tmp_path: Path) -> None:
    write_recording(log(), tmp_path / "bar.mcap")
    text = to_json(bar())
    assert not holds_code(text)
    (tmp_path / "bar.json").write_text(text, "utf-8")
    reports = tmp_path / "reports"
    code, _, shown = here("run", str(tmp_path / "bar.json"), "--out", str(reports), cwd=tmp_path)
    assert code == 0, shown
    (check,) = json.loads((reports / "bar" / "results.json").read_text())["methods"][0]["checks"]
    assert abs(check["value"]) < 1e-3
    # u_input is 3 % of the force; the mesh adds nothing to an exact answer.
    assert check["u_val"] == pytest.approx(0.03 * FORCE[-1], rel=0.02)


def test_a_method_changes_its_scene_by_path_and_the_user_what_a_method_does() -> None:
    both = bar(methods={
        "linear": Method("linear statics", QuasiStatic()),
        "bricks": Method("bricks", QuasiStatic(), {"body.element": "hex8"}),
    })  # fmt: skip
    _, methods = configure(both, Options({"methods.bricks.body.cells": "1,1,2",
                                          "methods.linear.material.E": "50kPa"}))  # fmt: skip
    recording = log()
    built = {n: both.build(recording, both.parameters, m.scene) for n, m in methods.items()}
    assert (built["bricks"].mesh.kind, len(built["bricks"].mesh.cells)) == ("hex8", 2)
    assert (built["linear"].mesh.kind, built["linear"].material.E) == ("tet4", 50e3)
    with pytest.raises(UsageError, match="nearest: "):
        configure(both, Options({"methods.linear.material.e": "50kPa"}))


def test_parts_of_which_there_are_none_are_no_parameter() -> None:
    """`loads` of the scene is empty: a text would be no load."""
    with pytest.raises(UsageError, match="unknown parameter 'loads'"):
        configure(bar(), Options({"loads": "3mm"}))


def test_what_names_cannot_register_is_one_line() -> None:
    scene = bar().build(log(), bar().parameters, None)
    strange = replace(log(), signals={"push": log().signals["stage"]})
    with pytest.raises(RegistrationError, match=r"input 'stage' has no value.*it has push"):
        as_declared(strange, scene)
    silent = replace(log(), signals={"stage": log().signals["stage"]})
    with pytest.raises(RegistrationError, match="nothing that this scene predicts"):
        as_declared(silent, scene)


def test_an_input_without_a_value_is_named_by_its_path() -> None:
    """A drive is no load."""
    mesh = Box((0.1, 0.1, 0.1), (1, 1, 1)).resolved(Path())
    for kind, part in (
        ("drives", Drive("stage", "z1", (0.0, 0.0, 1.0))),
        ("loads", Load("pull", "z1", (0.0, 0.0, 1.0))),
    ):
        scene = Scene(mesh, Material(1e4, 0.3), (Support("z0", (0, 1, 2)),), **{kind: (part,)})
        with pytest.raises(RegistrationError, match=rf"set {kind}\.{part.name}\.value"):
            Registered.given_inputs(scene, np.ones(1))


def test_an_open_modulus_is_identified_and_not_evidence() -> None:
    other = bar(
        parameters=bar().parameters.with_scene(material=Material(None, 0.0)),  # type: ignore[arg-type]
        load=lambda p, folder: (log(),), path=Path("bar.py"), uncertainty=Uncertainty(), accept=(),
        variations=(free("material.E", "10 kPa", "1 MPa", on="stage.force"),),
    )  # fmt: skip
    found = run_in_memory(other)
    assert found.identified[0].value == pytest.approx(E, rel=1e-3)
    assert " Fitted: material.E = " in found.sentence
    with pytest.raises(UsageError, match=r"material\.E is not set"):
        other.build(log(), other.parameters, None)


def test_variations_that_contradict_or_say_nothing_are_refused() -> None:
    with pytest.raises(UsageError, match=r"2 variations of body\.cells"):
        bar(variations=(vary("body.cells", "x 2"), vary("body.cells", "x 0.5")))
    with pytest.raises(UsageError, match=r"factors refine body\.cells, or dt"):
        vary("material.E", "x 2")
    for wrong in ("x", "x 1", "x two", "x 2, order 0"):
        with pytest.raises(UsageError, match=r"body\.cells"):
            vary("body.cells", wrong)
    with pytest.raises(UsageError, match="10 kPa"):
        free("material.E", "soft", "1 MPa", on="stage.force")
    with pytest.raises(UsageError, match="0 quantities"):
        bar(variations=(free("material.E", "10 kPa", "1 MPa"),))


def test_a_declared_scene_is_no_mesh_yet() -> None:
    with pytest.raises(SceneError, match="resolve the scene first"):
        _ = BAR.mesh
    with pytest.raises(SceneError, match="direction 'down'"):
        Load("push", "zmax", "down")  # type: ignore[arg-type]


DECLARATION = """
from validate.pipeline.experiment.experiment import Case, Experiment, vary
from validate.pipeline.experiment.method import Method
from validate.scene.geometries.specification import Box
from validate.scene.material import Material
from validate.scene.scene import Drive, Scene, Support
from validate.solve.static.quasi_static import QuasiStatic

EXPERIMENT = Experiment(
    name="bar",
    title="A bar",
    source="a test",
    recording="bar.mcap",
    scene=Scene(
        body=Box(("20 mm", "20 mm", "50 mm"), cells=(2, 2, 4)),
        material=Material("100 kPa", 0.3),
        drives=(Drive("stage", "zmax", "-z"),),
    ),
    variations=(vary("material.E", "relative 3 %"),),
    methods={"linear": Method("linear", QuasiStatic(), {"body.element": "hex8"})},
    cases=(Case("stiff", "stiffer", {"material.E": "x 1.2"}),),
)
"""


@pytest.mark.parametrize(
    ("one", "other", "says"),
    [
        ('"100 kPa", 0.3', '"100 kPa", 0.7', "line 16, material: Poisson ratio nu = 0.7"),
        ('"100 kPa", 0.3', '"100 mm", 0.3', "line 16, material: E=100 mm: expected Pa"),
        (
            '"20 mm", "20 mm", "50 mm"',
            '"20 mm", "20 mm"',
            "line 15, body: a block of 2 sizes and 3 numbers",
        ),
        ('vary("material.E"', 'vary("material.G"', "line 19: unknown parameter 'material.G'"),
        ("relative 3 %", "relative 3 kPa", "line 19: material.E: '3 kPa': expected a number in 1"),
        ("relative 3 %", "3 %", "line 19, variations: material.E: rule '3 %'"),
        ("body.element", "body.elements", "line 20: method 'linear' changes the unknown"),
        ('{"material.E": "x', '{"material.e": "x', "line 21: unknown parameter 'material.e'"),
        ("Support\n", "Supports\n", "line 6: ImportError: cannot import name 'Supports'"),
    ],
)
def test_an_error_of_a_declaration_names_its_path_and_line(
    one: str, other: str, says: str, tmp_path: Path
) -> None:
    (tmp_path / "bar.py").write_text(DECLARATION, "utf-8")
    assert load_file(tmp_path / "bar.py").name == "bar"
    (tmp_path / "bar.py").write_text(DECLARATION.replace(one, other), "utf-8")
    with pytest.raises(UsageError) as refusal:
        load_file(tmp_path / "bar.py")
    assert says in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_method_takes_a_value_of_another_parameter() -> None:
    """As where every method has a modulus of its own; an open one names the path to set."""
    tree, own = bar().parameters, {"material.E": "as material.rho"}
    with pytest.raises(UsageError, match=r"material\.rho is not set; give"):
        changed_by(tree, own)
    assert changed_by(with_given(tree, {"material.rho": 2e3}), own).scene.material.E == 2e3
    unknown = Method("m", QuasiStatic(), {"material.E": "as moduli.slip"})
    with pytest.raises(UsageError, match=r"unknown parameter 'moduli\.slip'"):
        require_paths(bar(methods={"m": unknown}), Path(__file__))


def test_the_law_of_a_method_keeps_what_it_knows_of_the_coefficients() -> None:
    rubber = Material(E, 0.4, "neo_hooke", coefficients=Coefficients(volumetric="coupled"))
    tree = bar().parameters.with_scene(material=rubber)
    linear, yeoh = (changed_by(tree, {"material.law": law}).scene.material
                    for law in ("linear", "yeoh"))  # fmt: skip
    assert (linear.coefficients, yeoh.coefficients.volumetric) == (Coefficients(), "coupled")


def test_a_user_changes_a_method_that_takes_a_value_of_another_parameter() -> None:
    """Several of its paths may only agree together: a law and its coefficient."""
    own = Method("m", QuasiStatic(), {"material.E": "as material.rho"})
    given = {"material.C01": "1kPa", "material.law": "mooney_rivlin"}
    _, methods = configure(
        bar(methods={"m": own}, accepted=("m",)),
        Options({f"methods.m.{path}": text for path, text in given.items()}),
    )
    assert dict(methods["m"].scene) == {**own.scene, **given, "material.C01": 1e3}
    with pytest.raises(UsageError, match=r"unknown parameter 'moduli\.E'"):
        configure(bar(), Options({"methods.linear.material.E": "as moduli.E"}))


def test_a_value_that_every_method_replaces_is_refused_with_the_path_that_is_read() -> None:
    """Skin: each law has its modulus; one value for all would change nothing in silence."""
    skin = experiment("skin_pads")
    with pytest.raises(UsageError, match=r"material\.E: .* set material\.E_linear$"):
        configure(skin, Options({"material.E": "10kPa"}, ("linear",)))
    cone = experiment("ekf_cone")  # its explicit runs take a factor of it
    given, _ = configure(cone, Options({"material.E": "90kPa"}, ("nfem",)))
    assert given.scene.material.E == 90e3
