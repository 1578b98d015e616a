"""`validate new` for an indentation: its questions, what it finds itself, the file it writes."""

from pathlib import Path

import numpy as np
import pytest
import skfem
from command_line import called
from machine_logs import machine_log
from scipy.optimize import nnls
from scipy.sparse.linalg import spsolve
from skfem.models.elasticity import lame_parameters, linear_elasticity

from validate.arrays import Floats
from validate.commands.questions.contact import _first_touch
from validate.pipeline import run_in_memory
from validate.pipeline.experiment.find import load_file
from validate.recording.mcap.write import write_recording
from validate.recording.types import Recording

# private: _first_touch: the questions ask it of a recording only.

GAP, DEPTH, RADIUS, K = 2e-4, 1e-3, 5e-3, 4e3
T = np.linspace(0.0, 8.0, 241)

ANSWERS = """
experiment = "body"
body = {shape = "block", block = "20mm,20mm,10mm"}
held = {all = "zmin"}
moved = {by = "displacement", along = "-z", place = "zmax"}
indenter = {shape = "sphere", radius = "5mm", friction = "bonded"}
machine = {compliance = "1e-4", sd = "1e-5"}
material = {E = "20kPa", nu = 0.3}
law = "linear"
accept = {force = "50mN"}
why = {force = "of a test"}
ranges = {E = "2%", nu = 0.01, load = 0.01}
"""


def log(power: float = 1.5) -> Recording:
    depth = np.linspace(-GAP, DEPTH, len(T))
    force = K * np.maximum(depth, 0.0) ** power
    force += np.random.default_rng(1).normal(0, 1e-3 * force.max(), len(T))
    return machine_log(T, GAP + depth, force)


@pytest.mark.parametrize(("shape", "power"), [("sphere", 1.5), ("plate", 1.0)])
def test_the_first_touch_is_found_with_its_uncertainty(shape: str, power: float) -> None:
    found = _first_touch(log(power), {"moved.by": "displacement"}, shape)
    assert found is not None
    assert found[0] == pytest.approx(GAP, abs=3 * found[1])
    assert 0 < found[1] < 0.02 * DEPTH


def test_a_log_that_never_presses_has_no_first_touch() -> None:
    flat = machine_log(T, log().signals["displacement"].y[:, 0], np.zeros(len(T)))
    assert _first_touch(flat, {"moved.by": "displacement"}, "sphere") is None


def test_answers_make_an_indentation_that_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write_recording(log(), tmp_path / "log.mcap")
    (tmp_path / "a.toml").write_text(ANSWERS, "utf-8")
    assert called("new", "ball", "--from", "log.mcap", "--answers", "a.toml")[0] == 0
    text = (tmp_path / "experiments" / "ball.py").read_text("utf-8")
    assert len(text.splitlines()) <= 60
    assert "machine=Machine(compliance=0.0001, sd=1e-05)," in text
    assert "bonded=True" in text
    experiment = load_file(tmp_path / "experiments" / "ball.py")
    scene = experiment.parameters.scene
    assert scene.contacts[0].shape.gap == pytest.approx(GAP, abs=2e-5)
    assert scene.body.part == "quarter"
    reach = np.sqrt(RADIUS * DEPTH)  # four cells along it
    assert scene.body.shares == pytest.approx((14 * reach / 4 / 10e-3,) * 3, rel=0.02)
    small = {"body.cells": "4,4,4", "seen.states": "8"}
    result = run_in_memory(experiment, small, quick=True)
    run = result.methods[0].runs[0]
    assert run.outcome.state == "finished"
    assert run.traces["displacement.slipping"].y.max() == 0  # bonded
    assert run.traces["displacement.touching"].y[-1] > 1


