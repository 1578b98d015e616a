"""The blocks of an Abaqus input file: keyword, parameters, rows, and where they stand.

A flat file has no parts; one by Abaqus/CAE has parts, and an assembly with their instances. Rows of
other files (`*Include`, `input=`) and rows that make nodes or elements out of others are refused.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

from validate.errors import SceneError

_MAKES = {"INCLUDE", "NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY", "SYSTEM", "IMPORT"}
_ENDS = {"PART": "END PART", "INSTANCE": "END INSTANCE"}


Home = tuple[str, str]
NOWHERE: Home = ("", "")


@dataclass(frozen=True)
class KeywordBlock:
    """A keyword in upper case with its parameters (keys in upper case), and the rows below it.

    `home` says inside which part or instance it stands, as ("PART", "gel"), ("", "") for none;
    `line` is its number in the file.
    """

    keyword: str
    given: Mapping[str, str]
    rows: tuple[str, ...]
    line: int
    home: Home = NOWHERE

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
        """The numbers of a row, with Fortran's exponents, too; raises as `wholes` does."""
        try:
            return [
                float(w.replace("D", "E").replace("d", "e")) for w in row.split(",") if w.strip()
            ]
        except ValueError as error:
            raise self.wrong(str(error)) from None

    def wrong(self, why: str) -> SceneError:
        return SceneError(f"*{self.keyword.capitalize()} in line {self.line}: {why[:120]}")


def blocks_of(text: str) -> list[KeywordBlock]:
    """All blocks in order; raises `SceneError` for one that is refused."""
    found, home = list[KeywordBlock](), NOWHERE
    for keyword, given, rows, line in _split(text.splitlines()):
        if keyword in _ENDS:
            home = (keyword, given.get("NAME", ""))
        block = KeywordBlock(keyword, given, tuple(rows), line, home)
        _require_own_rows(block)
        found.append(block)
        home = NOWHERE if keyword in _ENDS.values() else home
    return found


def _require_own_rows(block: KeywordBlock) -> None:
    if block.keyword in _MAKES and (block.rows or block.keyword != "SYSTEM"):
        raise block.wrong("is not followed; export plain nodes and elements in one file")
    if block.keyword in ("NODE", "ELEMENT") and "INPUT" in block.given:
        raise block.wrong("its rows are in another file; export plain nodes and elements in one")
    if block.keyword == "NODE" and block.given.get("SYSTEM", "R").upper() != "R":
        raise block.wrong("coordinates that are not rectangular; export them as x, y, z")


_Split = tuple[str, dict[str, str], list[str], int]


def _split(lines: list[str]) -> Iterator[_Split]:
    current: _Split | None = None
    goes_on = False
    for number, raw in enumerate(lines, start=1):
        line = raw.strip()
        if not line or line.startswith("**"):
            continue
        if goes_on and current is not None:
            current[1].update(_parameters(line))
        elif line.startswith("*"):
            if current is not None:
                yield current
            head, _, rest = line[1:].partition(",")
            current = (" ".join(head.upper().split()), _parameters(rest), [], number)
        elif current is not None:
            current[2].append(line)
            continue
        goes_on = line.endswith(",") and current is not None
    if current is not None:
        yield current


def _parameters(text: str) -> dict[str, str]:
    found = {}
    for word in re.findall(r'[^,"]*(?:"[^"]*")?[^,"]*', text):
        key, _, value = word.partition("=")
        if key.strip():
            found[key.strip().upper()] = value.strip().strip('"')
    return found
