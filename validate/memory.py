"""Free memory, and a refusal before more is allocated than there is.

A process that takes too much is killed without a word, minutes later; with an estimate it ends in
one line at once.
"""

import gc
import resource
from functools import cache
from pathlib import Path

from validate.errors import SceneError

_ROOT = Path("/")
_ALWAYS = 1e7  # bytes that any process finds; reading what is free takes milliseconds
_MOST = 0.9  # of what is free: an estimate is off, and other programs go on
_GROUP = ("memory.max", "memory.current"), ("memory.limit_in_bytes", "memory.usage_in_bytes")


class MemoryShortError(SceneError):
    """More is needed than is free; `share` of the need is."""

    def __init__(self, message: str, share: float) -> None:
        super().__init__(message)
        self.share = share


def require_memory(needed: float, what: str) -> None:
    """Raises `MemoryShortError` where `needed` bytes for `what`, of 10 MB and more, are above nine
    tenths of what is free."""
    if needed < _ALWAYS:
        return
    free = free_memory()
    if free is not None and needed > _MOST * free:
        raise MemoryShortError(
            f"{what}: about {needed / 1e9:.3g} GB of memory are needed, {free / 1e9:.3g} GB are "
            f"free; take a coarser mesh",
            _MOST * free / needed,
        )


@cache
def imports_stay() -> None:
    """Spares the garbage collector what is imported now, some 700 000 objects: it would walk
    through them several times a run, and once more at the end. It looks less often at the rest,
    which is rows of tables more than circles. Once a process."""
    gc.freeze()
    gc.set_threshold(20_000)


def free_memory() -> int | None:
    """Bytes that this process may still take: of the machine, its control group and its own limit,
    the least; None where the system says nothing (not Linux)."""
    known = [b for b in (_available(), _of_group(), _of_process()) if b is not None]
    return max(0, min(known)) if known else None


def _available() -> int | None:
    """MemAvailable of /proc/meminfo."""
    for line in _lines(_ROOT / "proc/meminfo"):
        name, _, value = line.partition(":")
        if name == "MemAvailable":
            return 1024 * int(value.split()[0])
    return None


def _of_group() -> int | None:
    """What the control group and those above it leave; the cache of files counts as free."""
    found = []
    for line in _lines(_ROOT / "proc/self/cgroup"):
        _, controllers, path = line.split(":", 2)
        top = _ROOT / "sys/fs/cgroup" / ("memory" if controllers == "memory" else "")
        if controllers not in ("", "memory"):
            continue
        group = top / path.lstrip("/")
        inside = (group, *group.parents)
        found += [_left(g) for g in inside if g == top or top in g.parents]
    return min((b for b in found if b is not None), default=None)


def _left(group: Path) -> int | None:
    for limit, used in _GROUP:
        numbers = [*_lines(group / limit), *_lines(group / used)]
        if len(numbers) == 2 and all(n.isdigit() for n in numbers):
            stat = dict(line.split() for line in _lines(group / "memory.stat"))
            return int(numbers[0]) - int(numbers[1]) + int(stat.get("inactive_file", 0))
    return None


def _of_process() -> int | None:
    """`ulimit -v` less what is mapped."""
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    pages = _lines(_ROOT / "proc/self/statm")
    if limit == resource.RLIM_INFINITY or not pages:
        return None
    return limit - int(pages[0].split()[0]) * resource.getpagesize()


def _lines(path: Path) -> list[str]:
    try:
        return path.read_text("ascii").splitlines()
    except (OSError, UnicodeDecodeError):
        return []
