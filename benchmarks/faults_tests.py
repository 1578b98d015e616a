"""Which tests execute a line, and what they say once it is broken.

Every test file runs once, traced, in a process of its own; the lines that each of its tests
executes are kept until the package or the file changes. All runs share one copy of the repository,
in which a single line is broken and mended: byte code and compiled kernels stay warm. Processes
are forked from one that holds the large libraries and nothing of `validate`. A fault in a file of
compiled kernels gets machine code of its own, made anew.
"""

import fcntl
import hashlib
import json
import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from importlib import import_module
from multiprocessing import get_context
from pathlib import Path
from time import perf_counter
from typing import Any

import click
from faults_drawn import PARTS, ROOT, Fault, Source, broken, source_files

_HEAVY = ("numpy", "scipy.optimize", "scipy.sparse.linalg", "scipy.stats", "skfem", "numba",
          "matplotlib.pyplot", "pyvista", "PIL.Image", "rich.console", "jinja2", "pint",
          "shapely.geometry", "coverage", "pytest")  # fmt: skip
_DEPTH = 3  # from a line to those that say its name, and on to those that say theirs
_BATCHES = 4.0, 20.0  # seconds of tests that are tried first, and next
_HANGS = 5, 120  # a run hangs beyond this many times its tests' own time and these CPU seconds more
Place = tuple[str, int]


@dataclass
class Tests:
    """What the tests of one file execute: path -> line -> tests, by their place in `seconds`."""

    name: str
    seconds: dict[str, float] = field(default_factory=dict)
    lines: dict[str, dict[str, list[int]]] = field(default_factory=dict)

    def of(self, places: set[Place]) -> set[str]:
        """The tests that execute any of these lines."""
        ids = list(self.seconds)
        return {ids[i] for path, n in places for i in self.lines.get(path, {}).get(str(n), ())}

    @property
    def reads(self) -> bool:
        """Whether they execute no line of the package, so that they can only read it."""
        return bool(self.seconds) and not any(self.lines.values())

    def cost(self, tests: set[str]) -> float:
        return 0.3 + sum(self.seconds[t] for t in tests)  # the file's own import included


