"""Images straightened by a camera's calibration: dots at known places seen through a known lens."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from validate.commands.main import cli
from validate.errors import RecordingError, UsageError
from validate.recording.images import image as lens
from validate.recording.images.image_stack import read_image_stack
from validate.recording.images.png_stack import read_png_stack

pytestmark = pytest.mark.usefixtures("decoded_here")

SIZE = (320, 240)
K = np.array([[260.0, 0, 158], [0, 255.0, 121], [0, 0, 1]])
D = np.array([-0.3, 0.09, 1e-3, -5e-4, 0.0])
SAID = {"m_per_px": "1mm", "rate": "10"}
DOTS = np.stack(np.meshgrid(np.arange(50, 290, 40), np.arange(40, 220, 40)), axis=-1).reshape(-1, 2)


def seen() -> np.ndarray:
    """Grey dots on the straight image, each pixel of the bent one sampled where its ray comes from:
    radial and tangential terms by Brown's formula, solved by fixed points."""
    x, y = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    bent = np.stack([(x - K[0, 2]) / K[0, 0], (y - K[1, 2]) / K[1, 1]], axis=-1)
    ray = bent.copy()
    k1, k2, p1, p2, _ = D
    for _ in range(60):
        u, v = ray[..., 0], ray[..., 1]
        r2 = u**2 + v**2
        radial = 1 + k1 * r2 + k2 * r2**2
        shift = np.stack([2 * p1 * u * v + p2 * (r2 + 2 * u**2),
                          p1 * (r2 + 2 * v**2) + 2 * p2 * u * v], axis=-1)  # fmt: skip
        ray = (bent - shift) / radial[..., None]
    px = ray * [K[0, 0], K[1, 1]] + [K[0, 2], K[1, 2]]
    off = np.linalg.norm(px[..., None, :] - DOTS, axis=-1).min(axis=-1)
    return np.rint(255 * np.exp(-0.5 * (off / 4) ** 2)).astype(np.uint8)


def centres(image: np.ndarray) -> np.ndarray:
    found = []
    for x, y in DOTS:
        part = image[y - 10 : y + 11, x - 10 : x + 11].astype(float)
        v, u = np.mgrid[-10:11, -10:11]
        found.append([x + (u * part).sum() / part.sum(), y + (v * part).sum() / part.sum()])
    return np.array(found)


def opencvs(path: Path, matrix: np.ndarray = K, coefficients: np.ndarray = D) -> Path:
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    file.write("image_width", SIZE[0])
    file.write("image_height", SIZE[1])
    file.write("camera_matrix", matrix)
    file.write("distortion_coefficients", coefficients)
    file.write("avg_reprojection_error", 0.21)
    file.release()
    return path


def ross(path: Path, model: str = "plumb_bob") -> Path:
    lines = [f"image_width: {SIZE[0]}", f"image_height: {SIZE[1]}", "camera_name: side"]
    for name, numbers in (("camera_matrix", K), ("distortion_coefficients", D[None])):
        data = ", ".join(f"{v:.9g}" for v in numbers.ravel())
        rows, cols = numbers.shape
        lines += [f"{name}:", f"  rows: {rows}", f"  cols: {cols}", f"  data: [{data}]"]
    lines.insert(3, f"distortion_model: {model}")
    path.write_text("\n".join(lines) + "\n", "utf-8")
    return path


@pytest.fixture
def shots(tmp_path: Path) -> Path:
    folder = tmp_path / "shots"
    folder.mkdir()
    for i in range(2):
        cv2.imwrite(str(folder / f"{i}.png"), seen())
    return folder


@pytest.mark.parametrize("name", [
    "lens.yml", "ros.yaml",
    *(pytest.param(name, marks=pytest.mark.slow) for name in ("lens.xml", "lens.json")),
])  # fmt: skip
def test_dots_are_where_they_are_once_the_lens_is_known(
    name: str, shots: Path, tmp_path: Path
) -> None:
    bent = centres(read_png_stack(shots, SAID).frame("images").images[0])
    assert np.abs(bent - DOTS).max() > 2
    path = ross(tmp_path / name) if name.startswith("ros") else opencvs(tmp_path / name)
    for read in (read_png_stack, read_image_stack):
        got = read(shots, {**SAID, "lens": str(path)})
        for image in got.frame("images").images:
            assert np.abs(centres(image) - DOTS).max() < 0.1
        told = got.metadata["provenance"]["lens"]
        assert told.startswith(f"straightened by {name} (5 coefficients")
        assert ("reprojection error 0.21 px" in told) == name.startswith("lens")


