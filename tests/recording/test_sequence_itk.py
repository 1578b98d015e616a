"""MetaImage and NRRD held to SimpleITK: files that it writes, and every file of the data folder."""

import re
from pathlib import Path

import numpy as np
import pytest
import SimpleITK

from validate.errors import RecordingError
from validate.recording.formats.metaimage import read_metaimage
from validate.recording.formats.nrrd import read_nrrd
from validate.recording.types import Recording

TURN = "0 -1 0 10 1 0 0 -2 0 0 1 1000 0 0 0 1"
TOOL = re.compile(r"\w+To\w+Transform")
PIXELS = np.random.default_rng(0).integers(0, 256, (3, 4, 5)).astype(np.uint8)


def by_itk(path: Path, *, deep: int = 0, compressed: bool = True, dtype: type = np.uint8) -> Path:
    """Three images of 5 x 4 px of 0.1 x 0.2 mm, a probe that is lost in the second; `deep` > 0
    writes four dimensions."""
    pixels = PIXELS.astype(dtype)
    stack = np.repeat(pixels[:, None], deep, axis=1) if deep else pixels
    image = SimpleITK.GetImageFromArray(stack, isVector=False)
    image.SetSpacing((0.1, 0.2, 1.0, 1.0)[: image.GetDimension()])
    for i in range(3):
        own = f"Seq_Frame{i:04d}_"
        image.SetMetaData(f"{own}Timestamp", str(5 + 0.1 * i))
        image.SetMetaData(f"{own}ProbeToTrackerTransform", TURN)
        image.SetMetaData(f"{own}ProbeToTrackerTransformStatus", "INVALID" if i == 1 else "OK")
        image.SetMetaData(f"{own}ImageStatus", "INVALID" if i == 2 else "OK")
    SimpleITK.WriteImage(image, str(path), compressed)
    return path


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("deep", [0, 1])
@pytest.mark.parametrize("ending", ["mha", "mhd", "seq.nrrd"])
def test_what_itk_writes_is_read_pixel_by_pixel(
    ending: str, deep: int, compressed: bool, tmp_path: Path
) -> None:
    path = by_itk(tmp_path / f"x.{ending}", deep=deep, compressed=compressed)
    got = (read_nrrd if ending.endswith("nrrd") else read_metaimage)(path, {})
    frames = got.frame("images")
    np.testing.assert_array_equal(np.array(frames.images), PIXELS[:2])
    np.testing.assert_allclose(frames.t, [0, 0.1], atol=1e-9)
    assert frames.m_per_px == pytest.approx((1e-4, 2e-4))
    moved = got.signal("ProbeToTracker/translation", "m")
    np.testing.assert_allclose(moved.t, [0, 0.2], atol=1e-9)
    np.testing.assert_allclose(moved.y, [[0.01, -0.002, 1.0]] * 2)


READ = {"mha": read_metaimage, "nrrd": read_nrrd}
BOTH = pytest.mark.parametrize("ending", ["mha", "nrrd"])


@BOTH
def test_volumes_and_pixels_of_other_depths_are_called_so(ending: str, tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"2 px deep|\(5, 4, 2, 3\)"):
        READ[ending](by_itk(tmp_path / f"x.{ending}", deep=2), {})
    with pytest.raises(RecordingError, match=r"MET_FLOAT|float32"):
        READ[ending](by_itk(tmp_path / f"x.{ending}", dtype=np.float32), {})


@BOTH
def test_16_bits_become_8_by_a_level_that_is_said(ending: str, tmp_path: Path) -> None:
    path = by_itk(tmp_path / f"x.{ending}", dtype=np.uint16)
    top = int(PIXELS[:2].max())
    got = READ[ending](path, {})
    shown = np.rint(PIXELS[:2] * (255 / top)).astype(np.uint8)
    np.testing.assert_array_equal(np.array(got.frame("images").images), shown)
    said = got.metadata["provenance"]["levels"]
    assert said == f"16 bits made 8: 0 to {top} (the largest) became 0 to 255"
    half = READ[ending](path, {"white": "510"}).frame("images").images
    np.testing.assert_array_equal(np.array(half), np.rint(PIXELS[:2] / 2).astype(np.uint8))