class Bench:
    """The copy, the tests' lines, and the runs in it."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.copy = folder, folder / "copy"
        (folder / "lines").mkdir(parents=True, exist_ok=True)
        self._lock = (folder / "lock").open("w")
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise click.ClickException(f"{folder} is in use; name another --folder") from None
        self._mirror()
        for heavy in _HEAVY:
            import_module(heavy)

    def _mirror(self) -> None:
        """All that the repository tracks, and what is not committed yet."""
        told = subprocess.run(
            ["git", "ls-files", "-z", "-c", "-o", "--exclude-standard"],
            cwd=ROOT, capture_output=True, check=True, text=True,
        )  # fmt: skip
        names = {n for n in told.stdout.split("\0") if n and (ROOT / n).is_file()}
        for name in names:
            here, there = ROOT / name, self.copy / name
            if not there.is_file() or there.read_bytes() != here.read_bytes():
                there.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(here, there)
        for there in [*self.copy.rglob("*.py")]:
            if str(there.relative_to(self.copy)) not in names:
                there.unlink()

    # --- the lines that tests execute -------------------------------------------------------------

    @cached_property
    def tests(self) -> list[Tests]:
        """What every test file executes; those that changed are traced again."""
        files = sorted((self.copy / "tests").rglob("test_*.py"))
        rest = [p for part in ("validate", "experiments", "tests")
                for p in sorted((self.copy / part).rglob("*.py")) if p not in files]  # fmt: skip
        digest = hashlib.sha256(b"".join(p.read_bytes() for p in rest)).hexdigest()
        return [self._traced(p, digest) for p in files]

    def _traced(self, path: Path, rest: str) -> Tests:
        name = str(path.relative_to(self.copy))
        key = hashlib.sha256(f"{rest} {name} ".encode() + path.read_bytes()).hexdigest()
        kept = self.folder / "lines" / f"{key[:24]}.json"
        if not kept.is_file():
            begin = perf_counter()
            if self._forked(lambda: _trace(name, self.copy, kept)) or not kept.is_file():
                raise click.ClickException(f"{name} fails unbroken; see {self.folder / 'log.txt'}")
            click.echo(f"traced {name}: {perf_counter() - begin:.0f} s")
        return Tests(name, **json.loads(kept.read_text(encoding="utf-8")))

    @cached_property
    def _sources(self) -> dict[str, Source]:
        files = source_files(self.copy)
        return {str(p.relative_to(self.copy)): Source(p.read_text(encoding="utf-8")) for p in files}

    @cached_property
    def _said(self) -> dict[str, list[Place]]:
        """Where each word stands."""
        found: dict[str, list[Place]] = {}
        for path, source in self._sources.items():
            for n, text in enumerate(source.text, start=1):
                for word in set(re.findall(r"\w+", text)):
                    found.setdefault(word, []).append((path, n))
        return found

    def _saying(self, name: str, path: str) -> list[Place]:
        """Where a name of the file `path` is said: a private one in that file only."""
        private = name.startswith("_")
        return [p for p in self._said.get(name, ()) if p[0] == path or not private]

    def nearest(self, fault: Fault) -> list[tuple[Tests, set[str]]]:
        """The tests that execute a line, by file: same name first, then what only reads the source
        (for a line that is evaluated at import), then the package's own, then the quickest."""
        places, module = self._places(fault), Path(fault.path)
        own, beside = f"test_{module.stem}.py", f"tests/{module.parent.name}/"
        found = [(t, ids) for t in self.tests if (ids := t.of(places))]
        if self._sources[fault.path].reached_by(fault.line)[0]:
            found += [(t, set(t.seconds)) for t in self.tests if t.reads]
        return sorted(found, key=lambda f: (
            not f[0].name.endswith(own), not f[0].reads, not f[0].name.startswith(beside),
            f[0].cost(f[1]),
        ))  # fmt: skip

    def _places(self, fault: Fault) -> set[Place]:
        """Lines whose execution executes this one: its own statement; for what is evaluated at
        import, or compiled, the lines of what it belongs to and those that say its name."""
        found: set[Place] = set()
        asked, ring = set[str](), {(fault.path, fault.line)}
        for _ in range(_DEPTH):
            beyond: set[Place] = set()
            for path, line in ring:
                source = self._sources[path]
                names, inner = source.reached_by(line)
                found |= {(path, n) for n in (*source.statement(line), *inner)}
                beyond |= {p for name in {*names} - asked for p in self._saying(name, path)}
                asked |= {*names}
            ring = beyond - found
        return found | ring

    # --- running them -----------------------------------------------------------------------------

    def outcome(self, fault: Fault, seconds: float) -> tuple[str, str]:
        """found, survived or not executed, and the test that found it. Tests that take so many
        seconds in all are tried: those that execute the line, then others of the same files."""
        nearest = self.nearest(fault)
        if not nearest:
            return "not executed", ""
        target = self.copy / fault.path
        whole, stat = target.read_text(encoding="utf-8"), target.stat()
        target.write_text(broken(fault, whole), encoding="utf-8")
        try:
            for batch in _batches(nearest, seconds):
                if found := self._found(batch, anew="import compiled" in whole):
                    return "found", found
        finally:
            target.write_text(whole, encoding="utf-8")
            os.utime(target, ns=(stat.st_atime_ns, stat.st_mtime_ns))
        return "survived", ""

    def _found(self, batch: list[tuple[Tests, set[str]]], anew: bool) -> str:
        failed = self.folder / "failed.txt"
        failed.unlink(missing_ok=True)
        cpu = _HANGS[0] * sum(t.cost(ids) for t, ids in batch) + _HANGS[1]
        with tempfile.TemporaryDirectory() as kernels:
            code = self._forked(
                lambda: _try(batch, self.copy, failed, int(cpu), kernels if anew else "")
            )
        if failed.is_file():
            return failed.read_text(encoding="utf-8")
        return f"ended with {code}" if code else ""

    def _forked(self, call: Callable[[], int]) -> int:
        """Exit code of what is called in a process, and a session, of its own."""

        def run() -> None:
            os.setsid()
            os.chdir(self.copy)
            sys.path.insert(0, str(self.copy))
            os.environ["PYTHONPATH"] = str(self.copy)
            with (self.folder / "log.txt").open("w") as log:
                os.dup2(log.fileno(), 1)
                os.dup2(log.fileno(), 2)
                os._exit(call())

        process = get_context("fork").Process(target=run)
        process.start()
        process.join()
        return int(process.exitcode or 0)


