"""Logs of a force or of a displacement alone: weights that are hung on, a stage."""

from pathlib import Path

import numpy as np
import pytest
from exports import D, F, T

from validate.errors import RecordingError, UsageError
from validate.recording.motion_capture.text_rows import ASSUMED
from validate.recording.tables.testing_machine import read_instron


def log(folder: Path, names: str, *columns: np.ndarray) -> Path:
    path = folder / "log.csv"
    rows = "".join(";".join(f"{x:.6f}" for x in r) + "\n" for r in zip(*columns, strict=True))
    path.write_text(f"{names}\n{rows}".replace(".", ","), "utf-8")
    return path


def test_a_force_alone_is_taken_when_it_is_said_so(tmp_path: Path) -> None:
    """It was a dead end: a displacement was asked for that no column has."""
    path = log(tmp_path, "Tempo (s);Forza (N)", T, F)
    with pytest.raises(RecordingError, match="--map displacement=none"):
        read_instron(path)
    found = read_instron(path, {"displacement": "none"})
    assert found.signals.keys() == {"force"}
    assert np.allclose(found.signal("force", "N").y[:, 0], F, rtol=0, atol=1e-6)
    assert found.record(ASSUMED)["signs"].startswith("as written")
    turned = read_instron(path, {"displacement": "none", "force": "Forza (N):-"})
    assert np.allclose(turned.signal("force", "N").y[:, 0], -F, rtol=0, atol=1e-6)
    assert turned.record(ASSUMED)["signs"] == "reversed, as given by --map"


def test_a_stage_alone_and_nothing(tmp_path: Path) -> None:
    path = log(tmp_path, "Zeit (s);Weg (mm)", T, D)
    with pytest.raises(RecordingError, match="--map force=none"):
        read_instron(path)
    found = read_instron(path, {"force": "none"}).signal("displacement", "m")
    assert np.allclose(found.y[:, 0], D / 1e3, rtol=0, atol=1e-9)
    with pytest.raises(UsageError, match="no column is left"):
        read_instron(path, {"force": "none", "displacement": "none"})
