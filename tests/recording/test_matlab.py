"""MATLAB 5: points and images as they were meant; units are asked for, damage costs a line."""

import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat

from validate.errors import RecordingError, UsageError
from validate.recording.formats import matlab_arrays
from validate.recording.formats.matlab import read_matlab

pytestmark = pytest.mark.usefixtures("decoded_here")

# private: _unpacks: called alone, case by case.

GEL = "field/gel-indentation/parCoordA.mat"
DISK = "ultrasound/disk/bmode_PWI_disk.mat"


def written(path: Path, packed: bool = False, **variables: Any) -> Path:
    savemat(path, variables, do_compression=packed)
    return path


@pytest.mark.slow
def test_particles_in_pixels_are_metres_by_the_size_that_is_said(shared_data: Path) -> None:
    """35 316 particles in a volume of 1022 x 1022 x 304 px of 0.4 um, as their source says."""
    got = read_matlab(shared_data / GEL, {"unit": "0.4um"})
    x = got.marker("parCoordA").x
    assert x.shape == (1, 35316, 3)
    assert x[0, 0].tolist() == pytest.approx([0.4e-6 * p for p in (550.85196, 19.98078, 2.959147)])
    assert (x.max(axis=(0, 1)) < 0.4e-6 * np.array([1022, 1022, 304])).all()
    assert got.source.integrity == "verified (Adler-32 of each variable)"


def test_a_stack_of_images_has_its_frames_last(shared_data: Path) -> None:
    got = read_matlab(shared_data / DISK, {"m_per_px": "0.1mm", "rate": "30"}).frame("I")
    assert len(got.images) == 32
    assert got.images[0].shape == (251, 251)
    assert got.m_per_px == pytest.approx((1e-4, 1e-4))
    assert got.t[1] == pytest.approx(1 / 30)


@pytest.mark.slow
def test_what_the_file_does_not_state_is_asked_for(tmp_path: Path) -> None:
    points = written(tmp_path / "x.mat", P=np.ones((4, 2)))
    with pytest.raises(UsageError, match=r"x\.mat: P has no unit .* unit=mm"):
        read_matlab(points, {})
    with pytest.raises(UsageError, match="unit=3kg: expected a length"):
        read_matlab(points, {"unit": "3kg"})
    assert read_matlab(points, {"unit": "mm", "sd": "2um"}).marker("P").sd == pytest.approx(2e-6)
    images = written(tmp_path / "y.mat", I=np.ones((4, 5, 2), np.uint8))
    with pytest.raises(UsageError, match=r"I has no times; .* rate=10"):
        read_matlab(images, {"m_per_px": "1mm"})
    single = written(tmp_path / "z.mat", I=np.ones((4, 5), np.uint8))
    assert len(read_matlab(single, {"m_per_px": "1mm"}).frame("I").images) == 1


@pytest.mark.slow
def test_what_is_neither_points_nor_images_is_listed(tmp_path: Path) -> None:
    other = {"note": "a text", "s": {"a": 1.0}, "plane": np.ones((4, 5)), "c": np.ones((4, 2)) * 1j}
    got = read_matlab(written(tmp_path / "x.mat", P=np.ones((4, 2)), **other), {"unit": "m"})
    assert got.unread == {
        "note": "char", "s.a": "(1, 1) float64", "plane": "(4, 5) float64",
        "c": "(4, 2) complex128",
    }  # fmt: skip
    with pytest.raises(UsageError, match=r"force=PATH:N .*'note': 'char'"):
        read_matlab(written(tmp_path / "x.mat", **other), {})
    words = {"note": "a text", "c": np.ones((4, 2)) * 1j}
    with pytest.raises(RecordingError, match=r"x\.mat: neither .* {'note': 'char'"):
        read_matlab(written(tmp_path / "x.mat", **words), {})
    with pytest.raises(RecordingError, match="neither points"):
        read_matlab(written(tmp_path / "x.mat"), {})


def test_numbers_that_are_none_are_no_positions(tmp_path: Path) -> None:
    points = np.ones((4, 3))
    points[1, 2], points[2] = np.inf, np.nan
    with pytest.raises(RecordingError, match=r"x\.mat: P: "):
        read_matlab(written(tmp_path / "x.mat", P=points), {"unit": "m"})


@pytest.mark.slow
def test_one_wrong_byte_of_a_packed_variable_fails_its_checksum(tmp_path: Path) -> None:
    path = written(tmp_path / "x.mat", True, P=np.random.default_rng(1).normal(size=(50, 3)))
    whole = path.read_bytes()
    for at in (200, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :])
        with pytest.raises(RecordingError, match=r"x\.mat: the variable at byte 136 fails"):
            read_matlab(path, {"unit": "m"})


@pytest.mark.own_process
@pytest.mark.parametrize(
    ("stated", "held", "said"),
    [(2**30, 100, "a variable of 1073741832 bytes unpacked, the limit is 536870912"),
     (100, 2**24, "the variable at byte 136 fails its checksum")],
)  # fmt: skip
def test_a_bomb_is_one_line_before_it_is_unpacked(
    stated: int, held: int, said: str, tmp_path: Path
) -> None:
    """A variable that states too much, and one that holds more than it states."""
    path = written(tmp_path / "x.mat", True, P=np.ones((4, 3)))
    body = zlib.compress(struct.pack("<II", 14, stated) + bytes(held), 9)
    path.write_bytes(path.read_bytes()[:128] + struct.pack("<II", 15, len(body)) + body)
    with pytest.raises(RecordingError, match=rf"x\.mat: {said}"):
        read_matlab(path, {"unit": "m"})


@pytest.mark.parametrize("packed", [True, False])
def test_a_cut_file_is_told_with_its_bytes(tmp_path: Path, packed: bool) -> None:
    path = written(tmp_path / "x.mat", packed, P=np.ones((4, 3)))
    whole = path.read_bytes()
    for count in (0, 100, 127, 131, len(whole) - 9, len(whole) - 1):
        path.write_bytes(whole[:count])
        with pytest.raises(RecordingError, match=r"x\.mat: (not a MATLAB 5 file|\d+ bytes)"):
            read_matlab(path, {"unit": "m"})


def test_another_version_is_told(tmp_path: Path) -> None:
    (tmp_path / "x.mat").write_bytes(b"MATLAB 7.0 MAT-file".ljust(600))
    with pytest.raises(RecordingError, match="not a MATLAB 5 file"):
        read_matlab(tmp_path / "x.mat", {})


def test_images_of_other_numbers_name_their_array(tmp_path: Path) -> None:
    path = written(tmp_path / "x.mat", images=np.zeros((4, 5, 3)))
    with pytest.raises(RecordingError, match=r"\(4, 5, 3\) float64; images.*uint8"):
        read_matlab(path, {"view": "images:px", "m_per_px": "0.1mm", "rate": "10"})


def test_what_is_no_variable_is_reported_with_its_place(tmp_path: Path) -> None:
    path = written(tmp_path / "x.mat", P=np.ones((4, 3)))
    path.write_bytes(path.read_bytes()[:128] + struct.pack("<II", 7, 16) + bytes(16))
    with pytest.raises(RecordingError, match=r"variable 24 bytes.*byte 152; damaged"):
        matlab_arrays.elements(path)


def test_bytes_that_do_not_unpack_are_no_variable() -> None:
    packed = zlib.compress(struct.pack("<II", 14, 8) + bytes(8))
    assert matlab_arrays._unpacks(packed, "<")
    assert not matlab_arrays._unpacks(b"no stream", "<")
    assert not matlab_arrays._unpacks(packed + b"more", "<")
