"""`validate new` offers every law of the package, with the coefficients that it has."""

from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from command_line import here, refused

from validate.commands.questions.law import law_names
from validate.pipeline import run_in_memory
from validate.pipeline.experiment.declaration import from_json, to_json
from validate.pipeline.experiment.find import load_file
from validate.recording.mcap.write import write_recording
from validate.recording.types import Recording, Signal, Source
from validate.scene.laws import Coefficients, law_kind
from validate.scene.material import LawName

PLATES = """
experiment = "plates"
test = "compression"
body = {diameter = "30mm", height = "20mm"}
accept = {force = "0.1N"}
why = {force = "felt"}
"""
BODY = """
experiment = "body"
body = {shape = "block", block = "30mm,30mm,20mm"}
material = {E = "20kPa", nu = 0.3}
moved = {by = "displacement", along = "-z", place = "zmax", sideways = false}
held = {x = "xmin", y = "ymin", z = "zmin"}
accept = {force = "50mN"}
why = {force = "felt"}
ranges = {E = "2%", nu = 0.01, load = 0.01}
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    t = np.arange(200) / 10
    d = 8e-5 * t
    signals = {
        "displacement": Signal(t, d[:, None], "m", 0.0, "machine"),
        "force": Signal(t, 700 * d[:, None], "N", 5e-3, "machine"),
    }
    log = Recording("gel", Source("x", "", 0, "x"), 0, signals=signals)
    write_recording(log, tmp_path / "log.mcap")
    return tmp_path


def value_of(name: str) -> str:
    """Of two terms for lists, of 100 Pa for numbers."""
    default = getattr(Coefficients(), name)
    if not isinstance(default, tuple):
        return "100"
    return "2,4" if default else "100"


def test_every_law_is_offered() -> None:
    assert set(law_names()) == set(get_args(LawName))


@pytest.mark.parametrize("law", get_args(LawName))
@pytest.mark.parametrize("kind", [PLATES, BODY], ids=["plates", "body"])
def test_a_law_is_chosen_with_its_coefficients(folder: Path, kind: str, law: str) -> None:
    names = law_kind(law).coefficients
    given = "".join(f'"material"."{n}" = "{value_of(n)}"\n' for n in names)
    text = kind
    if "material =" in kind:  # an inline table cannot be extended
        text = kind.replace(
            'material = {E = "20kPa", nu = 0.3}', 'material.E = "20kPa"\nmaterial.nu = 0.3'
        )
    (folder / "a.toml").write_text(f'law = "{law}"\n{given}{text}', "utf-8")
    code, _, err = here("new", "mine", "--from", "log.mcap", "--answers", "a.toml")
    assert code == 0, err
    written = (folder / "experiments" / "mine.py").read_text("utf-8")
    assert len(written.splitlines()) <= 60
    mine = load_file(folder / "experiments" / "mine.py")
    material = mine.parameters.scene.material
    changed = mine.methods[mine.accepted[0]].scene
    assert (changed or {}).get("material.law", material.law) == law
    used = material.coefficients
    for name in names:
        assert getattr(used, name) != getattr(Coefficients(), name)
    if names:
        (folder / "a.toml").write_text(f'law = "{law}"\n{text}', "utf-8")
        said = refused("new", "other", "--from", "log.mcap", "--answers", "a.toml")
        assert f"material.{names[-1]} (" in said


@pytest.mark.slow
@pytest.mark.parametrize("law", [name for name in get_args(LawName) if name != "linear"])
def test_plates_run_in_every_law_at_large_strain(folder: Path, law: str) -> None:
    """One cell an edge; force and its error are numbers, and near the log's 700 N/m."""
    names = law_kind(law).coefficients
    given = "".join(f'"material"."{n}" = "{value_of(n)}"\n' for n in names)
    (folder / "a.toml").write_text(f'law = "{law}"\n{given}{PLATES}', "utf-8")
    assert here("new", "mine", "--from", "log.mcap", "--answers", "a.toml")[0] == 0
    mine = load_file(folder / "experiments" / "mine.py")
    coarse = {"body.cells": "1,1"}
    (found,) = run_in_memory(mine, coarse, methods=("slip",), quick=True).methods
    scores = {s.name: s.value for s in found.scores}
    assert np.isfinite(list(scores.values())).all()
    file = folder / "experiments" / "mine.py"
    assert to_json(from_json(to_json(mine), file)) == to_json(mine)
    assert 0 < scores["force.rms@beyond"] < 0.1
