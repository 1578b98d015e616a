"""Tables of formats and of their `--map` keys, as the readers specify them."""

from collections.abc import Iterable, Sequence

from validate.recording.reader import MapOption, Reader
from validate.recording.readers import READERS

_BEGIN, _END = "<!-- {}: written by docs/format_tables.py -->", "<!-- end of {} -->"
_UNITS = {"": "text", "1": "number"}


def formats_table(readers: Iterable[Reader]) -> str:
    """Name, content, extensions and signature of each format, as a Markdown table."""
    rows = [
        [f"`{r.name}`", r.doc, " ".join(f"`{e}`" for e in r.extensions), r.sign] for r in readers
    ]
    return _table(("`--as`", "file", "extensions", "recognised because"), rows)


def options_table(readers: Sequence[Reader]) -> str:
    """Key, meaning, unit, default and formats of each `--map` key, as a Markdown table."""
    users: dict[MapOption, list[str]] = {}
    for reader in readers:
        for option in reader.options:
            users.setdefault(option, []).append(f"`{reader.name}`")
    rows = [
        [f"`{o.name}`", o.doc, _UNITS.get(o.unit, o.unit), o.default or "-", " ".join(names)]
        for o, names in sorted(users.items(), key=lambda pair: pair[0].name.lower())
    ]
    return _table(("key", "meaning", "unit of the value", "default", "formats"), rows)


def with_tables(page: str) -> str:
    """Return a page with the tables of the package's own readers between its marks.

    Raises `ValueError` for a page without them.
    """
    for name, table in (
        ("formats", formats_table(READERS.own)),
        ("keys", options_table(READERS.own)),
    ):
        begin, end = _BEGIN.format(name), _END.format(name)
        before, after = page.index(begin) + len(begin), page.index(end)
        page = f"{page[:before]}\n{table}\n{page[after:]}"
    return page


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)
