"""The public API is listed, documented and versioned, and nothing is public that is not listed."""

import inspect
import re
from collections import Counter
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from types import ModuleType

import pytest
from script_modules import module_of

import validate

# private: _call, _members: called alone, case by case.

MOST = 300


@pytest.fixture(scope="module")
def reference(project_root: Path) -> ModuleType:
    return module_of(project_root / "docs" / "reference_page.py")


def test_every_listed_name_imports_and_has_a_docstring_of_its_own(reference: ModuleType) -> None:
    names = list(reference.public())
    assert 150 < len(names) <= MOST
    assert [n for n, count in Counter(names).items() if count > 1] == []
    for module, name in names:
        assert not any(part.startswith("_") for part in (*module.split("."), name))
        what = reference.thing(module, name)
        if inspect.isclass(what) or inspect.isfunction(what):
            doc = what.__dict__.get("__doc__") if inspect.isclass(what) else what.__doc__
            assert doc, f"{module}.{name}: no docstring"
            assert not doc.startswith(f"{name}("), f"{module}.{name}: no docstring"
        assert getattr(import_module(module), name) is what or module == "validate"


def test_what_the_functions_at_the_top_return_is_documented(reference: ModuleType) -> None:
    """Every public method and property of the results has a docstring."""
    for module, name in reference.public():
        if module.startswith("validate.library."):
            for member, _, doc in reference._members(reference.thing(module, name)):
                assert doc, f"{name}.{member}"
    assert {n for m, n in reference.public() if m == "validate"} == set(validate.__all__)


def test_the_page_has_exactly_the_listed_names(reference: ModuleType) -> None:
    text = re.sub(r"```.*?```", "", reference.page(), flags=re.DOTALL)
    parts = re.split(r"^### (validate[\w.]*)$", text, flags=re.MULTILINE)[1:]
    printed = [
        (module, name)
        for module, part in zip(parts[::2], parts[1::2], strict=True)
        for name in re.findall(r"^#### (\w+)$", part, flags=re.MULTILINE)
    ]
    assert printed == list(reference.public())


def test_a_signature_changes_with_its_stored_line(reference: ModuleType) -> None:
    """After a change: python docs/reference_page.py --write, and `version` where a call breaks."""
    stored = reference.SIGNATURES.read_text("utf-8").splitlines()
    now = reference.signatures().splitlines()
    assert [line for line in now if line not in stored] == []
    assert [line for line in stored if line not in now] == []
    assert not any("0x" in line for line in now)


def test_a_changed_parameter_changes_the_line(reference: ModuleType) -> None:
    def before(a: int, *, b: str = "") -> float: ...  # type: ignore[empty-body]
    def after(a: int, b: str = "") -> float: ...  # type: ignore[empty-body]
    def wider(a: int | None, *, b: str = "") -> float: ...  # type: ignore[empty-body]

    lines = [reference._call(f) for f in (before, after, wider)]
    assert lines[0] == "(a: int, *, b: str = ...) -> float"
    assert len(set(lines)) == 3


def test_no_name_is_public_for_a_single_experiment(
    reference: ModuleType, project_root: Path
) -> None:
    """Each is used by the package itself, by the documentation or by two experiments."""
    places: dict[str, set[str]] = {}
    for folder, kind in (("validate", "py"), ("docs", "md"), ("experiments", "py")):
        for file in (project_root / folder).rglob(f"*.{kind}"):
            inside = file.relative_to(project_root)
            place = "/".join(inside.parts[:2]) if folder == "experiments" else str(inside)
            for word in set(re.findall(r"\w+", file.read_text("utf-8"))):
                places.setdefault(word, set()).add(place)
    for module, name in reference.public():
        own = module.replace(".", "/") + ".py"
        found = {p for p in places[name] if p != own and not p.endswith("__init__.py")}
        single = len(found) == 1 and found.pop().startswith("experiments/")
        assert not single, f"{module}.{name} is used by one experiment only"


def test_names_of_packages_exist() -> None:
    for found in iter_modules(validate.__path__):
        if found.ispkg:
            package = import_module(f"validate.{found.name}")
            assert len(set(package.__all__)) == len(package.__all__)
            for name in package.__all__:
                if not hasattr(package, name):  # a module
                    import_module(f"{package.__name__}.{name}")


def test_a_name_that_is_not_public_is_none() -> None:
    import validate.solve

    with pytest.raises(AttributeError, match=r"'validate\.solve'.*'nothing'"):
        _ = validate.solve.nothing
