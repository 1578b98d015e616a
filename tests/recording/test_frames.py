"""Images in recordings: PNG bounds and damage, MCAP round trip, folders of PNG."""

import base64
import json
import struct
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import jsonschema
import numpy as np
import pytest
from mcap_samples import ABSENT, T0, signal_json, walk, write_foreign

from validate.errors import RecordingError, UsageError
from validate.recording.images import png_stack
from validate.recording.images.image import (
    MAX_SIDE,
    coverage,
    decode_png,
    demosaiced,
    encode_png,
    png_size,
    sampled,
)
from validate.recording.images.png_stack import numbered, read_png_stack
from validate.recording.mcap.read import read_recording
from validate.recording.mcap.schemas import IMAGE, SCHEMAS
from validate.recording.mcap.write import write_recording
from validate.recording.preflight import Inspection
from validate.recording.types import Contours, Frames, Markers, Recording

RNG = np.random.default_rng(3)
IMAGES = tuple(RNG.integers(0, 256, (17, 23), dtype=np.uint8) for _ in range(3))
POSE = np.eye(4) + np.diag([0.25, 0.5], 2)
FRAMES = Frames(np.array([0.0, 0.04, 0.08]), IMAGES, (1e-4, 1.3e-4), POSE, "phantom")
RECORDING = Recording("us", ABSENT, T0, frames={"/us": FRAMES}, metadata={"note": {"a": "b"}})


def png(kind: bytes, content: bytes) -> bytes:
    crc = zlib.crc32(kind + content).to_bytes(4, "big")
    return len(content).to_bytes(4, "big") + kind + content + crc


def hand_made(width: int, height: int, rows: bytes, depth: int = 8, colour: int = 0) -> bytes:
    header = struct.pack(">IIBBBBB", width, height, depth, colour, 0, 0, 0)
    body = png(b"IHDR", header) + png(b"IDAT", zlib.compress(rows)) + png(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + body


def test_png_by_hand_is_read() -> None:
    got = decode_png(hand_made(3, 2, b"\0\1\2\3" + b"\0\xff\0\x80"))
    assert got.tolist() == [[1, 2, 3], [255, 0, 128]]
    assert not got.flags.writeable


def test_png_round_trip_is_exact() -> None:
    assert np.array_equal(decode_png(encode_png(IMAGES[0])), IMAGES[0])


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"GIF89a", "not a PNG"),
        (hand_made(MAX_SIDE + 1, 1, b""), "4097 x 1 px, allowed 1..4096"),
        (hand_made(2**31, 2**31, b""), "2147483648 x 2147483648 px"),
        (hand_made(0, 5, b""), "0 x 5 px"),
        (hand_made(2, 2, b"\0\1\2"), "3 bytes of pixels, its header needs 6"),
        (hand_made(2, 1, bytes(10**6)), "4 bytes of pixels, its header needs 3"),
        (hand_made(2, 1, bytes(5), depth=16), "16 bits, colour type 0"),
        (hand_made(2, 1, bytes(3), colour=3), "colour type 3"),
        (hand_made(1, 1, b"\0\1\2\3", colour=2), "1 coloured and 0 transparent pixels"),
        (encode_png(IMAGES[0])[:-12], "without an end"),
        (encode_png(IMAGES[0])[:-20], "truncated at byte"),
    ],
)
def test_png_that_is_damaged_or_too_large_is_refused(data: bytes, message: str) -> None:
    with pytest.raises(RecordingError, match=message):
        decode_png(data)


def test_every_flipped_bit_of_a_png_is_seen(capfd: pytest.CaptureFixture[str]) -> None:
    whole = encode_png(IMAGES[0])
    for at in range(len(whole)):
        data = bytearray(whole)
        data[at] ^= 0x10
        with pytest.raises(RecordingError):
            decode_png(bytes(data))
    assert capfd.readouterr() == ("", "")  # OpenCV prints when it is handed damaged bytes


