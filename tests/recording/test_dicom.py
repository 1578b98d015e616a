"""DICOM ultrasound that scanners wrote: the files of the package pydicom-data."""

import re
import zlib
from pathlib import Path

import numpy as np
import pydicom.data
import pytest
from children import lacking

from validate.errors import RecordingError, UsageError
from validate.installation import install_command
from validate.recording.formats import subprocess_decoder
from validate.recording.images import dicom, dicom_arrays
from validate.recording.images import dicom as dicom_files
from validate.recording.images.dicom import read_dicom
from validate.recording.readers import recognised

pytestmark = pytest.mark.usefixtures("decoded_here")

# private: _MOST, _PACKED: replaced by a small number: a short test.
# private: _box, _images, _moments, _require_few_bytes, _series: called alone, case by case.
# private: _frames, _read: replaced, to bring a case about.

data_store = pytest.importorskip("data_store", reason="pydicom-data is not installed")
DATA = Path(data_store.__file__).parent / "data"
BESIDE = Path(pydicom.data.__file__).parent / "test_files"


def test_a_cine_loop_is_its_region_with_its_scale_and_its_times() -> None:
    """120 JPEG images at 33.333 ms; the region states .05104970559 cm a pixel."""
    path = DATA / "color3d_jpeg_baseline.dcm"
    assert recognised(path).name == "dicom"
    got = read_dicom(path, {})
    frames = got.frame("images")
    assert len(frames.images) == 120
    assert frames.images[0].shape == (384, 512)
    assert frames.m_per_px == pytest.approx((5.104970559e-4, 5.104970559e-4), rel=1e-9)
    assert frames.t[-1] == pytest.approx(119 * 0.033333)
    told = got.metadata["provenance"]
    assert told["times"] == "FrameTime"
    assert told["images px"] == "84..596 x 31..415 of 640 x 480"


@pytest.mark.slow
@pytest.mark.parametrize("other", ["OBXXXX1A_rle_2frame.dcm", "OBXXXX1A_expb_2frame.dcm"])
def test_the_same_images_in_other_encodings_are_the_same_bit_for_bit(other: str) -> None:
    plain = read_dicom(DATA / "OBXXXX1A_2frame.dcm", {"rate": "20"}).frame("images")
    also = read_dicom(DATA / other, {"rate": "20"}).frame("images")
    assert plain.m_per_px == also.m_per_px == pytest.approx((2.622878767e-4,) * 2, rel=1e-9)
    for a, b in zip(plain.images, also.images, strict=True):
        assert (a == b).all()
    assert plain.t.tolist() == [0, 0.05]


@pytest.mark.slow
def test_two_views_beside_each_other_are_two_streams_from_the_left() -> None:
    got = read_dicom(DATA / "gdcm-US-ALOKA-16.dcm", {})
    assert sorted(got.frames) == ["images/1", "images/2"]
    told = got.metadata["provenance"]
    assert told["images/1 px"] == "32..336 x 24..416 of 640 x 480"
    assert told["images/2 px"] == "336..640 x 24..416 of 640 x 480"
    big = read_dicom(DATA / "gdcm-US-ALOKA-16_big.dcm", {})
    for topic in got.frames:
        assert (got.frame(topic).images[0] == big.frame(topic).images[0]).all()


@pytest.mark.slow
def test_a_scale_of_an_image_of_another_size_is_not_believed() -> None:
    path = BESIDE / "examples_ybr_color.dcm"
    with pytest.raises(UsageError, match=r"pixel 595, 414.*320 x 240"):
        read_dicom(path, {})
    frames = read_dicom(path, {"m_per_px": "1.02mm"}).frame("images")
    assert frames.images[0].shape == (240, 320)
    assert frames.m_per_px == pytest.approx((1.02e-3, 1.02e-3))


def test_what_is_not_stated_is_asked_for() -> None:
    with pytest.raises(UsageError, match=r"2 images.*--map rate=HZ"):
        read_dicom(DATA / "OBXXXX1A_2frame.dcm", {})
    with pytest.raises(UsageError, match=r"no scale, .* --map m_per_px=0\.1mm"):
        read_dicom(DATA / "US1_UNCR.dcm", {})


