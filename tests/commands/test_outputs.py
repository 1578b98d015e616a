"""What a user names as output: never lost without `--force`, and never an input."""

from pathlib import Path

import click
import numpy as np
import pytest
from command_line import here, refused

from validate.commands.arguments import require_new
from validate.commands.main import cli
from validate.errors import UsageError
from validate.recording.mcap.write import write_recording
from validate.recording.types import Recording, Signal, Source

T = np.arange(5.0)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    signal = Signal(T, T[:, None], "N", 0.0, "machine")
    write_recording(
        Recording("log", Source("log", "", 0, ""), 0, signals={"force": signal}),
        tmp_path / "log.mcap",
    )
    return tmp_path / "log.mcap"


def test_the_source_is_never_the_output(log: Path) -> None:
    before = log.read_bytes()
    (log.parent / "alias.mcap").symlink_to(log)
    (log.parent / "hard.mcap").hardlink_to(log)
    for out in (log, log.parent / "alias.mcap", log.parent / "hard.mcap"):
        for force in ((), ("--force",)):
            line = refused("import", str(log), "-o", str(out), *force)
            assert "this file is an input of the command; name another output" in line
    assert log.read_bytes() == before


def test_a_file_that_exists_is_replaced_by_force_alone(log: Path) -> None:
    out = log.parent / "out.mcap"
    out.write_text("mine")
    line = refused("import", str(log), "-o", str(out))
    assert "out.mcap: this file exists; name another output, or replace it with --force" in line
    assert out.read_text() == "mine"
    assert here("import", str(log), "-o", str(out), "--force")[0] == 0
    assert out.read_bytes().startswith(b"\x89MCAP")
    out.unlink()
    out.symlink_to(log.parent / "nowhere")  # a link that leads nowhere is there, too
    assert "this file exists" in refused("import", str(log), "-o", str(out))


def test_what_lies_beside_the_output_is_not_lost_either(tmp_path: Path) -> None:
    (tmp_path / "x.json").write_text("mine")
    line = refused("record", "needle_block", "-o", str(tmp_path / "x.mcap"))
    assert "x.json: this file exists" in line
    assert (tmp_path / "x.json").read_text() == "mine"


def test_a_job_s_folder_is_new_or_empty(tmp_path: Path) -> None:
    (tmp_path / "notes").touch()
    line = refused("external", "job", "hanging_bar", "-o", str(tmp_path))
    assert "this folder is not empty; name another one, or write there with --force" in line


def test_every_command_with_an_output_has_force() -> None:
    lacking = []

    def walk(command: click.Command, name: str) -> None:
        options = {o for p in command.params for o in p.opts}
        if options & {"-o", "--junit", "--latex"} and "--force" not in options:
            lacking.append(name)
        for below, inner in getattr(command, "commands", {}).items():
            walk(inner, f"{name} {below}")

    walk(cli, "validate")
    assert lacking == []


def test_inputs_that_are_not_there_are_no_matter(tmp_path: Path) -> None:
    require_new((tmp_path / "new",), (tmp_path / "absent",), force=False)
    (tmp_path / "a").touch()
    with pytest.raises(UsageError, match="this file is an input"):
        require_new((tmp_path / "a",), (tmp_path / "a",), force=True)
