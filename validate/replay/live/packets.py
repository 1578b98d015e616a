"""Packets of the live loop, little-endian; docs/live.md describes them for who sends them.

In:  magic "VLP1", sequence number uint32, time int64 ns, position d doubles in m.
Out: magic "VLF1", sequence number uint32 of the last one taken, force d doubles in N, flags uint32.
"""

import struct
from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats

PLACE, FORCE = b"VLP1", b"VLF1"
CONTACT, LIMITED, FADED, NO_ANSWER = 1, 2, 4, 8  # flags
LARGEST = 64  # bytes of a datagram that are read; a longer one is refused


@dataclass(frozen=True)
class Position:
    """`sequence` number, `ns` of the sender's own clock, place (d,) m."""

    sequence: int
    ns: int
    x: Floats


def position_of(data: bytes, d: int) -> Position | str:
    """The packet, or in a word why it is none: short, long, magic, not finite."""
    form = f"<4sIq{d}d"
    size = struct.calcsize(form)
    if len(data) != size:
        return "short" if len(data) < size else "long"
    magic, sequence, ns, *x = struct.unpack(form, data)
    if magic != PLACE:
        return "wrong magic"
    place = np.array(x)
    if not np.isfinite(place).all():
        return "not finite"
    return Position(sequence, ns, place)


def position_bytes(position: Position) -> bytes:
    """What a device sends."""
    d = len(position.x)
    return struct.pack(f"<4sIq{d}d", PLACE, position.sequence, position.ns, *position.x.tolist())


def force_bytes(sequence: int, force: Floats, flags: int) -> bytes:
    """What the loop answers with force (d,) N."""
    return struct.pack(f"<4sI{len(force)}dI", FORCE, sequence, *force.tolist(), flags)


def force_of(data: bytes, d: int) -> tuple[int, Floats, int]:
    """Sequence number, force (d,) N and flags of an answer."""
    _, sequence, *rest = struct.unpack(f"<4sI{d}dI", data)
    return int(sequence), np.array(rest[:d]), int(rest[d])


def newer(sequence: int, last: int) -> bool:
    """Whether a sequence number comes after the last one, beyond 2^32 - 1 again at 0."""
    return 0 < (sequence - last) % 2**32 < 2**31
