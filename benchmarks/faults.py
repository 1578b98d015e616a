"""Would the tests find a broken line? Breaks single lines by seed and runs the nearest tests.

python benchmarks/faults.py [COUNT] [--seed 1] [--seconds 300] [--only PART] [--dry]

A line of `validate/` is drawn among all that hold something to break, then one fault on it: an
operator, a constant, a sign, an off-by-one, a dropped term or condition. The nearest tests are
those of the same name first, then test files that import the module, then those that reach it
through other modules, ring by ring. Tests marked slow are left out. A fault that no test finds has
survived; `faults_equivalent.toml` lists those that change nothing that anyone can see, with the
reason (at most 5 %). Exit code 1 where fewer than 95 % of the others are found.
"""

import ast
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib import import_module
from multiprocessing import get_context
from pathlib import Path
from time import perf_counter
from typing import Literal

import click

ROOT = Path(__file__).resolve().parents[1]
EQUIVALENT = Path(__file__).with_name("faults_equivalent.toml")
FOUND, EQUAL = 0.95, 0.05
_RINGS = 3
_COMPARED = {"<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "==", "is not": "is",
             "is": "is not", "not in": "in", "in": "not in"}  # fmt: skip
_COMBINED = {"+": "-", "-": "+", "*": "/", "/": "*", "@": "+", "//": "*", "**": "*", "%": "*",
             "&": "|", "|": "&"}  # fmt: skip
_NAMES = {"min": "max", "max": "min", "sin": "cos", "cos": "sin", "all": "any", "any": "all",
          "minimum": "maximum", "maximum": "minimum", "argmin": "argmax", "argmax": "argmin",
          "floor": "ceil", "ceil": "floor", "rms": "mean"}  # fmt: skip
_WORDS = (ast.JoinedStr, ast.Raise, ast.Import, ast.ImportFrom)  # what only speaks


@dataclass(frozen=True)
class Fault:
    """Characters [start, end) of a line of a file replaced by `text`."""

    path: str
    line: int
    start: int
    end: int
    text: str
    before: str
    kind: str
    within: str

    @property
    def after(self) -> str:
        return self.before[: self.start] + self.text + self.before[self.end :]

    @property
    def name(self) -> str:
        return f"{self.path}: {self.before.strip()} -> {self.after.strip()}"


# --- what can be broken ---------------------------------------------------------------------------


def faults_of(path: Path) -> list[Fault]:
    """Every fault of a file; words, annotations and imports are left alone."""
    source = path.read_text(encoding="utf-8")
    lines = source.splitlines()
    told, tree = str(path.relative_to(ROOT)), ast.parse(source)
    defined = [n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef | ast.ClassDef)]
    found = []
    for start, end, text, kind in _edits(tree, lines):
        (line, a), (last, b) = start, end
        if line == last and lines[line - 1].isascii():
            inner = [n for n in defined if n.lineno <= line <= (n.end_lineno or 0)]
            within = max(inner, key=lambda n: n.lineno).name if inner else ""
            found.append(Fault(told, line, a, b, text, lines[line - 1], kind, within))
    return found


Place = tuple[int, int]
Edit = tuple[Place, Place, str, str]


def _edits(tree: ast.AST, lines: list[str]) -> Iterator[Edit]:
    for node in _code(tree):
        if isinstance(node, ast.BinOp):
            yield from _between(node.left, node.right, _COMBINED, "operator", lines)
            if isinstance(node.op, ast.Add | ast.Sub):
                yield _end(node.left), _end(node.right), "", "dropped term"
        elif isinstance(node, ast.Compare):
            yield from _between(node.left, node.comparators[0], _COMPARED, "comparison", lines)
        elif isinstance(node, ast.BoolOp):
            swap = {"and": "or", "or": "and"}
            yield from _between(node.values[0], node.values[1], swap, "condition", lines)
            yield _end(node.values[0]), _end(node.values[-1]), "", "dropped condition"
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.Not):
            yield _start(node), _start(node.operand), "", "sign"
        elif isinstance(node, ast.Constant) and type(node.value) in (int, float, bool):
            yield _start(node), _end(node), _other(node.value), "constant"
        elif isinstance(node, ast.Attribute) and node.attr in _NAMES:
            line, column = _end(node)
            yield (line, column - len(node.attr)), (line, column), _NAMES[node.attr], "function"
        elif isinstance(node, ast.Name) and node.id in _NAMES and isinstance(node.ctx, ast.Load):
            yield _start(node), _end(node), _NAMES[node.id], "function"
        elif isinstance(node, ast.AugAssign):
            yield from _between(node.target, node.value, {"+=": "-=", "-=": "+=", "*=": "/=",
                                "/=": "*=", "|=": "="}, "operator", lines)  # fmt: skip