def _batches(
    nearest: list[tuple[Tests, set[str]]], seconds: float
) -> Iterator[list[tuple[Tests, set[str]]]]:
    """Files in turn with the tests to be run, as many as take so many seconds; never none."""
    others = [(t, set(t.seconds) - ids) for t, ids in nearest]
    spent, limits, batch = 0.0, [*_BATCHES, seconds], []
    for t, ids in [*nearest, *((t, ids) for t, ids in others if ids)]:
        if spent and spent + t.cost(ids) > seconds:
            continue
        spent += t.cost(ids)
        batch.append((t, ids))
        if spent >= limits[0] or len({t.name for t, _ in batch}) < len(batch):
            limits = limits[1:] or [seconds]
            yield batch
            batch = []
    if batch:
        yield batch


# --- inside the process -----------------------------------------------------------------------


def _pytest(files: list[str], plugin: object) -> int:
    import pytest

    options = ("-x", "-q", "-p", "no:cacheprovider", "-n0", "-m", "not slow", "-o", "addopts=")
    code = pytest.main([*options, *files], plugins=[plugin])
    return 0 if code in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED) else 1


def _trace(name: str, copy: Path, kept: Path) -> int:
    import coverage
    import pytest

    source = [str(copy / part) for part in PARTS]
    traced = coverage.Coverage(data_file=None, source=source, config_file=False)
    seconds: dict[str, float] = {}

    class Contexts:
        @pytest.hookimpl(wrapper=True, tryfirst=True)
        def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
            traced.switch_context(item.nodeid)
            begin = perf_counter()
            result = yield
            seconds[item.nodeid] = round(perf_counter() - begin, 3)
            traced.switch_context("")
            return result

    traced.start()
    code = _pytest([name], Contexts())
    traced.stop()
    data, place = traced.get_data(), {test: i for i, test in enumerate(seconds)}
    lines: dict[str, dict[int, list[int]]] = {}
    for path in data.measured_files():
        by_line = data.contexts_by_lineno(path).items()
        tests = {n: [place[c] for c in told if c in place] for n, told in by_line}
        lines[str(Path(path).relative_to(copy))] = {n: found for n, found in tests.items() if found}
    if not code:
        kept.write_text(json.dumps({"seconds": seconds, "lines": lines}), encoding="utf-8")
    return code


def _try(
    batch: list[tuple[Tests, set[str]]], copy: Path, failed: Path, cpu: int, kernels: str
) -> int:
    import numba
    import pytest

    wanted = set().union(*(ids for _, ids in batch))
    sys.dont_write_bytecode = True
    os.environ["PYTHONDONTWRITEBYTECODE"] = "1"
    if kernels:
        numba.config.CACHE_DIR = os.environ["NUMBA_CACHE_DIR"] = kernels
    resource.setrlimit(resource.RLIMIT_CPU, (cpu, cpu))

    class Wanted:
        def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
            items[:] = [item for item in items if item.nodeid in wanted]

        def pytest_runtest_logreport(self, report: Any) -> None:
            if report.failed:
                failed.write_text(report.nodeid, encoding="utf-8")

        pytest_collectreport = pytest_runtest_logreport

    return _pytest([t.name for t, _ in batch], Wanted())