@pytest.mark.parametrize(
    ("path", "why"),
    [
        (BESIDE / "rtplan.dcm", "no image in it"),
        (DATA / "SC_rgb_32bit.dcm", "pixels of uint32; those of 8 and 16 bits are read"),
        (BESIDE / "dicomdirtests/98892003/MR700", "7 images of 7 places: slices of a volume"),
        (BESIDE / "dicomdirtests/98892003/MR1", r"3 series in one folder, of \[1, 1, 1\] files"),
        (BESIDE / "dicomdirtests", r"1 of 7 files are not DICOM \(README.txt\); take them out"),
        (BESIDE / "JPEG-lossy.dcm", "are in .JPEG Extended.*decompress it first"),
    ],
)
def test_what_is_no_readable_image_says_why(path: Path, why: str) -> None:
    with pytest.raises(RecordingError, match=why):
        read_dicom(path, {})


@pytest.mark.own_process
def test_without_the_library_the_line_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(subprocess_decoder, "python_module", lacking("pydicom"))
    with pytest.raises(UsageError, match=f"'pydicom'.*{re.escape(install_command('dicom'))}"):
        read_dicom(DATA / "US1_UNCR.dcm", {"m_per_px": "1mm"})


def test_16_bits_become_8_by_a_level_that_is_told() -> None:
    deep = pydicom.dcmread(BESIDE / "CT_small.dcm").pixel_array
    for options, white in (({}, deep.max()), ({"white": "3000"}, 3000)):
        got = read_dicom(BESIDE / "CT_small.dcm", options)
        expected = np.rint(np.clip(deep * (255 / white), 0, 255))
        assert (got.frame("images").images[0] == expected).all()
        told = got.metadata["provenance"]
        assert f"16 bits converted to 8: 0 to {white} (" in told["levels"]
        assert told["scale"] == "0.661468 x 0.661468 mm per pixel (PixelSpacing)"


def series(folder: Path, **changed: dict[int, object]) -> Path:
    """Four images of one series, each as dark as its number, in files named backwards."""
    folder.mkdir()
    for i in range(4):
        ds = pydicom.dcmread(DATA / "OBXXXX1A.dcm")
        ds.PixelData = bytes([10 * i]) * (ds.Rows * ds.Columns)
        ds.InstanceNumber = i + 1
        ds.PhotometricInterpretation = "MONOCHROME2"
        ds.ContentTime = ("125959.00", "125959.25", "130002", "130003")[i]
        for name, values in changed.items():
            setattr(ds, name, values.get(i, getattr(ds, name, None)))
        ds.save_as(folder / f"{9 - i}.dcm")
    return folder


def test_a_folder_of_one_series_is_one_sequence(tmp_path: Path) -> None:
    path = series(tmp_path / "loop")
    assert recognised(path).name == "dicom"
    got = read_dicom(path, {})
    frames = got.frame("images")
    assert [int(image[0, 0]) for image in frames.images] == [0, 10, 20, 30]
    assert frames.t == pytest.approx([0.0, 0.25, 3.0, 4.0])
    assert frames.m_per_px == pytest.approx((2.622878766e-4, 2.622878766e-4), rel=1e-9)
    told = got.metadata["provenance"]
    assert told["times"] == "ContentTime"
    assert told["scale"].endswith("mm per pixel (SequenceOfUltrasoundRegions)")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changed", "why"),
    [
        ({"InstanceNumber": {2: 1}}, "3 instance numbers of 4 files"),
        ({"NumberOfFrames": {2: 2}}, "1 files of several images each; import them one by one"),
        ({"ContentTime": {2: "125959.10"}}, "4 images without times; give --map rate=HZ"),
        ({"SliceLocation": {i: 1.5 * i for i in range(4)}}, "4 images of 4 places: slices of a"),
        ({"SeriesInstanceUID": {0: "1.2.3"}}, r"2 series in one folder, of \[1, 3\] files"),
    ],
)
def test_what_is_no_one_series_says_why(
    changed: dict[str, dict[int, object]], why: str, tmp_path: Path
) -> None:
    path = series(tmp_path / "loop", **changed)
    with pytest.raises((RecordingError, UsageError), match=why):
        read_dicom(path, {})