def _code(tree: ast.AST) -> Iterator[ast.AST]:
    """The nodes that compute."""
    for name, value in ast.iter_fields(tree):
        if name in ("annotation", "returns", "decorator_list"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST) and not isinstance(child, _WORDS):
                yield child
                yield from _code(child)


def _other(value: float) -> str:
    if isinstance(value, bool):
        return str(not value)
    if isinstance(value, int):
        return str(value + 1)
    return repr(1.5 * value) if value else "1.0"


def _between(
    left: ast.expr, right: ast.expr, swap: Mapping[str, str], kind: str, lines: list[str]
) -> Iterator[Edit]:
    """The operator between two expressions of one line, swapped."""
    (line, a), (last, b) = _end(left), _start(right)
    if line != last:
        return
    gap = lines[line - 1][a:b]
    token = gap.strip(" ()")
    if token in swap:
        at = a + gap.index(token)
        yield (line, at), (line, at + len(token)), swap[token], kind


def _start(node: ast.expr) -> Place:
    return node.lineno, node.col_offset


def _end(node: ast.expr) -> Place:
    return node.end_lineno or node.lineno, node.end_col_offset or node.col_offset


def drawn(count: int, seed: int, only: str) -> list[Fault]:
    """Lines drawn by seed, one fault on each."""
    by_line: dict[tuple[str, int], list[Fault]] = {}
    for path in sorted((ROOT / "validate").rglob("*.py")):
        if only in str(path):
            for fault in faults_of(path):
                by_line.setdefault((fault.path, fault.line), []).append(fault)
    chance = random.Random(seed)
    lines = chance.sample(sorted(by_line), min(count, len(by_line)))
    return [f for line in lines if (f := _one(by_line[line], chance))]


def _one(faults: list[Fault], chance: random.Random) -> Fault | None:
    """A fault of one line by chance, whose file is still Python."""
    for fault in chance.sample(faults, len(faults)):
        try:
            ast.parse(broken(fault))
        except SyntaxError:
            continue
        return fault
    return None


def broken(fault: Fault) -> str:
    """The file's text with the fault."""
    lines = (ROOT / fault.path).read_text(encoding="utf-8").splitlines(keepends=True)
    lines[fault.line - 1] = fault.after + "\n"
    return "".join(lines)


# --- the nearest tests ----------------------------------------------------------------------------


def nearest(fault: Fault, uses: Mapping[str, set[str]]) -> Iterator[str]:
    """Test files: same name, direct imports, those that import nothing of the package (they read
    its source), imports through other modules; in each ring those first that say the name of what
    is broken."""
    module = fault.path.removesuffix(".py").replace("/", ".")
    seen, reached = set(), {module}
    named = [f for f in uses if f.endswith(f"test_{module.rsplit('.', 1)[-1]}.py")]
    seen.update(named)
    yield from named
    readers = [f for f, used in uses.items() if f.startswith("tests") and not used]
    for _ in range(_RINGS):
        ring = [f for f, used in uses.items() if f.startswith("tests") and used & reached]
        said = {f: (ROOT / f).read_text(encoding="utf-8").count(fault.within) for f in ring}
        yield from sorted((f for f in ring if f not in seen), key=lambda f: -said[f])
        seen.update(ring)
        yield from (f for f in readers if f not in seen)
        seen.update(readers)
        reached |= {f for f, used in uses.items() if f.startswith("validate.") and used & reached}


def imports() -> dict[str, set[str]]:
    """Which modules of the package each module and each test file names."""
    found = {}
    for path in sorted((ROOT / "validate").rglob("*.py")):
        found[".".join(path.relative_to(ROOT).with_suffix("").parts)] = _imported(path)
    for path in sorted((ROOT / "tests").rglob("test_*.py")):
        found[str(path.relative_to(ROOT))] = _imported(path)
    return found


