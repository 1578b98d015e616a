"""SHA-256 of bytes that come one after another, taken beside the reading by a thread of its own.

Hashing costs half of what a bare reader takes, and lets other threads run. One block waits at most,
so memory stays bounded; a file below one block is hashed at once, without a thread.
"""

import hashlib
from concurrent.futures import Future, ThreadPoolExecutor

_BLOCK = 2**20  # bytes handed over at once


class Hashing:
    """The hash so far; `update` keeps the bytes' order."""

    def __init__(self) -> None:
        self._sha = hashlib.sha256()
        self._waiting: list[bytes] = []
        self._size = 0
        self._thread: ThreadPoolExecutor | None = None
        self._last: Future[None] | None = None

    def update(self, data: bytes) -> None:
        self._waiting.append(data)
        self._size += len(data)
        if self._size >= _BLOCK:
            self._hand_over()

    def hexdigest(self) -> str:
        """Of all bytes; nothing can be added afterwards."""
        self._join()
        if self._thread is not None:
            self._thread.shutdown()
        self._take(self._waiting)
        self._waiting = []
        return self._sha.hexdigest()

    def _hand_over(self) -> None:
        self._join()
        if self._thread is None:
            self._thread = ThreadPoolExecutor(1, "sha256")
        self._last = self._thread.submit(self._take, self._waiting)
        self._waiting, self._size = [], 0

    def _join(self) -> None:
        if self._last is not None:
            self._last.result()

    def _take(self, parts: list[bytes]) -> None:
        for part in parts:
            self._sha.update(part)