def test_the_machine_is_asked_about(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_recording(log(), tmp_path / "log.mcap")
    known = ANSWERS.replace('friction = "bonded"', 'friction = "rough"')
    (tmp_path / "a.toml").write_text(known, "utf-8")
    code, said = called("new", "ball", "--from", "log.mcap", "--answers", "a.toml")
    assert code == 2
    assert "indenter.friction = rough" in said
    (tmp_path / "a.toml").write_text(ANSWERS, "utf-8")
    listed = called("new", "ball", "--from", "log.mcap", "--answers", "a.toml", "--questions")[1]
    assert "machine" in listed
    assert "frictionless" in listed


# --- a cylinder, against another code -------------------------------------------------------------

BAR, HALF, HEIGHT, THICK, MODULUS, NU = 0.04, 0.02, 0.02, 2e-3, 20e3, 0.3
PRESSED = """
experiment = "body"
body = {shape = "block", block = "40mm,2mm,20mm"}
held = {all = "zmin", y = "ymin+ymax"}
moved = {by = "displacement", along = "-z", place = "zmax"}
indenter = {shape = "cylinder", radius = "40mm", axis = "+y", friction = "frictionless", gap = 0}
machine = {compliance = "0", sd = "0"}
material = {E = "20kPa", nu = 0.3}
law = "linear"
accept = {force = "2mN"}
why = {force = "of a test"}
ranges = {E = "0.1%", nu = 0.001, load = 0.001, contact = "0.001mm"}
"""


def line_contact(depths: Floats) -> Floats:
    """Forces N of a bar on the bonded strip at depths m, by scikit-fem in plane strain.

    Half of it in bilinear quadrilaterals; contact is a quadratic program in the nodal forces f >= 0
    with the surface's compliance C: min f C f / 2 - f (d - x^2 / 2 R).
    """
    x = HALF * np.linspace(0, 1, 61) ** 1.7
    z = HEIGHT * (1 - np.linspace(1, 0, 41) ** 1.7)
    basis = skfem.Basis(skfem.MeshQuad.init_tensor(x, z), skfem.ElementVector(skfem.ElementQuad1()))
    lam, mu = lame_parameters(MODULUS, NU)
    K = linear_elasticity(lam, mu).assemble(basis)
    nodal, at = basis.nodal_dofs, basis.mesh.p
    top = np.flatnonzero(np.isclose(at[1], HEIGHT))
    held = np.concatenate([nodal[:, np.isclose(at[1], 0)].ravel(), nodal[0, np.isclose(at[0], 0)]])
    free = np.setdiff1d(np.arange(basis.N), held)
    loads = np.zeros((basis.N, len(top)))
    loads[nodal[1, top], np.arange(len(top))] = 1.0
    C = np.zeros_like(loads)
    C[free] = spsolve(K.tocsc()[free][:, free], loads[free])
    L = np.linalg.cholesky(C[nodal[1, top]])
    into = depths[:, None] - at[0, top] ** 2 / (2 * BAR)
    return np.array([2 * THICK * nnls(L.T, np.linalg.solve(L, d))[0].sum() for d in into])


@pytest.mark.slow
def test_a_cylinder_presses_with_the_force_of_another_code(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Through the command, the written file and a whole run: within 2 u_val, which is u_num."""
    monkeypatch.chdir(tmp_path)
    depth = np.linspace(0.0, 2.5e-4, 26)
    force = line_contact(depth)
    t = np.linspace(0.0, 5.0, len(depth))
    write_recording(machine_log(t, depth, force, 1e-6), tmp_path / "log.mcap")
    (tmp_path / "a.toml").write_text(PRESSED, "utf-8")
    code, said = called("new", "bar", "--from", "log.mcap", "--answers", "a.toml")
    assert code == 0, said
    result = run_in_memory(load_file(tmp_path / "experiments" / "bar.py"))
    assert {c.name for c in result.checks} == {"force.max@low", "force.max@high"}
    for check in result.checks:
        assert check.validation == "not distinguishable", check
        assert abs(check.value) < 0.05 * force[-1]
        assert check.u_num > 0.5 * check.u_val


def test_a_file_of_answers_elsewhere_holds_numbers_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A compliance of 1e-4 m/N was taken for the name of a file beside the answers."""
    (tmp_path / "mine").mkdir()
    monkeypatch.chdir(tmp_path / "mine")
    write_recording(log(), tmp_path / "log.mcap")
    (tmp_path / "a.toml").write_text(ANSWERS.replace('"bonded"', '"0.3"'), "utf-8")
    code, said = called("new", "ball", "--from", "../log.mcap", "--answers", "../a.toml")
    assert code == 0, said
    p = load_file(tmp_path / "mine" / "experiments" / "ball.py").parameters
    assert p.settings.machine.compliance == 1e-4
    assert p.scene.contacts[0].friction == 0.3
