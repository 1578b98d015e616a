"""Input files of FEBio and SOFA, which are not installed, against formats, jobs and a surrogate.

The surrogate answers as the documentation of the programs describes.
"""

import json
import os
import runpy
import sys
import types
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from validate.arrays import Floats
from validate.scene.geometries.box import box, grid
from validate.scene.laws import Coefficients
from validate.scene.material import Material
from validate.scene.mesh import Mesh
from validate.scene.scene import Drive, Load, Scene, Support, Weight
from validate.solve.external.exchange import ExternalJob, read_answer, write_job

SIZE, COUPLED = (0.02, 0.02, 0.04), Coefficients(volumetric="coupled")
TET = Scene(
    box(SIZE, (2, 2, 3)), Material(1e4, 0.4, "neo_hooke", 1000.0, coefficients=COUPLED),
    (Support("z0", (0, 1, 2)), Support("z1", (0, 1))),
    drives=(Drive("push", "z1", (0.0, 0.0, -1.0)),),
    loads=(Load("pull", "x1", (1.0, 0.0, 0.0)), Weight("gravity", (0.0, 0.0, -1.0))),
)  # fmt: skip
T = np.array([1.0, 2.0, 3.0])
INPUTS = np.array([[1e-3, 0.1, 9.81], [2e-3, 0.2, 9.81], [3e-3, 0.3, 9.81]])
# Sections of format 4.0 and what may stand in them, after the FEBio User's Manual.
SECTIONS = {
    "Module": set(), "Control": {"analysis", "time_steps", "step_size", "solver", "time_stepper"},
    "Material": {"material"}, "Mesh": {"Nodes", "Elements", "NodeSet"},
    "MeshDomains": {"SolidDomain"}, "Boundary": {"bc"}, "Loads": {"nodal_load"},
    "LoadData": {"load_controller"}, "Output": {"logfile"},
}  # fmt: skip
# Components of SOFA v24 and the data that they are given here, after its documentation.
COMPONENTS = {
    "RequiredPlugin": {"name"}, "DefaultAnimationLoop": set(),
    "StaticSolver": {"newton_iterations", "relative_correction_tolerance_threshold"},
    "NewmarkImplicitSolver": {"gamma", "beta", "rayleighMass"},
    "SparseLDLSolver": {"template"}, "MechanicalObject": {"name", "template", "position"},
    "TetrahedronSetTopologyContainer": {"name", "position", "tetrahedra"},
    "TetrahedronSetGeometryAlgorithms": {"template"},
    "HexahedronSetTopologyContainer": {"name", "position", "hexahedra"},
    "HexahedronSetGeometryAlgorithms": {"template"},
    "HexahedronFEMForceField": {"method", "youngModulus", "poissonRatio", "rayleighStiffness"},
    "TetrahedronHyperelasticityFEMForceField": {
        "materialName", "ParameterSet", "rayleighStiffness"
    },
    "MeshMatrixMass": {"massDensity"}, "FixedProjectiveConstraint": {"indices"},
    "PartialFixedProjectiveConstraint": {"indices", "fixedDirections"},
    "LinearMovementProjectiveConstraint": {"indices", "template", "keyTimes", "movements"},
    "ConstantForceField": {"indices", "forces"},
}  # fmt: skip


def written(program: str, folder: Path, scene: Scene, **more: Any) -> ExternalJob:
    job = write_job(folder, scene, T, more.pop("inputs", INPUTS), more.pop("inertia", False), 1e-6)
    root = Path(__file__).parents[2]
    path = root / "benchmarks" / "external" / f"{program}_simulator.py"
    module = runpy.run_path(str(path))
    module["main"](folder)
    return job


@pytest.fixture
def bare(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "/nowhere")


def vector(text: str | None) -> list[float]:
    return [float(part) for part in (text or "").split(",")]


