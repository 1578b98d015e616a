"""The blocks of an Abaqus input file: keyword, parameters, rows, and where they stand.

A flat file has no parts; one by Abaqus/CAE has parts, and an assembly with their instances. Rows of
other files in the deck's folder (`*Include`, `input=`) stand in their place; rows that make nodes
or elements out of others are refused.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

from validate.errors import SceneError
from validate.scene.abaqus_lines import Deck, words_of

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
        """The numbers of a row, with Fortran's exponents, too; an empty place before the last
        number is 0. Raises as `wholes` does."""
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
        _require_own_rows(block)
        found.append(replace(block, home=home, system=system))
        home = NOWHERE if block.keyword in _ENDS.values() else home
    return found


def _require_own_rows(block: KeywordBlock) -> None:
    if block.keyword in _MAKES:
        raise block.wrong("is not supported; export plain nodes and elements")
    if block.keyword == "NODE" and block.given.get("SYSTEM", "R").upper() != "R":
        raise block.wrong("coordinates that are not Cartesian; export them as x, y, z")


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
        rows = _of_its_file(current, deck)
    if current is not None:
        yield replace(current, rows=tuple(rows))


def _of_its_file(block: KeywordBlock, deck: Deck) -> list[str]:
    """The rows that a keyword takes from the file it names by `input=`."""
    if block.keyword not in _ROWS or "INPUT" not in block.given:
        return []
    lines = list(deck.beside(block.given["INPUT"], block.where))
    if keyword := next((line for line in lines if line.is_keyword), None):
        raise block.wrong(
            f"keyword '{keyword.text[:40]}' in {keyword.where}; only rows are supported"
        )
    return [line.text for line in lines]
