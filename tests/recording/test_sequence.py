"""Tracked sequences: transforms frame by frame, images, and what is not OK left out."""

import zlib
from pathlib import Path

import numpy as np
import pytest
from sequences import images, tracked

from validate.errors import RecordingError, UsageError
from validate.recording.images import metaimage, nrrd
from validate.recording.images.metaimage import read_metaimage
from validate.recording.images.nrrd import read_nrrd

# private: _HEADER: replaced by a small number: a short test.
# private: _images, _require_end, _times: called alone, case by case.

STYLUS = "markers/stylus/EightLandmarkPointsTrackedForPhantomRegistration.igs.mha"
FREEHAND = "ultrasound/tracked/NwirePhantomFreehand.igs.{}"


def written(folder: Path, data: bytes, name: str = "x.igs.mha") -> Path:
    path = folder / name
    path.write_bytes(data)
    return path


def test_transforms_are_metres_at_their_times_and_exponents_of_three_digits_are_read(
    tmp_path: Path,
) -> None:
    got = read_metaimage(written(tmp_path, tracked()), {})
    moved = got.signal("StylusToReference/translation", "m")
    np.testing.assert_allclose(moved.y, np.tile([0.01, -2e-8, 1.0], (3, 1)), rtol=1e-12)
    np.testing.assert_allclose(moved.t, [0.0, 0.1, 0.2], atol=1e-9)
    turned = got.signal("StylusToReference/rotation", "1").y
    np.testing.assert_array_equal(turned[0].reshape(3, 3), [[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    assert moved.frame == "Reference"
    assert got.name == "x"


@pytest.mark.parametrize("compressed", [True, False])
def test_images_lie_with_x_along_their_columns(tmp_path: Path, compressed: bool) -> None:
    got = read_metaimage(written(tmp_path, tracked(compressed=compressed)), {}).frame("images")
    np.testing.assert_array_equal(np.array(got.images), images(3))
    assert got.m_per_px == pytest.approx((1e-4, 2e-4))


def test_pixels_of_an_mhd_lie_in_the_file_beside_it_and_nowhere_else(tmp_path: Path) -> None:
    (tmp_path / "x.raw").write_bytes(images(3).tobytes())
    head = tracked(compressed=False, last="x.raw")
    got = read_metaimage(written(tmp_path, head, "x.mhd"), {})
    np.testing.assert_array_equal(np.array(got.frame("images").images), images(3))
    for last in ("../x.raw", "/etc/passwd", "LIST", "x%d.raw"):
        away = written(tmp_path, tracked(compressed=False, last=last), "y.mhd")
        with pytest.raises(RecordingError, match=r"y\.mhd: its pixels"):
            read_metaimage(away, {})


def test_frames_that_are_not_ok_have_no_sample(tmp_path: Path) -> None:
    got = read_metaimage(written(tmp_path, tracked(4, lost=(1, 2))), {})
    np.testing.assert_allclose(got.signal("StylusToReference/rotation", "1").t, [0.0, 0.3])
    assert len(got.frame("images").images) == 4
    assert got.metadata["provenance"]["not_seen"].startswith("StylusToReference/rotation: 2")
    late = read_metaimage(written(tmp_path, tracked(4, lost=(0,), pixels=False)), {})
    np.testing.assert_allclose(late.signal("StylusToReference/rotation", "1").t, [0.0, 0.1, 0.2])
    never = read_metaimage(written(tmp_path, tracked(2, lost=(0, 1))), {})
    assert not never.signals
    assert never.unread == {"StylusToReference": "never seen"}
    with pytest.raises(RecordingError, match="never visible: StylusToReference"):
        read_metaimage(written(tmp_path, tracked(2, lost=(0, 1), pixels=False)), {})


def test_a_spacing_of_one_is_pixels_and_is_asked_for(tmp_path: Path) -> None:
    path = written(tmp_path, tracked(spacing="1 1 1"))
    with pytest.raises(UsageError, match="m_per_px"):
        read_metaimage(path, {})
    assert not read_metaimage(path, {"images": "no"}).frames
    assert read_metaimage(path, {"m_per_px": "0.3mm"}).frame("images").m_per_px == (3e-4, 3e-4)


def test_a_line_may_have_any_length_and_the_header_may_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = written(tmp_path, tracked(comment="x" * 3_000_000))
    assert len(read_metaimage(path, {}).frame("images").images) == 3
    monkeypatch.setattr(metaimage, "_HEADER", 2_000_000)
    with pytest.raises(RecordingError, match="2000000 bytes"):
        read_metaimage(path, {})


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("0 0 0 1 \n", "0 0 0 \n", "16 finite numbers"),
        ("0 0 0 1 \n", "0 0 1 1 \n", "last row"),
        ("1e3", "nan", "16 finite numbers"),
        ("Seq_Frame0001_Timestamp", "Seq_Frame0001_Time", "without a time, the first is 1"),
        ("MET_UCHAR", "MET_FLOAT", "grey or colour of 8 or 16 bits"),
        ("DimSize = 5 4 3", "DimSize = 5 4 9", "its header needs 180"),
        ("DimSize = 5 4 3", "DimSize = 50000 40000 9", "limit"),
        ("DimSize = 5 4 3", "DimSize = 5 -4 3", "DimSize"),
        ("0.1 0.2 1", "0 0.2 1", "ElementSpacing"),
        ("DimSize = 5 4 3", "DimSize = 5 4 3 1", r"DimSize \[5, 4, 3, 1\]: volumes 3 px deep"),
    ],
)
def test_damage_is_one_line(tmp_path: Path, old: str, new: str, said: str) -> None:
    data = tracked().replace(old.encode(), new.encode(), 1)
    with pytest.raises(RecordingError, match=said) as raised:
        read_metaimage(written(tmp_path, data), {})
    assert "\n" not in str(raised.value)


def test_a_stylus_without_an_image_is_read(shared_data: Path) -> None:
    got = read_metaimage(shared_data / STYLUS, {})
    assert got.clock["StylusToTracker/rotation"].rate_hz == pytest.approx(15.0, abs=0.01)
    assert got.signal("ReferenceToTracker/translation", "m").y.shape == (1000, 3)


@pytest.mark.slow
def test_two_formats_of_one_sequence_are_equal(shared_data: Path) -> None:
    one, other = (
        read(shared_data / FREEHAND.format(ending), {"m_per_px": "0.1mm"})
        for read, ending in ((read_metaimage, "mha"), (read_nrrd, "nrrd"))
    )
    assert (
        one.signals.keys()
        == other.signals.keys()
        == {
            f"{tool}ToTracker/{part}"
            for tool in ("Probe", "Reference")
            for part in ("rotation", "translation")
        }
    )
    for name, signal in one.signals.items():
        np.testing.assert_array_equal(signal.y, other.signals[name].y)
    pairs = zip(one.frame("images").images, other.frame("images").images, strict=True)
    assert all(np.array_equal(a, b) for a, b in pairs)
    assert one.unread == {"StylusToTracker": "never seen"}


@pytest.mark.parametrize(("sizes", "says"), [
    ("1024 1024 1024", "1073741824 pixels, limit 419430400"),
    ("5 4 3", "over 480 bytes unpacked, more than its sizes hold"),
])  # fmt: skip
def test_an_nrrd_bomb_is_refused_before_it_is_unpacked(
    tmp_path: Path, sizes: str, says: str
) -> None:
    packer = zlib.compressobj(9, zlib.DEFLATED, 31)
    packed = packer.compress(bytes(2**24)) + packer.flush()
    head = f"NRRD0004\ntype: uint8\ndimension: 3\nsizes: {sizes}\nencoding: gzip\n\n"
    with pytest.raises(RecordingError, match=rf"^x\.nrrd: {says}"):
        read_nrrd(written(tmp_path, head.encode() + packed, "x.nrrd"), {})


def test_a_sequence_without_a_frame_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="fields Seq_Frame0000"):
        read_metaimage(written(tmp_path, tracked(0, pixels=False)), {})


