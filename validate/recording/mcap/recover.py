"""Recovery of a truncated MCAP file: its complete part, byte for byte, with a new end.

A record `validate.recovered` tells what was saved and what is missing. There is no summary, so
readers that need an index find none.
"""

import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from validate.errors import RecordingError, UsageError
from validate.recording.mcap.integrity import verify
from validate.recording.mcap.records import HEAD, MAGIC, Cut, Op, Verified, opened
from validate.recording.mcap.write import replacing

RECORD = "validate.recovered"
_BLOCK = 2**20  # bytes copied at once


@dataclass(frozen=True)
class Recovered:
    """What was saved, by topic how many messages, and the lines that say so and what is missing."""

    counts: dict[str, int]
    lines: tuple[str, ...]


def recover(path: Path, out: Path) -> Recovered:
    """Write what of the MCAP file `path` is whole to `out`; `path` is left as it is.

    Raises `UsageError` for a file that is whole or for `out` being the file itself, and
    `RecordingError` for one that is damaged otherwise, holds no whole message, or cannot be
    written.
    """
    if out.resolve() == path.resolve():
        raise UsageError(f"{out}: this is the file to recover; name another output")
    with opened(path) as stream:
        verified = verify(stream, path, cut=True)
        if verified.cut is None:
            raise UsageError(f"{path.name}: the file is complete; import it without --recover")
        if not verified.messages:
            raise RecordingError(f"{path.name}: no complete message before byte {verified.cut.at}")
        told = _told(stream, verified, verified.cut)
        with replacing(out) as target:
            _copy(stream, target, verified.cut, _metadata(told))
    counts = {c.topic: len(verified.log_ns[n]) for n, c in verified.channels.items()}
    return Recovered(counts, tuple(f"{key}: {value}" for key, value in told.items()))


def _told(stream: BinaryIO, verified: Verified, cut: Cut) -> dict[str, str]:
    log = [ns for ns in verified.log_ns.values() if len(ns)]
    first, last = min(int(ns.min()) for ns in log), max(int(ns.max()) for ns in log)
    source = verified.source
    return {
        "from": f"{source.path}, sha256 {source.sha256}",
        "saved": f"{verified.messages} messages, {(last - first) / 1e9:.6f} s from {first} ns to "
        f"{last} ns, the first {cut.data} of {source.bytes} bytes",
        "missing": _missing(stream, source.bytes, cut, last),
    }


def _missing(stream: BinaryIO, size: int, cut: Cut, last: int) -> str:
    """What the bytes after the whole part still tell."""
    if cut.ended:
        return f"no message: only the summary is truncated, at byte {cut.at}"
    after = "how many messages followed is not known"
    if cut.at == size:
        return f"the end of the data after byte {cut.at}; {after}"
    stream.seek(cut.at)
    head = stream.read(HEAD.size + 16)
    found = f"{size - cut.at} bytes of a cut record at byte {cut.at}"
    if len(head) == HEAD.size + 16 and head[0] == Op.CHUNK:
        declared = HEAD.unpack_from(head)[1]
        start, end = (int.from_bytes(head[k : k + 8], "little") for k in (9, 17))
        found += (
            f", a chunk of {declared} bytes with log times {start} ns to {end} ns, up to "
            f"{(end - last) / 1e9:.6f} s after the last saved message"
        )
    return f"{found}; {after}"


def _metadata(told: dict[str, str]) -> bytes:
    pairs = b"".join(_text(text) for pair in told.items() for text in pair)
    content = _text(RECORD) + len(pairs).to_bytes(4, "little") + pairs
    return HEAD.pack(Op.METADATA, len(content)) + content


def _text(text: str) -> bytes:
    raw = text.encode()
    return len(raw).to_bytes(4, "little") + raw


def _copy(stream: BinaryIO, target: BinaryIO, cut: Cut, record: bytes) -> None:
    stream.seek(0)
    left = cut.data
    while left:
        block = stream.read(min(left, _BLOCK))
        if not block:
            raise RecordingError(f"the file became shorter while it was read, by {left} bytes")
        target.write(block)
        left -= len(block)
    crc = zlib.crc32(record, cut.crc)
    target.write(record + HEAD.pack(Op.DATA_END, 4) + crc.to_bytes(4, "little"))
    footer = HEAD.pack(Op.FOOTER, 20) + bytes(16)
    target.write(footer + zlib.crc32(footer).to_bytes(4, "little") + MAGIC)