def test_grey_stored_as_colour_is_grey() -> None:
    assert decode_png(hand_made(1, 1, b"\0\7\7\7", colour=2)).tolist() == [[7]]


def test_frames_return_exactly(tmp_path: Path) -> None:
    write_recording(RECORDING, tmp_path / "a.mcap")
    got = read_recording(tmp_path / "a.mcap")
    frames = got.frame("/us")
    assert all(np.array_equal(a, b) for a, b in zip(frames.images, IMAGES, strict=True))
    assert frames.m_per_px == (1e-4, 1.3e-4)
    assert np.array_equal(frames.pose, POSE)
    assert np.array_equal(frames.t, FRAMES.t)
    assert (frames.frame, got.t0_ns) == ("phantom", T0)
    assert dict(got.metadata) == {"note": {"a": "b"}}
    with pytest.raises(RecordingError, match=r"no images '/other'; it has .'/us'."):
        got.frame("/other")


def test_messages_are_foxglove_images(tmp_path: Path) -> None:
    write_recording(RECORDING, tmp_path / "a.mcap")
    bodies = [
        json.loads(c[22:]) for op, c in walk((tmp_path / "a.mcap").read_bytes()) if op == 0x05
    ]
    for body, image in zip(bodies, IMAGES, strict=True):
        jsonschema.validate(body, dict(SCHEMAS[IMAGE]))
        assert (body["format"], body["frame_id"]) == ("png", "phantom")
        data = np.frombuffer(base64.b64decode(body["data"]), np.uint8)
        assert np.array_equal(cv2.imdecode(data, cv2.IMREAD_UNCHANGED), image)


def test_inspection_names_frames_and_their_unit(tmp_path: Path) -> None:
    write_recording(RECORDING, tmp_path / "a.mcap")
    got = Inspection.of(tmp_path / "a.mcap")
    assert got.defects == ()
    assert [(t.kind, t.unit, t.frame, t.count) for t in got.topics] == [
        ("frames", "grey level", "phantom", 3)
    ]


def _image(**changes: object) -> dict[str, object]:
    data = base64.b64encode(encode_png(IMAGES[0])).decode()
    stamp = {"sec": T0 // 10**9, "nsec": T0 % 10**9}
    return {"timestamp": stamp, "frame_id": "p", "data": data, "format": "png"} | changes


CALIBRATED = {
    "calibration//us": {"m_per_px_x": "1e-4", "m_per_px_y": "2e-4"},
    "pose//us": {"T_frame_from_image": " ".join(map(str, np.eye(4).ravel()))},
}


@pytest.mark.parametrize(
    ("changes", "metadata", "message"),
    [
        ({"format": "jpeg"}, CALIBRATED, "image format 'jpeg', readable: 'png'"),
        ({"data": "!!"}, CALIBRATED, "not base64"),
        ({"data": base64.b64encode(b"nothing").decode()}, CALIBRATED, "not a PNG"),
        ({}, CALIBRATED | {"pose//us": {}}, "no record 'pose//us' with T_frame_from_image"),
        ({}, CALIBRATED | {"calibration//us": {"m_per_px_x": "1"}}, "with m_per_px_y, 2 numbers"),
        (
            {},
            CALIBRATED | {"calibration//us": {"m_per_px_x": "0", "m_per_px_y": "1"}},
            r"\(0.0, 1.0\) m per pixel|expected two numbers > 0",
        ),
        (
            {},
            CALIBRATED | {"calibration//us": {"m_per_px_x": "mm", "m_per_px_y": "1"}},
            "could not convert",
        ),
    ],
)
def test_damaged_image_streams_are_refused(
    tmp_path: Path, changes: dict, metadata: dict, message: str
) -> None:
    messages = [("/us", IMAGE, T0, _image(**changes))]
    with pytest.raises(RecordingError, match=message):
        read_recording(write_foreign(tmp_path / "f.mcap", messages, metadata=metadata))


def test_images_without_calibration_are_listed_as_a_defect(tmp_path: Path) -> None:
    messages = [("/us", IMAGE, T0, _image()), ("/s", "validate.Signal", T0, signal_json(T0))]
    path = write_foreign(tmp_path / "f.mcap", messages)
    assert not read_recording(path).frames
    got = Inspection.of(path)
    assert got.defects == ("'/us': images without record 'calibration//us'",)
    assert [t.kind for t in got.topics] == ["foreign", "signal"]


def test_images_count_against_the_memory_of_a_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_recording(RECORDING, tmp_path / "a.mcap")
    monkeypatch.setattr("validate.recording.mcap.streams.MAX_NUMBERS", 3 * 49 - 1)
    with pytest.raises(RecordingError, match="more than 146 numbers"):
        read_recording(tmp_path / "a.mcap")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"images": IMAGES[:2]}, "2 images, 3 times"),
        ({"images": (*IMAGES[:2], IMAGES[2].T)}, r"different sizes \[\(17, 23\), \(23, 17\)\]"),
        ({"images": (IMAGES[0].astype(float),) * 3}, r"image 0 is \(17, 23\) float64"),
        ({"images": (np.zeros((2, 2, 3), np.uint8),) * 3}, r"image 0 is \(2, 2, 3\) uint8"),
        ({"m_per_px": (1e-4, 0.0)}, "expected two numbers > 0"),
        ({"m_per_px": (1e-4, float("nan"))}, "1 of 2 values not finite"),
    ],
)
def test_impossible_frames_are_refused(changes: dict, message: str) -> None:
    with pytest.raises(RecordingError, match=message):
        replace(FRAMES, **changes)