@pytest.mark.usefixtures("bare")
def test_a_feb_has_the_sections_and_sets_of_its_format(tmp_path: Path) -> None:
    job = written("febio", tmp_path, TET)
    spec = ET.parse(tmp_path / "body.feb").getroot()
    assert (spec.tag, spec.get("version")) == ("febio_spec", "4.0")
    assert [part.tag for part in spec] == [*SECTIONS]
    for part in spec:
        assert {child.tag for child in part} <= SECTIONS[part.tag]
    nodes = [vector(n.text) for n in spec.iter("node")]
    assert np.allclose(nodes, TET.mesh.nodes, rtol=0, atol=1e-14)
    assert [int(n.get("id", 0)) for n in spec.iter("node")] == list(range(1, len(nodes) + 1))
    cells = np.array([vector(e.text) for e in spec.iter("elem")], dtype=int) - 1
    assert np.array_equal(cells, TET.mesh.cells)
    names = [s.get("name") for s in spec.iter("NodeSet")]
    assert len(names) == len(set(names))
    used = {x.get("node_set") for x in (*spec.iter("bc"), *spec.iter("nodal_load"))}
    assert used == set(names)
    assert [c.get("id") for c in spec.iter("load_controller")] == ["1", "2", "3"]
    material = next(spec.iter("material"))
    assert material.get("type") == "neo-Hookean"
    assert [c.tag for c in material] == ["density", "E", "v"]
    answer = read_answer(tmp_path, job)
    assert (answer.state, "febio4 body.feb" in answer.why) == ("cannot_run", True)


def skewed() -> Scene:
    """Hexahedra that are no boxes, whose top two drives move along one direction."""
    plain, rng = grid(SIZE, (2, 2, 2)), np.random.default_rng(2)
    nodes = plain.nodes + rng.uniform(-1e-3, 1e-3, plain.nodes.shape)
    mesh = Mesh(nodes, plain.cells, plain.kind, plain.facets)
    drives = Drive("push", "z1", (0.0, 0.0, -1.0)), Drive("lean", "z1", (0.0, 0.0, -1.0))
    return replace(TET, body=mesh, supports=TET.supports[:1], drives=drives)


LEANING = np.insert(INPUTS, 1, [4e-4, 5e-4, 6e-4], axis=1)


@pytest.mark.usefixtures("bare")
@pytest.mark.parametrize(("scene", "inputs"), [(TET, INPUTS), (skewed(), LEANING)])
def test_a_feb_holds_moves_and_pulls_as_the_job_does(
    tmp_path: Path, scene: Scene, inputs: Floats
) -> None:
    job = written("febio", tmp_path, scene, inputs=inputs)
    spec = ET.parse(tmp_path / "body.feb").getroot()
    sets = {s.get("name"): np.array(vector(s.text), dtype=int) - 1 for s in spec.iter("NodeSet")}
    curves = {
        c.get("id"): [vector(p.text) for p in c.iter("pt")] for c in spec.iter("load_controller")
    }
    at = {k: {point[0]: point[1] for point in v} for k, v in curves.items()}
    u, f = np.full(scene.mesh.nodes.shape, np.nan), np.zeros(scene.mesh.nodes.shape)
    for bc in spec.iter("bc"):
        own = sets[bc.get("node_set")]
        if bc.get("type") == "zero displacement":
            free = [bc.findtext(f"{c}_dof") for c in "xyz"]
            u[np.ix_(own, np.array([i for i, on in enumerate(free) if on == "1"]))] = 0.0
        else:
            value = bc.find("value")
            assert value is not None
            c = "xyz".index(bc.findtext("dof", ""))
            assert np.isnan(u[own, c]).all()  # a later one would replace it
            u[own, c] = vector(value.text)[0] * at[value.get("lc")][3.0]
    for load in spec.iter("nodal_load"):
        assert load.get("type") == "nodal_force"
        value = load.find("value")
        assert value is not None
        f[sets[load.get("node_set")]] += np.array(vector(value.text)) * at[value.get("lc")][3.0]
    system = job.system
    asked = (system.moves @ inputs[2, : len(scene.drives)]).reshape(u.shape)
    held = np.zeros(u.size, bool)
    held[system.held] = True
    assert np.array_equal(np.isfinite(u.ravel()), held)
    assert u.ravel()[held] == pytest.approx(asked.ravel()[held])
    assert f == pytest.approx(
        (system.loads @ inputs[2, len(scene.drives) :]).reshape(f.shape), abs=1e-12
    )


