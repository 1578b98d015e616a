"""C3D in the byte order of SGI, as the same file in Intel's: the library reads that one."""

from collections.abc import Iterator
from math import prod
from pathlib import Path

from validate.files import read_bytes
from validate.recording.formats.c3d_bytes import BIG, BLOCK, INTEL, layout, records

_HEADER = ((2, 12, 2), (12, 16, 4), (16, 20, 2), (20, 24, 4), (294, 302, 2), (304, 376, 4))
_Span = tuple[int, int, int]  # from, to, and the bytes of a number


def turned(path: Path, copy: Path) -> Path:
    """The path itself, or where its numbers stand the other way round a `copy` that is Intel's.

    C3D user guide: header, parameter section, data. Whole numbers and floats are turned each in
    its place, so that a file of whole numbers stays one.
    """
    raw = bytearray(read_bytes(path))
    lies = layout(path, bytes(raw[:BLOCK]))
    if lies.processor != BIG:
        return path
    begin = BLOCK * (max(raw[0], 2) - 1)
    wide = lies.each // max(4 * lies.points + lies.analog, 1) or 2
    spans = [*_HEADER, *_parameters(bytes(raw[: lies.at(0)]), begin), (lies.at(0), len(raw), wide)]
    for span in spans:
        _turn(raw, *span)
    raw[begin + 3] = INTEL
    copy.write_bytes(raw)
    return copy


def _turn(raw: bytearray, begin: int, end: int, wide: int) -> None:
    """Each number between two places turned round; what is left over stays."""
    end = begin + (min(end, len(raw)) - begin) // wide * wide
    part = raw[begin:end]
    for i in range(wide):
        raw[begin + i : end : wide] = part[wide - 1 - i :: wide]


def _parameters(raw: bytes, begin: int) -> Iterator[_Span]:
    """Where the links of groups and parameters stand, and the values of the latter."""
    for group, _, at in records(raw, begin):
        yield at, at + 2, 2
        if group > 0:
            kind, many = abs(int.from_bytes(raw[at + 2 : at + 3], signed=True)), raw[at + 3]
            values = at + 4 + many
            yield values, values + kind * prod(raw[at + 4 : values]), max(kind, 1)
