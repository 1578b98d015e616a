"""Values that no instrument writes: bombs, nesting without end, numbers of hundreds of digits."""

import base64
import io
import json
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from command_line import here, refused
from mcap.writer import Writer

from validate.errors import RecordingError
from validate.recording.mcap.known_messages import decode_picture
from validate.recording.mcap.write import write_recording
from validate.recording.tables.blocks import parse_tables
from validate.recording.types import Frames, Recording, Source

DEEP = 100_000
LONG = "9" * 400


def bomb(side: int) -> bytes:
    """A PNG of a few hundred bytes that declares side x side pixels."""

    def chunk(kind: bytes, content: bytes) -> bytes:
        crc = struct.pack(">I", zlib.crc32(kind + content))
        return struct.pack(">I", len(content)) + kind + content + crc

    header = struct.pack(">IIBBBBB", side, side, 16, 0, 0, 0, 0)
    packed = zlib.compress(bytes(10_000))
    parts = chunk(b"IHDR", header) + chunk(b"IDAT", packed) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + parts


def mcap(path: Path, data: bytes, schema: str = "foxglove.CompressedImage") -> Path:
    """Two messages of JSON on one channel."""
    out = io.BytesIO()
    writer = Writer(out)
    writer.start()
    known = writer.register_schema(schema, "jsonschema", b"{}")
    channel = writer.register_channel("/x", "json", known)
    for i in range(2):
        writer.add_message(channel, i * 10**9, data, i * 10**9)
    writer.finish()
    path.write_bytes(out.getvalue())
    return path


def image(data: bytes) -> bytes:
    message = {
        "timestamp": {"sec": 0, "nsec": 0}, "frame_id": "a", "format": "png",
        "data": base64.b64encode(data).decode(),
    }  # fmt: skip
    return json.dumps(message).encode()


@pytest.mark.parametrize("side", [5_000, 12_000, 20_000, 60_000])
def test_a_picture_that_declares_too_much_is_refused_by_its_header(side: int) -> None:
    """Beyond some 180 million pixels Pillow has an error of its own for it."""
    with pytest.raises(RecordingError, match=r"px, allowed|damaged image"):
        decode_picture(bomb(side))


HOSTILE = {
    "bomb": image(bomb(60_000)),
    "deep": b"[" * DEEP + b"]" * DEEP,
    "deep object": b'{"timestamp":' * DEEP + b"1" + b"}" * DEEP,
    "long": b'{"timestamp": {"sec": %s, "nsec": 0}}' % LONG.encode(),
    "long frame": b'{"timestamp": {"sec": 0, "nsec": 0}, "frame_id": %s}' % LONG.encode(),
}


@pytest.mark.parametrize("schema", ["foxglove.CompressedImage", "foxglove.FrameTransform", "mine"])
@pytest.mark.parametrize("case", HOSTILE)
def test_hostile_messages_cost_a_line(case: str, schema: str, tmp_path: Path) -> None:
    path = mcap(tmp_path / "x.mcap", HOSTILE[case], schema)
    for command in (("inspect",), ("import", "-o", str(tmp_path / "o.mcap"), "--m-per-px", "1mm")):
        code, out, err = here(command[0], str(path), *command[1:])
        assert code in (0, 1, 2), (code, out, err)
        assert "Traceback" not in err


@pytest.mark.parametrize(
    "text",
    [
        '{"markups": ' + "[" * DEEP,
        '{"markups": [' + '{"a": [' * DEEP + "]}" * DEEP + "]}",
        '{"markups": [{"controlPoints": [{"label": "a", "position": [1, 2, LONG]}]}]}',
        '{"markups": [{"controlPoints": [{"label": "a", "position": [1, 2, 1e999]}]}]}',
        '{"markups": [{"controlPoints": [{"label": LONG, "position": LONG}]}]}',
    ],
)
def test_hostile_markups_are_one_line(text: str, tmp_path: Path) -> None:
    path = tmp_path / "a.mrk.json"
    path.write_text(text.replace("LONG", LONG))
    refused("import", str(path), "--as", "markups", "-o", str(tmp_path / "o.mcap"))


@pytest.mark.parametrize(
    "text",
    [
        '{"shapes": ' + "[" * DEEP,
        '{"shapes": [{"points": [[LONG, 1], [2, 2], [3, 1]], "label": "a"}]}',
        '{"shapes": [{"points": [[1e999, 1], [2, 2], [3, 1]], "label": "a"}]}',
        '{"imageWidth": LONG, "imageHeight": 8, "shapes": []}',
        '{"images": [{"id": LONG, "file_name": "LONG.png"}], "annotations": []}',
    ],
)
def test_hostile_polygons_are_one_line(text: str, tmp_path: Path) -> None:
    frames = Frames(np.zeros(1), (np.zeros((8, 8), np.uint8),), (1e-3, 1e-3), np.eye(4), "i")
    write_recording(
        Recording("r", Source("r", "", 0, ""), 0, frames={"images": frames}), tmp_path / "r.mcap"
    )
    (tmp_path / "p.json").write_text(text.replace("LONG", LONG))
    refused(
        "outline", str(tmp_path / "r.mcap"), "--from", str(tmp_path / "p.json"), "--sd", "1px",
        "-o", str(tmp_path / "o.mcap"),
    )  # fmt: skip


def test_hostile_answers_are_one_line(tmp_path: Path) -> None:
    frames = Frames(np.zeros(1), (np.zeros((8, 8), np.uint8),), (1e-3, 1e-3), np.eye(4), "i")
    write_recording(
        Recording("r", Source("r", "", 0, ""), 0, frames={"images": frames}), tmp_path / "r.mcap"
    )
    for text in ("a = " + "[" * 4000, "a = " + "[" * 4000 + "]" * 4000, f"a = {LONG}"):
        (tmp_path / "a.toml").write_text(text)
        given = ("--from", str(tmp_path / "r.mcap"), "--answers", str(tmp_path / "a.toml"))
        refused("new", "mine", *given, "-o", str(tmp_path / "mine.py"))


def test_a_row_beyond_its_names_without_others_is_one_line(tmp_path: Path) -> None:
    names = "Time (s)\tDisplacement (mm)\tLoad (N)\n"
    for row in ("1\t\t1\t1\t\t1\t", "1\t\t1\t1\t\t1\t\n"):
        with pytest.raises(RecordingError, match="line 1 names 3 columns, but no row"):
            parse_tables((names + row).encode())