def test_images_of_frames_are_read_only_copies() -> None:
    image = np.zeros((4, 4), np.uint8)
    frames = Frames(np.array([0.0]), (image,), (1.0, 1.0), np.eye(4), "f")
    image[0, 0] = 9
    assert frames.images[0][0, 0] == 0
    with pytest.raises(ValueError, match="read-only"):
        frames.images[0][0, 0] = 1


SCALE = {"m_per_px": "1e-4"}


def test_png_stack_is_sorted_by_number(tmp_path: Path) -> None:
    for name, image in (("f2.png", IMAGES[0]), ("f10.png", IMAGES[1]), ("f1.PNG", IMAGES[2])):
        (tmp_path / name).write_bytes(encode_png(image))
    (tmp_path / "notes.txt").write_text("x")
    got = read_png_stack(tmp_path, {**SCALE, "rate": "25", "topic": "us"}).frame("us")
    assert got.t.tolist() == [0.0, 0.04, 0.08]
    assert got.m_per_px == (1e-4, 1e-4)
    for a, b in zip(got.images, (IMAGES[2], IMAGES[0], IMAGES[1]), strict=True):
        assert np.array_equal(a, b)


@pytest.mark.parametrize("scale", ["0.1", "8", "1e-7", "1e999"])
def test_a_pixel_beyond_reason_is_asked_back(tmp_path: Path, scale: str) -> None:
    (tmp_path / "1.png").write_bytes(encode_png(IMAGES[0]))
    with pytest.raises(UsageError, match=rf"m_per_px={scale}: .* 1e-06 to 0\.01 m"):
        read_png_stack(tmp_path, {"m_per_px": scale, "rate": "1"})


@pytest.mark.parametrize(
    ("scale", "side"), [("0.1mm", 1e-4), ("0.3 um", 3e-7), ("0.02m", 0.02), ("0.01", 0.01)]
)
def test_a_pixel_may_say_its_unit_and_is_taken_then(
    tmp_path: Path, scale: str, side: float
) -> None:
    (tmp_path / "1.png").write_bytes(encode_png(IMAGES[0]))
    got = read_png_stack(tmp_path, {"m_per_px": scale, "rate": "1"})
    assert got.frame("images").m_per_px == (side, side)


@pytest.mark.parametrize("scale", ["0", "-1mm", "1kPa", "small"])
def test_a_pixel_is_a_length_above_zero(tmp_path: Path, scale: str) -> None:
    with pytest.raises(UsageError, match="expected a length above 0"):
        read_png_stack(tmp_path, {"m_per_px": scale, "rate": "1"})


