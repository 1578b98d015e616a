"""Pool of workers of one command: this process, local workers by a fork server, or a scheduler."""

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from multiprocessing import forkserver, set_forkserver_preload
from pathlib import Path
from typing import Any

from validate.child_process import isolating_environment
from validate.engine.cell import Where
from validate.errors import UsageError
from validate.fem.kernels.threads import idle_now

# --- fork server of local workers: libraries are imported there once -----------------------------

# One thread; freed memory of up to 256 MB is kept for the next array of a step (glibc): its pages
# would be taken from the system anew each time, 1.1 million of them in a run of 310 implicit steps.
_OF_WORKERS = {
    "NUMBA_NUM_THREADS": "1",
    "MALLOC_MMAP_THRESHOLD_": "32000000",
    "MALLOC_TRIM_THRESHOLD_": "256000000",
}


def serve(preload: Sequence[str]) -> None:
    """Start the process where it does not run yet; what it cannot import each worker imports."""
    set_forkserver_preload(["distributed", *preload])
    with isolating_environment(), _deaf_to_interrupts(), _without_output():
        os.environ.update(_OF_WORKERS)
        forkserver.ensure_running()


@contextmanager
def _without_output() -> Iterator[None]:
    """Standard output and error of what is started here lead nowhere."""
    sys.stdout.flush()
    sys.stderr.flush()
    kept = [(fd, os.dup(fd)) for fd in (1, 2)]
    try:
        with Path(os.devnull).open("w") as nowhere:
            for fd, _ in kept:
                os.dup2(nowhere.fileno(), fd)
        yield
    finally:
        for fd, copy in kept:
            os.dup2(copy, fd)
            os.close(copy)


@contextmanager
def _deaf_to_interrupts() -> Iterator[None]:
    """Processes started here leave Ctrl-C to their parent, which ends them in order."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


# --- pool of workers of one command: this process, local workers or a scheduler ------------------


class Pool:
    """Workers that start when they are first needed, or before that in the background (`begin`).

    They end with the block: `with Pool(where) as pool`. `preload` names the modules that a worker
    needs, which are imported once for all of them. `shares`: the calling process does what it can
    until they have started, so that one alone is none. Raises `UsageError` for fewer than none.
    """

    def __init__(self, where: Where, preload: Sequence[str] = (), *, shares: bool = False) -> None:
        if where.workers is not None and where.workers < 0:
            raise UsageError(f"--workers {where.workers}: expected 0 (in this process) or more")
        self._where, self._preload = where, tuple(preload)
        count = idle_now() if where.workers is None else where.workers
        self.workers = 0 if shares and count == 1 else count
        self._stack, self._count = ExitStack(), 0
        self._client: Any = None
        self._error: BaseException | None = None
        self._starting: threading.Thread | None = None

    def __enter__(self) -> "Pool":
        return self

    def __exit__(self, *_: object) -> None:
        if self._starting:
            self._starting.join()
        self._stack.close()

    @property
    def address(self) -> str:
        """Of the scheduler that runs; "" where workers are local."""
        return self._where.scheduler

    @property
    def used(self) -> bool:
        """Whether cells are sent at all."""
        return bool(self.address) or self.workers > 0

    @property
    def busy(self) -> int:
        """Workers that have started."""
        return self._count if self._client else 0

    @property
    def words(self) -> str:
        return f"Dask at {self.address}" if self.address else f"{self._count} local"

    def prepare(self) -> None:
        """Has what workers need imported, in a process that they are forked from later."""
        if self.workers and not self.address:
            serve(self._preload)

    def begin(self, most: int | None = None) -> None:
        """Start the workers in the background, at most so many."""
        if self._starting or not self.used:
            return
        self._count = self.workers if most is None else min(self.workers, most)
        self.prepare()
        self._starting = threading.Thread(target=self._start, daemon=True)
        self._starting.start()

    def client(self, most: int | None = None) -> Any:
        """Return the client of the workers, started where they are not; waits for them.

        Raises `UsageError` when the scheduler cannot be reached.
        """
        self.begin(most)
        assert self._starting is not None
        self._starting.join()
        if self._error:
            raise self._error
        return self._client

    def beside(
        self, function: Callable[[Any, Any], Any], shared: Any, items: Iterable[Any]
    ) -> Callable[[], list[Any]]:
        """Begin to apply a function of a module to `shared` and each item, on local workers where
        some have started, as `items` comes to it; what it returns waits for the values, in order.

        Without workers, and where one dies, an item is done in this process when it is asked for.
        Raises what the function raises.
        """
        if self.address or not self.busy:
            return lambda: [function(shared, item) for item in items]
        from validate.engine.cluster import side_by_side

        return side_by_side(self._client, function, shared, items)

    def _start(self) -> None:
        from validate.engine.cluster import connected  # Dask takes a second

        try:
            self._client = self._stack.enter_context(connected(self._where, self._count))
        except BaseException as error:
            self._error = error
