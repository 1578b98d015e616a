"""The command that installs what is missing works for how the package was installed."""

import json
import shlex
import sys
import tomllib
from importlib.metadata import PackageNotFoundError
from pathlib import Path
from types import SimpleNamespace

import pytest

from validate import installation
from validate.installation import install_command

REQUIRES = ("numpy>=2.0", 'python-gdcm>=3.0.24; extra == "dicom"', "pytest>=8; extra == 'test'")


@pytest.fixture
def pip(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A clone with its own environment, as the README makes them; the current folder."""
    (tmp_path / ".venv" / "bin").mkdir(parents=True)
    (tmp_path / ".venv" / "bin" / "pip").touch()
    monkeypatch.setattr(sys, "executable", str(tmp_path / ".venv" / "bin" / "python"))
    monkeypatch.chdir(tmp_path)
    return tmp_path / ".venv" / "bin" / "pip"


def installed(monkeypatch: pytest.MonkeyPatch, origin: dict[str, object] | None) -> None:
    text = None if origin is None else json.dumps(origin)
    found = SimpleNamespace(read_text=lambda _: text, requires=REQUIRES)
    monkeypatch.setattr(installation, "distribution", lambda _: found)


def test_in_a_clone_it_is_the_readme_s_own(pip: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clone = pip.parents[2]
    installed(monkeypatch, {"url": clone.as_uri(), "dir_info": {"editable": True}})
    assert install_command("dicom") == '.venv/bin/pip install -e ".[dicom]"'
    assert install_command() == ".venv/bin/pip install -e ."
    (clone / "data").mkdir()
    monkeypatch.chdir(clone / "data")
    assert shlex.split(install_command("dicom")) == [
        str(pip), "install", "-e", f"{clone}[dicom]",
    ]  # fmt: skip


def test_a_folder_that_was_installed_once_is_named_again(
    pip: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = tmp_path / "a clone"
    installed(monkeypatch, {"url": place.as_uri(), "dir_info": {}})
    assert shlex.split(install_command("dicom"))[1:] == ["install", f"{place}[dicom]"]
    assert shlex.split(install_command())[1:] == ["install", str(place)]


@pytest.mark.parametrize(
    "origin", [None, {"url": "file:///x/validate_tissue-0.1.0.whl", "archive_info": {}}]
)
def test_from_elsewhere_libraries_are_named_and_never_the_package(
    origin: dict[str, object] | None, pip: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    installed(monkeypatch, origin)
    assert install_command("dicom") == '.venv/bin/pip install "python-gdcm>=3.0.24"'
    assert install_command() == '.venv/bin/pip install "numpy>=2.0"'


def test_without_pip_it_is_uv_and_without_an_installation_the_clone(
    pip: Path, monkeypatch: pytest.MonkeyPatch, project_root: Path
) -> None:
    def absent(_: str) -> object:
        raise PackageNotFoundError

    monkeypatch.setattr(installation, "distribution", absent)
    monkeypatch.setattr(installation, "find_spec", lambda _: None)
    assert install_command("dicom") == (
        f'uv pip install --python .venv/bin/python -e "{project_root}[dicom]"'
    )


def test_no_text_sends_a_user_to_a_name_that_nobody_published(project_root: Path) -> None:
    name = tomllib.loads((project_root / "pyproject.toml").read_text())["project"]["name"]
    files = [
        *(project_root / "validate").rglob("*.py"),
        *(project_root / "docs").rglob("*.md"),
        project_root / "README.md",
    ]
    sent = [f for f in files if f"install {name}" in f.read_text() or f"'{name}[" in f.read_text()]
    assert sent == []
