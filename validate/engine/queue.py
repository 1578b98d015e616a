"""Queue of waiting cells, shared by workers and the calling process."""

import threading
from collections import deque
from collections.abc import Sequence
from typing import Any

Batch = tuple[Any, ...]


class Queue:
    """Cells in order. While one that is timed runs, at most `beside` batches run in all."""

    def __init__(self, cells: Sequence[Any], beside: int = 1) -> None:
        self._waiting = deque(cells)
        self._beside = beside
        self._running: list[Batch] = []
        self._lock = threading.Lock()

    def __len__(self) -> int:
        return len(self._waiting)

    @property
    def running(self) -> int:
        return len(self._running)

    @property
    def first(self) -> Any:
        """The next cell; None where none waits."""
        with self._lock:
            return self._waiting[0] if self._waiting else None

    def take(self, most: int = 1) -> Batch:
        """At most so many of the next cells, timed ones singly; () where none may start now."""
        with self._lock:
            if not self._waiting:
                return ()
            running = [c for batch in self._running for c in batch]
            timed = any(c.timed for c in (self._waiting[0], *running))
            if timed and len(self._running) >= self._beside:
                return ()
            batch: Batch = (self._waiting.popleft(),)
            while len(batch) < most and self._waiting:
                if batch[0].timed or self._waiting[0].timed:
                    break
                batch += (self._waiting.popleft(),)
            self._running.append(batch)
            return batch

    def ended(self, batch: Batch) -> None:
        with self._lock:
            self._running.remove(batch)

    def again(self, cell: Any) -> None:
        """A cell whose result was lost is the next one."""
        with self._lock:
            self._waiting.appendleft(cell)

    def close(self) -> None:
        """Nothing is taken any more."""
        with self._lock:
            self._waiting.clear()
