"""Landmarks that a tracked tip was held on, from a recording to points with names."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from command_line import here, refused
from scipy.spatial.transform import Rotation

from validate.arrays import Floats
from validate.recording.mcap.read import read_recording
from validate.recording.mcap.write import write_recording
from validate.recording.motion_capture.poses import pose_signals
from validate.recording.types import Recording, Source

TIP = np.array([0.11, -0.008, 0.003])
POINTS = np.array(
    [[0, 0, 0], [0.06, 0, 0], [0, 0.08, 0.01], [0.05, 0.03, 0.04], [0.01, 0.02, 0.07]]
)
NAMES = ("edge", "corner", "top", "side", "lid")
BODY = Rotation.from_euler("xyz", [20, -40, 75], degrees=True).as_matrix()
PLACE = np.array([0.3, -0.1, 0.8])
NOISE, HZ = 5e-5, 40


def path(order: list[int], rng: np.random.Generator) -> Floats:
    """Two seconds on each landmark of the `order`, one on the way to the next."""
    stops = POINTS[order] @ BODY.T + PLACE
    legs = [np.repeat(stops[:1], 2 * HZ, axis=0)]
    for a, b in pairwise(stops):
        legs += [np.linspace(a, b, HZ), np.repeat(b[None], 2 * HZ, axis=0)]
    x = np.concatenate(legs)
    return np.asarray(x + NOISE * rng.normal(size=x.shape))


def recorded(folder: Path, order: list[int], reference: bool = False) -> Path:
    rng = np.random.default_rng(7)
    x = path(order, rng)
    t = np.arange(len(x)) / HZ
    tilt = 0.3 * np.column_stack([np.sin(t), np.cos(1.3 * t), np.sin(0.7 * t)])
    R = Rotation.from_rotvec(tilt).as_matrix()
    T = x - R @ TIP
    signals = {}
    if reference:  # which is carried about meanwhile
        Q = Rotation.from_rotvec(0.2 * np.column_stack([t, t, -t])).as_matrix()
        P = np.column_stack([0.1 * t, 0 * t, 0.2 * np.sin(t)])
        R, T = Q @ R, np.einsum("nij,nj->ni", Q, T) + P
        signals = pose_signals("BaseToTracker", t, Q, P, "Tracker")
    signals |= pose_signals("PenToTracker", t, R, T, "Tracker")
    file = folder / "x.mcap"
    write_recording(Recording("x", Source("x", "", 0, ""), 0, signals=signals), file)
    return file


def listed(folder: Path) -> Path:
    file = folder / "known.fcsv"
    rows = [
        ",".join([str(i), *(repr(1e3 * float(v)) for v in p), "0,0,0,1,1,1,0", name, "", ""])
        for i, (name, p) in enumerate(zip(NAMES, POINTS, strict=True))
    ]
    columns = "id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID"
    head = [
        "# Markups fiducial file version = 4.11", "# CoordinateSystem = LPS",
        f"# columns = {columns}",
    ]  # fmt: skip
    file.write_text("\n".join([*head, *rows]) + "\n")
    return file


def command(file: Path, out: Path, *more: str) -> tuple[str, ...]:
    tip = ",".join(f"{1e3 * v:g}mm" for v in TIP)
    return ("digitise", str(file), "--tool", "PenToTracker", "--tip", tip, *more, "-o", str(out))


@pytest.mark.parametrize("reference", [False, True])
def test_places_are_named_and_predicted_from_the_others(reference: bool, tmp_path: Path) -> None:
    """Touched in another order than the list's, one of them not at all."""
    x, out = recorded(tmp_path, [3, 0, 4, 1], reference), tmp_path / "y.mcap"
    more = ["--reference", "BaseToTracker"] if reference else []
    code, said, err = here(*command(x, out, "--known", str(listed(tmp_path)), *more))
    assert (code, err) == (0, "")
    assert "4 places where the tip stood still" in said
    got = read_recording(out).marker("PenToTracker/landmarks")
    assert (sorted(got.names), got.frame) == (
        ["corner", "edge", "lid", "side"], "Base" if reference else "Tracker",
    )  # fmt: skip
    true = {name: BODY @ p + PLACE for name, p in zip(NAMES, POINTS, strict=True)}
    off = got.x[0] - [true[name] for name in got.names]
    assert 0.1 < np.sqrt((off**2).mean()) / got.sd < 3  # of 20 samples each, which follow no other
    assert got.sd < NOISE
    record = read_recording(out).record("landmarks/PenToTracker")
    assert record["not touched"] == "top"
    pose = np.array([float(v) for v in record["pose"].split(" (")[0].split()]).reshape(4, 4)
    assert pose[:3, 3] == pytest.approx(PLACE, abs=2e-4)
    assert pose[:3, :3] == pytest.approx(BODY, abs=3e-3)


