"""Fork server of local workers: libraries are imported there once.

It starts in a clean environment (`child_process`), with one thread for numerical libraries, and
deaf to Ctrl-C, which its parent answers. It has no output: a pipe behind the command would wait for
the end of all that hold it.
"""

import os
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from multiprocessing import forkserver, set_forkserver_preload
from pathlib import Path

from validate.child_process import isolating_environment

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
