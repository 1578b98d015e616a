"""What can be broken in a line of `validate/`, and which lines a seed draws."""

import ast
import random
import re
from collections.abc import Iterator, Mapping, Set
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
_COMPARED = {"<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "==", "is not": "is",
             "is": "is not", "not in": "in", "in": "not in"}  # fmt: skip
_COMBINED = {"+": "-", "-": "+", "*": "/", "/": "*", "@": "+", "//": "*", "**": "*", "%": "*",
             "&": "|", "|": "&"}  # fmt: skip
_NAMES = {"min": "max", "max": "min", "sin": "cos", "cos": "sin", "all": "any", "any": "all",
          "minimum": "maximum", "maximum": "minimum", "argmin": "argmax", "argmax": "argmin",
          "floor": "ceil", "ceil": "floor", "rms": "mean"}  # fmt: skip
# Arguments that guard or decorate: they change no number and no word.
_QUIET = frozenset((
    "strict", "check_finite", "alpha", "ambient", "fontsize", "headlength", "headwidth",
    "linewidth", "linewidths", "line_width", "lw", "markersize", "ms", "ncols", "pad",
    "rotation", "shrink", "zorder",
))  # fmt: skip
_CONSTANT = re.compile(r"_?[A-Z][A-Z0-9_]*")
_DECLARED = ("quantity", "field")  # calls that declare a field with its default
_DRAWING = "validate/report/"  # what its modules name at their top is how a page looks
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

    @property
    def after(self) -> str:
        return self.before[: self.start] + self.text + self.before[self.end :]

    @property
    def name(self) -> str:
        return f"{self.path}: {self.before.strip()} -> {self.after.strip()}"


def faults_of(root: Path, path: Path, quiet: frozenset[str] = _QUIET) -> list[Fault]:
    """Every fault of a file; words, annotations, imports, `quiet` arguments, tuning constants and
    the sizes of drawings are left alone. Without `quiet`, only words, annotations and imports."""
    source = path.read_text(encoding="utf-8")
    lines, told, tree = source.splitlines(), str(path.relative_to(root)), ast.parse(source)
    left = _sizes(tree) if quiet and told.startswith(_DRAWING) else set()
    tuning = set(_tuning(tree)) if quiet else set()
    found = []
    for start, end, text, kind in _edits(tree, lines, quiet, tuning):
        (line, a), (last, b) = start, end
        if line == last and line not in left and lines[line - 1].isascii():
            found.append(Fault(told, line, a, b, text, lines[line - 1], kind))
    return found


def _sizes(tree: ast.Module) -> set[int]:
    """Lines of what a drawing module names at its top: sizes, styles, counts of panels."""
    named = (n for n in tree.body if isinstance(n, ast.Assign | ast.AnnAssign))
    return {line for n in named for line in range(n.lineno, (n.end_lineno or 0) + 1)}


def _tuning(tree: ast.Module) -> Iterator[ast.expr]:
    """Yield the values of tuning constants: numbers that a module or a class names in capital
    letters, and numbers that are defaults of fields. Formulas, tables and objects are excluded."""
    classes = [n for n in ast.walk(tree) if isinstance(n, ast.ClassDef)]
    for body in (tree.body, *(kind.body for kind in classes)):
        for statement in body:
            match statement:
                case ast.Assign(targets=[target], value=value):
                    named = _constants(target)
                case ast.AnnAssign(target=target, annotation=kind, value=ast.expr() as value):
                    is_field = body is not tree.body and "ClassVar" not in ast.unparse(kind)
                    named = is_field or _constants(target)
                    value = _default(value) if is_field else value
                case _:
                    continue
            if named and _numbers(value):
                yield value


def _constants(target: ast.expr) -> bool:
    parts = target.elts if isinstance(target, ast.Tuple) else [target]
    return all(isinstance(p, ast.Name) and _CONSTANT.fullmatch(p.id) for p in parts)


def _default(value: ast.expr) -> ast.expr:
    """Return the default in the declaration of a field."""
    match value:
        case ast.Call(func=ast.Name(id=name), args=[default, *_]) if name in _DECLARED:
            return default
        case ast.Call(func=ast.Name(id=name), keywords=given) if name in _DECLARED:
            return next((k.value for k in given if k.arg == "default"), value)
    return value


def _numbers(value: ast.expr) -> bool:
    """Return whether a value is a number, arithmetic of numbers, or a tuple of them."""
    match value:
        case ast.Constant(value=number):
            return type(number) in (int, float)
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return _numbers(operand)
        case ast.BinOp(left=left, right=right):
            return _numbers(left) and _numbers(right)
        case ast.Tuple(elts=parts):
            return all(not isinstance(p, ast.Tuple) and _numbers(p) for p in parts)
    return False


Place = tuple[int, int]
Edit = tuple[Place, Place, str, str]


