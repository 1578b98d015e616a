"""Sequences as PLUS and 3D Slicer save them: sides of the transducer, colour, the axis of images
first or last, single images."""

from pathlib import Path

import nrrd
import numpy as np
import pytest
from sequences import images, tracked

from validate.errors import RecordingError, UsageError
from validate.recording.images.metaimage import read_metaimage
from validate.recording.images.nrrd import read_nrrd

pytestmark = pytest.mark.usefixtures("decoded_here")

KINDS = ["list", "domain", "domain", "domain"]
DIRECTIONS = np.array([[np.nan] * 3, [0.1, 0, 0], [0, 0.2, 0], [0, 0, 1]])


def oriented(path: Path, way: str) -> Path:
    line = f"UltrasoundImageOrientation = {way}\nElementDataFile".encode()
    path.write_bytes(tracked().replace(b"ElementDataFile", line))
    return path


@pytest.mark.parametrize(
    ("way", "turn"),
    [
        ("MFA", (slice(None), slice(None))),
        ("XX", (slice(None), slice(None))),
        ("UFA", (slice(None), slice(None, None, -1))),
        ("MN", (slice(None, None, -1), slice(None))),
        ("UNA", (slice(None, None, -1), slice(None, None, -1))),
    ],
)
def test_images_lie_as_their_transforms_have_them(
    tmp_path: Path, way: str, turn: tuple[slice, slice]
) -> None:
    """PLUS turns them to marked, far as it reads: its transforms of the image are for that."""
    got = read_metaimage(oriented(tmp_path / "x.mha", way), {})
    expected = [image[turn] for image in images(3)]
    np.testing.assert_array_equal(got.frame("images").images, expected)
    told = got.metadata["provenance"].get("images", "")
    assert told.endswith(f"as {way}, but its transforms need MF") == (
        way[0] == "U" or way[1] == "N"
    )


def test_lines_along_rows_are_no_image(tmp_path: Path) -> None:
    path = oriented(tmp_path / "x.mha", "FM")
    with pytest.raises(RecordingError, match=r"orientation FM.*--map images=no"):
        read_metaimage(path, {})
    assert "StylusToReference/rotation" in read_metaimage(path, {"images": "no"}).signals


def test_colour_becomes_grey(tmp_path: Path) -> None:
    colour = np.array([[[[100, 0, 0], [0, 100, 0], [0, 0, 100]]]], np.uint8)
    head = "ObjectType = Image\nNDims = 3\nDimSize = 3 1 1\nElementSpacing = 0.1 0.1 1\n"
    head += "ElementNumberOfChannels = 3\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n"
    (tmp_path / "x.mha").write_bytes(head.encode() + colour.tobytes())
    got = read_metaimage(tmp_path / "x.mha", {}).frame("images")  # a single image needs no time
    assert got.images[0].tolist() == [[30, 59, 11]]
    stored = np.moveaxis(colour, (3, 2, 1, 0), (0, 1, 2, 3)).copy()
    header = {"kinds": ["vector", "domain", "domain", "list"], "spacings": [np.nan, 0.1, 0.1, 1]}
    nrrd.write(str(tmp_path / "x.nrrd"), stored, header)
    shown = read_nrrd(tmp_path / "x.nrrd", {}).frame("images")
    assert shown.images[0].tolist() == [[30, 59, 11]]
    assert shown.m_per_px == pytest.approx((1e-4, 1e-4))


def test_a_list_of_images_before_their_axes_is_one_of_times(tmp_path: Path) -> None:
    """As 3D Slicer saves: the axis of the images first, its label, unit and values beside."""
    stored = images(3).transpose(0, 2, 1)[..., None].copy()
    header = {
        "space": "left-posterior-superior", "space origin": [0, 0, 0], "kinds": KINDS,
        "space directions": DIRECTIONS, "axis 0 index type": "numeric",
        "axis 0 index values": "2 2.5 3.5",
    }  # fmt: skip
    path = tmp_path / "x.seq.nrrd"
    nrrd.write(str(path), stored, header)
    with pytest.raises(UsageError, match="give --map rate=HZ"):
        read_nrrd(path, {})  # values without a unit of time, as numbers of frames
    for unit in ({"axis 0 index unit": "s"}, {"units": ["s", "", "", ""]}):
        nrrd.write(str(path), stored, header | unit)
        got = read_nrrd(path, {}).frame("images")
        np.testing.assert_array_equal(got.images, images(3))
        assert got.t.tolist() == [0, 0.5, 1.5]
        assert got.m_per_px == pytest.approx((1e-4, 2e-4))


