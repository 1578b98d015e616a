"""The tip of a tracked tool against one that is known, and against a published one."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import here, refused
from scipy.spatial.transform import Rotation

from validate.arrays import Floats, Ints
from validate.errors import RegistrationError
from validate.recording.mcap.read import read_recording
from validate.recording.mcap.write import write_recording
from validate.recording.motion_capture.poses import pose_signals
from validate.recording.readers import recognised
from validate.recording.types import Recording, Source
from validate.register.tools.image_plane import pivot

# private: _standing: replaced, to bring a case about.

TIP = np.array([0.1086, -0.0078, 0.0025])
N = 300
SEQUENCE = "markers/stylus/EightLandmarkPointsTrackedForPhantomRegistration.igs.mha"
PUBLISHED = np.array([0.108565, 0.00777385, 0.0025389])  # m, its device set
ERROR = 0.000462  # m, stated beside it


def turned(
    rng: np.random.Generator, tilt: Floats, noise: float = 0.0, points: int = 1, coming: int = 0
) -> tuple[Floats, Floats, Ints]:
    """Swung about each axis by `tilt` degrees; the tip comes from afar in the first poses."""
    u = np.linspace(0, 1, N)[:, None]
    swing = np.sin(2 * np.pi * (u * np.array([11, 13, 17]) + rng.random(3)))
    R = (Rotation.from_rotvec(np.radians(tilt) * swing) * Rotation.random(rng=rng)).as_matrix()
    point = np.arange(N) * points // N
    c = 0.2 * rng.normal(size=(points, 3))
    T = c[point] - R @ TIP + noise * rng.normal(size=(N, 3))
    T[:coming] += np.linspace(0.2, 0.01, coming)[:, None]
    return R, T, point


WIDE = np.full(3, 30.0)


@pytest.mark.parametrize("points", [1, 4])
def test_without_noise_the_tip_is_exact(points: int) -> None:
    R, T, point = turned(np.random.default_rng(0), WIDE, points=points)
    got = pivot(R, T, point)
    assert np.abs(got.tip - TIP).max() < 1e-15
    assert got.rms < 1e-14
    assert len(got.used) == N
    assert np.abs(R @ TIP + T - got.points[point]).max() < 1e-14


def test_the_standard_deviation_that_is_stated_holds() -> None:
    """Of ten parts: a t value of nine degrees of freedom is within 2.26 in 95 %."""
    rng = np.random.default_rng(1)
    found = [pivot(*turned(rng, WIDE, noise=3e-4)) for _ in range(40)]
    z = np.abs([(f.tip - TIP) / f.sd for f in found])
    assert 0.88 < (z < 2.26).mean() < 0.99
    assert np.mean([f.rms for f in found]) == pytest.approx(3e-4, rel=0.03)


def test_poses_before_the_tip_stands_are_left_out() -> None:
    R, T, point = turned(np.random.default_rng(2), WIDE, noise=3e-4, coming=70)
    got = pivot(R, T, point)
    assert 220 <= len(got.used) <= 230
    assert got.used.min() >= 70
    assert np.abs(got.tip - TIP).max() < 4 * got.sd.max()
    with pytest.raises(RegistrationError, match=r"stay on one point|fewer than half"):
        pivot(*turned(np.random.default_rng(2), WIDE, noise=3e-4, coming=200))


@pytest.mark.parametrize(
    ("tilt", "says"),
    [
        ((40, 0, 0), r"turned by .* degrees rms about the second axis, at least 5.7 are needed"),
        ((5, 5, 5), r"turned by 5 degrees rms"),
    ],
)
def test_a_motion_that_leaves_the_tip_open_is_refused(tilt: Any, says: str) -> None:
    with pytest.raises(RegistrationError, match=says):
        pivot(*turned(np.random.default_rng(3), np.array(tilt), noise=3e-4))


def test_too_few_poses_and_a_tip_that_wanders_are_refused() -> None:
    R, T, point = turned(np.random.default_rng(4), WIDE)
    with pytest.raises(RegistrationError, match="10 poses; at least 20"):
        pivot(R[:10], T[:10], point[:10])
    moved = T + 0.05 * np.sin(np.linspace(0, 40, N))[:, None] * [1, 0.5, -0.7]
    with pytest.raises(RegistrationError, match=r"stay on one point|fewer than half"):
        pivot(R, moved, point)


def recording(tmp_path: Path, reference: bool = False) -> Path:
    rng = np.random.default_rng(5)
    R, T, _ = turned(rng, WIDE, noise=1e-4)
    t = np.arange(N) / 20
    signals = {}
    if reference:  # which moves about as it likes
        Q, P = Rotation.random(N, rng=rng).as_matrix(), rng.normal(size=(N, 3))
        R, T = Q @ R, np.einsum("nij,nj->ni", Q, T) + P
        signals = pose_signals("Reference", t, Q, P, "Tracker")
    signals |= pose_signals("Stylus", t, R, T, "Tracker")
    file = tmp_path / "x.mcap"
    write_recording(Recording("x", Source("x", "", 0, "verified"), 0, signals=signals), file)
    return file


@pytest.mark.parametrize("reference", [False, True])
def test_the_command_tells_the_tip_and_writes_its_path(reference: bool, tmp_path: Path) -> None:
    x, out = recording(tmp_path, reference), tmp_path / "y.mcap"
    more = ["--reference", "Reference"] if reference else []
    code, said, _ = here("calibrate", str(x), "--pivot", "Stylus", *more, "-o", str(out))
    assert code == 0
    assert "of 300 of 300 poses about 1 points" in said
    got = read_recording(out)
    told = [float(v) for v in got.metadata["pivot/Stylus"]["tip"].removesuffix(" mm").split(",")]
    assert told == pytest.approx(1e3 * TIP, abs=0.1)
    tip = got.marker("Stylus/tip")
    assert tip.x.std(axis=0).max() < 2e-4
    assert tip.sd == pytest.approx(1e-4, rel=0.1)


def test_what_the_command_cannot_use_is_told(tmp_path: Path) -> None:
    x, out = recording(tmp_path), str(tmp_path / "y.mcap")
    assert "tools with poses: Stylus" in refused("calibrate", str(x), "--pivot", "Pen", "-o", out)
    both = refused("calibrate", str(x), "--pivot", "Stylus", "--unit", "mm", "-o", out)
    assert "--unit: for an image plane; leave out with --pivot Stylus" in both
    lone = refused("calibrate", str(x), "--tip", "1mm,2mm,3mm", "-o", out)
    assert "--reference and --tip need --pivot TOOL" in lone
    odd = ("calibrate", str(x), "--pivot", "Stylus", "-o", out, "--tip")
    assert "expected three lengths" in refused(*odd, "1mm")
    assert "never stays" in refused(*odd, "500mm,0mm,0mm")
    assert "Missing option '--points'" in refused("calibrate", str(x), "-o", out)


@pytest.mark.slow
def test_a_stylus_on_eight_landmarks_against_its_published_tip(
    shared_data: Path, tmp_path: Path
) -> None:
    """1.5 mm from the published tip: three times the error stated beside it, eight times our own
    sd. Landmarks are predicted worse with ours (docs/explanation/measured.md); why is untested."""
    path = shared_data / SEQUENCE
    x, out = tmp_path / "x.mcap", tmp_path / "y.mcap"
    write_recording(recognised(path).read(path, {"images": "no"}), x)
    given = ["--pivot", "StylusToTracker", "--reference", "ReferenceToTracker", "-o", str(out),
             "--force"]  # fmt: skip
    code, said, _ = here("calibrate", str(x), *given, "--tip", "110mm,5mm,0mm")
    assert code == 0
    assert "poses about 10 points" in said
    got = read_recording(out).metadata["pivot/StylusToTracker"]
    tip = 1e-3 * np.array([float(v) for v in got["tip"].removesuffix(" mm").split(",")])
    assert tip == pytest.approx([0.1096, 0.00677, 0.00285], abs=1e-4)
    assert 2 * ERROR < np.linalg.norm(tip - PUBLISHED) < 4 * ERROR
    whole = refused("calibrate", str(x), *given)
    assert "does not stay on one point" in whole


def test_a_tip_that_stands_in_few_poses_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    R, T, point = turned(np.random.default_rng(0), WIDE)
    module = sys.modules[pivot.__module__]  # its package exports the function by the same name
    monkeypatch.setattr(module, "_standing", lambda *_: np.arange(149))
    with pytest.raises(RegistrationError, match="149 of 300 poses"):
        pivot(R, T, point)
    monkeypatch.setattr(module, "_standing", lambda *_: np.arange(150))
    assert len(pivot(R, T, point).used) == 150
