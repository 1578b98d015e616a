"""The command that measures coverage: what it counts, in child processes as well."""

import subprocess
import sys
from pathlib import Path

import pytest

# private: _SETTINGS: a limit or list of the code, which the test must meet exactly.

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))

import coverage_report as report

MODULE = """\
import sys


def halved(text):
    try:
        number = int(text)
    except ValueError:
        raise SystemExit("no number") from None
    if number % 2:
        raise SystemExit("odd")
    return number // 2


if __name__ == "__main__":
    print(halved(sys.argv[1]))
"""
PARENT = """\
import subprocess, sys
for text in sys.argv[2:]:
    subprocess.run([sys.executable, "-I", sys.argv[1], text])
"""


@pytest.mark.parametrize(
    ("texts", "taken", "missing"),
    [
        (["4"], 2, ["7: except ValueError:", "8: raise", "10: raise"]),
        (["4", "5", "x"], 3, []),
    ],
)
def test_lines_of_an_isolated_child_are_counted(
    tmp_path: Path, texts: list[str], taken: int, missing: list[str]
) -> None:
    """Branches: number odd or even, run as a program or imported (never taken)."""
    package, settings = tmp_path / "validate" / "compare", tmp_path / "settings"
    package.mkdir(parents=True)
    (package / "half.py").write_text(MODULE, encoding="utf-8")
    (tmp_path / "parent.py").write_text(PARENT, encoding="utf-8")
    settings.write_text(report._SETTINGS.format(root=tmp_path, folder=tmp_path), encoding="utf-8")
    command = [sys.executable, "-m", "coverage", "run", f"--rcfile={settings}", "parent.py"]
    subprocess.run([*command, str(package / "half.py"), *texts], cwd=tmp_path, check=True)
    branches, _, _, lines = report.measured(report.counted(settings, tmp_path), tmp_path)
    assert (branches.count, branches.count - len(branches.missing)) == (4, taken)
    assert "validate/compare/half.py:14 -> exit" in branches.missing
    assert lines.count == 3
    prefix = "validate/compare/half.py:"
    begins = [line.removeprefix(prefix).split(" SystemExit")[0] for line in lines.missing]
    assert begins == missing


def test_an_except_is_executed_when_its_body_is() -> None:
    text = "try:\n    f()\nexcept (\n    A, B\n):\n    pass\nraise E(\n    1)\n"
    assert report.errors(text) == [(3, 6), (7, 7)]


def test_an_error_in_a_compiled_function_cannot_be_counted() -> None:
    text = "@compiled(nogil=True)\ndef f(x):\n    raise E\n"
    with pytest.raises(ValueError, match="line 3: raise"):
        report.errors(text)


def test_a_share_prints_what_it_counts() -> None:
    share = report.Share("branches of compare", 8, ("a:1 -> 2",))
    assert str(share) == "branches of compare: 87.5 % (7 of 8)"
    assert report.Share("branches of compare", 0, ()).value == 1.0
