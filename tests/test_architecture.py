"""Habits that hold in every module: frozen types, schemes that are all in their tuple."""

import ast
import os
import re
from collections.abc import Iterator, Mapping
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import numpy as np
import pytest
from phantoms import COARSE_GRID, phantom_mesh
from tree import ONE_PROCESS, nodes

pytestmark = ONE_PROCESS

# Grows while one file is read and never leaves its reader.
ACCUMULATORS = {"streams.py:Collected", "third_party_channels.py:Gathered", "threads.py:Team"}


def modules(root: Path) -> list[Path]:
    return sorted((root / "validate").rglob("*.py")) + sorted((root / "experiments").rglob("*.py"))


def defined(path: Path) -> Iterator[ast.ClassDef]:
    return (node for node in nodes(path) if isinstance(node, ast.ClassDef))


@cache
def classes(path: Path) -> tuple[tuple[str, dict[str, object] | None], ...]:
    """Name and dataclass settings of each class of a file, which is parsed once for two tests."""
    return tuple((node.name, dataclass_settings(node)) for node in defined(path))


def dataclass_settings(node: ast.ClassDef) -> dict[str, object] | None:
    """Keywords of the class's dataclass decorator; None when it has none."""
    for decorator in node.decorator_list:
        call = decorator if isinstance(decorator, ast.Call) else None
        name = ast.unparse(call.func if call else decorator)
        if name in ("dataclass", "dataclasses.dataclass"):
            return {str(k.arg): ast.literal_eval(k.value) for k in call.keywords} if call else {}
    return None


def test_names_of_test_modules_are_unique(project_root: Path) -> None:
    """pytest imports them by bare name: two of one name are one module."""
    names = [p.name for p in (project_root / "tests").rglob("*.py") if p.name != "conftest.py"]
    assert sorted(names) == sorted(set(names))


def test_every_dataclass_is_frozen(project_root: Path) -> None:
    found = {
        f"{path.name}:{name}": settings
        for path in modules(project_root)
        for name, settings in classes(path)
        if settings is not None
    }
    assert len(found) > 40
    assert {name for name, s in found.items() if s.get("frozen") is not True} == ACCUMULATORS


def test_every_scheme_is_in_the_tuple(project_root: Path) -> None:
    """A class with `prepare` is a scheme; the contract tests reach it only through SCHEMES."""
    from validate.solve.schemes import SCHEMES

    written = {
        node.name
        for path in (project_root / "validate" / "solve").rglob("*.py")
        for node in defined(path)
        if any(isinstance(f, ast.FunctionDef) and f.name == "prepare" for f in node.body)
        and "Protocol" not in [ast.unparse(b) for b in node.bases]
    }
    assert written == {scheme.__name__ for scheme in SCHEMES}


def test_every_filter_is_in_the_tuple(project_root: Path) -> None:
    """A class of the filters' floor with `prepare` is a filter."""
    from validate.estimate.filters import FILTERS

    written = {
        node.name
        for path in (project_root / "validate" / "estimate").rglob("*.py")
        for node in defined(path)
        if any(isinstance(f, ast.FunctionDef) and f.name == "prepare" for f in node.body)
        and "Protocol" not in [ast.unparse(b) for b in node.bases]
    }
    assert written == {filter_.__name__ for filter_ in FILTERS}


def test_arrays_of_meshes_are_read_only() -> None:
    mesh = phantom_mesh(COARSE_GRID, 2)
    for array in (mesh.nodes, mesh.cells, *mesh.facets.values()):
        assert isinstance(array, np.ndarray)
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def test_the_recording_floor_knows_no_phantom(project_root: Path) -> None:
    """Which face is loaded and which way is up are said by a recording or a scene."""
    words = ("phantom", "top face", "bottom face", "probe plate", "gravity", "upward")
    for path in (project_root / "validate" / "recording").rglob("*.py"):
        text = path.read_text(encoding="utf-8").lower()
        assert not [word for word in words if word in text], path.name


def test_a_heading_within_a_module_has_something_below_it(project_root: Path) -> None:
    """Two headings in a row, or one at the end, are what a merge or a deletion left."""
    empty = re.compile(r"^# ---[^\n]*\n(?:#(?! ---)[^\n]*\n)*\n*(?:# ---|\Z)", re.MULTILINE)
    found = [
        str(path.relative_to(project_root))
        for folder in ("validate", "experiments", "tests")
        for path in sorted((project_root / folder).rglob("*.py"))
        if empty.search(path.read_text("utf-8"))
    ]
    assert found == []


