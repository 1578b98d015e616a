"""The commands of docs/reference/commands.md, from the declarations of the command line."""

import re
from inspect import cleandoc

import click
from reference_page import BAR

from validate.commands.help import SECTIONS, command_at
from validate.commands.main import cli


def page() -> str:
    """Return every command by section as Markdown: purpose, example, usage, options."""
    text = ""
    for title, names in SECTIONS.items():
        text += f"\n## {title}\n"
        text += "".join(_entry(name, command_at(cli, name)) for name in names)
    return text


def _entry(name: str, command: click.Command) -> str:
    context = click.Context(command, info_name=f"validate {name}")
    words, _, example = cleandoc(command.help or "").partition("\b\nExample:\n")
    usage = command.get_usage(context).removeprefix("Usage: ")
    options = [p for p in command.params if isinstance(p, click.Option)]
    records = [record for p in options if (record := p.get_help_record(context))]
    rows = [f"| `{names.replace('|', BAR)}` | {_cell(meaning)} |" for names, meaning in records]
    parts = [
        f"### validate {name}",
        words.replace("\b", "").strip(),
        f"```console\n{re.sub(r'^ *', '$ ', example.strip(), flags=re.MULTILINE)}\n```",
        f"```text\n{usage}\n```",
        "\n".join(["| option | meaning |", "| --- | --- |", *rows]),
    ]
    return "\n" + "\n\n".join(parts) + "\n"


def _cell(text: str) -> str:
    """Return the text with nothing that a table of Markdown would take as its own."""
    return re.sub(r"([\\*<|])", r"\\\1", text)