def test_luma_is_what_an_operator_sees() -> None:
    """Of pure red, green and blue: .299, .587 and .114 of white."""
    frames = read_dicom(DATA / "SC_rgb.dcm", {"m_per_px": "1mm"}).frame("images")
    values = set(np.unique(frames.images[0]).tolist())
    assert {76, 150, 29, 0, 255} <= values


def deflated(path: Path, body: bytes | None) -> Path:
    """An image packed as a whole, its packed part replaced where one is given."""
    ds = pydicom.dcmread(DATA / "OBXXXX1A_2frame.dcm")
    ds.file_meta.TransferSyntaxUID = pydicom.uid.DeflatedExplicitVRLittleEndian
    ds.save_as(path, enforce_file_format=True)
    if body is not None:
        meta = pydicom.filereader.read_file_meta_info(path)
        start = 144 + int(meta.FileMetaInformationGroupLength)
        path.write_bytes(path.read_bytes()[:start] + body)
    return path


@pytest.mark.slow
def test_a_file_packed_as_a_whole_is_read_unless_it_is_a_bomb(tmp_path: Path) -> None:
    plain = read_dicom(DATA / "OBXXXX1A_2frame.dcm", {"rate": "20"}).frame("images")
    also = read_dicom(deflated(tmp_path / "x.dcm", None), {"rate": "20"}).frame("images")
    assert all((a == b).all() for a, b in zip(plain.images, also.images, strict=True))
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    body = b"".join(packer.compress(bytes(2**24)) for _ in range(17)) + packer.flush()
    with pytest.raises(RecordingError, match=r"y\.dcm.*over 268435456 bytes"):
        read_dicom(deflated(tmp_path / "y.dcm", body), {"rate": "20"})


def of_pixels(syntax: str, pixels: bytes, **words: object) -> pydicom.Dataset:
    """Three images of 4 x 6 px, 0.1 mm a pixel, 10 a second."""
    ds = pydicom.Dataset()
    ds.file_meta = pydicom.dataset.FileMetaDataset()
    ds.file_meta.TransferSyntaxUID = syntax
    ds.SOPClassUID, ds.SOPInstanceUID = pydicom.uid.UltrasoundMultiFrameImageStorage, "1.2.3"
    ds.Rows, ds.Columns, ds.NumberOfFrames, ds.SamplesPerPixel = 4, 6, 3, 1
    ds.BitsAllocated, ds.BitsStored, ds.HighBit, ds.PixelRepresentation = 8, 8, 7, 0
    ds.PhotometricInterpretation, ds.PixelSpacing, ds.FrameTime = "MONOCHROME2", [0.1, 0.1], 100
    ds.PixelData = pixels
    for name, value in words.items():
        setattr(ds, name, value)
    return ds


def test_every_image_with_half_of_its_colours_is_read(tmp_path: Path) -> None:
    """Uncompressed loops in YBR_FULL_422: two levels, then two colours for both; grey here."""
    grey = np.arange(72, dtype=np.uint8).reshape(3, 4, 3, 2)
    both = np.full_like(grey, 128)
    ds = of_pixels(
        pydicom.uid.ExplicitVRLittleEndian, np.concatenate([grey, both], axis=3).tobytes(),
        PhotometricInterpretation="YBR_FULL_422", SamplesPerPixel=3, PlanarConfiguration=0,
    )  # fmt: skip
    ds.save_as(tmp_path / "x.dcm", enforce_file_format=True)
    images = read_dicom(tmp_path / "x.dcm", {}).frame("images").images
    np.testing.assert_array_equal(images, grey.reshape(3, 4, 6))


SCALED = {"m_per_px": "0.1mm"}


