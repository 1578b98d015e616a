"""Videos written by FFmpeg, images by Pillow: pixels, scale and times as stated, or asked for."""

import io
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image, TiffImagePlugin

from validate.commands.main import cli
from validate.errors import RecordingError, UsageError
from validate.recording.images import image_stack
from validate.recording.images.image import MAX_SIDE, shallow
from validate.recording.images.image_stack import read_image_stack
from validate.recording.images.video import read_video
from validate.recording.mcap import known_messages as raw
from validate.recording.mcap.known_messages import RawImage, decode_picture
from validate.recording.readers import recognised

pytestmark = pytest.mark.usefixtures("decoded_here")

# private: _numbers: called alone, case by case.

SAID = {"m_per_px": "0.1mm", "rate": "20"}


def film(path: Path, code: str = "mp4v", count: int = 12, colour: bool = False) -> Path:
    video = cv2.VideoWriter(
        str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*code), 25.0, (64, 48)
    )
    for i in range(count):
        image = np.full((48, 64, 3), 20, np.uint8)
        image[8:40, 4 * i : 4 * i + 16] = (0, 0, 250) if colour else 200
        video.write(image)
    video.release()
    return path


@pytest.mark.parametrize(("name", "code"), [("x.mp4", "mp4v"), ("x.avi", "MJPG")])
def test_a_video_has_the_containers_times(tmp_path: Path, name: str, code: str) -> None:
    path = film(tmp_path / name, code)
    assert recognised(path).name == "video"
    got = read_video(path, {"m_per_px": "0.1mm"})
    frames = got.frame("images")
    assert len(frames.images) == 12
    assert frames.t.tolist() == pytest.approx([0.04 * i for i in range(12)])
    assert frames.m_per_px == (1e-4, 1e-4)
    middles = [float(np.average(np.arange(64), weights=np.maximum(im[20], 60) - 60))
               for im in frames.images]  # fmt: skip
    assert np.diff(middles) == pytest.approx(4.0, abs=0.3)
    assert got.metadata["provenance"]["times"] == "from the container, evenly spaced"
    assert got.metadata["provenance"]["colour"] == "grey, as recorded"


@pytest.mark.own_process
def test_a_videos_rate_scale_and_every_frame_are_the_users(tmp_path: Path) -> None:
    path = film(tmp_path / "x.mp4", colour=True)
    with pytest.raises(UsageError, match="has no scale; give it, as --m-per-px"):
        read_video(path, {})
    got = read_video(path, {"m_per_px": "0.1mm", "rate": "500", "every": "5"})
    assert got.frame("images").t.tolist() == pytest.approx([0.0, 0.01, 0.02])
    said = got.metadata["provenance"]
    assert (said["frames"], said["colour"]) == (
        "3 of 12, one in 5",
        "converted to grey (ITU-R 601)",
    )
    for wrong in ("0", "1.5", "x"):
        with pytest.raises(UsageError, match="every"):
            read_video(path, {"m_per_px": "0.1mm", "every": wrong})