@pytest.mark.slow
@pytest.mark.parametrize(("name", "change", "why"), [
    ("a.yml", lambda p: p.write_text("nothing: 1"), "a.yml: it has no camera_matrix"),
    ("b.yml", lambda p: opencvs(p, coefficients=D[:3]), "3 coefficients of distortion; expected "
                                                        "one of"),
    ("c.yml", lambda p: opencvs(p, matrix=-K), "focal lengths and distortion must be numbers"),
    ("d.yml", lambda p: ross(p, "equidistant"), "distortion model 'equidistant'; expected"),
    ("e.yml", lambda p: p.write_bytes(b"\xff\x00{"), "e.yml: damaged"),
    ("f.yml", lambda p: None, "f.yml: cannot be read"),
    ("g.yml", lambda p: p.write_bytes(opencvs(p).read_bytes()[:150]), "g.yml: "),
])  # fmt: skip
def test_what_is_no_calibration_is_one_line(
    name: str, change: object, why: str, shots: Path, tmp_path: Path
) -> None:
    assert callable(change)
    change(tmp_path / name)
    with pytest.raises(RecordingError, match=why):
        read_png_stack(shots, {**SAID, "lens": str(tmp_path / name)})


@pytest.mark.own_process
def test_images_of_another_size_are_refused_and_the_lens_is_printed(
    shots: Path, tmp_path: Path
) -> None:
    path = opencvs(tmp_path / "lens.yml")
    words = ["import", str(shots), "--m-per-px", "1mm", "--rate", "10", "--map", f"lens={path}"]
    done = CliRunner().invoke(cli, [*words, "-o", str(tmp_path / "x.mcap")])
    assert "lens: straightened by lens.yml" in " ".join(done.output.split())
    cv2.imwrite(str(shots / "0.png"), np.zeros((100, 120), np.uint8))
    with pytest.raises(UsageError, match=r"320 x 240 px.*120 x 100, 320"):
        read_png_stack(shots, {**SAID, "lens": str(path)})


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("fisheye_model: 1\n", "a fisheye model; expected the model of OpenCV's calibrateCamera"),
        ("distortion_model: equidistant\n", "distortion model 'equidistant'; expected plumb_bob"),
        ("image_width: 320\n", "it has no camera_matrix"),
        ("x: " + "1" * 2**21, "bytes, the limit is 1000000"),
    ],
    ids=["fisheye", "model", "matrix", "size"],
)
def test_another_lens_is_called_by_its_name(text: str, says: str, tmp_path: Path) -> None:
    (tmp_path / "lens.yaml").write_text(text)
    with pytest.raises(RecordingError, match=says):
        lens.arrays(tmp_path / "lens.yaml")


@pytest.mark.parametrize(
    ("matrix", "coefficients", "says"),
    [
        (np.diag([-260.0, 255.0, 1.0]), D, "focal lengths and distortion must be numbers, above 0"),
        (K, np.array([np.nan, 0, 0, 0]), "focal lengths and distortion must be numbers, above 0"),
        (K, np.zeros(3), r"3 coefficients of distortion; expected one of \("),
    ],
)
def test_a_calibration_that_is_none_is_refused(
    matrix: np.ndarray, coefficients: np.ndarray, says: str, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    (tmp_path / "lens.yaml").write_text("x: 1")
    size = np.array([3.0, 2.0])
    monkeypatch.setattr(lens, "decoded", lambda *_: {"K": matrix, "D": coefficients, "size": size})
    with pytest.raises(RecordingError, match=says):
        lens.straightened([np.zeros((2, 3), np.uint8)], {"lens": str(tmp_path / "lens.yaml")})
