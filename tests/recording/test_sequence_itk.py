"""MetaImage and NRRD held to SimpleITK: files that it writes, and every file of the data folder."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from itk_files import PIXELS, call, name

from validate.errors import RecordingError
from validate.recording.images.metaimage import read_metaimage
from validate.recording.images.nrrd import read_nrrd
from validate.recording.types import Recording

pytestmark = pytest.mark.usefixtures("decoded_here")

TOOL = re.compile(r"\w+To\w+Transform")
READ = {"mha": read_metaimage, "mhd": read_metaimage, "seq.nrrd": read_nrrd}
EACH_ENDING = pytest.mark.parametrize("ending", READ)


@pytest.fixture(scope="module")
def itk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of files that SimpleITK wrote."""
    folder = tmp_path_factory.mktemp("itk")
    call("write", folder)
    return folder


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("deep", [0, 1])
@EACH_ENDING
def test_what_itk_writes_is_read_pixel_by_pixel(
    ending: str, deep: int, compressed: bool, itk: Path
) -> None:
    got = READ[ending](itk / name(ending, deep=deep, compressed=compressed), {})
    frames = got.frame("images")
    np.testing.assert_array_equal(np.array(frames.images), PIXELS[:2])
    np.testing.assert_allclose(frames.t, [0, 0.1], atol=1e-9)
    assert frames.m_per_px == pytest.approx((1e-4, 2e-4))
    moved = got.signal("ProbeToTracker/translation", "m")
    np.testing.assert_allclose(moved.t, [0, 0.2], atol=1e-9)
    np.testing.assert_allclose(moved.y, [[0.01, -0.002, 1.0]] * 2)


@pytest.mark.slow
@EACH_ENDING
def test_volumes_and_levels_that_are_none_are_called_so(ending: str, itk: Path) -> None:
    with pytest.raises(RecordingError, match=r"2 px deep|\(5, 4, 2, 3\)"):
        READ[ending](itk / name(ending, deep=2), {})
    with pytest.raises(RecordingError, match=r"MET_FLOAT|float32"):
        READ[ending](itk / name(ending, "float32"), {})
    with pytest.raises(RecordingError, match=r"from -100 to 1\d\d; save them from 0"):
        READ[ending](itk / name(ending, "int16"), {})


@EACH_ENDING
def test_16_bits_become_8_by_a_level_that_is_said(ending: str, itk: Path) -> None:
    path, top = itk / name(ending, "uint16"), int(PIXELS[:2].max())
    got = READ[ending](path, {})
    shown = np.rint(PIXELS[:2] * (255 / top)).astype(np.uint8)
    np.testing.assert_array_equal(np.array(got.frame("images").images), shown)
    said = got.metadata["provenance"]["levels"]
    assert said == f"16 bits converted to 8: 0 to {top} (the largest) became 0 to 255"
    half = READ[ending](path, {"white": "510"}).frame("images").images
    np.testing.assert_array_equal(np.array(half), np.rint(PIXELS[:2] / 2).astype(np.uint8))


def test_16_bits_in_the_other_order_of_bytes_are_the_same(itk: Path, tmp_path: Path) -> None:
    """By the largest level, levels 256 times as high would look the same: `white` is said."""
    path, said = itk / name("mha", "uint16", compressed=False), {"white": "510"}
    whole, size = path.read_bytes(), 2 * PIXELS.size
    turned = np.frombuffer(whole[-size:], "<u2").astype(">u2").tobytes()
    big = tmp_path / "big.mha"
    big.write_bytes(whole[:-size].replace(b"MSB = False", b"MSB = True") + turned)
    one, other = (np.array(read_metaimage(p, said).frame("images").images) for p in (path, big))
    np.testing.assert_array_equal(one, other)


@pytest.mark.slow
def test_every_sequence_of_the_data_folder_is_as_itk_reads_it(
    shared_data: Path, tmp_path: Path
) -> None:
    """ITK refuses the one without images."""
    found = sorted(p for end in ("mha", "mhd", "nrrd") for p in shared_data.rglob(f"*.{end}"))
    compared = [path.name for path in found if held_to_itk(path, tmp_path / f"{path.name}.npz")]
    assert len(compared) == len(found) - 1 >= 3


def held_to_itk(path: Path, out: Path) -> bool:
    """Whether ITK reads the file; pixels, times and poses are then its own."""
    read = read_nrrd if path.suffix == ".nrrd" else read_metaimage
    got = read(path, {"m_per_px": "0.1mm"})
    call("read", path, out)
    if not out.is_file():
        assert not got.frames, path.name
        return False
    with np.load(out) as theirs:
        pixels, texts = theirs["pixels"], json.loads(str(theirs["texts"]))
    fields = [own(texts, i) for i in range(len(pixels))]
    good = [i for i, f in enumerate(fields) if f.get("ImageStatus", "OK") == "OK"]
    np.testing.assert_array_equal(np.array(got.frame("images").images), pixels[good])
    assert_poses(got, fields)
    return True


def own(texts: dict[str, str], i: int) -> dict[str, str]:
    start = f"Seq_Frame{i:04d}_"
    return {key.removeprefix(start): text for key, text in texts.items() if key.startswith(start)}


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
