"""Rigid indenters on measured bodies, and the machine that moves them, against exact truths."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from machine_logs import machine_log, on_a_body

from validate.commands.questions.scene import tree_of
from validate.compare.result import Result
from validate.errors import ComparisonError, SceneError, UsageError
from validate.fem.system import build
from validate.parameters import with_given
from validate.pipeline import run_in_memory
from validate.pipeline.bodies.choices import BodyRanges, Machine, MeasuredBody, SeenOf
from validate.pipeline.bodies.measured import touching
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.tree import Built, Tree
from validate.pipeline.plates.scene import doubt, yielding
from validate.recording.mcap.write import write_recording
from validate.recording.types import Recording
from validate.scene.contact import (
    Indenter,
    RigidContact,
    RigidCylinder,
    RigidPlane,
    RigidPunch,
    RigidSphere,
)
from validate.scene.geometries.indented_bodies import IndentedBlock, IndentedCylinder
from validate.scene.material import Material
from validate.scene.scene import Load, Scene, Support

SIZE, E, C = (0.04, 0.03, 0.02), 20e3, 4e-3
STIFFNESS = E * SIZE[0] * SIZE[1] / SIZE[2]  # N/m between slippery plates, nu 0
GAP, DEPTH, NOISE = 2e-4, 1e-3, 2e-4
T = np.linspace(0.0, 4.0, 161)


def pressed(shape: Indenter, **more: Any) -> tuple[RigidContact, ...]:
    """An indenter that comes down on the upper side."""
    declared: Any = shape
    return (RigidContact("displacement", "zmax", declared, "-z", **more),)


QUARTER = IndentedBlock(SIZE, (2, 2, 2), (0.02, 0.015, 0.02), part="quarter")
PLATE = Indenter("plate", gap=GAP)
BLOCK = Tree(
    "log.mcap",
    Scene(QUARTER, Material(E, 0.0), (Support("zmin", (2,)),), contacts=pressed(PLATE),
          dilatation="by_element"),
    MeasuredBody(
        SeenOf(force="force", states=9), BodyRanges(E=1e-3, nu=1e-3, load=1e-3, contact=1e-6),
        Machine(C, 1e-5),
    ),
)  # fmt: skip


def log(compliance: float = C) -> Recording:
    """A plate that comes down through a gap onto a uniaxial bar, by a machine that yields."""
    depth = np.linspace(-GAP, DEPTH, len(T))
    force = STIFFNESS * np.maximum(depth, 0.0)
    noise = np.random.default_rng(1).normal(0, NOISE, len(T))
    return recorded(GAP + depth + compliance * force, force + noise)


def recorded(u: Any, F: Any) -> Recording:
    return machine_log(T, u, F, NOISE)


def experiment(folder: Path, p: Tree, compliance: float = C) -> Experiment:
    methods = {"linear": touching("linear", "linear")}
    return on_a_body(folder, p, log(compliance), methods, {"force": 0.05})


def verdicts(result: Result) -> set[tuple[str, str]]:
    return {(c.validation, c.acceptance) for c in result.checks}


@pytest.fixture(scope="module")
def known(tmp_path_factory: pytest.TempPathFactory) -> Result:
    return run_in_memory(experiment(tmp_path_factory.mktemp("known"), BLOCK))


def test_a_declared_compliance_makes_the_verdict_right(known: Result) -> None:
    assert verdicts(known) == {("not distinguishable", "good enough")}
    assert not known.warnings
    force = known.methods[0].runs[0].traces["displacement.force"].y
    # The recorded force's noise enters the depth by C F, which is what is left.
    assert force[-1] == pytest.approx(STIFFNESS * DEPTH, abs=4 * C * STIFFNESS * NOISE)


def test_its_standard_uncertainty_enters_u_input(known: Result) -> None:
    """dF/dC = -F dF/du, of a linear specimen -F k."""
    high = next(c for c in known.checks if c.name == "force.max@high")
    assert {i.name for i in known.inputs} >= {"machine compliance", "contact point"}
    share = STIFFNESS * BLOCK.settings.machine.sd  # of the force
    least, most = 0.5 * share * STIFFNESS * DEPTH, 3 * share * STIFFNESS * DEPTH
    assert least < high.u_input < most


def test_without_it_the_verdict_is_wrong_and_the_doubt_comes_first(tmp_path: Path) -> None:
    result = run_in_memory(experiment(tmp_path, BLOCK.with_settings(machine=Machine())))
    assert ("differs", "not good enough") in verdicts(result)
    assert not any("machine" in w for w in result.warnings)  # 8 N/mm is soft for any machine
    stiff = recorded(T * 1e-4, T * 20.0)  # 2e5 N/m
    said = doubt(BLOCK.with_settings(machine=Machine()), stiff, "displacement", 0.5)
    assert said.startswith("machine.compliance is not set. The specimen yields 5e-06 m/N at 80 N")
    assert "shifts the force by 2 to 20 % (16 N; the limit is 0.5 N)" in said


def test_a_stated_compliance_is_no_doubt() -> None:
    stiff = recorded(T * 1e-4, T * 20.0)
    assert not doubt(BLOCK.with_settings(machine=Machine(0.0)), stiff, "displacement", 0.5)


def told(folder: Path, file: str) -> Any:
    p = BLOCK.with_settings(machine=Machine(measured=file))
    return yielding(p, folder, "displacement").settings.machine


def test_a_rigid_block_tells_the_compliance(tmp_path: Path) -> None:
    force = T * 5.0 + np.random.default_rng(2).normal(0, NOISE, len(T))
    write_recording(recorded(3e-6 * T * 5.0, force), tmp_path / "rigid.mcap")
    found = told(tmp_path, "rigid.mcap")
    assert found.compliance == pytest.approx(3e-6, rel=1e-3)
    assert 0 < found.sd < 3e-9
    write_recording(recorded(0 * T, 0 * T), tmp_path / "empty.mcap")
    with pytest.raises(ComparisonError, match="press a rigid block"):
        told(tmp_path, "empty.mcap")


def test_a_measured_compliance_is_taken_off(tmp_path: Path) -> None:
    """Set by a user, on an experiment that declares no compliance; its sd enters u_input."""
    force = T * 0.5 + np.random.default_rng(2).normal(0, NOISE, len(T))
    write_recording(recorded(C * T * 0.5, force), tmp_path / "rigid.mcap")
    made = experiment(tmp_path, BLOCK.with_settings(machine=Machine()))
    result = run_in_memory(made, {"machine.measured": "rigid.mcap"})
    assert verdicts(result) == {("not distinguishable", "good enough")}
    used = {q.path: q.default for q in result.parameters}
    assert used["machine.compliance"] == pytest.approx(C, rel=1e-3)
    assert "machine compliance" in {i.name for i in result.inputs}


def test_an_open_modulus_is_identified_through_contact(tmp_path: Path) -> None:
    p = with_given(BLOCK, {"material.E": None})
    result = run_in_memory(experiment(tmp_path, p))
    value = result.identified_values[0]
    assert value.value == pytest.approx(E, rel=0.01)
    assert value.parts["machine compliance"] == pytest.approx(
        E * STIFFNESS * BLOCK.settings.machine.sd, rel=0.3
    )
    assert {c.name: c.acceptance for c in result.checks}["force.max@high"] == "good enough"


def test_a_plate_that_presses_already(tmp_path: Path) -> None:
    """A gap below zero is a depth at the first instant."""
    p = BLOCK.with_scene(contacts=pressed(replace(PLATE, gap=-1e-4)))
    other = run_in_memory(experiment(tmp_path, p), quick=True)
    force = other.methods[0].runs[0].traces["displacement.force"].y
    assert force[-1] == pytest.approx(STIFFNESS * (DEPTH + GAP + 1e-4), rel=2e-3)


@pytest.mark.parametrize(
    ("card", "shape", "start"),
    [
        (Indenter("plate", gap=1e-3), RigidPlane, SIZE[2] + 1e-3),
        (Indenter("sphere", 5e-3), RigidSphere, SIZE[2] + 5e-3),
        (Indenter("punch", 5e-3, gap=1e-3), RigidPunch, SIZE[2] + 1e-3),
        (Indenter("cylinder", 4e-3, axis="+x", gap=1e-3), RigidCylinder, SIZE[2] + 5e-3),
    ],
)
def test_an_indenter_starts_above_the_middle_of_its_place(
    card: Indenter, shape: type, start: float
) -> None:
    scene = Built()(None, BLOCK.with_scene(contacts=pressed(card)))
    mesh, (part,) = scene.mesh, scene.contacts
    assert isinstance(part.shape, shape)
    at = np.array(part.shape.vectors()[0])
    assert at == pytest.approx([SIZE[0] / 2, SIZE[1] / 2, start], abs=1e-9)
    gaps = part.shape.gap(mesh.nodes[np.isclose(mesh.nodes[:, 2], SIZE[2])])
    assert gaps.min() == pytest.approx(card.gap, abs=1e-9)


def test_an_uncertain_gap_moves_no_instant_to_the_other_window(tmp_path: Path) -> None:
    """Half of the way is a state of its own; what presses already is deeper everywhere."""
    made = experiment(tmp_path, BLOCK, 0.0)
    (log_,) = made.load(BLOCK, tmp_path)
    windows = []
    for gap in (0.0, -1e-6):
        p = BLOCK.with_scene(contacts=pressed(replace(PLATE, gap=gap)))
        p = with_given(p, {"seen.states": 8, "machine.compliance": 0.0})
        scene = made.build(log_, p, made.methods["linear"].scene)
        windows.append([len(s.t) for s in made.place(log_, p, scene).selections])
    assert windows[0] == windows[1] == [4, 4]


@pytest.mark.slow
def test_a_quarter_has_the_force_of_the_whole(tmp_path: Path) -> None:
    """A tip a little off the middle presses a whole body, with cells as large."""
    forces = []
    shares, middle = (1.5 * 4 / 60,) * 3, (SIZE[0] / 2, SIZE[1] / 2, SIZE[2])
    for part, cells in (("quarter", (2, 2, 2)), ("whole", (4, 4, 2))):
        body = IndentedBlock(SIZE, cells, middle, shares, part)
        tip = Indenter("sphere", 5e-3, gap=GAP, tip=() if part == "quarter" else middle)
        p = BLOCK.with_scene(body=body, supports=(Support("zmin"),), contacts=pressed(tip))
        p = p.with_settings(machine=Machine(0.0))
        result = run_in_memory(experiment(tmp_path, p, 0.0), quick=True)
        assert result.methods[0].scene.copies == (4 if part == "quarter" else 1)
        forces.append(result.methods[0].runs[0].traces["displacement.force"].y[-1])
    assert forces[1] == pytest.approx(forces[0], rel=1e-3)


def test_a_cylinder_specimen_has_its_volume() -> None:
    body = IndentedCylinder(0.02, 0.003, (12, 4), (0.3, 0.3))
    volume = 4 * body.resolved(Path()).cell_volumes().sum()
    assert volume == pytest.approx(np.pi * 0.01**2 * 0.003, rel=0.01)


ANSWERS = {"body.shape": "cylinder", "body.cylinder": "20mm,3mm", "held.all": "zmin",
           "moved.by": "displacement", "moved.along": "-z", "moved.place": "zmax",
           "indenter.shape": "sphere", "indenter.radius": "1mm"}  # fmt: skip


def test_answers_tell_whether_a_quarter_is_enough() -> None:
    block = {**ANSWERS, "body.shape": "block", "body.block": "20mm,20mm,10mm"}
    for more, part in (
        ({}, "quarter"), ({"held.x": "xmin"}, "whole"), ({"seen.markers": "m"}, "whole"),
        ({"indenter.tip": "1mm,10mm,10mm"}, "whole"), ({"moved.along": "+z"}, "whole"),
        ({"indenter.tip": "10mm,10mm,10mm"}, "quarter"),
    ):  # fmt: skip
        assert tree_of(log(), {**block, **more}).scene.body.part == part, more
    with pytest.raises(UsageError, match="give the body as a mesh file"):
        tree_of(log(), {**ANSWERS, "held.x": "xmin"})


def refused(shape: Indenter) -> None:
    Built()(None, BLOCK.with_scene(contacts=pressed(shape)))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Indenter("sphere"), "needs a radius above 0"),
        (lambda: pressed(PLATE, friction=-1.0), "friction -1, expected 0 or more"),
        (lambda: Indenter("plate", tip=(1.0,)), "expected three lengths"),
        (lambda: Machine(-1.0), "both must be 0 or above"),
        (lambda: Machine(1e-6, measured="x.mcap"), "both set"),
        (lambda: IndentedBlock(SIZE, (1, 1), SIZE), "three numbers each"),
        (lambda: IndentedCylinder(0.02, 0.01, (8,)), "two numbers each"),
        (lambda: refused(Indenter("cylinder", 1e-3, axis="+z")), "must lie across its direction"),
        (lambda: refused(Indenter("sphere", 1e-3, tip=(1.0, 1.0, 1.0))), "no node of its place"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused(make: Any, words: str) -> None:
    with pytest.raises((UsageError, SceneError), match=words):
        make()


def test_a_compliance_without_a_force_is_refused(tmp_path: Path) -> None:
    p = with_given(BLOCK, {"seen.force": None})
    with pytest.raises(UsageError, match="needs the recorded force"):
        run_in_memory(experiment(tmp_path, p))


def test_a_force_that_pulls_moves_no_indenter(tmp_path: Path) -> None:
    part = replace(pressed(PLATE)[0], name="force")
    with pytest.raises(UsageError, match="'force' moves the body: unit N"):
        run_in_memory(experiment(tmp_path, BLOCK.with_scene(contacts=(part,))))
    both = BLOCK.with_scene(loads=(Load("force", "zmax", "-z"),))
    with pytest.raises(UsageError, match="2 parts that move or load"):
        run_in_memory(experiment(tmp_path, both))


def test_a_quarter_shows_its_force_alone(tmp_path: Path) -> None:
    p = with_given(BLOCK, {"seen.markers": "m"})
    with pytest.raises(UsageError, match="a quarter, of which only the force"):
        run_in_memory(experiment(tmp_path, p))


@pytest.mark.slow
def test_hertz_on_a_large_block() -> None:
    """F = 4/3 E* sqrt(R) d^(3/2) on the mesh that an indenter gets: three cells a radius."""
    R, a, nu = 1.0, 0.01, 0.3
    answers = {
        **ANSWERS, "body.shape": "block", "body.block": "1.2,1.2,0.6", "material.nu": f"{nu}",
        "material.E": f"{E}", "indenter.radius": f"{R}", "indenter.gap": "0",
    }  # fmt: skip
    made = tree_of(machine_log(T, 4 / 3 * a * 4 / 3 * a / R * T / T[-1], T), answers, order=1)
    scene = Built()(None, made)
    assert scene.copies == 4
    stepper = touching("linear", "linear").settings.prepare(build(scene))
    state = stepper.step(stepper.rest(), np.array([a**2 / R]))
    hertz = 4 / 3 * E / (1 - nu**2) * a**3 / R
    assert state.numbers["displacement.force"] == pytest.approx(hertz, rel=0.02)


def test_a_bonded_plate_is_stiffer_than_a_slippery_one(tmp_path: Path) -> None:
    """Between slippery plates the force is E A d / h; a bonded one holds the block's end."""
    p = BLOCK.with_scene(material=Material(E, 0.45)).with_settings(machine=Machine(0.0))
    forces = []
    for bonded in (False, True):
        stuck = p.with_scene(contacts=pressed(replace(PLATE, bonded=bonded)))
        result = run_in_memory(experiment(tmp_path, stuck, 0.0), quick=True)
        forces.append(result.methods[0].runs[0].traces["displacement.force"].y[-1])
    assert forces[0] == pytest.approx(STIFFNESS * DEPTH, rel=1e-3)
    assert forces[1] > 1.1 * forces[0]