def test_lossless_jpeg_is_read_bit_for_bit(tmp_path: Path) -> None:
    """By the values of pydicom's own tests, and an MR in JPEG-LS by its uncompressed twin, both
    without what makes them slices of a volume."""
    (image,) = read_dicom(DATA / "JPGLosslessP14SV1_1s_1f_8b.dcm", SCALED).frame("images").images
    assert image.shape == (768, 1024)
    assert image[300, 512:520].tolist() == [26, 26, 25, 22, 19, 16, 14, 15]
    assert image[600, 512:520].tolist() == [45, 43, 41, 38, 33, 30, 26, 21]
    found = []
    for kind in ("_jpeg_ls_lossless", ""):
        ds = pydicom.dcmread(DATA / f"emri_small{kind}.dcm")
        del ds.SpacingBetweenSlices
        ds.save_as(tmp_path / "x.dcm")
        found.append(read_dicom(tmp_path / "x.dcm", {**SCALED, "rate": "10"}).frame("images"))
    np.testing.assert_array_equal(found[0].images, found[1].images)


@pytest.mark.parametrize(
    ("file", "why"),
    [
        (
            DATA / "emri_small.dcm",
            r"10 slices of a volume \(1.2 mm between slices, without times\)",
        ),
        (BESIDE / "rtdose.dcm", r"15 slices of a volume \(spaced by distance\)"),
        (DATA / "eCT_Supplemental.dcm", r"2 slices of a volume \(of 2 places\)"),
    ],
)
def test_slices_in_one_file_are_no_film(file: Path, why: str) -> None:
    """They were images over time, by the rate that was asked for."""
    for options in ({}, {**SCALED, "rate": "10"}):
        with pytest.raises(RecordingError, match=f"{why}, not images over time"):
            read_dicom(file, options)


def test_images_at_a_distance_with_times_are_a_film(tmp_path: Path) -> None:
    ds = of_pixels(pydicom.uid.ExplicitVRLittleEndian, bytes(72), SpacingBetweenSlices=1.0)
    ds.save_as(tmp_path / "x.dcm", enforce_file_format=True)
    assert len(read_dicom(tmp_path / "x.dcm", SCALED).frame("images").images) == 3
    ds.DimensionOrganizationType = "3D"
    ds.save_as(tmp_path / "x.dcm", enforce_file_format=True)
    with pytest.raises(RecordingError, match=r"3 slices of a volume \(organised in 3D\)"):
        read_dicom(tmp_path / "x.dcm", SCALED)


def test_a_codec_that_is_not_here_is_named_with_the_tool_that_has_it(tmp_path: Path) -> None:
    packed = pydicom.encaps.encapsulate([bytes(8)] * 3)
    ds = of_pixels(pydicom.uid.MPEG4HP41, packed)
    ds["PixelData"].is_undefined_length = True
    ds.save_as(tmp_path / "x.dcm", enforce_file_format=True)
    with pytest.raises(RecordingError, match=r"as with `gdcmraw -i x\.dcm -o x\.mp4`"):
        read_dicom(tmp_path / "x.dcm", {})


def test_more_images_than_stated_are_not_cut_off(tmp_path: Path) -> None:
    ds = of_pixels(pydicom.uid.ExplicitVRLittleEndian, bytes(4 * 24))
    ds.save_as(tmp_path / "x.dcm", enforce_file_format=True)
    with pytest.raises(RecordingError, match="more images than the 3 that its header"):
        read_dicom(tmp_path / "x.dcm", {})


def test_a_region_that_ends_before_it_begins_is_damage() -> None:
    assert dicom._box(Path("x.dcm"), np.array([2.0, 3.0, 5.0, 9.0]), 6, 10) == (2, 3, 6, 10)
    with pytest.raises(RecordingError, match="a region from 5, 3 to 5, 9; damaged"):
        dicom._box(Path("x.dcm"), np.array([5.0, 3.0, 5.0, 9.0]), 6, 10)
    with pytest.raises(RecordingError, match="a region from -1, 3 to 5, 9; damaged"):
        dicom._box(Path("x.dcm"), np.array([-1.0, 3.0, 5.0, 9.0]), 6, 10)