def test_png_stacks_that_cannot_be_ordered_or_timed_are_refused(tmp_path: Path) -> None:
    options = {**SCALE, "rate": "1"}
    with pytest.raises(RecordingError, match=r"no \*.png files"):
        read_png_stack(tmp_path, options)
    with pytest.raises(UsageError, match="not a folder of PNG images"):
        read_png_stack(tmp_path / "absent", options)
    (tmp_path / "a1.png").write_bytes(encode_png(IMAGES[0]))
    with pytest.raises(UsageError, match="needs --m-per-px and --rate"):
        read_png_stack(tmp_path, SCALE)
    for rate in ("-1", "inf", "soon"):
        with pytest.raises(UsageError, match=f"rate={rate}: expected a number above 0"):
            read_png_stack(tmp_path, {**SCALE, "rate": rate})
    (tmp_path / "a01.png").write_bytes(encode_png(IMAGES[0]))
    with pytest.raises(RecordingError, match="have the same number"):
        read_png_stack(tmp_path, options)
    (tmp_path / "a01.png").write_bytes(b"")
    (tmp_path / "a1.png").unlink()
    with pytest.raises(RecordingError, match=r"a01.png: not a PNG"):
        read_png_stack(tmp_path, options)


def test_coverage_of_a_box_and_a_disc() -> None:
    box = np.array([[0.5, 0.5], [3.0, 0.5], [3.0, 2.75], [0.5, 2.75]])
    want = np.outer([0, 1, 1, 0.25], [0, 1, 1, 0.5, 0])
    assert coverage(box, (4, 5)) == pytest.approx(want, abs=1e-12)
    assert coverage(box[::-1], (4, 5)) == pytest.approx(want, abs=1e-12)
    a = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    disc = np.array([20.3, 18.9]) + 12.5 * np.stack([np.cos(a), np.sin(a)], axis=1)
    assert coverage(disc, (40, 41)).sum() == pytest.approx(np.pi * 12.5**2, rel=1e-3)
    assert coverage(disc - 30, (40, 41)).sum() < np.pi * 12.5**2 / 4  # cut by the border


def test_values_between_pixels_end_half_a_pixel_outside() -> None:
    """Bilinear inside, the border's own value up to its outer edge, nothing beyond."""
    image = np.arange(6.0).reshape(2, 3)
    x, y = np.array([[0.5, -0.5, 2.5, 1.0, 1.0], [0.5, 0.0, 1.0, -0.5, 1.5]])[:, None]
    assert sampled(image, x, y).ravel() == pytest.approx([2.0, 0.0, 5.0, 1.0, 4.0])
    for out in ((-0.51, 0.0), (2.51, 0.0), (0.0, -0.51), (0.0, 1.51)):
        assert np.isnan(sampled(image, *np.array(out)[:, None, None]))


def test_a_mirrored_outline_covers_mirrored_pixels() -> None:
    """Scan lines lie in the middle of their share of a pixel."""
    x, y = np.array([[0.6, 2.2, 1.9, 0.6], [0.6, 0.6, 2.4, 2.4]])
    seen = coverage(np.stack([x, y], axis=1), (4, 4))
    assert coverage(np.stack([x, 3 - y], axis=1), (4, 4)) == pytest.approx(seen[::-1])
    assert seen[:, 1] == pytest.approx([0.0, 0.9, 0.9, 0.0])


def chunk_first(kind: bytes, content: bytes) -> bytes:
    return b"\x89PNG\r\n\x1a\n" + png(kind, content) + png(b"IEND", b"")


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (chunk_first(b"IDAT", bytes(13)), "it does not begin with a header"),
        (chunk_first(b"IHDR", bytes(12)), "it does not begin with a header"),
        (
            hand_made(2, 1, b"")[:33] + png(b"IDAT", b"no stream") + png(b"IEND", b""),
            r"its pixels cannot be unpacked \(Error -3",
        ),
    ],
)
def test_png_without_a_header_or_pixels_is_refused(data: bytes, message: str) -> None:
    with pytest.raises(RecordingError, match=f"damaged PNG: {message}"):
        decode_png(data)


