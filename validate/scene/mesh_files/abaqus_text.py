"""Parser of the blocks of an Abaqus input file: keyword, parameters, rows, line numbers.

A flat file has no parts; one by Abaqus/CAE has parts, and an assembly with their instances. Rows of
other files in the deck's folder (`*Include`, `input=`) stand in their place; rows that make nodes
or elements out of others are refused.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Self

from validate.errors import RecordingError, SceneError
from validate.files import inside, read_bytes, read_text

# --- The lines of an Abaqus input file, with those of the files that it includes in their place.
#
# Only relative names are followed, from the deck's own folder (where a job is started) and not
# out of it; a file that includes itself, more than 200 inclusions and 64 MB together are refused.

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
        self._bytes += path.stat().st_size
        if self._bytes > _MOST:
            raise SceneError(f"more than {_MOST} bytes with what it includes")
        for line in _joined(read_text(path, _MOST), of):
            included = _included(line)
            if included is None:
                yield line
            else:
                yield from self.beside(included, line.where, (*inside, path.resolve()))


def files_named(path: Path) -> tuple[Path, ...]:
    """Return the file itself, and of a deck those of its folder that it names, and that they name,
    as far as they are there."""
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
    """Return a keyword in capitals and its parameters, their keys in capitals."""
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


# -------------------------------------------------------------------------------------------------

_MAKES = {"NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY", "IMPORT"}
_ROWS = {"NODE", "ELEMENT", "NSET", "ELSET", "SURFACE", "SYSTEM"}  # whose rows are read
_ENDS = {"PART": "END PART", "INSTANCE": "END INSTANCE"}


Home = tuple[str, str]
NOWHERE: Home = ("", "")


@dataclass(frozen=True)
class KeywordBlock:
    """A keyword in upper case with its parameters (keys in upper case), and the rows below it.

    `home` says inside which part or instance it stands, as ("PART", "gel"), ("", "") for none;
    `where` its line in the file; `system` the rows of the *System in force.
    """

    keyword: str
    given: Mapping[str, str]
    rows: tuple[str, ...]
    where: str
    home: Home = NOWHERE
    system: Self | None = None

    def words(self) -> list[str]:
        """What stands between the commas of all rows, empty places left out."""
        return [word for row in self.rows for word in map(str.strip, row.split(",")) if word]

    @cached_property
    def wholes(self) -> list[int]:
        """The words as whole numbers; raises `SceneError` with the line for one that is none."""
        try:
            return [int(word) for word in self.words()]
        except ValueError as error:
            raise self.wrong(str(error)) from None

    def floats(self, row: str) -> list[float]:
        """Return the numbers of a row, with Fortran's exponents, too; an empty place before the
        last number is 0. Raises as `wholes` does."""
        try:
            return [
                float(w.replace("D", "E").replace("d", "e") or 0)
                for w in map(str.strip, row.rstrip(", \t").split(","))
            ]
        except ValueError as error:
            raise self.wrong(str(error)) from None

    def wrong(self, why: str) -> SceneError:
        return SceneError(f"*{self.keyword.capitalize()} in {self.where}: {why[:120]}")


def blocks_of(deck: Deck) -> list[KeywordBlock]:
    """All blocks in order; raises `SceneError` for one that is refused."""
    found, home = list[KeywordBlock](), NOWHERE
    system: KeywordBlock | None = None
    for block in _split(deck):
        if block.keyword in _ENDS:
            home = (block.keyword, block.given.get("NAME", ""))
        if block.keyword in (*_ENDS, *_ENDS.values()):
            system = None  # it holds in the part or instance in which it stands
        if block.keyword == "SYSTEM":
            system = block if block.rows else None
        if block.keyword in _MAKES:
            raise block.wrong("is not supported; export plain nodes and elements")
        if block.keyword == "NODE" and block.given.get("SYSTEM", "R").upper() != "R":
            raise block.wrong("coordinates that are not Cartesian; export them as x, y, z")
        found.append(replace(block, home=home, system=system))
        home = NOWHERE if block.keyword in _ENDS.values() else home
    return found


def _split(deck: Deck) -> Iterator[KeywordBlock]:
    current: KeywordBlock | None = None
    rows: list[str] = []
    for line in deck.lines():
        if not line.is_keyword:
            rows.append(line.text)
            continue
        if current is not None:
            yield replace(current, rows=tuple(rows))
        current = KeywordBlock(*words_of(line.text), (), line.where)
        # The rows that a keyword takes from the file it names by `input=`.
        if current.keyword not in _ROWS or "INPUT" not in current.given:
            rows = []
        else:
            lines = list(deck.beside(current.given["INPUT"], current.where))
            if keyword := next((line for line in lines if line.is_keyword), None):
                raise current.wrong(
                    f"keyword '{keyword.text[:40]}' in {keyword.where}; only rows are supported"
                )
            rows = [line.text for line in lines]
    if current is not None:
        yield replace(current, rows=tuple(rows))
