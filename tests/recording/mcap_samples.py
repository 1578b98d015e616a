"""Recordings, foreign MCAP files, and a reader of MCAP bytes that is independent of ours."""

import json
import struct
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import zstandard
from mcap.writer import Writer

from validate.recording.types import Contours, Markers, Recording, Signal, Source

T0 = 1_700_000_000_123_456_789
ABSENT = Source("synthetic", "", 0, "verified")


def sample_recording() -> Recording:
    """Every stream kind, NaN points, a plane stream, metadata; 5 + 4 + 7 + 2 samples."""
    rng = np.random.default_rng(7)
    x = rng.normal(size=(5, 3, 3)) * 0.01
    x[1, 2] = np.nan
    x[3, 0, 1] = np.nan
    x[0, 0, 0] = -0.0
    pose = np.eye(4)
    pose[:3, 3] = rng.normal(size=3)
    outlines = tuple(rng.normal(size=(k, 2)) for k in (3, 8))
    return Recording(
        name="phantom",
        source=ABSENT,
        t0_ns=T0,
        markers={
            "/markers": Markers(np.arange(5) / 1e2, ("a", "b", "é"), x, 2e-4, "camera"),
            "/plane": Markers(np.arange(4) / 1e2, ("p",), rng.normal(size=(4, 1, 2)), 0.0, "plate"),
        },
        signals={
            "/force": Signal(
                np.arange(7) * 333_333 / 1e9, rng.normal(size=(7, 2)), "N", 0.01, "plate"
            )
        },
        contours={"/outline": Contours(np.array([0.01, 0.02]), outlines, 1e-4, pose, "camera")},
        metadata={"calibration": {"k1": "0.1", "note": "zwölf"}, "empty": {}},
    )


def same_values(a: Recording, b: Recording) -> bool:
    """Equal bit for bit in all that was measured (any NaN is like any other)."""
    return json.dumps(_plain(a)) == json.dumps(_plain(b))


def _plain(r: Recording) -> Any:
    return [
        r.name,
        r.t0_ns,
        {k: [_bits(m.t), m.names, _bits(m.x), m.sd, m.frame] for k, m in r.markers.items()},
        {k: [_bits(s.t), _bits(s.y), s.unit, s.sd, s.frame] for k, s in r.signals.items()},
        {
            k: [
                _bits(c.t),
                [_bits(o) for o in c.outlines],
                c.sd,
                _bits(c.pose),
                c.frame,
                None if c.each is None else _bits(c.each),
            ]
            for k, c in r.contours.items()
        },
        {
            k: [_bits(f.t), [i.tolist() for i in f.images], f.m_per_px, _bits(f.pose), f.frame]
            for k, f in r.frames.items()
        },
        {k: dict(v) for k, v in r.metadata.items()},
    ]


def _bits(array: np.ndarray) -> list[Any]:
    return [array.shape, np.where(np.isnan(array), np.nan, array).astype("<f8").tobytes().hex()]


def markers_json(ns: int | None, **changes: Any) -> dict[str, Any]:
    """A `validate.Markers` message as another program would write it; None drops the stamp."""
    message = {
        "stamp": {"sec": (ns or 0) // 10**9, "nsec": (ns or 0) % 10**9},
        "frame": "world",
        "names": ["a", "b"],
        "x": [0, 1],
        "y": [2.5, 3],
        "z": [4, None],
        "sd": 0.001,
    }
    if ns is None:
        del message["stamp"]
    return message | changes


def signal_json(ns: int, **changes: Any) -> dict[str, Any]:
    stamp = {"sec": ns // 10**9, "nsec": ns % 10**9}
    message = {"stamp": stamp, "frame": "plate", "unit": "N", "values": [1.5], "sd": 0.1}
    return message | changes


def write_foreign(
    path: Path,
    messages: list[tuple[str, str, int, Any]],
    *,
    encodings: tuple[str, str] = ("jsonschema", "json"),
    publish: Mapping[int, int] | None = None,
    metadata: Mapping[str, dict[str, str]] | None = None,
    empty_topics: Mapping[str, str] | None = None,
    **options: Any,
) -> Path:
    """An MCAP by the `mcap` package: (topic, schema, log time ns, message) in this order.

    `publish` gives message i another publish time than its log time.
    """
    with path.open("wb") as stream:
        writer = Writer(stream, **options)
        writer.start()
        for name, values in (metadata or {}).items():
            writer.add_metadata(name, values)
        channels: dict[str, int] = {}
        wanted = [*(empty_topics or {}).items(), *((t, s) for t, s, _, _ in messages)]
        for topic, schema in wanted:
            if topic not in channels:
                number = writer.register_schema(schema, encodings[0], b"{}")
                channels[topic] = writer.register_channel(topic, encodings[1], number)
        for i, (topic, _, ns, message) in enumerate(messages):
            data = message if isinstance(message, bytes) else json.dumps(message).encode()
            when = (publish or {}).get(i, ns)
            writer.add_message(channels[topic], log_time=ns, publish_time=when, data=data)
        writer.finish()
    return path


def walk(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Opcode and content of all records, chunks unpacked; by the specification, in a few lines."""
    magic = b"\x89MCAP0\r\n"
    assert data[:8] == data[-8:] == magic
    yield from _walk(data[8:-8])


def _walk(data: bytes) -> Iterator[tuple[int, bytes]]:
    while data:
        opcode, length = struct.unpack("<BQ", data[:9])
        content, data = data[9 : 9 + length], data[9 + length :]
        if opcode != 6:
            yield opcode, content
            continue
        (name,) = struct.unpack("<I", content[28:32])
        packed = content[32 + name + 8 :]
        plain = zstandard.ZstdDecompressor().decompress(packed) if name else packed
        yield from _walk(plain)


def text_at(content: bytes, at: int) -> tuple[str, int]:
    (length,) = struct.unpack_from("<I", content, at)
    return content[at + 4 : at + 4 + length].decode(), at + 4 + length