def test_what_opencv_cannot_encode_or_decode_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    data = encode_png(IMAGES[0])
    monkeypatch.setattr(cv2, "imdecode", lambda *_: None)
    with pytest.raises(RecordingError, match="damaged PNG: its pixels cannot"):
        decode_png(data)
    monkeypatch.setattr(cv2, "imencode", lambda *_: (False, None))
    with pytest.raises(RecordingError, match=r"image \(17, 23\) cannot"):
        encode_png(IMAGES[0])


@pytest.mark.parametrize(
    "image", [np.zeros((2, 3), np.uint16), np.zeros((2, 3, 3), np.uint8), np.zeros(4, np.uint8)]
)
def test_only_grey_of_8_bits_is_encoded(image: np.ndarray) -> None:
    with pytest.raises(RecordingError, match=rf"{image.dtype}: expected \(h, w\) uint8"):
        encode_png(image)


def test_the_size_of_what_is_no_png_is_refused() -> None:
    assert png_size(encode_png(IMAGES[0])[:40]) == (23, 17)
    with pytest.raises(RecordingError, match=r"not a PNG .wrong first bytes."):
        png_size(b"GIF89a")


def test_a_mosaic_narrower_than_its_filter_is_refused() -> None:
    with pytest.raises(RecordingError, match=r"\(3, 8\).*least 4 px"):
        demosaiced(np.zeros((3, 8), np.uint8), "RGGB")
    assert (demosaiced(np.full((4, 8), 90, np.uint8), "RGGB") == 90).all()


def test_files_of_a_stack_are_bounded_alone_and_together(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    options = {"m_per_px": "0.1mm", "rate": "10"}
    for i in range(2):
        (tmp_path / f"{i}.png").write_bytes(encode_png(IMAGES[i]))
    size = (tmp_path / "0.png").stat().st_size
    monkeypatch.setattr(png_stack, "MAX_FILE", size - 1)
    with pytest.raises(RecordingError, match=f"0.png: {size} bytes, the limit is {size - 1}"):
        read_png_stack(tmp_path, options)
    monkeypatch.undo()
    monkeypatch.setattr(png_stack, "MAX_STACK", 23 * 17)
    with pytest.raises(RecordingError, match="more than 391 bytes; split the stack"):
        read_png_stack(tmp_path, options)
    monkeypatch.undo()
    (tmp_path / "2.png").symlink_to(tmp_path / "nowhere.png")
    with pytest.raises(RecordingError, match=r"2.png. is outside|cannot be read"):
        read_png_stack(tmp_path, options)


def test_a_folder_that_cannot_be_listed_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"nowhere: cannot be read \(No such file"):
        numbered(tmp_path / "nowhere")


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Markers(T3[:0], ("a",), np.zeros((0, 1, 3)), 0, ""), "markers: no samples"),
        (lambda: Markers(T3, ("a", "a"), np.zeros((3, 2, 3)), 0, ""), "2 names, 1 different ones"),
        (lambda: Markers(T3, ("a",), np.zeros((3, 1, 4)), 0, ""), "4 coordinates per point, exp"),
        (lambda: Contours(T3, (RING,), 0, np.eye(4), ""), "contours: 1 outlines, 3 times"),
        (lambda: Contours(T3, (RING, RING[:2], RING), 0, np.eye(4), ""), "outline 1 has fewer th"),
        (
            lambda: Contours(T3, (RING,) * 3, 0, np.eye(4), "", each=np.full((3, 2), 1.5)),
            "an sd below 0, or a confidence that is not within 0..1",
        ),
    ],
)
def test_impossible_streams_are_refused(make: Callable[[], object], says: str) -> None:
    with pytest.raises(RecordingError, match=says):
        make()


T3 = np.array([0.0, 1.0, 2.0])
RING = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
