"""Commands of `validate` run in this process, as a user types them."""

import contextlib
import io
import os
from pathlib import Path
from unittest import mock

from click.testing import CliRunner

from validate.commands import main as cli


def here(*arguments: str, cwd: Path | None = None, **environment: str) -> tuple[int, str, str]:
    """Exit code, standard output and error of a command run in this process."""
    out, err = io.StringIO(), io.StringIO()
    with (
        contextlib.chdir(cwd or Path.cwd()),
        mock.patch.dict(os.environ, environment),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        code = cli.run(list(arguments))
    return code, out.getvalue(), err.getvalue()


def called(*arguments: str) -> tuple[int, str]:
    """Exit code and output of a command, or 2 and its error."""
    done = CliRunner().invoke(cli.cli, list(arguments), standalone_mode=False)
    if done.exception is not None:
        return 2, str(done.exception)
    return int(done.return_value or 0), done.output


def refused(*arguments: str, cwd: Path | None = None, **environment: str) -> str:
    """Runs a command that must be refused: exit 2, one line on standard error, nothing else."""
    code, out, err = here(*arguments, cwd=cwd, **environment)
    assert code == 2, (code, out, err)
    assert out == ""
    lines = err.splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("validate: ")
    return lines[0]