def test_times_are_those_of_the_first_field_that_every_image_has() -> None:
    """The first image has no time of acquisition, and that of its content is none in the second."""
    sets = [pydicom.Dataset() for _ in range(2)]
    assert dicom_arrays._moments(sets)[1] == "nothing"
    for ds, text in zip(sets, ("125959.5", "130001"), strict=True):
        ds.ContentTime = text
    sets[1].AcquisitionTime = "130000"
    t, field = dicom_arrays._moments(sets)
    assert (t.tolist(), field) == ([0.0, 1.5], "ContentTime")


@pytest.mark.parametrize(
    ("words", "raised"),
    [
        ("bytes missing", RuntimeError),
        ("unable to decode: missing dependencies", UsageError),
    ],
)
def test_what_a_codec_says_is_damage_unless_it_lacks_a_library(
    words: str, raised: type[Exception], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise RuntimeError(words)

    monkeypatch.setattr(dicom_arrays, "iter_pixels", refuse)
    ds = of_pixels(pydicom.uid.ExplicitVRLittleEndian, bytes(72))
    with pytest.raises(raised, match=r"bytes missing|Explicit VR Little Endian"):
        list(dicom_arrays._frames(ds))


def test_images_that_are_too_many_of_several_sizes_or_missing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    ds = of_pixels(pydicom.uid.ExplicitVRLittleEndian, bytes(72))
    other = of_pixels(pydicom.uid.ExplicitVRLittleEndian, bytes(72), Rows=3)
    with pytest.raises(RecordingError, match=r"sizes \[\(3, 6\), \(4, 6\)\]"):
        dicom_arrays._images([ds, other])
    image = np.zeros((4, 6), np.uint8)
    monkeypatch.setattr(dicom_arrays, "_frames", lambda ds: iter([image, image]))
    with pytest.raises(RecordingError, match="2 of 3 images"):
        dicom_arrays._images([ds])
    monkeypatch.setattr(dicom_arrays, "MAX_PIXELS", 71)
    with pytest.raises(RecordingError, match=r"\(3, 4, 6\) pixels.*71; split"):
        dicom_arrays._images([ds])


def test_a_folder_of_too_many_files_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for i in range(3):
        (tmp_path / f"{i}.dcm").write_bytes(bytes(128) + b"DICM")
    assert len(dicom_files.files_of(tmp_path)) == 3
    monkeypatch.setattr(dicom_files, "_MOST", 2)
    with pytest.raises(RecordingError, match=r"3 files.*2; split"):
        dicom_files.files_of(tmp_path)


def test_a_region_that_reaches_beyond_its_image_was_resized() -> None:
    with pytest.raises(UsageError, match=r"pixel 9, 5.*8 x 6"):
        dicom._box(Path("x.dcm"), np.array([0.0, 0.0, 9.0, 5.0]), 8, 6)


def test_files_of_a_folder_that_are_no_one_loop_are_reported(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def sets(*numbers: int | None, many: int = 1) -> list[pydicom.Dataset]:
        made = []
        for number in numbers:
            ds = pydicom.Dataset()
            ds.NumberOfFrames = many
            if number is not None:
                ds.InstanceNumber = number
            made.append(ds)
        return made

    monkeypatch.setattr(dicom_arrays, "_read", lambda ds: ds)
    monkeypatch.setattr(dicom_arrays, "files_of", lambda found: found)
    assert [ds.InstanceNumber for ds in dicom_arrays._series(sets(2, 1))] == [1, 2]
    for found, says in (
        (sets(1, 2, many=3), "2 files of several images each; import them one by one"),
        (sets(1, 1, 2), "2 instance numbers of 3 files"),
        (sets(1, None), "2 instance numbers of 2 files"),
    ):
        with pytest.raises(RecordingError, match=says):
            dicom_arrays._series(found)  # type: ignore[arg-type]


def test_what_unpacks_to_too_much_is_refused_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = deflated(tmp_path / "x.dcm", None)
    dicom_arrays._require_few_bytes(path)
    monkeypatch.setattr(dicom_arrays, "_PACKED", 1000)
    with pytest.raises(RecordingError, match="over 1000 bytes"):
        dicom_arrays._require_few_bytes(path)
