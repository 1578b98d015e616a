"""TIFF stacks that tifffile wrote: ImageJ's scale and times, depths, colour, BigTIFF."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile

from validate.errors import RecordingError, UsageError
from validate.recording.images import image_stack
from validate.recording.images.image_stack import read_image_stack
from validate.recording.readers import recognised

pytestmark = pytest.mark.usefixtures("decoded_here")

LEVELS = np.random.default_rng(0).integers(0, 4096, (3, 40, 50)).astype(np.uint16)
BYTES = (LEVELS >> 4).astype(np.uint8)
SAID = {"m_per_px": "1mm", "rate": "2"}


def test_a_stack_of_imagej_states_its_scale_and_its_times(tmp_path: Path) -> None:
    """0.65 um a pixel, an image every 0.5 s, 12 bits in 16."""
    path = tmp_path / "x.tif"
    told = {"unit": "um", "finterval": 0.5, "axes": "TYX"}
    tifffile.imwrite(path, LEVELS, imagej=True, resolution=(1 / 0.65, 1 / 0.65), metadata=told)
    assert recognised(path).name == "image-stack"
    frames = read_image_stack(path, {"white": "4095"}).frame("images")
    assert frames.m_per_px == pytest.approx((6.5e-7, 6.5e-7), rel=1e-5)
    assert frames.t.tolist() == [0, 0.5, 1]
    shown = np.rint(LEVELS * (255 / 4095)).astype(np.uint8)
    np.testing.assert_array_equal(np.array(frames.images), shown)


@pytest.mark.parametrize("how", [{"compression": "zlib"}, {"bigtiff": True}, {"byteorder": ">"}])
def test_8_bits_are_bit_for_bit(how: dict[str, Any], tmp_path: Path) -> None:
    path = tmp_path / "x.tif"
    tifffile.imwrite(path, BYTES, photometric="minisblack", **how)
    got = read_image_stack(path, SAID).frame("images")
    np.testing.assert_array_equal(np.array(got.images), BYTES)


def test_dots_a_centimetre_of_others_are_a_printers(tmp_path: Path) -> None:
    path = tmp_path / "x.tif"
    tifffile.imwrite(path, BYTES[0], resolution=(100, 100), resolutionunit="CENTIMETER")
    with pytest.raises(UsageError, match=r"x\.tif: has no scale; give it"):
        read_image_stack(path, {"rate": "2"})


def test_pages_that_are_small_packed_are_counted_before_they_are_decoded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "x.tif"
    pages = np.zeros((40, 300, 300), np.uint8)
    tifffile.imwrite(path, pages, photometric="minisblack", compression="zlib")
    assert path.stat().st_size < 40_000
    monkeypatch.setattr(image_stack, "MOST", 2 * 300 * 300)
    with pytest.raises(RecordingError, match=r"40 images of 300 x 300 px.*than 180000"):
        image_stack.arrays(path)


def test_a_big_tiff_that_is_not_read_is_called_so(tmp_path: Path) -> None:
    """It is whole: Pillow reads that order of classic TIFF alone."""
    path = tmp_path / "x.tif"
    tifffile.imwrite(path, BYTES, photometric="minisblack", bigtiff=True, byteorder=">")
    with pytest.raises(RecordingError, match=r"x\.tif: a BigTIFF whose numbers"):
        read_image_stack(path, SAID)


SIZED = {
    "PhysicalSizeX": 6.5, "PhysicalSizeXUnit": "µm", "PhysicalSizeY": 6.6,
    "PhysicalSizeYUnit": "µm", "TimeIncrement": 500, "TimeIncrementUnit": "ms",
}  # fmt: skip


def test_ome_states_its_scale_and_its_times(tmp_path: Path) -> None:
    """They were asked for."""
    path = tmp_path / "x.ome.tif"
    tifffile.imwrite(path, BYTES, ome=True, metadata={"axes": "TYX", **SIZED})
    recording = read_image_stack(path, {})
    frames = recording.frame("images")
    assert frames.m_per_px == pytest.approx((6.5e-6, 6.6e-6), rel=1e-9)
    assert frames.t.tolist() == [0, 0.5, 1]
    assert "declared by OME" in recording.metadata["provenance"]["m_per_px"]
    tifffile.imwrite(path, BYTES, ome=True, metadata={"axes": "TYX", "PhysicalSizeX": 6.5})
    with pytest.raises(UsageError, match="has no scale"):
        read_image_stack(path, {"rate": "2"})


def test_channels_and_planes_of_ome_are_no_times(tmp_path: Path) -> None:
    """By a rate, both channels were images of one film."""
    path = tmp_path / "x.ome.tif"
    for axes in ("TCYX", "TZYX"):
        pages = np.concatenate([BYTES, BYTES[:1]]).reshape(2, 2, 40, 50)
        tifffile.imwrite(path, pages, ome=True, metadata={"axes": axes, **SIZED})
        with pytest.raises(RecordingError, match="4 pages are 2 times of"):
            read_image_stack(path, SAID)


@pytest.mark.parametrize("how", [{"imagej": True}, {"ome": True}])
def test_planes_of_a_volume_are_no_times(how: dict[str, Any], tmp_path: Path) -> None:
    """By a rate, they were images over time."""
    path, by = tmp_path / "x.tif", {"imagej": "ImageJ", "ome": "OME"}[next(iter(how))]
    tifffile.imwrite(path, BYTES, metadata={"axes": "ZYX"}, **how)
    for options in ({}, SAID):
        with pytest.raises(
            RecordingError,
            match=rf"3 planes of a volume \({by}\)",
        ):
            read_image_stack(path, options)


def test_planes_of_imagej_at_each_time_are_no_times(tmp_path: Path) -> None:
    path = tmp_path / "x.tif"
    pages = np.concatenate([BYTES, BYTES]).reshape(2, 3, 40, 50)
    tifffile.imwrite(path, pages, imagej=True, metadata={"axes": "TZYX"})
    with pytest.raises(RecordingError, match=r"6 pages .* 3 planes \(ImageJ\)"):
        read_image_stack(path, SAID)


@pytest.mark.parametrize(
    "said", [{"axes": "TYX"}, {"axes": "ZYX", "finterval": 0.5}, {"axes": "ZYX", "fps": 2}]
)
def test_a_film_of_imagej_is_no_volume(said: dict[str, Any], tmp_path: Path) -> None:
    """ImageJ calls the images of a film that it imports slices, and states their rate."""
    tifffile.imwrite(tmp_path / "x.tif", BYTES, imagej=True, metadata=said)
    assert len(read_image_stack(tmp_path / "x.tif", SAID).frame("images").images) == 3


def test_a_damaged_number_of_ome_is_none(tmp_path: Path) -> None:
    path = tmp_path / "x.ome.tif"
    tifffile.imwrite(path, BYTES, ome=True, metadata={"axes": "TYX", **SIZED})
    path.write_bytes(path.read_bytes().replace(b'SizeX="6.5"', b'SizeX="6,5"'))
    with pytest.raises(UsageError, match="has no scale"):
        read_image_stack(path, {"rate": "2"})
