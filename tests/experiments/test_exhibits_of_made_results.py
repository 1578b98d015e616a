"""What the papers' exhibits say of results that are made by hand."""

from types import SimpleNamespace as Made

import numpy as np
import pytest
from beside import beside

from experiments.bending_rod import exhibits as rod_exhibits

# private: _MESHES: replaced by a small number: a short test.
# private: _dips, _motion: called alone, case by case.
# private: _tips: replaced, to bring a case about.


def test_a_tip_that_hangs_is_a_positive_sag(monkeypatch: pytest.MonkeyPatch) -> None:
    def tips(system: object, t: np.ndarray) -> tuple[np.ndarray, float]:
        return -0.02 * (1 - np.cos(t)), -0.02

    body = Made(scene=Made(mesh=Made(cells=range(48))))
    monkeypatch.setattr(rod_exhibits, "_MESHES", (2,))
    monkeypatch.setattr(rod_exhibits, "_tips", tips)
    monkeypatch.setattr(rod_exhibits, "build_system", lambda scene: body)
    made, numbers = rod_exhibits._dips()
    mesh, *beams = made.tables[0].rows
    assert mesh[:3] == (2, 48, pytest.approx(20.0))
    assert mesh[3] == pytest.approx(np.pi / 2, abs=0.01)  # cos t = 0
    assert numbers["static.2"] == pytest.approx(0.02)
    assert all(row[2] > 0 for row in beams)
    drawn = made.charts[0].series[0].y
    assert drawn[0] == pytest.approx(20.0, rel=1e-3)  # mm above its static place


def test_a_recording_without_markers_has_no_noise() -> None:
    truth = Made(probes={"node_A": np.array([[0.0, 0.0, 0.0], [3e-3, 0.0, 4e-3]])})
    followed = Made(truth=truth, seen=Made(of=lambda kind: ()))
    assert beside("ekf_cone", "exhibits")._motion(followed, "node_A") == (pytest.approx(5e-3), 0.0)
    seen = Made(of=lambda kind: (Made(sd=2e-5),))
    assert beside("ekf_cone", "exhibits")._motion(Made(truth=truth, seen=seen), "node_A")[1] == 2e-5
