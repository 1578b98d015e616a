"""Help pages: commands in groups by purpose, each page with an example."""

import io
from collections.abc import Iterator
from typing import TYPE_CHECKING, TextIO

import click

from validate.commands.arguments import complain_of_former_name

if TYPE_CHECKING:
    from validate.recording.reader import Reader


# --- Output into a pipe whose reader ends early, as `| head` does.


class _Pipe(io.RawIOBase):
    """A raw stream that drops what is written once nobody reads it any more."""

    def __init__(self, raw: io.RawIOBase) -> None:
        self._raw, self._read = raw, True

    def writable(self) -> bool:
        return True

    def write(self, data: object) -> int:
        size = memoryview(data).nbytes  # type: ignore[arg-type]
        if not self._read:
            return size
        try:
            return self._raw.write(data) or 0  # type: ignore[arg-type]
        except BrokenPipeError:
            self._read = False
            return size

    def fileno(self) -> int:
        return self._raw.fileno()

    def isatty(self) -> bool:
        return self._raw.isatty()


def outlives_reader(stream: TextIO) -> TextIO:
    """Return the stream, with a reader that may end early: the command goes on, its exit code
    stays."""
    buffer = getattr(stream, "buffer", None)
    raw = getattr(buffer, "raw", buffer)  # an unbuffered stream has its raw one there
    if not isinstance(raw, io.RawIOBase):
        return stream
    stream.flush()
    return io.TextIOWrapper(
        io.BufferedWriter(_Pipe(raw)), encoding=stream.encoding, errors=stream.errors,
        line_buffering=True,
    )  # fmt: skip


# -------------------------------------------------------------------------------------------------

SECTIONS = {
    "Recordings": (
        "inspect", "import", "align", "merge", "outline", "digitise", "calibrate", "data",
    ),
    "Experiments": ("new", "body", "list", "run", "identify", "check", "record"),
    "Studies": (
        "study filters", "study stability", "study tradeoff", "study choose", "study coverage",
    ),
    "Results": ("open", "report", "show", "compare", "history", "summary", "export"),
    "Connect": ("external check", "external job", "live"),
}  # fmt: skip


FORMER_COMMANDS = {"guest": "external"}  # former names, for one version; no help page lists them


class Sections(click.Group):
    """A group of commands that are listed by section, those of inner groups by their whole name."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the command; a former name prints one warning line with the new name."""
        if args and args[0] in FORMER_COMMANDS:
            now = FORMER_COMMANDS[args[0]]
            complain_of_former_name(f"'validate {args[0]}'", f"'validate {now}'")
            args = [now, *args[1:]]
        return super().resolve_command(ctx, args)

    def format_commands(self, context: click.Context, formatter: click.HelpFormatter) -> None:
        for title, names in SECTIONS.items():
            with formatter.section(title):
                formatter.write_dl([(n, command_at(self, n).get_short_help_str(80)) for n in names])


class WithFormats(click.Command):
    """A command whose help page lists every format with its extensions and `--map` keys."""

    def format_epilog(self, context: click.Context, formatter: click.HelpFormatter) -> None:
        from validate.recording.readers import in_order  # all formats: only where they are shown

        with formatter.section("Formats (--as), extensions and keys of --map"):
            formatter.write_dl([(r.name, "; ".join(_facts(r))) for r in in_order()])


def _facts(reader: "Reader") -> list[str]:
    """Content, extensions and keys of a format."""
    keys = ", ".join(option.name for option in reader.options)
    return [reader.doc, " ".join(reader.extensions), *([f"--map {keys}"] if keys else [])]


def command_at(group: click.Group, name: str) -> click.Command:
    """Return the command of a name such as "study filters"."""
    found: click.Command = group
    for word in name.split():
        assert isinstance(found, click.Group)
        found = found.commands[word]
    return found


def every_command(group: click.Group, name: str = "") -> Iterator[tuple[str, click.Command]]:
    """All commands below a group with their whole names, groups themselves left out."""
    for word, command in group.commands.items():
        whole = f"{name} {word}".strip()
        if isinstance(command, click.Group) and not command.invoke_without_command:
            yield from every_command(command, whole)
        else:
            yield whole, command
            if isinstance(command, click.Group):
                yield from every_command(command, whole)
