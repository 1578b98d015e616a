"""Images and outlines whose metres are something else are asked back, with the factor."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import here, refused
from mcap_samples import ABSENT, T0, sample_recording

from validate.recording.images.image import encode_png
from validate.recording.mcap.write import write_recording
from validate.recording.preflight import Inspection
from validate.recording.scales import odd_pixel, odd_scales
from validate.recording.types import Contours, Frames, Recording, Signal

IMAGE = np.zeros((300, 400), np.uint8)
SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def frames(side: float) -> Frames:
    return Frames(np.array([0.0]), (IMAGE,), (side, side), np.eye(4), "probe")


def outlines(size: float) -> Contours:
    return Contours(np.array([0.0]), (size * SQUARE,), 1e-4, np.eye(4), "probe")


@pytest.mark.parametrize(
    ("side", "says"),
    [
        (1e-4, ""),
        (1e-2, ""),
        (8.0, "8 m per pixel is outside 1e-06 to 0.01 m: an image of 3.2e+03 x 2.4e+03 m; a factor "
              "1000 (8mm) or 1000000 (8um)?"),
        (0.1, "0.1 m per pixel is outside 1e-06 to 0.01 m: an image of 40 x 30 m; a factor 1000 "
              "(0.1mm)?"),
        (1e-8, "1e-08 m per pixel is outside 1e-06 to 0.01 m: an image of 4e-06 x 3e-06 m"),
    ],
)  # fmt: skip
def test_a_pixel_and_the_image_it_makes(side: float, says: str) -> None:
    assert odd_pixel((side, side), IMAGE.shape) == says


def test_a_wide_image_of_plausible_pixels_is_odd() -> None:
    assert odd_pixel((9e-3, 9e-3), (4000, 4000)) == (
        "0.009 m per pixel: an image of 36 x 36 m; a factor 1000 (0.009mm)?"
    )
    assert odd_pixel((9e-3, 9e-3)) == ""
    assert odd_pixel((1e-4, 1e-4), (1, 60_000)) == ""  # a line of pixels is no image


@pytest.mark.parametrize(
    ("size", "says"),
    [
        (0.02, ""),
        (20.0, "'o': outlines of 20 m are outside 1e-05 to 5 m; a factor 1000 or 1000000?"),
        (1e-7, "'o': outlines of 1e-07 m are outside 1e-05 to 5 m"),
    ],
)
def test_outlines(size: float, says: str) -> None:
    found = odd_scales(Recording("r", ABSENT, T0, contours={"o": outlines(size)}))
    assert found == ((says,) if says else ())


def test_asked_back_wherever_images_enter(tmp_path: Path) -> None:
    folder = tmp_path / "Bilder ä"
    folder.mkdir()
    (folder / "1.png").write_bytes(encode_png(IMAGE))
    to = ("-o", str(tmp_path / "a.mcap"), "--force", "--as", "png-stack", "--rate", "10")
    line = refused("import", str(folder), *to, "--m-per-px", "8")
    assert "an image of 3.2e+03 x 2.4e+03 m; a factor 1000 (8mm)" in line
    assert line.endswith("With its unit it is taken")
    code, _, err = here("import", str(folder), *to, "--m-per-px", "8m")  # meant, and asked
    assert (code, err.count("\n")) == (0, 1)
    assert "'images': 8 m per pixel is outside" in err
    code, _, err = here("import", str(folder), *to, "--m-per-px", "0.1mm")
    assert (code, err) == (0, "")


def test_a_recording_of_outlines_and_images_is_asked_back(tmp_path: Path) -> None:
    odd = replace(sample_recording(), contours={"/o": outlines(20.0)}, frames={"/us": frames(8.0)})
    path = tmp_path / "a.mcap"
    write_recording(odd, path)
    other = Recording(
        "log", ABSENT, T0, signals={"/x": Signal(np.zeros(1), np.ones((1, 1)), "N", 0.0, "p")}
    )
    write_recording(other, tmp_path / "log.mcap")
    merged = ("merge", str(path), str(tmp_path / "log.mcap"), "-o", str(tmp_path / "b.mcap"))
    code, _, err = here(*merged)
    assert (code, err.count("\n")) == (0, 3)  # two scales, and that clocks are taken as one
    assert "a factor 1000 or 1000000?" in err
    defects = Inspection.of(path).defects
    assert sum("m per pixel is outside" in d or "outlines of 20 m" in d for d in defects) == 2