def test_16_bits_in_the_other_order_of_bytes_are_the_same(tmp_path: Path) -> None:
    path = by_itk(tmp_path / "x.mha", dtype=np.uint16, compressed=False)
    plain = read_metaimage(path, {}).frame("images").images
    whole = path.read_bytes()
    size = 2 * PIXELS.size
    turned = np.frombuffer(whole[-size:], "<u2").astype(">u2").tobytes()
    path.write_bytes(whole[:-size].replace(b"MSB = False", b"MSB = True") + turned)
    np.testing.assert_array_equal(
        np.array(plain), np.array(read_metaimage(path, {}).frame("images").images)
    )


@BOTH
def test_levels_below_zero_are_refused(ending: str, tmp_path: Path) -> None:
    image = SimpleITK.GetImageFromArray(PIXELS.astype(np.int16) - 100)
    image.SetMetaData("Seq_Frame0000_ImageStatus", "OK")
    image.SetSpacing((0.1, 0.1, 1.0))
    SimpleITK.WriteImage(image, str(tmp_path / f"x.{ending}"))
    with pytest.raises(RecordingError, match=r"levels from -100 to 15\d; save them from 0 on"):
        READ[ending](tmp_path / f"x.{ending}", {"rate": "10"})


@pytest.mark.slow
def test_every_sequence_of_the_data_folder_is_as_itk_reads_it(shared_data: Path) -> None:
    """ITK refuses the one without images."""
    found = sorted(p for end in ("mha", "mhd", "nrrd") for p in shared_data.rglob(f"*.{end}"))
    compared = [path.name for path in found if held_to_itk(path)]
    assert len(compared) == len(found) - 1 >= 3


def held_to_itk(path: Path) -> bool:
    """Whether ITK reads the file; pixels, times and poses are then its own."""
    read = read_nrrd if path.suffix == ".nrrd" else read_metaimage
    got = read(path, {"m_per_px": "0.1mm"})
    try:
        image = SimpleITK.ReadImage(str(path))
    except RuntimeError:
        assert not got.frames, path.name
        return False
    theirs = SimpleITK.GetArrayViewFromImage(image)
    if image.GetNumberOfComponentsPerPixel() > 1:  # an axis of the kind `list`
        theirs = np.moveaxis(theirs, -1, 0)
    theirs = theirs.reshape(-1, *theirs.shape[-2:])
    fields = [own(image, i) for i in range(len(theirs))]
    good = [i for i, f in enumerate(fields) if f.get("ImageStatus", "OK") == "OK"]
    np.testing.assert_array_equal(np.array(got.frame("images").images), theirs[good])
    assert_poses(got, fields)
    return True


def own(image: SimpleITK.Image, i: int) -> dict[str, str]:
    start = f"Seq_Frame{i:04d}_"
    keys = [key for key in image.GetMetaDataKeys() if key.startswith(start)]
    return {key.removeprefix(start): image.GetMetaData(key).strip() for key in keys}


def assert_poses(got: Recording, fields: list[dict[str, str]]) -> None:
    stamps = np.array([float(f["Timestamp"]) for f in fields])
    tools = {key.removesuffix("Transform") for f in fields for key in f if TOOL.fullmatch(key)}
    for tool in tools - got.unread.keys():
        seen = [i for i, f in enumerate(fields) if f[f"{tool}TransformStatus"] == "OK"]
        T = np.array([fields[i][f"{tool}Transform"].split() for i in seen], dtype=float)
        moved = got.signal(f"{tool}/translation", "m")
        np.testing.assert_allclose(1e3 * moved.y, T[:, [3, 7, 11]], rtol=1e-12)
        np.testing.assert_allclose(np.diff(moved.t), np.diff(stamps[seen]), atol=2e-9)
        turned = got.signal(f"{tool}/rotation", "1").y
        np.testing.assert_allclose(turned, T[:, [0, 1, 2, 4, 5, 6, 8, 9, 10]], rtol=1e-12)
