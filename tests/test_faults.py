"""The command that breaks lines: what it breaks, and which tests it takes for the nearest."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))

import faults


@pytest.fixture
def one_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(faults, "ROOT", tmp_path)
    (tmp_path / "validate").mkdir()
    return tmp_path / "validate" / "one.py"


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("y = a + b", {"y = a - b", "y = a"}),
        ("y = a * 2.0", {"y = a / 2.0", "y = a * 3.0"}),
        ("y = x[1]", {"y = x[2]"}),
        ("y = -a", {"y = a"}),
        ("y = a < b", {"y = a <= b"}),
        ("y = a and b", {"y = a or b", "y = a"}),
        ("y = np.min(a)", {"y = np.max(a)"}),
        ("y += a", {"y -= a"}),
        ("raise E(f'{1 + 2} is wrong')", set()),
        ("from a import b", set()),
    ],
)
def test_faults_of_a_line(one_file: Path, line: str, expected: set[str]) -> None:
    one_file.write_text(line + "\n", encoding="utf-8")
    assert {f.after.rstrip() for f in faults.faults_of(one_file)} == expected


def test_draw_is_by_seed_and_still_python(one_file: Path) -> None:
    one_file.write_text("".join(f"x{i} = a{i} + {i}\n" for i in range(30)), encoding="utf-8")
    first, again, other = (faults.drawn(10, seed, "") for seed in (1, 1, 2))
    assert first == again != other
    assert len({f.line for f in first}) == 10
    for fault in first:
        compile(faults.broken(fault), "one", "exec")


def test_nearest_tests_come_first() -> None:
    fault = faults.Fault("validate/a/b.py", 1, 0, 1, "", "x", "sign", "broken_one")
    uses = {
        "validate.c": {"validate.a.b"},
        "tests/test_far.py": {"validate.c"},
        "tests/test_uses.py": {"validate.a.b"},
        "tests/a/test_b.py": {"validate.a.b"},
        "tests/test_other.py": {"validate.d"},
        "tests/test_reads.py": set(),
    }
    texts = dict.fromkeys(uses, "")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Path, "read_text", lambda self, encoding: texts.get(str(self), ""))
        found = list(faults.nearest(fault, uses))
    told = ["tests/a/test_b.py", "tests/test_uses.py", "tests/test_reads.py", "tests/test_far.py"]
    assert found == told
