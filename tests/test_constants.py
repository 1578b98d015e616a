"""Numbers that modules name: one that moves, moves figures or limits, and is changed here too."""

import ast
import tomllib
from pathlib import Path

from tree import ONE_PROCESS, parsed

pytestmark = ONE_PROCESS

DRAWN = "validate/report"
_LONGEST = 120  # characters: what is longer is a declaration, with tests of its own
_TABLES = (ast.Dict, ast.DictComp)  # they grow by an entry, and are tested entry by entry


def _named(root: Path) -> dict[str, dict[str, str]]:
    """What modules name at their top, and fields declare, that is written with numbers; but for
    those of pictures and pages, which change how results look and not what they are."""
    found: dict[str, dict[str, str]] = {}
    for path in sorted(set((root / "validate").rglob("*.py")) - {*(root / DRAWN).iterdir()}):
        module = ".".join(path.relative_to(root / "validate").with_suffix("").parts)
        tree = parsed(path)
        kinds = [n for n in tree.body if isinstance(n, ast.ClassDef)]
        named = {**_written(tree.body, ""), **_fields(kinds)}
        if named:
            found[module] = named
    return found


def _written(body: list[ast.stmt], prefix: str) -> dict[str, str]:
    found: dict[str, str] = {}
    for statement in body:
        match statement:
            case ast.Assign(targets=[target], value=value):
                pass
            case ast.AnnAssign(target=target, value=ast.expr() as value):
                pass
            case _:
                continue
        text = ast.unparse(value)
        if isinstance(value, _TABLES) or len(text) > _LONGEST:
            continue
        if text in ("True", "False") or any(_number(part) for part in ast.walk(value)):
            found[prefix + ast.unparse(target)] = text
    return found


def _fields(kinds: list[ast.ClassDef]) -> dict[str, str]:
    """Defaults of fields; those with a unit are in `defaults.toml`."""
    each = (_written(kind.body, f"{kind.name}.") for kind in kinds)
    return {n: text for found in each for n, text in found.items() if "quantity(" not in text}


def _number(part: ast.AST) -> bool:
    return isinstance(part, ast.Constant) and type(part.value) in (int, float)


def test_named_numbers_are_as_listed(project_root: Path) -> None:
    listed = tomllib.loads((project_root / "tests" / "constants.toml").read_text("utf-8"))
    named = _named(project_root)
    moved = {
        f"{module}.{name}": (value, named[module][name])
        for module, names in listed.items()
        for name, value in names.items()
        if named.get(module, {}).get(name, value) != value
    }
    assert not moved, "a number moved (listed, named): list it, and say so in the changelog"
    assert sum(map(len, listed.values())) > 250