AXES = np.diag([0.1, 0.2, 0.3])
SPACE = {"space": "left-posterior-superior", "space origin": [0, 0, 0], "space directions": AXES}
BY = {"rate": "10", "m_per_px": "0.1mm"}


@pytest.mark.parametrize(
    ("header", "why"),
    [
        ({"kinds": ["domain"] * 3, **SPACE}, "its three axes are of space"),
        ({"kinds": ["space"] * 3}, "its three axes are of space"),
        ({"spacings": [0.1, 0.2, 0.3]}, "spacings 0.1 0.2 0.3"),
        (SPACE, "three space directions"),
        ({"kinds": ["domain", "domain", "list"]}, ""),
        ({"kinds": ["domain", "domain", "time"], "spacings": [0.1, 0.2, 0.5]}, ""),
        ({"spacings": [0.1, 0.2, 0.5], "units": ["mm", "mm", "s"]}, ""),
        ({"spacings": [0.1, 0.2, np.nan]}, ""),
        ({}, ""),
    ],
)
def test_an_nrrd_with_three_axes_of_space_is_no_film(
    tmp_path: Path, header: dict[str, object], why: str
) -> None:
    """Its slices were images over time, by the rate that was asked for."""
    path = tmp_path / "x.nrrd"
    nrrd.write(str(path), images(3).transpose(2, 1, 0).copy(), header)
    if why:
        for options in (BY, {}) if header == SPACE else (BY,):
            with pytest.raises(RecordingError, match=rf"x\.nrrd: 3 slices of a volume \({why}\)"):
                read_nrrd(path, options)
        return
    assert len(read_nrrd(path, BY).frame("images").images) == 3
    if not header:
        with pytest.raises(UsageError, match=r"--map rate=HZ \(a.*read\)"):
            read_nrrd(path, {"m_per_px": "0.1mm"})


def test_an_nrrd_of_four_axes_and_no_depth_is_a_film(tmp_path: Path) -> None:
    """As SimpleITK writes it, which calls every axis one of space."""
    pixels = images(3).transpose(2, 1, 0)[:, :, None].copy()
    nrrd.write(str(tmp_path / "x.nrrd"), pixels, {"kinds": ["domain"] * 4})
    assert len(read_nrrd(tmp_path / "x.nrrd", BY).frame("images").images) == 3


@pytest.mark.parametrize(
    ("lines", "is_read"),
    [
        ("NDims = 3\nDimSize = 5 4 3", False),
        ("NDims = 3\nKinds = domain domain domain\nDimSize = 5 4 3", False),
        ("NDims = 3\nKinds = domain domain list\nDimSize = 5 4 3", True),
        ("NDims = 4\nDimSize = 5 4 1 3", True),
        ("NDims = 3\nSeq_Frame0000_ImageStatus = OK\nDimSize = 5 4 3", True),
    ],
)
def test_a_metaimage_of_three_axes_is_a_film_where_it_lists_images(
    tmp_path: Path, lines: str, is_read: bool
) -> None:
    head = f"ObjectType = Image\n{lines}\nElementSpacing = 0.1 0.2 0.3\nElementType = MET_UCHAR\n"
    path = tmp_path / "x.mha"
    path.write_bytes(f"{head}ElementDataFile = LOCAL\n".encode() + images(3).tobytes())
    if is_read:
        assert len(read_metaimage(path, BY).frame("images").images) == 3
        return
    for options in ({}, BY):
        with pytest.raises(RecordingError, match=r"3 slices.*\(spacing 0.1 0.2 0.3\)"):
            read_metaimage(path, options)