@pytest.mark.parametrize(("name", "code"), [("x.mp4", "mp4v"), ("x.avi", "MJPG")])
def test_a_cut_or_forged_video_costs_a_line(tmp_path: Path, name: str, code: str) -> None:
    path = film(tmp_path / name, code)
    whole = path.read_bytes()
    for count in (12, len(whole) // 3, len(whole) - 1):
        path.write_bytes(whole[:count])
        with pytest.raises(RecordingError, match=name.replace(".", r"\.")):
            read_video(path, {"m_per_px": "0.1mm"})
    forged = {"mp4v": b"\x7f\xff\xff\xff" + whole[4:],
              "MJPG": whole[:4] + b"\xff\xff\xff\x7f" + whole[8:]}  # fmt: skip
    path.write_bytes(forged[code])
    with pytest.raises(RecordingError):
        read_video(path, {"m_per_px": "0.1mm"})


def gradient(i: int, top: int = 255) -> Any:
    return (np.arange(48)[:, None] * np.ones(32) * top / 47 * (1 - 0.1 * i)).round()


def test_a_folder_of_jpeg_is_in_the_order_of_its_numbers(tmp_path: Path) -> None:
    for i in (10, 9, 2):
        Image.fromarray(gradient(i).astype(np.uint8)).save(tmp_path / f"cam_{i}.jpg", quality=95)
    assert recognised(tmp_path).name == "image-stack"
    images = read_image_stack(tmp_path, SAID).frame("images").images
    tops = [int(image[-1].mean()) for image in images]
    assert tops == pytest.approx([int(gradient(i)[-1].mean()) for i in (2, 9, 10)], abs=3)
    with pytest.raises(UsageError, match="has no scale"):
        read_image_stack(tmp_path, {"rate": "20"})
    with pytest.raises(UsageError, match="3 images without times"):
        read_image_stack(tmp_path, {"m_per_px": "1mm"})


def test_pages_of_16_bits_become_8_and_it_is_said(tmp_path: Path) -> None:
    pages = [Image.fromarray(gradient(i, 4000).astype(np.uint16)) for i in range(3)]
    path = tmp_path / "x.tif"
    pages[0].save(path, save_all=True, append_images=pages[1:])
    got = read_image_stack(path, SAID)
    images = got.frame("images").images
    assert [int(im.max()) for im in images] == [255, 230, 204]
    assert got.metadata["provenance"]["levels"].startswith(
        "16 bits converted to 8: 0 to 4000 (the largest)"
    )
    white = read_image_stack(path, SAID | {"white": "8000"}).frame("images").images
    assert int(white[0].max()) == 128
    assert got.frame("images").t.tolist() == pytest.approx([0, 0.05, 0.1])


def test_imagej_states_scale_and_interval(tmp_path: Path) -> None:
    """Tags after ImageJ's documentation; dots an inch of any other program are a printer's."""
    tags = TiffImagePlugin.ImageFileDirectory_v2()
    tags[270] = "ImageJ=1.54f\nimages=2\nframes=2\nunit=mm\nfinterval=0.25\n"
    tags[282] = tags[283] = TiffImagePlugin.IFDRational(20, 1)
    pages = [Image.fromarray(gradient(i).astype(np.uint8)) for i in range(2)]
    path = tmp_path / "x.tif"
    pages[0].save(path, save_all=True, append_images=pages[1:], tiffinfo=tags)
    got = read_image_stack(path, {}).frame("images")
    assert got.m_per_px == pytest.approx((5e-5, 5e-5))
    assert got.t.tolist() == [0.0, 0.25]
    pages[0].save(tmp_path / "y.tif", dpi=(300, 300))
    with pytest.raises(UsageError, match="has no scale"):
        read_image_stack(tmp_path / "y.tif", {})


def test_a_png_of_16_bits_is_sent_to_the_reader_that_takes_it(tmp_path: Path) -> None:
    (tmp_path / "i").mkdir()
    Image.fromarray(gradient(0, 60000).astype(np.uint16)).save(tmp_path / "i" / "a1.png")
    arguments = ["import", str(tmp_path / "i"), "--m-per-px", "0.1mm", "--rate", "1", "-o",
                 str(tmp_path / "x.mcap")]  # fmt: skip
    done = CliRunner().invoke(cli, arguments)
    assert "--as image-stack reads others" in str(done.exception)
    assert CliRunner().invoke(cli, [*arguments, "--as", "image-stack"]).exception is None


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["jpg", pytest.param("tif", marks=pytest.mark.slow)])
def test_a_bomb_or_a_cut_image_costs_a_line(tmp_path: Path, kind: str) -> None:
    file = tmp_path / f"a1.{kind}"
    Image.fromarray(gradient(0).astype(np.uint8)).save(file)
    whole = file.read_bytes()
    for count in (4, len(whole) // 2):
        file.write_bytes(whole[:count])
        with pytest.raises(RecordingError, match=f"a1.{kind}"):
            read_image_stack(tmp_path, SAID)
    Image.new("L", (20000, 20000)).save(file)
    with pytest.raises(RecordingError):
        read_image_stack(tmp_path, SAID)


@pytest.mark.parametrize(
    ("name", "dots", "said"),
    [
        ("x.tif", 2540, "declares 2540 dots an inch: if the instrument .* --m-per-px 0.01mm$"),
        ("x.tif", 96, "declares 96 dots an inch, as for printers and screens: not a scale$"),
        ("png/1.png", 2540, "declares 2540 dots an inch: if the instrument .* --m-per-px 0.01mm$"),
        ("png/1.png", 72, "as for printers and screens: not a scale$"),
        ("jpg/1.jpg", 508, "--m-per-px 0.05mm$"),
        ("png/1.png", None, "e.g. 1e-4 and 10$"),
    ],
)
def test_dots_an_inch_are_offered_and_never_believed(
    tmp_path: Path, name: str, dots: int | None, said: str
) -> None:
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    image = Image.fromarray(np.full((8, 9), 7, np.uint8))
    if dots is None:
        image.save(path)
    else:
        image.save(path, dpi=(dots, dots))
    whole = path if path.suffix == ".tif" else path.parent
    reader = recognised(whole)
    with pytest.raises(UsageError, match=said):
        reader.read(whole, {})
    got = reader.read(whole, {"m_per_px": "0.2mm", "rate": "1"})
    assert got.frame("images").m_per_px == (2e-4, 2e-4)


def test_import_prints_the_level_by_which_deep_images_became_8_bits(tmp_path: Path) -> None:
    Image.fromarray(np.array([[0, 500], [1000, 250]], np.uint16)).save(tmp_path / "x.tif")
    Image.fromarray(np.full((8, 9), 7, np.uint8)).save(tmp_path / "y.tif")
    line = ["import", str(tmp_path / "x.tif"), "--m-per-px", "1mm", "-o", str(tmp_path / "x.mcap")]
    said = CliRunner().invoke(cli, line).output
    assert "levels: 16 bits converted to 8: 0 to 1000 (the largest) became 0 to 255" in said
    line[1] = str(tmp_path / "y.tif")
    assert "levels" not in CliRunner().invoke(cli, line).output


def test_images_of_several_kinds_in_a_folder_are_all_read(tmp_path: Path) -> None:
    """Beside PNG the others were left out without a word; what macOS leaves is none."""
    for i, ending in enumerate(["png", "bmp", "tif", "png"]):
        Image.fromarray(np.full((4, 6), 10 * i, np.uint8)).save(tmp_path / f"f{i}.{ending}")
    (tmp_path / "._f0.png").write_bytes(b"\0\5\26\7")
    reader = recognised(tmp_path)
    assert reader.name == "image-stack"
    levels = [int(image[0, 0]) for image in reader.read(tmp_path, SAID).frame("images").images]
    assert levels == [0, 10, 20, 30]
    for other in ("f1.bmp", "f2.tif"):
        (tmp_path / other).unlink()
    assert recognised(tmp_path).name == "png-stack"
    assert len(recognised(tmp_path).read(tmp_path, SAID).frame("images").images) == 2


def test_hdf5_that_is_none_of_matlab_says_how_it_becomes_one(tmp_path: Path) -> None:
    (tmp_path / "x.h5").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(64))
    with pytest.raises(UsageError, match=r"HDF5 file .*scipy.io.savemat\('x.mat'"):
        recognised(tmp_path / "x.h5")


