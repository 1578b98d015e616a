"""A tracked strip: exact stretches, a tracker against a stage, and the strip of others."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from beside import beside, experiment

from experiments.rubber_strip.points_file import StageTest, read_points, read_stage
from validate.arrays import Floats
from validate.errors import RecordingError, UsageError
from validate.fem.laws.plane_stress import response
from validate.parameters import with_given
from validate.pipeline import load as load_experiment
from validate.pipeline.experiment.options import Options
from validate.pipeline.experiment.tree import Built, Tree
from validate.pipeline.run.pipeline import compare

stretches = beside("rubber_strip", "stretches").stretches
load = beside("rubber_strip", "strip").load
against_stage = beside("rubber_strip", "tracker").against_stage
TREE: Tree = experiment("rubber_strip").parameters

NU = 0.42
AXIAL = 1 + np.linspace(0, 0.3, 13)


def turned() -> Floats:
    """A proper rotation about no axis of the strip."""
    q, _ = np.linalg.qr(np.array([[1.0, 2.0, 0.3], [0.2, 1.0, 4.0], [3.0, 0.1, 1.0]]))
    return np.asarray(q * np.sign(np.linalg.det(q)))


def strip(axial: Floats, across: Floats) -> Floats:
    """Points (nt, 120, 3) m of a strip of 50 mm x 4 mm pulled homogeneously, anywhere in space."""
    x, y = np.meshgrid(np.linspace(0, 0.05, 24), np.linspace(0, 0.004, 5), indexing="ij")
    flat = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    pulled = [flat * [a, b, 1.0] + [0.001 * k, 0.0, 0.0]
              for k, (a, b) in enumerate(zip(axial, across, strict=True))]  # fmt: skip
    return np.array(pulled) @ turned().T + [0.1, 0.2, 0.4]


def contracted() -> Floats:
    """What a coupled neo-Hooke of this Poisson ratio does."""
    tree = with_given(TREE, {"nu.neo_coupled": NU})
    point: Any = Built()(None, tree, experiment("rubber_strip").methods["neo_coupled"].scene)
    return response(point, AXIAL)["free_stretch"]


def written(folder: Path, name: str = "pulled_mm.npz", noise: float = 0.002) -> Path:
    points = 1e3 * strip(AXIAL, contracted())
    points += np.random.default_rng(5).normal(0, noise, points.shape)
    np.savez(folder / name, points=points)
    return folder / name


def test_stretches_of_a_strip_anywhere_in_space_are_its_own() -> None:
    x = strip(AXIAL, AXIAL**-0.4)
    x[3, 7] = np.nan
    found = stretches(x, 4)
    assert found.axial == pytest.approx(np.tile(AXIAL, (4, 1)).T, rel=1e-12)
    assert found.across == pytest.approx(np.tile(AXIAL**-0.4, (4, 1)).T, rel=1e-11)
    assert found.ratio == pytest.approx(np.full((12, 4), 0.4), rel=1e-9)
    assert found.sd_across < 1e-12


def test_the_deviation_of_a_mean_stretch_is_that_of_many_trackings() -> None:
    rng, x = np.random.default_rng(2), strip(AXIAL[:2], AXIAL[:2] ** -0.4)
    said, got = [], []
    for _ in range(200):
        found = stretches(x + rng.normal(0, 5e-6, x.shape), 4)
        said.append(found.sd_across)
        got.append(found.across[1].mean())
    assert np.std(got) == pytest.approx(np.mean(said), rel=0.15)


def test_too_few_points_are_said() -> None:
    x = strip(AXIAL, AXIAL**-0.4)
    with pytest.raises(RecordingError, match=r"120 points.*180 needed for 30 patches"):
        stretches(x, 30)
    x[5, 30:56] = np.nan
    with pytest.raises(RecordingError, match="state 5: 4 of 30 points"):
        stretches(x, 4)


def test_archives_say_their_unit_and_hold_no_programs(tmp_path: Path) -> None:
    path = written(tmp_path, "pulled.npz")
    with pytest.raises(UsageError, match=r"pulled.npz has no unit; .* --set unit=mm"):
        read_points(path)
    assert read_points(path, "mm").marker("points").x.shape == (13, 120, 3)
    np.savez(tmp_path / "other_mm.npz", faces=np.zeros((2, 3)))
    with pytest.raises(RecordingError, match=r"'points'.*\['faces'\]"):
        read_points(tmp_path / "other_mm.npz")
    np.savez(tmp_path / "whole_mm.npz", points=np.ones((2, 5, 3), dtype="int32"))
    with pytest.raises(RecordingError, match=r"points \(2, 5, 3\) int32.* as float"):
        read_points(tmp_path / "whole_mm.npz")
    np.savez(tmp_path / "object_mm.npz", points=np.array([{}, None], dtype=object))
    with pytest.raises(RecordingError, match="not an archive of arrays"):
        read_points(tmp_path / "object_mm.npz")
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    (tmp_path / "damaged_mm.npz").write_bytes(data)
    with pytest.raises(RecordingError, match=r"CRC|damaged"):
        read_points(tmp_path / "damaged_mm.npz")


def test_a_strip_that_does_not_reach_beyond_its_first_steps_is_said(tmp_path: Path) -> None:
    path = written(tmp_path)
    with pytest.raises(RecordingError, match=r"12 states.*first = 40 %"):
        load(with_given(TREE, {"recording": str(path), "first": 0.4}), tmp_path)


def test_a_tracker_is_as_far_off_its_stage_as_it_was_made(tmp_path: Path) -> None:
    """Paths of other lengths (perspective), one position 2 um off along and 1 um across."""
    rng, stage = np.random.default_rng(1), 2e-4 * np.arange(15)
    slopes = 16e3 * (1 + 0.02 * rng.normal(size=(900, 1))) * np.array([[0.8, 0.6]])
    x = 500 * rng.random((900, 2)) + stage[:, None, None] * slopes
    off = 16e3 * (2e-6 * np.array([0.8, 0.6]) + 1e-6 * np.array([-0.6, 0.8]))
    x[7] += off
    noisy = x + rng.normal(0, 0.008, x.shape)
    noisy[3, 5] = np.nan
    np.savez(tmp_path / "cam_px.npz", points=noisy, stage_mm=1e3 * stage)
    found = against_stage(read_stage(tmp_path / "cam_px.npz"))
    assert found.points == 899
    assert found.scale == pytest.approx(16e3, rel=0.01)
    assert found.along[7] == pytest.approx(2e-6 * 14 / 15, rel=0.05)
    assert found.aside[7] == pytest.approx(1e-6 * 14 / 15, rel=0.05)
    assert found.scatter == pytest.approx(0.008 / 16e3, rel=0.03)
    with pytest.raises(RecordingError, match=r"3 positions over 0\.4 mm"):
        against_stage(StageTest("short", x[:3], stage[:3]))


@pytest.mark.slow
def test_the_first_steps_predict_the_last_one(tmp_path: Path) -> None:
    options = Options({"recording": str(written(tmp_path))}, methods=("neo_coupled", "svk"))
    result = compare(load_experiment("rubber_strip"), options)
    found = {s.name: s.value for s in result.identified}
    assert found["nu.neo_coupled"] == pytest.approx(NU, abs=0.01)
    verdicts = {m.name: [c.verdict for c in m.checks] for m in result.methods}
    assert verdicts == {"neo_coupled": ["good enough"], "svk": ["not good enough"]}


@pytest.mark.slow
def test_the_strip_of_others(shared_data: Path) -> None:
    result = compare(load_experiment("rubber_strip"), Options({}))
    found = {s.name: s.value for s in result.identified}
    assert found["nu.neo_coupled"] == pytest.approx(0.415, abs=0.005)
    off = {m.name: m.checks[0].value for m in result.methods if m.accepted}
    assert off["neo_coupled"] == pytest.approx(0.66e-3, abs=0.05e-3)
    assert off["neo_split"] == pytest.approx(2.98e-3, abs=0.05e-3)
    assert off["svk"] == pytest.approx(-28.8e-3, abs=0.5e-3)
    (drawn,) = next(e for e in result.exhibits if e.anchor == "strip").charts
    places = {s.label: np.column_stack([s.x, s.y]) for s in drawn.series}
    measured = places.pop("measured")
    far = {name: np.sqrt(((at - measured) ** 2).mean()) for name, at in places.items()}  # mm
    assert far["neo-Hooke, coupled volume"] == pytest.approx(0.12, abs=0.06)
    assert far["neo-Hooke, coupled volume"] < far["St. Venant-Kirchhoff"]
    tracker = next(e for e in result.exhibits if e.anchor == "tracker").tables[0]
    assert [row[1] for row in tracker.rows] == [3476, 3475]
    assert all(row[4] == pytest.approx(1.5, abs=0.2) for row in tracker.rows)  # um, along
    assert all(row[7] == pytest.approx(0.255, abs=0.01) for row in tracker.rows)  # um, one point


@pytest.mark.parametrize(("states", "patches"), [(1, 4), (5, 1)])
def test_a_ratio_needs_two_states_and_two_patches(states: int, patches: int) -> None:
    with pytest.raises(RecordingError, match=f"{states} states in {patches} patches: at least two"):
        stretches(np.zeros((states, 40, 3)), patches)
