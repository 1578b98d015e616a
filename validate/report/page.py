"""What a page is made of: sections of paragraphs, lists, tables, pictures and animations."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from validate.compare.result import Result

Pixels = NDArray[np.uint8]
Mark = Literal["", "good", "bad", "open", "head", "strong"]


@dataclass(frozen=True)
class Cell:
    """A table cell: its text and how it stands out; a mark never replaces words."""

    text: str
    mark: Mark = ""


@dataclass(frozen=True)
class Paragraph:
    kind: ClassVar[str] = "paragraph"
    text: str
    mark: Mark = ""


@dataclass(frozen=True)
class Items:
    """A list of sentences."""

    kind: ClassVar[str] = "items"
    texts: tuple[str, ...]


@dataclass(frozen=True)
class Table:
    """Rows under headings; columns named in `words` hold text, the others numbers."""

    kind: ClassVar[str] = "table"
    caption: str
    headings: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    words: tuple[int, ...] = (0,)
    folded: bool = False


@dataclass(frozen=True)
class Picture:
    """pixels (h, w, 3) sRGB with what it shows (caption) and the same in words (alt).

    `photo` pictures are shaded renders, which a lossy code may touch; the others are line art.
    """

    kind: ClassVar[str] = "picture"
    name: str
    caption: str
    alt: str
    pixels: Pixels
    photo: bool = False


@dataclass(frozen=True)
class Animation:
    """frames (h, w, 3) sRGB shown in turn for `milliseconds` each, again and again.

    The first frame stands for all of them where nothing moves: on paper.
    """

    kind: ClassVar[str] = "animation"
    name: str
    caption: str
    alt: str
    frames: tuple[Pixels, ...]
    milliseconds: tuple[int, ...]

    @property
    def still(self) -> Picture:
        """The first frame as a picture."""
        return Picture(self.name, self.caption, self.alt, self.frames[0])


Part = Paragraph | Items | Table | Picture | Animation


@dataclass(frozen=True)
class Section:
    """A part of the page with an anchor for the table of contents."""

    anchor: str
    title: str
    parts: tuple[Part, ...]

    @property
    def pictures(self) -> tuple[Picture, ...]:
        return tuple(p for p in self.parts if isinstance(p, Picture))

    @property
    def animations(self) -> tuple[Animation, ...]:
        return tuple(p for p in self.parts if isinstance(p, Animation))


Sections = Section | tuple[Section, ...] | None
SectionOf = Callable[[Result], Sections]


def listed(made: Sections) -> tuple[Section, ...]:
    """The sections that a maker made: none, one or several."""
    if made is None:
        return ()
    return made if isinstance(made, tuple) else (made,)


def cells(*texts: str) -> tuple[Cell, ...]:
    """A row of plain cells."""
    return tuple(Cell(t) for t in texts)


def section(anchor: str, title: str, *parts: Part | None) -> Section | None:
    """A section of the parts that exist; None when none does."""
    present = tuple(p for p in parts if p is not None)
    return Section(anchor, title, present) if present else None
