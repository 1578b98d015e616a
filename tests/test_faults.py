"""The command that breaks lines: what it breaks, and which tests it takes for the nearest."""

import sys
from pathlib import Path

import pytest

# private: _batches: called alone, case by case.

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))

import faults_drawn as drawing
import faults_tests


@pytest.fixture
def one_file(tmp_path: Path) -> Path:
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
        ("zip(a, b, strict=True)", set()),
        (
            "ax.plot(x, 2 * y, alpha=0.3)",
            {"ax.plot(x, 2 / y, alpha=0.3)", "ax.plot(x, 3 * y, alpha=0.3)"},
        ),
    ],
)
def test_faults_of_a_line(one_file: Path, line: str, expected: set[str]) -> None:
    one_file.write_text(line + "\n", encoding="utf-8")
    found = drawing.faults_of(one_file.parents[1], one_file)
    assert {f.after.rstrip() for f in found} == expected


TUNED = """\
LIMIT = 3
_SHORT, _LONG = 0.5, 2**10
LADDER: tuple[float, ...] = (1e-3, -2.0)


class Box:
    SIDES = 4
    side: float = 2.0
    depth: float = quantity(3.0, "m", "depth of the box")
    parts: int = field(default=6)
"""


@pytest.mark.parametrize("line", [x for x in TUNED.splitlines() if "=" in x])
def test_tuning_constants_are_left_out(one_file: Path, line: str) -> None:
    one_file.write_text(TUNED, encoding="utf-8")
    number = TUNED.splitlines().index(line) + 1
    root = one_file.parents[1]
    assert [f for f in drawing.faults_of(root, one_file) if f.line == number] == []
    every = drawing.faults_of(root, one_file, frozenset())
    assert any(f.line == number for f in every)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("RISE = 2 * ndtr(-2.0)", {"RISE = 2 / ndtr(-2.0)", "RISE = 3 * ndtr(-2.0)",
                                   "RISE = 2 * ndtr(2.0)", "RISE = 2 * ndtr(-3.0)"}),
        ("ORDER = {'tri3': 1}", {"ORDER = {'tri3': 2}"}),
        ("EDGES = ((0, 1),)", {"EDGES = ((1, 1),)", "EDGES = ((0, 2),)"}),
        ("WORK = SIZE + 6", {"WORK = SIZE - 6", "WORK = SIZE", "WORK = SIZE + 7"}),
        ("limit = 3", {"limit = 4"}),
        ("def f(LIMIT=3): pass", {"def f(LIMIT=4): pass"}),
        ("class A:\n    exact: bool = True", {"    exact: bool = False"}),
        ("class A:\n    least: ClassVar[float] = 0.5", {"    least: ClassVar[float] = 0.75"}),
        ("class A:\n    side: float = part(2.0)", {"    side: float = part(3.0)"}),
    ],
)  # fmt: skip
def test_formulas_tables_and_switches_are_no_tuning_constants(
    one_file: Path, text: str, expected: set[str]
) -> None:
    one_file.write_text(text + "\n", encoding="utf-8")
    found = drawing.faults_of(one_file.parents[1], one_file)
    assert {f.after.rstrip() for f in found} == expected


def test_draw_is_by_seed_and_still_python(one_file: Path) -> None:
    one_file.write_text("".join(f"x{i} = a{i} + {i}\n" for i in range(30)), encoding="utf-8")
    root = one_file.parents[1]
    first, again, other = (drawing.drawn(root, 10, seed, "") for seed in (1, 1, 2))
    assert first == again != other
    assert len({f.line for f in first}) == 10
    for fault in first:
        compile(drawing.broken(fault, one_file.read_text("utf-8")), "one", "exec")


TEXT = """\
LIMIT = 3


class Box:
    side: float = 2.0

    def area(
        self, scale: float = 1.0
    ) -> float:
        if (
            scale > LIMIT
        ):
            return 0.0
        return scale * self.side


@compiled(cache=True)
def kernel(x):
    return x + 1
"""


def test_lines_of_a_statement_are_executed_together() -> None:
    source = drawing.Source(TEXT)
    assert source.statement(1) == range(1, 2)
    assert source.statement(11) == range(10, 13)  # the condition, not what follows it
    assert source.statement(13) == range(13, 14)
    assert source.statement(8) == range(7, 10)


def test_what_runs_at_import_or_compiled_is_reached_by_name() -> None:
    source = drawing.Source(TEXT)
    assert source.reached_by(1) == (["LIMIT"], range(0))
    assert source.reached_by(5) == (["Box", "side"], range(4, 15))
    assert source.reached_by(8) == (["Box", "area"], range(10, 15))
    assert source.reached_by(13) == ([], range(0))  # traced
    assert source.reached_by(19) == (["kernel"], range(19, 20))


def test_batches_begin_with_what_executes_the_line_and_end_with_the_time() -> None:
    def tests(name: str, *seconds: float) -> faults_tests.Tests:
        return faults_tests.Tests(name, {f"{name}{i}": s for i, s in enumerate(seconds)})

    a, b, c = tests("a", 1.0, 2.0), tests("b", 4.0), tests("c", 50.0)
    nearest = [(a, {"a0"}), (b, {"b0"}), (c, {"c0"})]
    told = [[(t.name, sorted(ids)) for t, ids in x] for x in faults_tests._batches(nearest, 20.0)]
    assert told == [[("a", ["a0"]), ("b", ["b0"])], [("a", ["a1"])]]
    alone = list(faults_tests._batches([(c, {"c0"})], 20.0))
    assert [t.name for t, _ in alone[0]] == ["c"]  # never none