def _imported(path: Path) -> set[str]:
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module, *(f"{node.module}.{a.name}" for a in node.names)}
        elif isinstance(node, ast.Import):
            names |= {a.name for a in node.names}
    return {n for n in names if n.startswith("validate")}


# --- running them ---------------------------------------------------------------------------------


Ending = Literal["found", "survived", "out of time"]


def outcome(fault: Fault, copy: Path, uses: Mapping[str, set[str]], seconds: int) -> Ending:
    """What the nearest tests say of the broken line within so many seconds."""
    target, whole = copy / fault.path, (ROOT / fault.path).read_text(encoding="utf-8")
    target.write_text(broken(fault), encoding="utf-8")
    end, found = perf_counter() + seconds, ""
    try:
        for test in nearest(fault, uses):
            code = _run(test, copy, end - perf_counter())
            if code is None:
                return "out of time"
            if code:
                found = _failed(copy)
                break
    finally:
        target.write_text(whole, encoding="utf-8")
    if found and _run(found, copy, seconds):
        raise click.ClickException(f"{found} fails without any fault; see {copy / 'log.txt'}")
    return "found" if found else "survived"


def _failed(copy: Path) -> str:
    """The test, or the file that could not be collected, that found the fault."""
    told = (copy / "log.txt").read_text(encoding="utf-8")
    named = re.search(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", told, re.MULTILINE)
    if not named:
        raise click.ClickException(f"pytest ended without a word: {told[-500:]}")
    return named[1]


def _run(test: str, copy: Path, seconds: float) -> int | None:
    """Exit code of pytest in a process of its own; None where the time was not enough."""
    process = get_context("fork").Process(target=_pytest, args=(test, copy))
    process.start()
    process.join(max(seconds, 0))
    if process.is_alive():
        os.killpg(process.pid or 0, signal.SIGKILL)
        process.join()
        return None
    return int(process.exitcode or 0)


def _pytest(test: str, copy: Path) -> None:
    os.setsid()
    os.chdir(copy)
    sys.path.insert(0, str(copy))
    with (copy / "log.txt").open("w") as log:
        os.dup2(log.fileno(), 1)
        os.dup2(log.fileno(), 2)
        import pytest

        options = ["-x", "-q", "-p", "no:cacheprovider", "-n0", "-m", "not slow", "-o", "addopts="]
        code = pytest.main([*options, test])
        os._exit(0 if code in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED) else 1)


def _copied(folder: Path) -> Path:
    """All that the repository tracks."""
    told = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True, text=True
    )
    for name in told.stdout.split("\0")[:-1]:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, folder / name)
    return folder


@click.command()
@click.argument("count", default=200)
@click.option("--seed", default=1)
@click.option("--seconds", default=300, help="limit of the tests of one fault")
@click.option("--only", default="", help="part of a path")
@click.option("--dry", is_flag=True, help="print the faults, run nothing")
def main(count: int, seed: int, seconds: int, only: str, dry: bool) -> None:
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ[name] = "1"
    for heavy in ("numpy", "scipy.sparse", "skfem", "numba", "pytest"):
        import_module(heavy)  # once, not in every process
    begin, uses = perf_counter(), imports()
    known = tomllib.loads(EQUIVALENT.read_text(encoding="utf-8")) if EQUIVALENT.is_file() else {}
    faults = drawn(count, seed, only)
    told: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        copy = _copied(Path(folder))
        for i, fault in enumerate(faults, start=1):
            if dry:
                said = fault.kind
            elif fault.name in known:
                said = "equivalent"
            else:
                said = outcome(fault, copy, uses, seconds)
            told[said] += 1
            click.echo(f"[{i}/{len(faults)}] {said}: line {fault.line}, {fault.name}")
    rest = told["found"] + told["survived"]
    share = told["found"] / max(rest, 1)
    click.echo(
        f"{len(faults)} faults, seed {seed}: {', '.join(f'{n} {w}' for w, n in told.items())}; "
        f"{100 * share:.1f} % of {rest} found; {perf_counter() - begin:.0f} s wall time"
    )
    sys.exit(0 if share >= FOUND and told["equivalent"] <= EQUAL * len(faults) else 1)


if __name__ == "__main__":
    main()
