"""Byte layout of a C3D file: declared length, and files of more than 65535 frames in parts.

A header counts at most 65535 frames; a longer file is read in parts that a header can count.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from validate.files import read_bytes
from validate.recording.reader import head

BLOCK = 512  # bytes
INTEL, BIG = 84, 86  # processors; numbers of the latter (SGI) stand the other way round
_DEC = 85  # the one whose floats stand so by halves
MOST = 65535  # frames that a header counts
_FRAMES = 6  # where the header has its first and last frame


@dataclass(frozen=True)
class Layout:
    """`points` and `analog` numbers of one frame, `frames` by the header, the block (from 1) in
    which they `start`, and bytes `each`."""

    processor: int
    points: int
    analog: int
    frames: int
    start: int
    each: int

    @property
    def needs(self) -> int:
        """Bytes to the end of the last frame that the header counts."""
        return self.at(self.frames)

    def at(self, frame: int) -> int:
        """Where a frame begins, bytes."""
        return BLOCK * (self.start - 1) + frame * self.each


def layout(path: Path, first: bytes) -> Layout:
    """By the first block. The last frame of a trial that begins late is counted modulo 65536."""
    processor = _processor(path, first)
    order = ">" if processor == BIG else "<"
    points, analog, begin, end = struct.unpack(f"{order}4H", first[2:10])
    (start,) = struct.unpack(f"{order}H", first[16:18])
    size = (4 if _negative(processor, first) else 2) * (4 * points + analog)
    frames = end - begin + 1 + (MOST + 1 if end < begin else 0)
    return Layout(processor, points, analog, frames, start, size)


def _processor(path: Path, first: bytes) -> int:
    """Whose numbers the whole file is in, as its parameters state: 84 Intel, 85 DEC, 86 SGI."""
    begin = BLOCK * (max(first[0], 2) - 1)
    return (head(path, begin + 4)[begin + 3 :] or b"\0")[0]


def _negative(processor: int, first: bytes) -> bool:
    """Whether the header's scale is below 0: coordinates are floats, not integers."""
    sign = {BIG: 0, _DEC: 1}.get(processor, 3)  # the byte of its highest bits
    return first[12 + sign] >= 128


def parts_beyond(path: Path, frames: int, copy: Path) -> Iterator[Path]:
    """The frames after those that the header counts, up to `frames`, as whole files that are
    written to `copy` one after the other."""
    raw = read_bytes(path)
    lies = layout(path, raw[:BLOCK])
    for begin in range(lies.frames, frames, MOST):
        count = min(MOST, frames - begin)
        front = bytearray(raw[: lies.at(0)])
        front[_FRAMES : _FRAMES + 4] = struct.pack("<2H", 1, count)
        copy.write_bytes(front + raw[lies.at(begin) : lies.at(begin + count)])
        yield copy


def records(raw: bytes, begin: int) -> Iterator[tuple[int, bytes, int]]:
    """Group number (below 0: a group itself), name and the place of the link of each record, as far
    as the links lead.

    C3D user guide, parameter section: four bytes, then records that are linked.
    """
    order = ">" if raw[begin + 3 : begin + 4] == bytes([BIG]) else "<"
    at, ahead = begin + 4, 1
    while ahead > 0 and at + 2 <= len(raw):
        length, group = struct.unpack("bb", raw[at : at + 2])
        after = at + 2 + abs(length)  # of a locked one it is negative
        if length == 0 or after + 4 > len(raw):
            return
        yield group, raw[at + 2 : after], after
        (ahead,) = struct.unpack(f"{order}h", raw[after : after + 2])
        at = after + ahead
