"""Cache of compiled loops on disk, safe with several processes.

numba stores one file of code a signature, numbered by an index that it reads and writes without a
lock. Two processes that compile two signatures of one function together both take the next number,
and who loads it later calls one signature with the code of the other: the process dies (numba
issues 4807 and 10128). Here every stored code has a name that no other process takes, and is
written before the index names it; what two indices can lose to each other is compiled again.
"""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar, cast
from uuid import uuid4

from numba import njit

_Function = TypeVar("_Function", bound=Callable[..., object])


def compiled(*inlined: ModuleType, **options: Any) -> Callable[[_Function], _Function]:
    """`numba.njit` with these options, its code kept beside the function's own file.

    `inlined`: other modules whose functions are in it; a change of theirs compiles it anew, too.
    """
    stamps = tuple(Path(str(module.__file__)).stat().st_mtime_ns for module in inlined)

    def made(function: _Function) -> _Function:
        dispatcher = njit(cache=True, **options)(function)
        stored: Any = dispatcher._cache._cache_file
        stored._source_stamp = (stored._source_stamp, stamps)
        name_apart(stored)
        return cast(_Function, dispatcher)

    return made


def name_apart(stored: Any) -> None:
    """Lets a `numba.core.caching.IndexDataCacheFile` give each code that it saves its own name."""

    def save(key: object, data: object) -> None:
        name = stored._data_name_pattern.format(number=uuid4().int)
        stored._save_data(name, data)
        stored._save_index({**stored._load_index(), key: name})

    stored.save = save
