"""The image plane of a tracked probe against one that is known."""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import here, refused
from scipy.spatial.transform import Rotation

from validate.arrays import Floats
from validate.errors import RegistrationError
from validate.recording.mcap.read import read_recording
from validate.recording.mcap.write import write_recording
from validate.recording.motion_capture.poses import pose_signals
from validate.recording.types import Contours, Frames, Markers, Recording, Source
from validate.register.markers.transform import Similarity
from validate.register.tools.image_plane import KnownTarget, SeenPoints, image_plane

TRUTH = Similarity(Rotation.from_euler("xyz", [80, -25, 10], degrees=True).as_matrix(),
                   np.array([0.012, -0.03, 0.045]))  # fmt: skip
SCALE = np.array([0.11e-3, 0.098e-3])  # m per px


def poses(n: int, rng: np.random.Generator, turn: float = 0.3) -> tuple[Floats, Floats]:
    R = Rotation.from_rotvec(turn * rng.normal(size=(n, 3))).as_matrix()
    return R, 0.02 * rng.normal(size=(n, 3))


def pixel_of(place: Floats, R: Floats, t: Floats) -> Floats:
    """Where a place of the tracker's frame lies in image coordinates (x, y, away) m."""
    return (R.T @ (place - t) - TRUTH.t) @ TRUTH.R


def landmarks(rng: np.random.Generator, images: int, each: int, noise: float = 0.0) -> SeenPoints:
    """Places that happen to lie in each image's plane."""
    R, t = poses(images, rng)
    image = np.repeat(np.arange(images), each)
    px = rng.uniform([0, 0], [800, 600], size=(len(image), 2))
    flat = np.column_stack([px * SCALE, np.zeros(len(px))])
    there = np.einsum("nij,nj->ni", R[image], TRUTH.apply(flat)) + t[image]
    targets = tuple(KnownTarget(f"p{i}", x) for i, x in enumerate(there))
    px = px + noise * rng.normal(size=px.shape)
    return SeenPoints(px, image, targets, R[image], t[image])


def n_wires() -> list[KnownTarget]:
    """Three N's, one below the other: two parallel wires and a slanted one."""
    found = []
    for k in range(3):
        for name, x, end in (("a", 0.0, 0.0), ("b", 0.0, 0.04), ("c", 0.04, 0.04)):
            a, b = np.array([x, 0.02 * k, 0.0]), np.array([end, 0.02 * k + 0.002, 0.04])
            found.append(KnownTarget(f"{name}{k}", a, (b - a) / np.linalg.norm(b - a)))
    return found


def wired(rng: np.random.Generator, images: int, noise: float = 0.0) -> SeenPoints:
    """Where the image plane cuts the wires."""
    px, at, targets, Rs, ts = [], [], [], [], []
    R, t = poses(images, rng, 0.25)
    for k in range(images):
        for wire in n_wires():
            # Solve for the length along the wire at which nothing is left across the image.
            here_, there = (pixel_of(wire.place + s * wire.along, R[k], t[k]) for s in (0.0, 1.0))
            s = -here_[2] / (there[2] - here_[2])
            px.append((here_ + s * (there - here_))[:2] / SCALE)
            at.append(k)
            targets.append(wire)
            Rs.append(R[k])
            ts.append(t[k])
    seen = np.array(px) + noise * rng.normal(size=(len(px), 2))
    return SeenPoints(seen, np.array(at), tuple(targets), np.array(Rs), np.array(ts))


@pytest.mark.parametrize("make", [lambda rng: landmarks(rng, 6, 4), lambda rng: wired(rng, 8)],
                         ids=["landmarks", "wires"])  # fmt: skip
def test_without_noise_the_plane_is_exact(make) -> None:  # type: ignore[no-untyped-def]
    found = image_plane(make(np.random.default_rng(0)))
    assert found.pose.matrix == pytest.approx(TRUTH.matrix, abs=1e-9)
    assert found.m_per_px == pytest.approx(SCALE, rel=1e-8)
    assert found.rms < 1e-10
    assert found.predicted < 1e-9


