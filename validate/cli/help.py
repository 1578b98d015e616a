"""Help pages: commands in groups by what they are for, each page with an example."""

from collections.abc import Iterator

import click

SECTIONS = {
    "Recordings": (
        "inspect", "import", "align", "merge", "outline", "digitise", "calibrate", "data",
    ),
    "Experiments": ("new", "body", "list", "run", "identify", "check", "record"),
    "Studies": (
        "study filters", "study stability", "study tradeoff", "study choose", "study coverage",
    ),
    "Results": ("compare", "history", "summary", "export"),
    "Connect": ("guest check", "guest job", "live"),
}  # fmt: skip


class Sections(click.Group):
    """A group of commands that are listed by section, those of inner groups by their whole name."""

    def format_commands(self, context: click.Context, formatter: click.HelpFormatter) -> None:
        for title, names in SECTIONS.items():
            with formatter.section(title):
                formatter.write_dl([(n, command_at(self, n).get_short_help_str(80)) for n in names])


def command_at(group: click.Group, name: str) -> click.Command:
    """The command of a name such as "study filters"."""
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
