"""What `validate new` writes from a log enters every study, as any experiment does."""

import json
import os
from pathlib import Path

import numpy as np
import pytest

from validate.commands.main import run
from validate.recording.mcap.write import write_recording
from validate.recording.types import Recording, Signal, Source

DIAMETER, HEIGHT, E = 0.03, 0.02, 20e3


def compressed() -> Recording:
    """A cylinder of 20 kPa between slipping plates to 8 % strain."""
    t, d = np.arange(200) / 10, np.arange(200) * 8e-6
    noise = np.random.default_rng(1).normal(0, 0.005, len(t))
    force = E * np.pi * DIAMETER**2 / 4 * d / HEIGHT + noise
    signals = {
        "displacement": Signal(t, d[:, None], "m", 0.0, "machine"),
        "force": Signal(t, force[:, None], "N", 0.005, "machine"),
    }
    sizes = {"diameter_m": repr(DIAMETER), "height_m": repr(HEIGHT), "test": "compression"}
    return Recording("gel", Source("x", "", 0, "x"), 0, signals=signals,
                     metadata={"specimen": sizes})  # fmt: skip


@pytest.fixture(scope="module")
def own(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a log and the experiment written from it."""
    folder = tmp_path_factory.mktemp("own")
    write_recording(compressed(), folder / "gel.mcap")
    before = Path.cwd()
    os.chdir(folder)
    try:
        assert run(["new", "my_gel", "--from", "gel.mcap"]) == 0
    finally:
        os.chdir(before)
    return folder


@pytest.fixture
def here(own: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(own)
    monkeypatch.setenv("VALIDATE_NO_GL", "1")  # renders have tests of their own
    return own


def told(folder: Path, study: str) -> dict[str, object]:
    (path,) = (folder / "reports" / "my_gel").glob(f"study-{study}*/results.json")
    return dict(json.loads(path.read_text("utf-8"))["study"])


@pytest.mark.slow
def test_it_runs(here: Path) -> None:
    assert run(["run", "my_gel", "--methods", "slip"]) == 0


@pytest.mark.slow
def test_it_climbs_a_ladder_of_its_own_meshes_and_a_method_is_chosen(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["study", "tradeoff", "my_gel", "--quick", "--workers", "0"]) == 0
    found = told(here, "tradeoff")
    cells = found["cells"]
    assert isinstance(cells, list)
    assert {c["element"] for c in cells} == {"P1", "MD", "P2"}
    assert all(c["error_m"] is not None for c in cells)
    # Uniform compression is exact on every mesh; the law's share is not.
    assert max(c["error_m"] for c in cells) < 1e-12
    assert found["law_error_m"] > 1e-6  # type: ignore[operator]
    capsys.readouterr()
    finished = here / "reports" / "my_gel" / "study-tradeoff" / "cells"
    before = len(list(finished.glob("*.json")))
    asked = ["--error", "0.1mm", "--rate", "500Hz", "--workers", "0"]
    assert run(["study", "choose", "my_gel", "--quick", *asked]) == 0
    assert "meets 0.1 mm and 500 Hz" in " ".join(capsys.readouterr().out.split())
    assert len(list(finished.glob("*.json"))) >= before


def test_its_stability_map_says_that_nothing_is_stepped(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["study", "stability", "my_gel", "--quick", "--workers", "0"]) == 0
    assert "no scheme that marches in time" in " ".join(capsys.readouterr().out.split())
    assert told(here, "stability")["points"] == 0


def test_filters_are_refused_in_one_line(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["study", "filters", "my_gel"]) == 2
    error = capsys.readouterr().err
    assert "'my_gel' has no filter: no method of slip, bonded is given markers" in error
    assert error.count("\n") == 1
