"""SHA-256 and CRC-32 of bytes that come one after another, taken by a thread beside the reading.

Both cost more than half of what a bare reader takes, and let other threads run. A few blocks wait
at most, so memory stays bounded; a file below one block is summed at once, without a thread.
"""

import hashlib
import zlib
from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor

_BLOCK, _AHEAD = 2**20, 4  # bytes handed over at once, and how many blocks may wait


class Sums:
    """The SHA-256 of all bytes, and the CRC-32 of those since the last `restart`."""

    def __init__(self) -> None:
        self._sha = hashlib.sha256()
        self._crc = 0
        self._waiting: list[bytes] = []
        self._size = 0
        self._thread: ThreadPoolExecutor | None = None
        self._handed: deque[Future[None]] = deque()

    def update(self, data: bytes) -> None:
        """Adds bytes behind the others."""
        self._waiting.append(data)
        self._size += len(data)
        if self._size >= _BLOCK:
            self._hand_over()

    def crc(self) -> int:
        """Of all bytes since the last restart."""
        self._settle()
        return self._crc

    def restart(self) -> None:
        """The CRC counts from here on."""
        self._settle()
        self._crc = 0

    def hexdigest(self) -> str:
        """The SHA-256 of all bytes; nothing can be added afterwards."""
        self._settle()
        if self._thread is not None:
            self._thread.shutdown()
        return self._sha.hexdigest()

    def _settle(self) -> None:
        while self._handed:
            self._handed.popleft().result()
        self._take(self._waiting)
        self._waiting, self._size = [], 0

    def _hand_over(self) -> None:
        if len(self._handed) >= _AHEAD:
            self._handed.popleft().result()
        if self._thread is None:
            self._thread = ThreadPoolExecutor(1, "sums")
        self._handed.append(self._thread.submit(self._take, self._waiting))
        self._waiting, self._size = [], 0

    def _take(self, parts: list[bytes]) -> None:
        for part in parts:
            self._sha.update(part)
            self._crc = zlib.crc32(part, self._crc)
