"""`validate new` of slender, nearly incompressible bodies: right, and known to be right."""

from pathlib import Path

import numpy as np
import pytest
from command_line import called, refused

from validate.arrays import Floats
from validate.parameters import with_given
from validate.pipeline import run_in_memory
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.find import load_file
from validate.pipeline.experiment.options import folder_of
from validate.pipeline.run.case_solution import solve
from validate.recording.mcap.write import write_recording
from validate.recording.types import Markers, Recording, Source

LENGTH, ACROSS, NOISE = 0.1, 0.01, 2e-5
T = np.linspace(0, 1, 11)
ANSWERS = """
body = {body}
held.all = "{held}"
material = {{E = 1e6, nu = 0.499{rho}}}
law = "neo_hooke"
moved = {moved}
motion.how = "static"
seen = {{layout = "as seen"}}
accept = {{marker = "1mm"}}
why = {{marker = "of a test"}}
ranges = {{E = "0.1%", nu = 0.0005, load = "0.1%"}}
"""
BLOCK = {"body": '{shape = "block", block = "100mm,10mm,10mm"}', "held": "xmin"}
ROUND = {"body": '{shape = "cylinder", cylinder = "10mm,100mm"}', "held": "zmin"}


def along(axis: int, shares: tuple[float, ...]) -> Floats:
    """Points of the axis, or of a side of the block, at shares of the length."""
    x = np.zeros((len(shares), 3)) if axis == 2 else np.full((len(shares), 3), ACROSS / 2)
    x[:, axis] = LENGTH * np.array(shares)
    return x


def declared(folder: Path, shape: dict[str, str], *, tracked: bool) -> Experiment:
    """A body held at one end, under its weight, or whose other end three markers move by 10 mm."""
    axis = 2 if shape is ROUND else 0
    down = np.array([-1.0, 0, 0]) if shape is ROUND else np.array([0, 0, -1.0])
    shares = (0.5, 0.75) if tracked else (0.5, 1.0)
    x = along(axis, shares)
    names: tuple[str, ...] = ("half", "far")
    moved = '{by = "gravity", along = "' + ("-x" if shape is ROUND else "-z") + '"}'
    u = np.zeros((len(T), 2, 3))
    if tracked:
        corners = along(axis, (1.0, 1.0, 1.0))
        corners[:, [i for i in range(3) if i != axis]] += 3e-3 * np.array([[1, 0], [-1, 0], [0, 1]])
        x, names = np.vstack([corners, x]), ("e1", "e2", "e3", *names)
        u = np.zeros((len(T), 5, 3))
        u[:, :3] = 0.01 * T[:, None, None] * down
        end = "zmax" if shape is ROUND else "xmax"
        moved = f'{{by = "markers", place = "{end}", markers = "e1,e2,e3"}}'
    u += np.random.default_rng(3).normal(0, NOISE, u.shape)
    source = Source("x", "", 0, "x")
    streams = {"m": Markers(T, names, x + u, NOISE, "body")}
    write_recording(Recording("log", source, 0, markers=streams), folder / "log.mcap")
    text = ANSWERS.format(**shape, moved=moved, rho="" if tracked else ", rho = 1000")
    (folder / "a.toml").write_text(text, "utf-8")
    code, said = called("new", "mine", "--from", "log.mcap", "--answers", "a.toml")
    assert code == 0, said
    assert "first answer: up to" in said
    return load_file(folder / "experiments" / "mine.py")


def errors(of: Experiment, cells: tuple[int, ...]) -> Floats:
    """Of every marker and instant, simulated less recorded, by the linear law on these cells."""
    p = with_given(of.parameters, {"body.cells": cells})
    found = solve(of, of.load(p, folder_of(of)), "linear", of.methods["linear"], p).residuals
    return np.vstack([residual.values for residual in found.values()])


@pytest.mark.slow
@pytest.mark.usefixtures("estimates")
@pytest.mark.parametrize("shape", [BLOCK, ROUND], ids=["block", "cylinder"])
@pytest.mark.parametrize("tracked", [False, True], ids=["gravity", "tracked"])
def test_a_slender_body_is_within_a_percent_of_the_converged_one_and_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, shape: dict[str, str], *, tracked: bool
) -> None:
    monkeypatch.chdir(tmp_path)
    made = declared(tmp_path, shape, tracked=tracked)
    cells = made.parameters.scene.body.cells
    finer = tuple(3 * n // 2 for n in cells)
    mine, converged = errors(made, cells), errors(made, finer)
    motion = np.abs(converged).max()  # the compared markers were recorded at rest
    assert motion > 2e-3
    assert np.abs(mine - converged).max() < 0.01 * motion
    for check in run_in_memory(made, methods=made.accepted).checks:
        assert 2 * check.u_val < 0.1 * motion, check


@pytest.mark.slow
@pytest.mark.usefixtures("estimates")
def test_refine_sets_all_load_steps_and_no_limit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    made = declared(tmp_path, BLOCK, tracked=True)
    assert made.refine is not None
    assert made.refine(made.parameters, tmp_path) == {"mesh.budget": "false", "seen.states": "30"}
    words = refused("run", "hanging_bar", "--refine")
    assert "--refine: hanging_bar runs on all its meshes already" in words
