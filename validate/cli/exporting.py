"""`validate export`: a stored run for other programs."""

from pathlib import Path

from validate.cli.display import say
from validate.errors import UsageError
from validate.places import try_file, write_whole
from validate.report.outside import junit, latex
from validate.study.stored import read_as


def export(run: Path, junit_file: Path | None, latex_file: Path | None) -> None:
    """Writes what was asked for; raises `UsageError` where nothing was."""
    wanted = [(f, make) for f, make in ((junit_file, junit), (latex_file, latex)) if f is not None]
    if not wanted:
        raise UsageError(
            "export: no output is named; give --junit checks.xml or --latex checks.tex"
        )
    for file, make in wanted:
        try_file(file)
        write_whole(file, read_as(run, make))
        say(f"{file}: {file.stat().st_size / 1e3:.1f} kB", indent="  ")
