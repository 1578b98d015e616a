"""What made a run is told: command, commit, hashes of files; no folder of the machine."""

import hashlib
import subprocess
from dataclasses import replace
from pathlib import Path

import jsonschema
import pytest
from report_samples import small_result

from validate.parameters import Changed
from validate.report.exhibits import draw_all
from validate.report.page.html import page
from validate.report.sections.provenance import how
from validate.report.stored import environment as module
from validate.report.stored.environment import Commit, Made, UsedFile, commit_of, environment, made
from validate.report.stored.store import document, schema

# private: _version: called alone, case by case.

CREATED = "2026-11-21T04:00:00Z"


def git(folder: Path, *arguments: str) -> None:
    who = ["-c", "user.name=a", "-c", "user.email=a@example.org"]
    subprocess.run(["git", "-C", str(folder), *who, *arguments], check=True, capture_output=True)


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    """A project in a folder with a space and an umlaut, with one file committed."""
    folder = tmp_path / "mein Gel ü"
    folder.mkdir()
    (folder / "gel.py").write_text("E = 1\n", "utf-8")
    git(folder, "init", "-q")
    git(folder, "add", "gel.py")
    git(folder, "commit", "-qm", "first")
    return folder


def test_the_commit_and_whether_the_files_are_as_it_has_them(clone: Path) -> None:
    head = (clone / ".git" / "logs" / "HEAD").read_text().split()[1]
    assert commit_of([clone / "gel.py"]) == Commit(head, dirty=False)
    (clone / "notes.txt").write_text("of no concern", "utf-8")
    assert commit_of([clone / "gel.py"]) == Commit(head, dirty=False)
    assert commit_of([clone]) == Commit(head, dirty=True)
    (clone / "gel.py").write_text("E = 2\n", "utf-8")
    assert commit_of([clone / "gel.py"]) == Commit(head, dirty=True)
    assert str(Commit("0123456789abcdef", dirty=True)) == "0123456789, with changes"


def test_a_hook_of_git_does_not_send_it_elsewhere(
    clone: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A commit hook runs with GIT_DIR set."""
    here = commit_of([clone / "gel.py"])
    monkeypatch.setenv("GIT_DIR", str(tmp_path))
    assert here is not None
    assert commit_of([clone / "gel.py"]) == here


def test_files_that_no_clone_has_have_no_commit(clone: Path, tmp_path: Path) -> None:
    (clone / "new.py").write_text("", "utf-8")
    (tmp_path / "loose.py").write_text("", "utf-8")
    assert commit_of([clone / "new.py"]) is None
    assert commit_of([tmp_path / "loose.py"]) is None
    assert commit_of([]) is None


def test_a_machine_without_git_knows_no_commit(
    clone: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", "")
    assert commit_of([clone / "gel.py"]) is None


def test_command_and_files_without_the_folders_of_the_machine(clone: Path) -> None:
    arguments = [
        "run",
        "gel",
        "--set",
        f"data={clone}",
        "--out",
        str(clone),
        "--set",
        "a=b/c d",
        f"a={clone}=x",
    ]
    found = made(arguments, [clone / "gel.py"], [clone / "gel.py"])
    where = "'…/mein Gel ü'"
    assert found.command == (
        f"validate run gel --set 'data=…/mein Gel ü' --out {where} --set 'a=b/c d' "
        "'a=…/mein Gel ü=x'"
    )
    hashed = hashlib.sha256(b"E = 1\n").hexdigest()
    assert found.files == (
        UsedFile("experiment", "gel.py", hashed, 6), UsedFile("mesh", "gel.py", hashed, 6),
    )  # fmt: skip
    assert found.project == commit_of([clone / "gel.py"])
    assert len(found.code_sha256) == 64


def test_the_file_and_the_page_say_it() -> None:
    by = Made(
        "validate run cube", Commit("a" * 40, dirty=True), None, "b" * 64,
        (UsedFile("mesh", "cube.npz", "c" * 64, 12),), ("gauges 1.2",),
    )  # fmt: skip
    result = replace(small_result(), changed=(Changed("material.E", 1e4, 1.4e4, "Pa"),))
    content = document(result, CREATED, by)
    jsonschema.Draft202012Validator(schema()).validate(content)
    assert content["changed"] == [
        {"path": "material.E", "default": 1e4, "value": 1.4e4, "unit": "Pa"}
    ]
    told = content["made"]
    assert (told["command"], told["commit"], told["dirty"]) == ("validate run cube", "a" * 40, True)
    assert told["files"][0]["sha256"] == "c" * 64
    assert told["plug_ins"] == ["gauges 1.2"]
    changed, code, files = how(result, by).tables
    assert changed.rows == (("material.E", "10000", "14000", "Pa"),)
    assert ("commit", "aaaaaaaaaa, with changes") in code.rows
    assert ("plug-ins", "gauges 1.2") in code.rows
    assert files.rows == (("mesh", "cube.npz", 12, "c" * 64),)
    assert how(small_result(), Made()).tables[0].note == "None differs."


def test_a_column_without_heading_is_on_the_page() -> None:
    result = small_result()
    text = page(
        result, draw_all(result, (how(result, Made("validate run cube")),)), CREATED, ("", "")
    )
    assert ">command</td>" in text
    assert ">validate run cube</td>" in text


def test_the_page_says_at_once_that_something_was_changed() -> None:
    changed = replace(small_result(), changed=(Changed("material.E", 1e4, 1.4e4, "Pa"),))
    said = "1 parameter not as the experiment declares: material.E; "
    assert said in page(changed, (), CREATED, ("", ""))
    assert 'id="changed"' not in page(small_result(), (), CREATED, ("", ""))


def test_the_machine_is_described() -> None:
    found = environment()
    assert {"cpu", "cpu_count", "memory", "os", "python", "numpy", "scipy", "numba"} <= set(found)
    assert all(found.values())


@pytest.mark.parametrize("error", [AttributeError, ValueError, OSError])
def test_a_machine_that_does_not_say_its_memory(
    error: type[Exception], monkeypatch: pytest.MonkeyPatch
) -> None:
    def unknown(name: str) -> int:
        raise error(name)

    monkeypatch.setattr(module.os, "sysconf", unknown)
    assert module.environment()["memory"] == "unknown"
    sizes = {"SC_PAGE_SIZE": 4096, "SC_PHYS_PAGES": 2**20}
    monkeypatch.setattr(module.os, "sysconf", sizes.__getitem__)
    assert module.environment()["memory"] == "4.0 GiB"
    assert module._version("no-such-distribution") == "not installed"