def test_no_module_imports_itself_by_a_detour(project_root: Path) -> None:
    """Imports inside functions count: what waits for its call is an arrow all the same."""
    files = {
        ".".join(path.relative_to(project_root).with_suffix("").parts): path
        for path in (project_root / "validate").rglob("*.py")
    }
    modules = {name.removesuffix(".__init__"): path for name, path in files.items()}
    TopologicalSorter({name: _imports(path, modules) for name, path in modules.items()}).prepare()


def _imports(path: Path, modules: Mapping[str, Path]) -> set[str]:
    """The project's modules that a file names in its imports."""
    found: set[str] = set()
    for node in nodes(path):
        if isinstance(node, ast.ImportFrom) and node.module:
            for name in node.names:
                whole = f"{node.module}.{name.name}"
                found.add(whole if whole in modules else node.module)
        elif isinstance(node, ast.Import):
            found |= {name.name for name in node.names}
    return found & modules.keys()


def test_what_a_module_prepares_is_prepared_by_one_worker(request: pytest.FixtureRequest) -> None:
    """pytest 9.2 with pytest-xdist 3.8 drops the groups without a word (xdist issue 1386)."""
    if "PYTEST_XDIST_WORKER" in os.environ:
        assert request.node.nodeid.endswith("@tree")


def test_files_of_others_are_opened_in_one_guarded_way(project_root: Path) -> None:
    """`validate.files` alone reads: what a process of its own hands back is ours."""
    reads = re.compile(r"\.(read_bytes|read_text)\(|\bpath\.open\(|\bfile\.open\(|\bopen\(path")
    found = [
        f"{path.name}: {line.strip()}"
        for folder in ("validate/recording", "validate/scene", "validate/register", "experiments")
        for path in sorted((project_root / folder).rglob("*.py"))
        for line in path.read_text("utf-8").splitlines()
        if reads.search(line) and path.name != "subprocess_decoder.py"
    ]
    assert found == []


# What a named tuple and a notebook offer all the same.
OFFERED = {"_replace", "_asdict", "_make", "_fields", "_repr_html_", "_repr_png_"}


def _private_names(path: Path) -> set[str]:
    """Names with an underscore that a test takes from elsewhere: imports, attributes, patches."""
    own = {n.name for n in nodes(path) if isinstance(n, ast.FunctionDef | ast.ClassDef)}
    names: set[str] = set()
    for node in nodes(path):
        if isinstance(node, ast.ImportFrom) and str(node.module).startswith(("validate", "exper")):
            names |= {name.name for name in node.names}
        elif isinstance(node, ast.Attribute) and node.attr.startswith("_"):
            on = node.value.id if isinstance(node.value, ast.Name) else ""
            names |= set() if on in ("self", "cls") else {node.attr} - own
        elif isinstance(node, ast.Call) and _called(node.func).endswith("setattr"):
            texts = [a.value for a in node.args[:2] if isinstance(a, ast.Constant)]
            names |= {text.rsplit(".", 1)[-1] for text in texts if isinstance(text, str)}
    return {n for n in names if n.startswith("_") and not n.startswith("__")} - OFFERED


def _called(function: ast.expr) -> str:
    """The last name of what is called."""
    return str(getattr(function, "attr", getattr(function, "id", "")))


def _reasons(path: Path) -> set[str]:
    """Names in comments `# private: _name, _other: reason`, of as many lines as it needs."""
    found = re.findall(
        r"^# private: ((?:.|\n#   )*?):(?: |\n#   )", path.read_text("utf-8"), re.MULTILINE
    )
    return {name for names in found for name in re.findall(r"\b_\w+", names)}


def test_a_private_name_in_a_test_has_its_reason(project_root: Path) -> None:
    """A test goes through the public way; a file says why where it does not."""
    files = sorted((project_root / "tests").rglob("*.py"))
    left = {f.name: sorted(n) for f in files if (n := _private_names(f) - _reasons(f))}
    # The interface to external simulators is renamed as a whole.
    assert {n: v for n, v in left.items() if v != ["_arrays", "_density", "_exit"]} == {}
    stale = {f.name: sorted(n) for f in files if (n := _reasons(f) - _private_names(f))}
    assert stale == {}


def test_refusals_pin_key_and_number_not_wording(project_root: Path) -> None:
    """What `match` holds of a message has at most 44 letters: a better sentence breaks no test."""
    match = re.compile(r'\bmatch=\s*[rf]*"((?:[^"\\]|\\.)*)"')
    texts = (
        (f, t) for f in (project_root / "tests").rglob("*.py") for t in match.findall(f.read_text())
    )
    assert [(f.name, t) for f, t in texts if len(re.sub(r"{.*?}|\\\\", "", t)) > 44] == []
