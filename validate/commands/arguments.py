"""Arguments that commands share: exit codes, option types and PATH=VALUE texts."""

import sys
from collections.abc import Callable, Iterable, Iterator
from functools import wraps
from pathlib import Path
from typing import Any, Literal

import click

from validate.errors import UsageError
from validate.report.views.layout import width, wrapped

FOLDER = click.Path(file_okay=False, path_type=Path)
FILE = click.Path(dir_okay=False, path_type=Path)
EXPERIMENTS = click.option(
    "--experiments", "named", multiple=True, type=FOLDER, metavar="DIR",
    help="A further folder of experiment files.",
)  # fmt: skip
FORCE = click.option("--force", is_flag=True, help="Replace an output that exists.")
Detail = Literal["short", "screen", "full"]  # -q, neither, --verbose
OK, FAILED, BAD_INPUT, BUG, INTERRUPTED = 0, 1, 2, 70, 130


def detailed(command: Callable[..., Any]) -> Any:
    """Add `-q` and `--verbose` to a command, which gets `detail`: "short", "screen" or "full"."""

    @wraps(command)
    def chosen(*, quiet: bool, verbose: bool, **given: Any) -> Any:
        from validate.commands.progress import quiet as without_progress

        if quiet and verbose:
            raise UsageError("-q and --verbose exclude each other: give one")
        if not quiet:
            return command(detail="full" if verbose else "screen", **given)
        with without_progress():
            return command(detail="short", **given)

    for option in (
        click.option("-v", "--verbose", is_flag=True, help="Print everything, not one screen."),
        click.option("-q", "--quiet", is_flag=True, help="Print the answer only, no progress."),
    ):
        chosen = option(chosen)
    return chosen


def external_simulators(command: Callable[..., Any]) -> Any:
    """Add `--external` to a command, which gets `simulators`; `--guest` is the former name."""

    @wraps(command)
    def renamed(*, former: tuple[str, ...], simulators: tuple[str, ...], **given: Any) -> Any:
        if former:
            complain_of_former_name("--guest", "--external")
        return command(simulators=(*simulators, *former), **given)

    for option in (
        click.option("--guest", "former", multiple=True, hidden=True),
        click.option(
            "--external", "simulators", multiple=True, metavar="COMMAND",
            help="An external simulator as one more method (docs/how-to/external-simulators.md).",
        ),
    ):  # fmt: skip
        renamed = option(renamed)
    return renamed


def complain_of_former_name(former: str, now: str) -> None:
    """Print one line on standard error: a word of the command line has a new name."""
    complain(f"{former} is called {now} now; the next version accepts {now} only")


def command_line() -> tuple[str, ...]:
    """Return the arguments of the running command; empty where there is none."""
    context = click.get_current_context(silent=True)
    return tuple(context.find_root().obj or ()) if context else ()


def complain(message: str) -> None:
    """One line on standard error; on a terminal broken between words, not where it ends."""
    line = "validate: " + " ".join(message.split())
    seen = wrapped(line, width(sys.stderr), "  ") if sys.stderr.isatty() else [line]
    click.echo("\n".join(seen), err=True)


def pairs(texts: tuple[str, ...], option: str) -> dict[str, str]:
    """`a=b` texts as a mapping; raises `UsageError` for a text without '='."""
    found = {}
    for text in texts:
        key, sign, value = text.partition("=")
        if not (sign and key.strip()):
            raise UsageError(f"{option} {text}: expected PATH=VALUE")
        found[key.strip()] = value.strip()
    return found


def output(text: str, *, required: bool = True) -> Callable[[Callable[..., Any]], Any]:
    """Return the options `-o` and `--force` of a command that writes one file, `out`.

    The command is called where `require_new` lets it be; all other paths that it is given are its
    inputs.
    """

    def decorated(command: Callable[..., Any]) -> Any:
        @wraps(command)
        def checked(*, force: bool, out: Path | None, **given: Any) -> Any:
            if out is not None:
                require_new((out,), _paths(given.values()), force=force)
            return command(out=out, **given)

        return click.option("-o", "out", required=required, type=FILE, help=text)(FORCE(checked))

    return decorated


def _paths(values: Iterable[Any]) -> Iterator[Path]:
    for value in values:
        if isinstance(value, Path):
            yield value
        elif isinstance(value, tuple):
            yield from _paths(value)


def require_new(outputs: Iterable[Path], inputs: Iterable[Path] = (), *, force: bool) -> None:
    """Raise `UsageError` for an output that exists, unless it may be replaced by `force`, and for
    one that is an input in any case."""
    sources = [path for path in inputs if path.exists()]
    for out in outputs:
        there = out.exists() or out.is_symlink()
        if there and any(source.samefile(out) for source in sources if out.exists()):
            raise UsageError(f"-o {out}: this file is an input of the command; name another output")
        if there and not force:
            raise UsageError(
                f"-o {out}: this file exists; name another output, or replace it with --force"
            )


def require_empty(folder: Path, option: str, *, force: bool) -> None:
    """Raise `UsageError` for a folder that holds something, unless `force` lets files be written
    there."""
    if folder.is_dir() and any(folder.iterdir()) and not force:
        raise UsageError(
            f"{option} {folder}: this folder is not empty; name another one, or write there with "
            "--force"
        )
