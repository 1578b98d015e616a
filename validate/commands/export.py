"""`validate export`: export a stored run as JUnit XML or LaTeX."""

from pathlib import Path

from validate.commands.display import say
from validate.errors import UsageError
from validate.places import try_file, write_whole
from validate.report.export.junit_latex import junit, tabular
from validate.report.long_table import LongTable, content_of
from validate.report.views.standard import view_of
from validate.report.views.view_filling import filled
from validate.study.stored_runs.score_comparison import read_table


def export(run: Path, junit_file: Path | None, latex_file: Path | None) -> None:
    """Write the requested exports; raises `UsageError` where none is requested."""
    makers = ((junit_file, _junit), (latex_file, checks_in_latex))
    wanted = [(file, make) for file, make in makers if file is not None]
    if not wanted:
        raise UsageError(
            "export: no output is named; give --junit checks.xml or --latex checks.tex"
        )
    table = read_table(run, "score*", "check*", "published*", "outcome")
    for file, make in wanted:
        try_file(file)
        write_whole(file, make(table))
        say(f"{file}: {file.stat().st_size / 1e3:.1f} kB", indent="  ")


def _junit(table: LongTable) -> str:
    return junit(content_of(table))


def checks_in_latex(table: LongTable) -> str:
    """Return the checks of all methods as a `tabular`."""
    head = table.head
    (checks,) = filled(view_of("checks"), table).tables
    return tabular(checks, f"{head['experiment']}, {head['created']}: {head['sentence']}")
