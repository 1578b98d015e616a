"""Compiled code that several processes store at once (tests in parallel, studies, two commands)."""

from pathlib import Path
from typing import Any

from numba.core.caching import IndexDataCacheFile

from validate.fem.kernels.jit_cache import compiled, name_apart

# private: _load_index, _save_data: numba's cache, between whose steps another process comes.


def _seen_by_one_process(folder: Path) -> IndexDataCacheFile:
    stored = IndexDataCacheFile(str(folder), "loop", source_stamp=1)
    name_apart(stored)
    return stored


def test_two_processes_that_store_at_once_never_run_each_others_code(tmp_path: Path) -> None:
    first, second = (_seen_by_one_process(tmp_path) for _ in range(2))
    write = first._save_data

    def interrupted(name: str, data: object) -> None:
        second.save("integers", "code for integers")
        write(name, data)

    first._save_data = interrupted
    second._load_index = dict  # it read the index before the first had written it
    first.save("floats", "code for floats")
    later = _seen_by_one_process(tmp_path)
    assert later.load("integers") in (None, "code for integers")
    assert later.load("floats") == "code for floats"


def test_two_signatures_are_stored_apart_and_found_again(tmp_path: Path) -> None:
    file = tmp_path / "doubling.py"
    file.write_text("def twice(x):\n    return x + x\n")
    first, again = (_twice_of(file) for _ in range(2))
    assert (first(1), first(1.5)) == (2, 3.0)
    assert (again(1), again(1.5)) == (2, 3.0)
    assert sum(again.stats.cache_hits.values()) == 2


def _twice_of(file: Path) -> Any:
    names: dict[str, Any] = {}
    exec(compile(file.read_text(), str(file), "exec"), names)
    return compiled(nogil=True)(names["twice"])


def test_every_stored_loop_is_stored_apart(project_root: Path) -> None:
    files = (project_root / "validate").rglob("*.py")
    own = [file.name for file in files if "cache=True" in file.read_text()]
    assert own == ["jit_cache.py"]