def test_sofa_weighs_hexahedra_that_are_no_boxes_as_we_do(tmp_path: Path) -> None:
    scene = skewed()
    job = write_job(tmp_path, scene, T, LEANING, False, 1e-6)
    path = Path(__file__).parents[2] / "benchmarks" / "external" / "sofa_simulator.py"
    mass = runpy.run_path(str(path))["weights"](scene.mesh.nodes, scene.mesh.cells, 1000.0)
    assert mass == pytest.approx(-job.system.loads[2::3, 1])


LOG = """#!{python}
import numpy as np
blocks = []
for k in range(1, {steps} + 1):
    rows = "".join(f"{{i + 1}} {{1e-4 * k}} 0 {{-1e-4 * i}}\\n" for i in range({nodes}))
    blocks.append(f"*Step  = {{k}}\\n*Time  = {{k}}\\n*Data  = ux;uy;uz\\n{{rows}}")
open("displacement.txt", "w").write("".join(blocks))
"""


def stand_in(folder: Path, name: str, text: str) -> None:
    (folder / name).write_text(text, "utf-8")
    (folder / name).chmod(0o755)


@pytest.mark.parametrize(("steps", "state"), [(3, "finished"), (2, "not_converged")])
def test_what_febio_prints_is_an_answer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, steps: int, state: str
) -> None:
    programs = tmp_path / "programs"
    programs.mkdir()
    nodes = len(TET.mesh.nodes)
    stand_in(programs, "febio4", LOG.format(python=sys.executable, steps=steps, nodes=nodes))
    monkeypatch.setenv("PATH", f"{programs}{os.pathsep}{os.environ['PATH']}")
    (tmp_path / "job").mkdir()
    job = written("febio", tmp_path / "job", TET)
    answer = read_answer(tmp_path / "job", job)
    assert (answer.state, len(answer.u)) == (state, steps)
    assert answer.u[1, 5].tolist() == pytest.approx([2e-4, 0.0, -5e-4])


@pytest.mark.usefixtures("bare")
def test_what_febio_has_otherwise_is_said(tmp_path: Path) -> None:
    split = Material(1e4, 0.4, "neo_hooke", 1000.0)
    job = written("febio", tmp_path, Scene(TET.mesh, split, TET.supports, drives=TET.drives,
                                           loads=TET.loads))  # fmt: skip
    lines = read_answer(tmp_path, job).findings
    assert any("split volumetric form" in line for line in lines)


class Part:
    """What a scene adds, as SofaPython3 would keep it."""

    def __init__(self, kind: str, given: dict[str, Any]) -> None:
        assert given.keys() <= COMPONENTS[kind], (kind, given.keys())
        self.kind, self.given = kind, given
        self.forces = types.SimpleNamespace(value=given.get("forces"))
        self.position = types.SimpleNamespace(value=given.get("position"))


class Node:
    def __init__(self) -> None:
        self.parts: list[Part] = []
        self.controllers: list[Any] = []
        self.children: list[Node] = []

    def addObject(self, one: Any, **given: Any) -> Any:
        if isinstance(one, str):
            self.parts.append(Part(one, given))
            return self.parts[-1]
        self.controllers.append(one)
        return one

    def addChild(self, name: str) -> "Node":
        self.children.append(Node())
        return self.children[-1]


@pytest.fixture
def sofa(monkeypatch: pytest.MonkeyPatch) -> Callable[[Path], tuple[Node, Node]]:
    monkeypatch.setenv("PATH", "/nowhere")
    controller = type("Controller", (), {"__init__": lambda self, **given: None})
    module = types.ModuleType("Sofa")
    module.Core = types.SimpleNamespace(Controller=controller)  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "Sofa", module)

    def made(folder: Path) -> tuple[Node, Node]:
        root = Node()
        runpy.run_path(str(folder / "scene.py"))["createScene"](root)
        return root, root.children[0]

    return made