def test_three_landmarks_in_one_image_are_enough() -> None:
    found = image_plane(landmarks(np.random.default_rng(1), 1, 3))
    assert found.pose.matrix == pytest.approx(TRUTH.matrix, abs=1e-9)
    assert np.isnan(found.predicted)


@pytest.mark.slow
@pytest.mark.parametrize(
    "make", [lambda rng: landmarks(rng, 8, 4, 1.0), lambda rng: wired(rng, 8, 1.0)],
    ids=["landmarks", "wires"],
)  # fmt: skip
def test_the_claim_holds_over_many_draws(make) -> None:  # type: ignore[no-untyped-def]
    """A pixel's error over 60 draws against its claimed sd, and images left out are missed by more
    than those that served."""
    px, errors, claims = np.array([400.0, 300.0]), [], []
    where = TRUTH.apply(np.array([*(SCALE * px), 0.0]))
    for seed in range(60):
        found = image_plane(make(np.random.default_rng(seed)))
        flat = np.array([*(np.array(found.m_per_px) * px), 0.0])
        errors.append(found.pose.apply(flat) - where)
        claims.append(found.sd(px))
        assert found.predicted > 0.9 * found.rms
    ratio = np.sqrt((np.array(errors) ** 2).mean()) / np.sqrt((np.array(claims) ** 2).mean())
    assert 0.8 < ratio < 1.25


def test_what_leaves_the_plane_open_is_refused() -> None:
    rng = np.random.default_rng(2)
    with pytest.raises(RegistrationError, match="2 points give 6 equations for 8 unknowns"):
        image_plane(landmarks(rng, 1, 2))
    still = wired(rng, 1)
    with pytest.raises(RegistrationError, match=r"larger distances|do not fix"):
        image_plane(SeenPoints(np.tile(still.px[:3], (3, 1)), np.repeat([0, 1, 2], 3),
                               still.targets[:3] * 3, np.tile(still.R[:3], (3, 1, 1)),
                               np.tile(still.t[:3], (3, 1))))  # fmt: skip


def files(folder: Path, seen: SeenPoints) -> None:
    """A recording of images and poses, points and wires in mm, as a user has them."""
    n = int(seen.image.max()) + 1
    first = [int(np.flatnonzero(seen.image == k)[0]) for k in range(n)]
    t = np.arange(n) / 10
    frames = Frames(t, (np.zeros((60, 80), np.uint8),) * n, (1e-4, 1e-4), np.eye(4), "image")
    tool = pose_signals("ProbeToReference", t, seen.R[first], seen.t[first], "reference")
    source = Source("x", "", 0, "")
    write_recording(Recording("x", source, 0, signals=tool, frames={"images": frames}),
                    folder / "x.mcap")  # fmt: skip
    with (folder / "points.csv").open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["image", "u", "v", "target"])
        for i, p, target in zip(seen.image, seen.px, seen.targets, strict=True):
            rows.writerow([i, *p.tolist(), target.name])
    with (folder / "wires.csv").open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["target", "x", "y", "z", "x2", "y2", "z2"])
        for wire in n_wires():
            assert wire.along is not None
            ends = (wire.place, wire.place + 0.04 * wire.along)
            rows.writerow([wire.name, *(1e3 * np.concatenate(ends)).tolist()])