def packed(image: Image.Image, kind: str) -> bytes:
    out = io.BytesIO()
    image.save(out, kind)
    return out.getvalue()


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"no picture at all", "17 bytes are not an image"),
        (packed(Image.new("L", (MAX_SIDE + 1, 1)), "PNG"), "4097 x 1 px, allowed 1..4096 per side"),
        (packed(Image.new("F", (2, 2)), "TIFF"), "of mode F: over 16 bits; save 16-bit grey"),
    ],
)
def test_a_message_without_picture_is_refused(data: bytes, says: str) -> None:
    with pytest.raises(RecordingError, match=says):
        decode_picture(data)


def test_levels_below_zero_and_images_beyond_the_limit_are_refused() -> None:
    with pytest.raises(RecordingError, match="levels from -2 to 7; save them from 0 on"):
        shallow([np.array([[-2.0, 7.0]])], {})
    with pytest.raises(RecordingError, match="4097 x 1 px, the limit is 4096 per side"):
        shallow([np.zeros((1, MAX_SIDE + 1), np.uint8)], {})


def test_a_file_without_images_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(image_stack, "decoded", lambda *_: {})
    with pytest.raises(RecordingError, match=r"x.tif: no image in it"):
        read_image_stack(tmp_path / "x.tif", {})


def test_images_beyond_all_bytes_of_a_stack_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for i in range(3):
        Image.fromarray(gradient(i).astype(np.uint8)).save(tmp_path / f"{i}.png")
    size = gradient(0).size
    assert len(image_stack.arrays(tmp_path)) >= 4
    monkeypatch.setattr(image_stack, "MOST", 2 * size)
    with pytest.raises(RecordingError, match=f"more than {2 * size} bytes of images; split"):
        image_stack.arrays(tmp_path)


def test_rows_of_a_raw_image_that_are_cut_are_refused() -> None:
    with pytest.raises(RecordingError, match="11 bytes for 3 x 2 px of 2; truncated"):
        raw._numbers(RawImage("yuv422", 2, 3, 6, bytes(11), False), 2, 1)
    found = raw._numbers(RawImage("mono16", 1, 2, 6, b"\0\1\0\2\\9\\9", True), 1, 2)
    assert found[..., 0].tolist() == [[1, 2]]
