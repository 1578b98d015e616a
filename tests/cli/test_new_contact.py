"""`validate new` for an indentation: its questions, what it finds itself, the file it writes."""

from pathlib import Path

import numpy as np
import pytest

from tests.cli.test_new_body import called
from validate.cli.new_contact import _first_touch
from validate.recording.mcap.write import write_recording
from validate.recording.types import Recording, Signal, Source
from validate.replay import compare
from validate.replay.find import load_file

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
    signals = {
        "displacement": Signal(T, (GAP + depth)[:, None], "m", 0.0, "machine"),
        "force": Signal(T, force[:, None], "N", 0.0, "machine"),
    }
    return Recording("log", Source("x", "", 0, "x"), 0, signals=signals)


@pytest.mark.parametrize(("shape", "power"), [("sphere", 1.5), ("plate", 1.0)])
def test_the_first_touch_is_found_with_its_uncertainty(shape: str, power: float) -> None:
    found = _first_touch(log(power), {"moved.by": "displacement"}, shape)
    assert found is not None
    assert found[0] == pytest.approx(GAP, abs=3 * found[1])
    assert 0 < found[1] < 0.02 * DEPTH


def test_a_log_that_never_presses_has_no_first_touch() -> None:
    quiet = log()
    flat = Recording("log", quiet.source, 0, signals={
        "displacement": quiet.signals["displacement"],
        "force": Signal(T, np.zeros((len(T), 1)), "N", 0.0, "machine"),
    })  # fmt: skip
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
    card = experiment.parameters.indenter
    assert card.gap == pytest.approx(GAP, abs=2e-5)
    assert card.reach == pytest.approx(np.sqrt(RADIUS * DEPTH), rel=0.02)
    small = {"body.cells": "4", "seen.states": "8"}
    result = compare(experiment, small, quick=True)
    run = result.methods[0].runs[0]
    assert run.outcome.state == "finished"
    assert run.traces["moved.slipping"].y.max() == 0  # bonded
    assert run.traces["moved.touching"].y[-1] > 1


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
