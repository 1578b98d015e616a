"""Positions from UDP packets on loopback; forces return to the sender.

Nothing that arrives ends the loop: what is no sound packet is counted by its fault. After `RESYNC`
packets in a row that are late or out of order the sender's clock and numbers are taken anew; until
then no place is given, so that the force fades. The socket is bound to 127.0.0.1 and nothing else,
and at most `_AT_ONCE` packets are read in a tick.
"""

import socket
import struct
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats
from validate.errors import UsageError

# --- Packets of the live loop, little-endian; docs/how-to/live.md describes them for senders.
#
# In: magic "VLP1", sequence number uint32, time int64 ns, position d doubles in m. Out: magic
# "VLF1", sequence number uint32 of the last one taken, force d doubles in N, flags uint32.

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
    """Return the packet, or in a word why it is none: short, long, magic, not finite."""
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
    """Return the packet of a device."""
    d = len(position.x)
    return struct.pack(f"<4sIq{d}d", PLACE, position.sequence, position.ns, *position.x.tolist())


def force_bytes(sequence: int, force: Floats, flags: int) -> bytes:
    """Return the packet of the loop with force (d,) N."""
    return struct.pack(f"<4sI{len(force)}dI", FORCE, sequence, *force.tolist(), flags)


def force_of(data: bytes, d: int) -> tuple[int, Floats, int]:
    """Sequence number, force (d,) N and flags of an answer."""
    _, sequence, *rest = struct.unpack(f"<4sI{d}dI", data)
    return int(sequence), np.array(rest[:d]), int(rest[d])


def newer(sequence: int, last: int) -> bool:
    """Return whether a sequence number comes after the last one, beyond 2^32 - 1 again at 0."""
    return 0 < (sequence - last) % 2**32 < 2**31


# -------------------------------------------------------------------------------------------------

LOOPBACK = "127.0.0.1"
_AT_ONCE = 64
_LATE_NS = 50_000_000  # behind the quickest packet so far
RESYNC = 128  # packets in a row that are late or out of order; the force is nothing by then
_GONE = 1.0  # s without a packet: another sender may take over


class Listener:
    """Reads positions (d,) m within the box `low` to `high` (d,) m at `rate` ticks a second.

    Port 0 takes a free one. Raises `UsageError` for a port that cannot be had.
    """

    kind = "udp"

    def __init__(self, low: Floats, high: Floats, rate: float, port: int = 0) -> None:
        self.rate = rate
        self.counts: Counter[str] = Counter()
        self._low, self._high = low, high
        self._peer: tuple[str, int] | None = None
        self._last: Position | None = None
        self._heard = 0.0
        self._quickest: int | None = None
        self._lost = 0
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((LOOPBACK, port))
        except (OSError, OverflowError) as error:
            self._socket.close()
            raise UsageError(f"--listen {port}: {error}; choose another port, 0 for any") from error
        self._socket.setblocking(False)

    @property
    def address(self) -> tuple[str, int]:
        host, port = self._socket.getsockname()
        return str(host), int(port)

    @property
    def findings(self) -> Mapping[str, int]:
        """How many packets were taken, and how many were not, by their fault."""
        return dict(self.counts)

    def due(self, k: int) -> float | None:
        """When tick k is due, s after the start."""
        return k / self.rate

    def after(self, k: int, now: float) -> int:
        """Return the tick after k: those whose time is over are left out, nobody waits for them."""
        return max(k + 1, int(now * self.rate))

    def place(self, k: int, now: float) -> Floats | None:
        """Return the newest sound position (d,) m since the last tick, at `now` s; None without
        one."""
        found = None
        for _ in range(_AT_ONCE):
            try:
                data, sender = self._socket.recvfrom(LARGEST + 1)
            except BlockingIOError:
                break
            except OSError:  # an answer to who had gone comes back as an error of ours
                self.counts["unreachable"] += 1
                continue
            fault = self._taken(data, sender, now)
            self.counts[fault or "taken"] += 1
            if not fault and self._last is not None:
                found = self._last.x
        return found

    def _taken(self, data: bytes, sender: tuple[str, int], now: float) -> str:
        """Takes a packet, or says what is wrong with it."""
        position = position_of(data, len(self._low))
        if isinstance(position, str):
            return position
        if ((position.x < self._low) | (position.x > self._high)).any():
            return "out of reach"
        if sender != self._peer:
            if self._peer is not None and now - self._heard < _GONE:
                return "another sender"
            self._peer, self._last, self._quickest, self._lost = sender, None, None, 0
        fault, behind = self._timed(position, now)
        if fault and self._lost + 1 < RESYNC:
            self._lost += 1
            return fault
        if fault:
            self.counts["resynchronised"] += 1
            self._quickest = None
        self._quickest = behind if self._quickest is None else min(behind, self._quickest)
        self._last, self._heard, self._lost = position, now, 0
        return ""

    def _timed(self, position: Position, now: float) -> tuple[str, int]:
        """What is wrong with a packet's number or stamp, and how far it is behind, ns."""
        behind = round(now * 1e9) - position.ns
        if self._last is not None and not newer(position.sequence, self._last.sequence):
            return "out of order", behind
        quickest = behind if self._quickest is None else min(behind, self._quickest)
        return ("late" if behind - quickest > _LATE_NS else ""), behind

    def give(self, force: Floats, flags: int) -> None:
        """Send the force (d,) N to the sender of the last position."""
        if self._peer is None or self._last is None:
            return
        try:
            self._socket.sendto(force_bytes(self._last.sequence, force, flags), self._peer)
        except OSError:
            self.counts["unsent"] += 1

    def close(self) -> None:
        self._socket.close()