@pytest.mark.parametrize(
    ("shape", "kind"), [((5, 4, 2, 3), "uint8"), ((5, 4), "int32"), ((5, 4), "float64")]
)
def test_pixels_that_are_no_grey_images_are_refused(shape: tuple[int, ...], kind: str) -> None:
    pixels = np.zeros(shape, kind)
    with pytest.raises(RecordingError, match=rf"pixels \({shape[0]}, .* {kind}; images of 8 or 16"):
        nrrd._images(Path("x.nrrd"), pixels)
    image = np.arange(20, dtype=np.uint16).reshape(5, 4, 1, 1)
    (found,) = nrrd._images(Path("x.nrrd"), image)
    assert (found == image[:, :, 0, 0].T).all()


@pytest.mark.parametrize(
    ("values", "unit", "expected"),
    [("0 0.5 2", "s", [0, 0.5, 2]), ("0 500 2000", "ms", [0, 0.5, 2]), ("a b c", "s", []),
     ("0 2 1", "s", []), ("0 1 2", "mm", [])],
)  # fmt: skip
def test_a_list_of_indices_is_times_where_they_rise(
    values: str, unit: str, expected: list[float]
) -> None:
    header = {"sizes": [3, 4, 4], "axis 0 index values": values, "axis 0 index unit": unit}
    assert nrrd._times(header, ["list", "domain", "domain"]).tolist() == expected


def test_an_nrrd_that_is_cut_in_its_packed_pixels_is_refused(tmp_path: Path) -> None:
    packer = zlib.compressobj(wbits=31)
    packed = packer.compress(bytes(1000)) + packer.flush()
    path = tmp_path / "x.nrrd"
    path.write_bytes(b"NRRD0004\nencoding: gzip\n\n" + packed)
    nrrd._require_end(path, 1000)
    with pytest.raises(RecordingError, match="over 999 bytes"):
        nrrd._require_end(path, 999)
    path.write_bytes(path.read_bytes()[:-5])
    with pytest.raises(RecordingError, match="truncated: its pixels do not end"):
        nrrd._require_end(path, 1000)
