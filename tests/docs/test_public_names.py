"""Every package says what is public, and the reference has exactly that."""

import re
from pathlib import Path
from types import ModuleType

import pytest
from script_modules import module_of


@pytest.fixture(scope="module")
def reference(project_root: Path) -> ModuleType:
    path = project_root / "docs" / "reference_page.py"
    return module_of(path)


def test_every_package_has_public_names_with_docstrings(reference: ModuleType) -> None:
    packages = reference.packages()
    assert len(packages) >= 14
    for package in packages:
        found = dict(reference.public(package))
        assert found.keys() == set(package.__all__)
        assert len(set(package.__all__)) == len(package.__all__)
        undocumented = [n for n, thing in found.items() if not getattr(thing, "__doc__", None)]
        assert undocumented == [], package.__name__


def test_the_reference_has_exactly_the_public_names(reference: ModuleType) -> None:
    text = re.sub(r"```.*?```", "", reference.page(), flags=re.DOTALL)
    parts = re.split(r"^## validate\.(\w+)$", text, flags=re.MULTILINE)[1:]
    printed = {
        name: re.findall(r"^### (\w+)$", part, flags=re.MULTILINE)
        for name, part in zip(parts[::2], parts[1::2], strict=True)
    }
    assert printed == {p.__name__.split(".")[1]: list(p.__all__) for p in reference.packages()}


def test_a_name_that_is_not_public_is_none() -> None:
    import validate.solve

    with pytest.raises(AttributeError, match=r"'validate\.solve' has no attribute 'nothing'"):
        _ = validate.solve.nothing