def test_the_command_writes_images_that_know_where_they_lie(tmp_path: Path) -> None:
    files(tmp_path, wired(np.random.default_rng(3), 8, 0.5))
    out = tmp_path / "y.mcap"
    given = ["calibrate", str(tmp_path / "x.mcap"), "--points", str(tmp_path / "points.csv"),
             "--targets", str(tmp_path / "wires.csv"), "--unit", "mm", "-o", str(out),
             "--force"]  # fmt: skip
    code, said, err = here(*given, "--probe", "ProbeToReference")
    assert (code, err) == (0, "")
    assert "72 points in 8 images" in said
    frames = read_recording(out).frame("images")
    assert frames.frame == "Probe"
    assert frames.m_per_px == pytest.approx(SCALE, rel=0.02)
    assert frames.pose[:3, 3] == pytest.approx(TRUTH.t, abs=5e-4)
    record = read_recording(out).record("image_plane/images")
    assert "each image from the others" in record["predicted"]
    assert "mm at the middle" in record["sd"]
    assert "no poses of 'Stylus'; tools with poses: ProbeToReference" in refused(
        *given, "--probe", "Stylus"
    )
    (tmp_path / "points.csv").write_text("image,u,v,target\n0,1,1,q\n")
    assert "points.csv: no target 'q'; there are a0, b0" in refused(
        *given, "--probe", "ProbeToReference"
    )
    (tmp_path / "points.csv").write_text("image,u,v,target\n99,1,1,a0\n")
    assert "image 99: expected 0 to 7" in refused(*given, "--probe", "ProbeToReference")
    (tmp_path / "points.csv").write_text("image,u,v,target\n1.7,1,1,a0\n")
    assert "image 1.7: expected 0 to 7" in refused(*given, "--probe", "ProbeToReference")
    (tmp_path / "points.csv").write_text("image,u,v,target\n1,one,1,a0\n")
    assert "points.csv: u = 'one' is not a number" in refused(*given, "--probe", "ProbeToReference")
    (tmp_path / "points.csv").write_text("image,u,v,target\n0,1\n")
    assert "no target ''" in refused(*given, "--probe", "ProbeToReference")
    (tmp_path / "points.csv").write_text("image,u,v,target\n0,1,1,a0\n")
    for rows, why in (
        ("x,y,z,target\n1,2,3\n", "no target 'a0'"),
        ("target,x,y,z,x2\na0,0,0,0,5\n", "y2 = '' is not a number"),
        (f"target,x,y,z\na0,{'1' * 200000},0,0\n", "not a comma-separated table (field"),
    ):
        (tmp_path / "wires.csv").write_text(rows)
        assert why in refused(*given, "--probe", "ProbeToReference")
    files(tmp_path, wired(np.random.default_rng(3), 2))
    (tmp_path / "points.csv").write_text("image;u;v;target\n")
    assert "separated by commas" in refused(*given, "--probe", "ProbeToReference")
    (tmp_path / "points.csv").write_text("image,u\n")
    assert "expected image, u, v, target" in refused(*given, "--probe", "ProbeToReference")


def test_a_mistaken_unit_and_outlines_of_before_are_refused(tmp_path: Path) -> None:
    """One image that stands still: places in mm that are said to be metres."""
    seen = landmarks(np.random.default_rng(5), 1, 5)
    still = SeenPoints(seen.px, seen.image, seen.targets, np.tile(np.eye(3), (5, 1, 1)),
                       np.zeros((5, 3)))  # fmt: skip
    files(tmp_path, still)
    rows = [f"p{i},{','.join(map(repr, (1e3 * x).tolist()))}" for i, x in enumerate(seen.places)]
    (tmp_path / "wires.csv").write_text("\n".join(["target,x,y,z", *rows]))
    given = ["--points", str(tmp_path / "points.csv"), "--targets", str(tmp_path / "wires.csv"),
             "--probe", "ProbeToReference", "-o", str(tmp_path / "y.mcap")]  # fmt: skip
    x = tmp_path / "x.mcap"
    assert here("calibrate", str(x), *given, "--unit", "mm")[0] == 0
    (tmp_path / "y.mcap").unlink()
    assert "wires.csv: the table has no unit" in refused("calibrate", str(x), *given)
    assert "a pixel would be 110 mm wide" in refused("calibrate", str(x), *given, "--unit", "m")
    ring = np.array([[0, 0], [0.01, 0], [0, 0.01]])
    drawn = Contours(np.zeros(1), (ring,), 1e-4, np.eye(4), "image", "images")
    write_recording(replace(read_recording(x), contours={"outline": drawn}), x)
    assert "['outline'] would keep" in refused("calibrate", str(x), *given, "--unit", "mm")
    assert not (tmp_path / "y.mcap").exists()


