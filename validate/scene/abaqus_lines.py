"""The lines of an Abaqus input file, with those of the files that it includes in their place.

Only relative names are followed, from the deck's own folder (where a job is started) and not out of
it; a file that includes itself, more than 200 inclusions and 64 MB together are refused.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from validate.errors import RecordingError, SceneError
from validate.files import inside, read_bytes, read_text

_NAMED = re.compile(rb'(?im)^\s*\*[^\r\n]*?\binput\s*=\s*"?([^",\r\n]+)')
_MOST, _TIMES = 64 * 2**20, 200  # bytes of all files together; how often one is included


@dataclass(frozen=True)
class DeckLine:
    """Text without blanks at its ends, and where it stands, as "line 3 of 'mesh.inp'"."""

    text: str
    where: str

    @property
    def is_keyword(self) -> bool:
        return self.text.startswith("*")


class Deck:
    """An input file; `included` are the names of those it names, each once, as they are read."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.included: list[str] = []
        self._bytes = self._times = 0

    def lines(self) -> Iterator[DeckLine]:
        """Without comments and empty ones; a keyword with its continuation is one line."""
        yield from self._of(self.path, "", ())

    def beside(self, name: str, where: str, inside: tuple[Path, ...] = ()) -> Iterator[DeckLine]:
        """The lines of the file of that `name`; raises `SceneError` for one that is not taken."""
        path = self._found(name, where)
        if path in (*inside, self.path.resolve()):
            raise SceneError(f"'{name}' in {where} includes itself; write each file once")
        self._times += 1
        if self._times > _TIMES:
            raise SceneError(f"more than {_TIMES} inclusions, at '{name}' in {where}")
        if name not in self.included:
            self.included.append(name)
        yield from self._of(path, f" of '{name}'", inside)

    def _found(self, name: str, where: str) -> Path:
        try:
            path = inside(self.path.resolve().parent, name)
        except RecordingError as error:
            raise SceneError(f"{error} ({where})") from None
        if not path.is_file():
            raise SceneError(
                f"'{name[:80]}' in {where} is no file in the deck's folder; put it there, or "
                "delete the line if it has no nodes, elements or sets"
            )
        return path

    def _of(self, path: Path, of: str, inside: tuple[Path, ...]) -> Iterator[DeckLine]:
        for line in _joined(self._text(path), of):
            included = _included(line)
            if included is None:
                yield line
            else:
                yield from self.beside(included, line.where, (*inside, path.resolve()))

    def _text(self, path: Path) -> str:
        self._bytes += path.stat().st_size
        if self._bytes > _MOST:
            raise SceneError(f"more than {_MOST} bytes with what it includes")
        return read_text(path, _MOST)


def files_named(path: Path) -> tuple[Path, ...]:
    """The file itself, and of a deck those of its folder that it names, and that they name, as far
    as they are there."""
    found: list[Path] = []
    left = [path]
    while left and len(found) <= _TIMES:
        file = left.pop(0)
        if file in found:
            continue
        found.append(file)
        if path.suffix.lower() == ".inp" and file.stat().st_size <= _MOST:
            names = (n.decode("utf-8", "replace") for n in _NAMED.findall(read_bytes(file, _MOST)))
            left += [p for n in names if (p := _beside(path, n.strip())) is not None]
    return tuple(found)


def _beside(path: Path, name: str) -> Path | None:
    try:
        found = inside(path.parent, name)
    except RecordingError:
        return None
    return found if found.is_file() else None


def words_of(text: str) -> tuple[str, dict[str, str]]:
    """A keyword in capitals and its parameters, their keys in capitals."""
    head, _, rest = text[1:].partition(",")
    found = {}
    for word in re.findall(r'[^,"]*(?:"[^"]*")?[^,"]*', rest):
        key, _, value = word.partition("=")
        if key.strip():
            found[key.strip().upper()] = value.strip().strip('"')
    return " ".join(head.upper().split()), found


def _included(line: DeckLine) -> str | None:
    if not line.text[:9].upper().replace(" ", "").startswith("*INCLUDE"):
        return None
    keyword, given = words_of(line.text)
    if keyword != "INCLUDE":
        return None
    if "PASSWORD" in given:
        raise SceneError(
            f"*Include in {line.where}: the file is encrypted; export it without encryption"
        )
    return given.get("INPUT", "")


def _joined(text: str, of: str) -> Iterator[DeckLine]:
    keyword = ""
    first = 0
    for number, raw in enumerate(text.splitlines(), start=1):
        line = raw.strip()
        if not line or line.startswith("**"):
            continue
        if keyword.endswith(","):
            keyword += line
        elif line.startswith("*"):
            keyword, first = line, number
        else:
            yield DeckLine(line, f"line {number}{of}")
            continue
        if not keyword.endswith(","):
            yield DeckLine(keyword, f"line {first}{of}")
            keyword = ""
    if keyword:
        yield DeckLine(keyword, f"line {first}{of}")
