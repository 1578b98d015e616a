"""Wrapper that runs a program within limits and reports its exit code and peak memory.

python limits.py MEMORY_BYTES FILE_BYTES PEAK_FILE COMMAND [ARGUMENT ...]

Run by its path, alone: it is small, and a process that is made of it begins small.
"""

import os
import resource
import signal
import sys
from pathlib import Path


def become(command: list[str], memory: int, size: int) -> None:
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
    try:
        os.execvp(command[0], command)
    except OSError as error:
        print(f"{command[0]}: {error.strerror}", flush=True)
        os._exit(127)


if __name__ == "__main__":
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    child = os.fork()
    if child == 0:
        become(sys.argv[4:], int(sys.argv[1]), int(sys.argv[2]))
    _, status, used = os.wait4(child, 0)
    Path(sys.argv[3]).write_text(str(1024 * used.ru_maxrss), "ascii")
    if os.WIFSIGNALED(status):
        signal.signal(os.WTERMSIG(status), signal.SIG_DFL)
        os.kill(os.getpid(), os.WTERMSIG(status))
    raise SystemExit(os.waitstatus_to_exitcode(status))