def test_targets_are_taken_from_landmarks_as_from_a_table(tmp_path: Path) -> None:
    seen = landmarks(np.random.default_rng(5), 4, 5, 0.5)
    files(tmp_path, seen)
    names = tuple(target.name for target in seen.targets)
    places = np.array([target.place for target in seen.targets])
    lines = [
        f"{n},{','.join(map(repr, (1e3 * x).tolist()))}" for n, x in zip(names, places, strict=True)
    ]
    (tmp_path / "table.csv").write_text("\n".join(["target,x,y,z", *lines]))
    points = {
        "pen/landmarks": Markers(np.zeros(1), names, places[None], 1e-4, "Reference"),
        "pen/tip": Markers(np.arange(2.0), ("tip",), np.zeros((2, 1, 3)), 1e-4, "Reference"),
    }
    write_recording(Recording("t", Source("t", "", 0, ""), 0, markers=points), tmp_path / "t.mcap")
    given = ["calibrate", str(tmp_path / "x.mcap"), "--points", str(tmp_path / "points.csv"),
             "--probe", "ProbeToReference", "-o", str(tmp_path / "y.mcap")]  # fmt: skip
    found = []
    for name, unit in (("table.csv", ["--unit", "mm"]), ("t.mcap", [])):
        assert here(*given, "--targets", str(tmp_path / name), *unit)[0] == 0
        found.append(read_recording(tmp_path / "y.mcap").frame("images").pose)
        (tmp_path / "y.mcap").unlink()
    assert found[1] == pytest.approx(found[0], abs=1e-8)
    assert "with points in metres" in refused(
        *given, "--targets", str(tmp_path / "t.mcap"), "--unit", "mm"
    )
    assert "0 streams of points at one instant" in refused(
        *given, "--targets", str(tmp_path / "x.mcap")
    )


def test_swapped_targets_are_doubted_and_named_twice_refused(tmp_path: Path) -> None:
    files(tmp_path, wired(np.random.default_rng(3), 8, 0.5))
    wires = tmp_path / "wires.csv"
    given = ["calibrate", str(tmp_path / "x.mcap"), "--points", str(tmp_path / "points.csv"),
             "--targets", str(wires), "--unit", "mm", "--probe", "ProbeToReference",
             "-o", str(tmp_path / "y.mcap")]  # fmt: skip
    lines = wires.read_text().splitlines()
    wires.write_text("\n".join([*lines, lines[1]]))
    assert "target a0 occurs twice" in refused(*given)
    other = {"a0": "c2", "c2": "a0"}
    swapped = [f"{other.get(line[:2], line[:2])}{line[2:]}" for line in lines]
    wires.write_text("\n".join(swapped))
    code, _, err = here(*given)
    assert code == 0
    assert "check for swapped targets" in err


def test_one_image_that_alone_tells_a_motion_leaves_no_prediction_of_itself() -> None:
    """Without the second image its points have no prediction."""
    rng = np.random.default_rng(4)
    seen = landmarks(rng, 2, 3)
    found = image_plane(seen)
    assert np.isfinite(found.left_out).all()
    short = seen.some(np.arange(6) < 5)  # three points and two: six numbers of eight
    left_out = image_plane(short).left_out
    assert np.isnan(left_out[:3]).all()
    assert np.isfinite(left_out[3:]).all()


def test_wires_along_one_direction_leave_a_motion_open() -> None:
    """The probe turns by 1e-7 rad: enough for nine numbers of a linear map, not for a pose."""
    rng = np.random.default_rng(5)
    seen = landmarks(rng, 4, 4)
    R = Rotation.from_rotvec(1e-7 * rng.normal(size=(4, 3))).as_matrix()[seen.image]
    flat = np.column_stack([seen.px * SCALE, np.zeros(16)])
    there = np.einsum("nij,nj->ni", R, TRUTH.apply(flat)) + seen.t
    along = np.array([0.0, 0.0, 1.0])
    wires = tuple(KnownTarget(f"w{i}", x, along) for i, x in enumerate(there))
    with pytest.raises(RegistrationError, match="do not fix the image plane: turn"):
        image_plane(replace(seen, targets=wires, R=R))