Made = Callable[[Path], tuple[Node, Node]]


def test_a_scene_has_sofas_components_and_answers(tmp_path: Path, sofa: Made) -> None:
    job = written("sofa", tmp_path, TET)
    assert "runSofa" in read_answer(tmp_path, job).why
    root, body = sofa(tmp_path)
    kinds = [part.kind for part in body.parts]
    assert kinds[:2] == ["StaticSolver", "SparseLDLSolver"]
    law = body.parts[kinds.index("TetrahedronHyperelasticityFEMForceField")].given
    mu, bulk = 1e4 / 2.8, 1e4 / 3 / 0.2
    assert (law["materialName"], law["ParameterSet"]) == ("NeoHookean", pytest.approx([mu, bulk]))
    moves = body.parts[kinds.index("LinearMovementProjectiveConstraint")].given
    assert np.array(moves["movements"])[:, 2].tolist() == pytest.approx([0, -1e-3, -2e-3, -3e-3])
    assert moves["keyTimes"] == [0.0, 1.0, 2.0, 3.0]
    fixed = body.parts[kinds.index("FixedProjectiveConstraint")].given["indices"]
    assert fixed == TET.mesh.facet_nodes("z0").tolist()
    forces = [part for part in body.parts if part.kind == "ConstantForceField"]
    (walks,) = root.controllers
    dofs = body.parts[kinds.index("MechanicalObject")]
    for k in range(3):
        walks.onAnimateBeginEvent(None)
        total = sum(np.sum(np.array(part.forces.value), axis=0) for part in forces)
        weight = 1000 * 9.81 * np.prod(SIZE)
        assert total == pytest.approx([INPUTS[k, 1], 0.0, -weight])
        dofs.position.value = (TET.mesh.nodes + 1e-4 * (k + 1)).tolist()
        walks.onAnimateEndEvent(None)
    answer = read_answer(tmp_path, job)
    assert answer.state == "finished"
    assert answer.u[2] == pytest.approx(np.full(TET.mesh.nodes.shape, 3e-4))


def test_dynamics_of_hexahedra_march_by_newmark(tmp_path: Path, sofa: Made) -> None:
    bricks = Scene(
        grid(SIZE, (1, 1, 2)), Material(1e4, 0.3, "linear", 1000.0, 2.0, 1e-3),
        (Support("z0", (0, 1, 2)), Support("x0", (0,))), loads=(Weight("g", (0.0, 0.0, -1.0)),),
    )  # fmt: skip
    written("sofa", tmp_path, bricks, inputs=INPUTS[:, 2:], inertia=True)
    root, body = sofa(tmp_path)
    given = {part.kind: part.given for part in body.parts}
    assert given["NewmarkImplicitSolver"]["rayleighMass"] == 2.0
    assert given["HexahedronFEMForceField"]["rayleighStiffness"] == 1e-3
    assert given["PartialFixedProjectiveConstraint"]["fixedDirections"] == [1, 0, 0]
    assert given["MeshMatrixMass"] == {"massDensity": 1000.0}
    assert (root.dt, root.gravity) == (1.0, [0.0, 0.0, 0.0])  # type: ignore[attr-defined]


def test_a_drive_that_leaves_a_face_free_to_slide_is_not_written(
    tmp_path: Path, sofa: Made
) -> None:
    free = Scene(TET.mesh, TET.material, TET.supports[:1], drives=TET.drives, loads=TET.loads)
    job = written("sofa", tmp_path, free)
    assert "leaves other directions of 9 nodes free" in read_answer(tmp_path, job).why
    assert json.loads((tmp_path / "answer.json").read_text())["state"] == "cannot_run"
    assert not (tmp_path / "scene.py").exists()
