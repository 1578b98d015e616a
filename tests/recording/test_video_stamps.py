"""Videos that PyAV wrote: uneven stamps, pixels that are not square, names that are patterns."""

import struct
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from click.testing import CliRunner

from validate.commands.main import cli
from validate.errors import RecordingError, UsageError
from validate.recording.images import video
from validate.recording.images.video import VIDEO, read_video

pytestmark = pytest.mark.usefixtures("decoded_here")

# private: _last_box, _times: called alone, case by case.
# private: _require_few: replaced, to bring a case about.

UNEVEN = (0, 40, 80, 200, 230, 330, 500)  # ms
SCALE = {"m_per_px": "0.1mm"}


def film(
    path: Path, codec: str = "mpeg4", stamps: Sequence[int] = UNEVEN, aspect: Fraction | None = None
) -> Path:
    """48 x 64 px, each image of one grey, 20 + 20 i, stamped in ms."""
    with av.open(str(path), "w") as out:
        stream = out.add_stream(codec, rate=25)
        stream.width, stream.height = 64, 48
        stream.pix_fmt = "yuvj420p" if codec == "mjpeg" else "yuv420p"
        stream.time_base = stream.codec_context.time_base = Fraction(1, 1000)
        if aspect:
            stream.codec_context.sample_aspect_ratio = aspect
        for i, stamp in enumerate(stamps):
            rgb = np.full((48, 64, 3), 20 + 20 * i, np.uint8)
            frame = av.VideoFrame.from_ndarray(rgb, "rgb24").reformat(format=stream.pix_fmt)
            frame.pts, frame.time_base = stamp, Fraction(1, 1000)
            out.mux(stream.encode(frame))
        out.mux(stream.encode())
    return path


@pytest.mark.parametrize(
    ("name", "codec"), [("x.mp4", "mpeg4"), ("x.mov", "mjpeg"), ("x.mkv", "mpeg4")]
)
def test_uneven_stamps_of_the_container_are_the_times(
    name: str, codec: str, tmp_path: Path
) -> None:
    path = film(tmp_path / name, codec)
    got = read_video(path, SCALE)
    frames = got.frame("images")
    np.testing.assert_allclose(frames.t, np.array(UNEVEN) * 1e-3, atol=1e-9)
    greys = [int(np.median(image)) for image in frames.images]
    np.testing.assert_allclose(greys, 20 + 20 * np.arange(7), atol=3)
    assert frames.images[0].shape == (48, 64)
    said = got.metadata["provenance"]["times"]
    assert said == "from the container, uneven: steps of 30 to 170 ms"


def test_some_of_uneven_frames_keep_their_stamps(tmp_path: Path) -> None:
    got = read_video(film(tmp_path / "x.mp4"), {**SCALE, "every": "3"})
    np.testing.assert_allclose(got.frame("images").t, [0, 0.2, 0.5], atol=1e-9)


def test_pixels_that_are_not_square_are_refused(tmp_path: Path) -> None:
    wide = film(tmp_path / "wide.mp4", aspect=Fraction(4, 3))
    with pytest.raises(RecordingError, match=r"wide.mp4: its pixels are 4:3, not square"):
        read_video(wide, SCALE)


def test_a_name_that_is_a_pattern_names_no_other_files(tmp_path: Path) -> None:
    path = film(tmp_path / "x.mp4").rename(tmp_path / "a%03d.png")
    (tmp_path / "a001.png").write_bytes(b"another")
    assert len(read_video(path, SCALE).frame("images").images) == 7


def test_a_playlist_or_a_photograph_is_no_video(tmp_path: Path) -> None:
    """FFmpeg would open what a playlist names."""
    path = tmp_path / "x.mp4"
    for start in (b"#EXTM3U\nhttp://example.org/x.ts\n", b"ffconcat version 1.0\nfile x.mp4\n"):
        path.write_bytes(start)
        with pytest.raises(RecordingError, match=r"x\.mp4"):
            read_video(path, SCALE)
    path.write_bytes(b"\0\0\0\x18ftypheic" + bytes(12))
    assert not VIDEO.recognises(path)


def test_it_is_inspected_by_the_command(tmp_path: Path) -> None:
    path = film(tmp_path / "x.mp4")
    seen = CliRunner().invoke(cli, ["inspect", str(path), "--map", "m_per_px=0.1mm"])
    assert seen.exception is None
    assert "images" in seen.output
    assert "read as video" in seen.output


def test_frames_that_are_small_packed_are_counted_before_they_are_decoded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = film(tmp_path / "x.mp4")
    monkeypatch.setattr(video, "MOST", 3 * 64 * 48)
    with pytest.raises(RecordingError, match=r"declares 7 frames of 64 x 48.*9216"):
        video.arrays(path)
    assert len(video.arrays(path, every=3)["images"]) == 3


def test_a_matroska_file_that_was_cut_is_refused(tmp_path: Path) -> None:
    path = film(tmp_path / "x.mkv")
    whole = path.read_bytes()
    assert VIDEO.recognises(path)
    path.write_bytes(whole[:-100])
    with pytest.raises(RecordingError, match=rf"its parts need {len(whole)}: truncated"):
        read_video(path, SCALE)
    path.write_bytes(whole[:40])
    with pytest.raises(RecordingError, match="truncated"):
        read_video(path, SCALE)


def test_frames_that_are_declared_and_not_there_are_damage(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = film(tmp_path / "x.mp4")
    found = {"declared": np.array(9), "decoded": np.array(7), "images": np.zeros((7, 4, 5))}
    monkeypatch.setattr(video, "decoded", lambda *_: found)
    with pytest.raises(RecordingError, match="7 frames can be decoded, 9"):
        read_video(path, SCALE)


def test_a_box_shorter_than_its_head_is_damage(tmp_path: Path) -> None:
    path = tmp_path / "x.mp4"
    path.write_bytes(struct.pack(">I4s", 8, b"ftyp") + struct.pack(">I4s", 5, b"moov") + bytes(8))
    with pytest.raises(RecordingError, match=r"x.mp4: a part of 5 bytes at 8: damaged"):
        video._last_box(path, 24)
    path.write_bytes(struct.pack(">I4sQ", 1, b"mdat", 40) + bytes(8))
    assert video._last_box(path, 24) == 40
    path.write_bytes(struct.pack(">I4s", 0, b"mdat") + bytes(16))
    assert video._last_box(path, 24) == 24


@pytest.mark.parametrize("rate", [0.0, -25.0, float("inf"), float("nan")])
def test_frames_without_times_and_without_a_rate_ask_for_one(rate: float) -> None:
    still = np.zeros(3)
    with pytest.raises(UsageError, match=r"x.avi: 3 frames.*--rate"):
        video._times(Path("x.avi"), still, rate, 1, {})
    t, words = video._times(Path("x.avi"), still, 10.0, 2, {})
    assert (t.tolist(), words) == ([0.0, 0.2, 0.4], "10 Hz as declared; frames have no times")


def test_frames_beyond_all_bytes_of_a_film_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = film(tmp_path / "x.mp4")
    monkeypatch.setattr(video, "_require_few", lambda *_: None)
    monkeypatch.setattr(video, "MOST", 3 * 48 * 64)
    assert len(video.arrays(path, every=3)["images"]) == 3
    with pytest.raises(RecordingError, match="64 x 48 beyond 9216 bytes after 4; read"):
        video.arrays(path)
