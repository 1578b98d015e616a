"""Numbers that nobody entered: a default that moves, moves figures, and is changed here as well."""

import ast
import tomllib
from pathlib import Path

from tree import ONE_PROCESS, parsed

pytestmark = ONE_PROCESS


def _declared(root: Path) -> dict[str, dict[str, float]]:
    """Numbers that fields declare as `quantity(number, unit, words)`, by class."""
    found: dict[str, dict[str, float]] = {}
    for path in sorted((root / "validate").rglob("*.py")):
        for kind in (n for n in parsed(path).body if isinstance(n, ast.ClassDef)):
            for field in (f for f in kind.body if isinstance(f, ast.AnnAssign)):
                match field.value:
                    case ast.Call(func=ast.Name(id="quantity"), args=[default, *_]):
                        number = _number(default)
                        if number is not None:
                            found.setdefault(kind.name, {})[ast.unparse(field.target)] = number
    return found


def _number(default: ast.expr) -> float | None:
    try:
        value = ast.literal_eval(default)
    except ValueError:
        return None
    return value if type(value) in (int, float) else None


def test_defaults_are_as_listed(project_root: Path) -> None:
    listed = tomllib.loads((project_root / "tests" / "defaults.toml").read_text("utf-8"))
    declared = _declared(project_root)
    moved = {
        f"{kind}.{name}": (value, declared[kind][name])
        for kind, names in listed.items()
        for name, value in names.items()
        if declared.get(kind, {}).get(name, value) != value
    }
    assert not moved, "a default moved (listed, declared): list it, and say so in the changelog"
    assert sum(map(len, listed.values())) > 150
