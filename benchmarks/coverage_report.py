"""Branch coverage of compare, register and identify; executed raise and except lines of all.

python benchmarks/coverage_report.py [TESTS...] [--slow] [-n PROCESSES] [--folder FOLDER]

The command runs the test suite under coverage.py. It prints these figures, each with the lines that
are missing from it:

- the share of the branches of `compare`, of `register` and of `identify` that the tests take;
- the share of the `raise` statements and `except` clauses of the whole package that the tests
  execute. An except clause is executed when the first statement of its body is.

The exit code is 1 if a figure is below 95 % or if a test fails. Child processes are counted:
decoders, workers of pytest, workers of Dask. coverage.py starts in a child through a `.pth` file of
the environment, which isolated children (`python -I`) read as well. A child that a signal ends
leaves no trace.

Compiled functions leave no trace. `compare`, `register` and `identify` have none. Those of other
packages contain no raise and no try, and the command stops if one of them does. Their numpy
references are counted like all other code.

--slow also runs the tests marked slow. --folder keeps the traces and counts those of earlier runs;
with --only-count nothing is run.
"""

import ast
import json
import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
from coverage import Coverage

ROOT = Path(__file__).resolve().parents[1]
BRANCHES = ("compare", "register", "identify")
LEAST = 0.95
_SETTINGS = """\
[run]
branch = true
source =
    {root}/validate
    {root}/experiments
data_file = {folder}/traces
parallel = true
patch = subprocess
"""
_COMPILED = re.compile(r"\b(compiled|inlined|intrinsic|njit)\b")


@dataclass(frozen=True)
class Share:
    """A share of `count` lines or branches: `missing` are not executed, each as a line to print."""

    name: str
    count: int
    missing: tuple[str, ...]

    @property
    def value(self) -> float:
        return 1 - len(self.missing) / self.count if self.count else 1.0

    def __str__(self) -> str:
        executed = self.count - len(self.missing)
        return f"{self.name}: {100 * self.value:.1f} % ({executed} of {self.count})"


@click.command()
@click.argument("tests", nargs=-1)
@click.option("--slow", is_flag=True, help="run the tests marked slow as well")
@click.option("-n", "processes", default="auto", help="processes of pytest")
@click.option("--folder", type=click.Path(path_type=Path), help="where the traces are kept")
@click.option("--only-count", is_flag=True, help="run nothing, count what the folder holds")
def main(
    tests: tuple[str, ...], slow: bool, processes: str, folder: Path | None, only_count: bool
) -> None:
    with tempfile.TemporaryDirectory() as passing:
        kept = (folder or Path(passing)).resolve()
        kept.mkdir(parents=True, exist_ok=True)
        settings = kept / "settings"
        settings.write_text(_SETTINGS.format(root=ROOT, folder=kept), encoding="utf-8")
        code = 0 if only_count else _run(settings, [*tests, "-n", processes], slow)
        shares = measured(counted(settings, ROOT), ROOT)
    for share in shares:
        click.echo("\n".join([str(share), *(f"  {line}" for line in share.missing)]))
    click.echo("\n".join(["", *map(str, shares)]))
    sys.exit(code or int(any(share.value < LEAST for share in shares)))


def _run(settings: Path, arguments: list[str], slow: bool) -> int:
    command = [sys.executable, "-m", "coverage", "run", f"--rcfile={settings}", "-m", "pytest"]
    marked = ["-m", ""] if slow else []
    return subprocess.run([*command, "-q", *marked, *arguments], cwd=ROOT, check=False).returncode


def counted(settings: Path, root: Path) -> dict[str, Any]:
    """Return the files of coverage.py's JSON report by their path below `root`."""
    traced = Coverage(config_file=str(settings))
    traced.combine(keep=True)
    report = settings.with_name("report.json")
    traced.json_report(outfile=str(report))
    files = json.loads(report.read_text(encoding="utf-8"))["files"]
    return {Path(path).resolve().relative_to(root).as_posix(): f for path, f in files.items()}


def measured(files: dict[str, Any], root: Path) -> list[Share]:
    """Return all figures of the files of a report."""
    return [*(branches(name, files) for name in BRANCHES), raised(files, root)]


def branches(package: str, files: dict[str, Any]) -> Share:
    """Return the share of the branches of a package that are taken."""
    own = {path: told for path, told in files.items() if path.startswith(f"validate/{package}/")}
    missing = tuple(
        f"{path}:{begin} -> {'exit' if end < 0 else end}"
        for path, told in sorted(own.items())
        for begin, end in told["missing_branches"]
    )
    count = sum(told["summary"]["num_branches"] for told in own.values())
    return Share(f"branches of {package}", count, missing)


def raised(files: dict[str, Any], root: Path) -> Share:
    """Return the share of the raise statements and except clauses that are executed."""
    count, missing = 0, []
    for path, told in sorted(files.items()):
        text = (root / path).read_text(encoding="utf-8")
        shown, executed = text.splitlines(), set(told["executed_lines"])
        for line, body in errors(text):
            count += 1
            if body not in executed:
                missing.append(f"{path}:{line}: {shown[line - 1].strip()}")
    return Share("raise and except lines", count, tuple(missing))


def errors(text: str) -> list[tuple[int, int]]:
    """Return the line of every raise and except of a file, and the line that proves its execution.

    Raises `ValueError` for a raise or try in a compiled function, because its lines leave no trace.
    """
    tree = ast.parse(text)
    for function in (n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef)):
        if any(_COMPILED.search(ast.unparse(d)) for d in function.decorator_list):
            for node in ast.walk(function):
                if isinstance(node, ast.Raise | ast.Try):
                    raise ValueError(
                        f"line {node.lineno}: raise or try in a compiled function leaves no trace"
                    )
    nodes = list(ast.walk(tree))
    raises = [(n.lineno, n.lineno) for n in nodes if isinstance(n, ast.Raise)]
    excepts = [(n.lineno, n.body[0].lineno) for n in nodes if isinstance(n, ast.ExceptHandler)]
    return sorted(raises + excepts)


if __name__ == "__main__":
    main()