def test_without_a_list_they_have_numbers_and_are_targets_of_an_image_plane(tmp_path: Path) -> None:
    x, out = recorded(tmp_path, [0, 1, 2]), tmp_path / "y.mcap"
    assert here(*command(x, out))[0] == 0
    got = read_recording(out).marker("PenToTracker/landmarks")
    assert got.names == ("1", "2", "3")
    assert got.x[0] == pytest.approx(POINTS[:3] @ BODY.T + PLACE, abs=4 * NOISE)
    code, _, err = here(*command(x, tmp_path / "z.mcap", "--known", str(out)))
    assert code == 2  # three of the same session: too few to leave one out
    assert "4 are needed" in err


def test_what_cannot_be_digitised_is_one_line(tmp_path: Path) -> None:
    x, out = recorded(tmp_path, [0, 1, 2, 3]), tmp_path / "y.mcap"
    assert "--unit mm: it is the unit of --known" in refused(*command(x, out, "--unit", "mm"))
    table = tmp_path / "known.csv"
    table.write_text("target,x,y,z,x2,y2,z2\na,0,0,0,1,0,0\n")
    known = ("--known", str(table))
    assert "the table has no unit" in refused(*command(x, out, *known))
    assert "a: wires" in refused(*command(x, out, *known, "--unit", "mm"))
    table.write_text("target,x,y,z\n" + "".join(f"{i},{i},{i * i},{3 * i}\n" for i in range(5)))
    assert "of 5 landmarks lie among the 4 places" in refused(
        *command(x, out, *known, "--unit", "mm")
    )
    assert "tools with poses: PenToTracker" in refused(*command(x, out, "--reference", "Base"))
    wrong = [w if w != "PenToTracker" else "Pen" for w in command(x, out)]
    assert "no poses of 'Pen'; tools with poses: PenToTracker" in refused(*wrong)
    far = list(command(x, out))
    far[far.index("--tip") + 1] = "900mm,0mm,0mm"
    assert "never stays within 3 mm for 1 s: check --tip" in refused(*far)
    assert not out.exists()


def test_landmarks_of_a_body_are_taken_from_what_declares_them(
    shared_data: Path, tmp_path: Path
) -> None:
    """The published tip on the published landmarks: each within .4 mm of where the others put it,
    as `validate run stylus_phantom` finds."""
    folder = shared_data / "markers" / "stylus"
    sequence = folder / "EightLandmarkPointsTrackedForPhantomRegistration.igs.mha"
    x, out = tmp_path / "x.mcap", tmp_path / "y.mcap"
    assert here("import", str(sequence), "--map", "images=no", "-o", str(x))[0] == 0
    known = str(next(folder.glob("PlusDeviceSet*.xml")))
    given = ["digitise", str(x), "--tool", "StylusToTracker", "--reference", "ReferenceToTracker",
             "--tip", "108.565mm,7.77385mm,2.5389mm", "--known", known]  # fmt: skip
    assert here(*given, "-o", str(out))[0] == 0
    record = read_recording(out).record("landmarks/StylusToTracker")
    assert record["predicted"] == "rms 0.256 mm, each landmark from the others"
    assert record["places that are no landmark"] == "2"
    assert "in millimetres" in refused(*given, "--unit", "cm", "-o", str(tmp_path / "z.mcap"))


def test_poses_that_are_missing_are_told(tmp_path: Path) -> None:
    """The tip seen at the ends of its time on a landmark alone, the reference not on another."""
    whole = read_recording(recorded(tmp_path, [3, 0, 4, 1], reference=True))
    t = whole.signals["PenToTracker/translation"].t
    seen = {"PenToTracker": (t < 3.5) | (t > 4.8), "BaseToTracker": (t < 6.1) | (t > 6.3)}
    keeps = {topic: seen[topic.partition("/")[0]] for topic in whole.signals}
    signals = {
        topic: replace(s, t=s.t[keeps[topic]], y=s.y[keeps[topic]])
        for topic, s in whole.signals.items()
    }
    write_recording(replace(whole, signals=signals, clock={}), tmp_path / "gaps.mcap")
    given = command(tmp_path / "gaps.mcap", tmp_path / "y.mcap", "--reference", "BaseToTracker")
    code, said, err = here(*given)
    assert code == 0
    told = " ".join((said + err).split())
    gone, left = int((~seen["BaseToTracker"]).sum()), int(seen["PenToTracker"].sum())
    assert f"{gone} of {left} poses of 'PenToTracker' are left out: 'BaseToTracker' was" in told
    assert "from 2.98 s on, the tip was visible for only 0.7 of 2.02 s" in told
    assert told.count("it may have moved in between") == 1


def test_a_landmark_that_was_taken_back_is_none(tmp_path: Path) -> None:
    """3D Slicer keeps it without coordinates."""
    x, known = recorded(tmp_path, [3, 0, 4, 1]), listed(tmp_path)
    rows = [f"{r},1,0" if ",top," in r else r for r in known.read_text().splitlines()]
    known.write_text("\n".join(rows) + "\n")
    assert here(*command(x, tmp_path / "y.mcap", "--known", str(known)))[0] == 0
    record = read_recording(tmp_path / "y.mcap").record("landmarks/PenToTracker")
    assert record["not touched"] == "none"
    assert "of 4 landmarks" in record["fitted"]