def _edits(
    tree: ast.AST, lines: list[str], quiet: frozenset[str], tuning: Set[ast.expr]
) -> Iterator[Edit]:
    for node in _code(tree, quiet, tuning):
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


def _code(tree: ast.AST, quiet: frozenset[str], tuning: Set[ast.expr]) -> Iterator[ast.AST]:
    """The nodes that compute."""
    for name, value in ast.iter_fields(tree):
        if name in ("annotation", "returns", "decorator_list"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if child in tuning or (isinstance(child, ast.keyword) and child.arg in quiet):
                continue
            if isinstance(child, ast.AST) and not isinstance(child, _WORDS):
                yield child
                yield from _code(child, quiet, tuning)


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


Lines = dict[tuple[str, int], list[Fault]]
PARTS = ("validate", "experiments")


def source_files(root: Path) -> list[Path]:
    """The files of the package and of the shipped experiments."""
    return sorted(path for part in PARTS for path in (root / part).rglob("*.py"))


def candidates(root: Path, only: str, quiet: frozenset[str] = _QUIET) -> Lines:
    """The lines that hold something to break, with their faults."""
    by_line: Lines = {}
    for path in source_files(root):
        if only in str(path.relative_to(root)):
            for fault in faults_of(root, path, quiet):
                by_line.setdefault((fault.path, fault.line), []).append(fault)
    return by_line


def drawn(root: Path, count: int, seed: int, only: str) -> list[Fault]:
    """Lines drawn by seed, one fault on each."""
    by_line, chance = candidates(root, only), random.Random(seed)
    lines = chance.sample(sorted(by_line), min(count, len(by_line)))
    return [f for line in lines if (f := _one(root, by_line[line], chance))]


def _one(root: Path, faults: list[Fault], chance: random.Random) -> Fault | None:
    """A fault of one line by chance, whose file is still Python."""
    for fault in chance.sample(faults, len(faults)):
        try:
            ast.parse(broken(fault, (root / fault.path).read_text(encoding="utf-8")))
        except SyntaxError:
            continue
        return fault
    return None


def broken(fault: Fault, whole: str) -> str:
    """The file's text with the fault."""
    lines = whole.splitlines(keepends=True)
    lines[fault.line - 1] = fault.after + "\n"
    return "".join(lines)


# --- what a line belongs to -----------------------------------------------------------------------


class Source:
    """A file's statements: which lines are executed together, and by what name they are reached."""

    def __init__(self, text: str) -> None:
        self.text = text.splitlines()
        self._statements = [n for n in ast.walk(ast.parse(text)) if isinstance(n, ast.stmt)]

    def _around(self, line: int) -> list[ast.stmt]:
        """The statements that hold a line, outermost first; a decorator is of what it decorates."""
        held = [n for n in self._statements if _first(n) <= line <= (n.end_lineno or 0)]
        return sorted(held, key=lambda n: (_first(n), -(n.end_lineno or 0)))

    def statement(self, line: int) -> range:
        """The lines of the innermost statement, of a compound one those before its body."""
        around = self._around(line)
        if not around:
            return range(line, line + 1)
        body = getattr(around[-1], "body", None)
        end = _first(body[0]) if body and line < _first(body[0]) else around[-1].end_lineno + 1
        return range(_first(around[-1]), end)

    def reached_by(self, line: int) -> tuple[list[str], range]:
        """Names and lines by which a line is reached that is evaluated at import or compiled; none
        for a line of a function, which is traced."""
        none: tuple[list[str], range] = [], range(0)
        around = self._around(line)
        if not around or isinstance(around[-1], ast.Import | ast.ImportFrom):
            return none
        for n, statement in enumerate(around):
            if isinstance(statement, ast.FunctionDef):
                if line >= _first(statement.body[0]) and not _compiled(statement):
                    return none
                inner = range(_first(statement.body[0]), (statement.end_lineno or 0) + 1)
                owners = [s.name for s in around[:n] if isinstance(s, ast.ClassDef)]
                return [*owners, statement.name], inner
        owners = [s for s in around if isinstance(s, ast.ClassDef)]
        inner = range(owners[-1].lineno, (owners[-1].end_lineno or 0) + 1) if owners else range(0)
        return [*(s.name for s in owners), *_assigned(around[-1])], inner


def _first(statement: ast.stmt) -> int:
    return min([statement.lineno, *(d.lineno for d in getattr(statement, "decorator_list", ()))])


def _compiled(function: ast.FunctionDef) -> bool:
    return any(re.search("compiled|inlined", ast.unparse(d)) for d in function.decorator_list)


def _assigned(statement: ast.stmt) -> list[str]:
    targets = getattr(statement, "targets", [getattr(statement, "target", None)])
    named = [n.id for t in targets if t for n in ast.walk(t) if isinstance(n, ast.Name)]
    return [n for n in named if not n.startswith("__")]
