"""One kind of experiment that `validate new` writes."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from validate.cli.asking import Answers, Question
from validate.errors import UsageError
from validate.recording.types import Recording
from validate.units import in_si, split

FEW_CELLS = 150  # of a mesh file whose quadratic ones are halved twice in some minutes


@dataclass(frozen=True)
class NewKind:
    """`fits` says whether a recording holds what it `needs`; `asks` gives the questions that follow
    from the answers so far, for a file in a folder; `fields` fills the `template`, given the
    recording's path from that folder; `used` are the topics it looks at, `assumed` lines on what
    nobody said."""

    name: str
    doc: str
    needs: str
    against: str
    template: str
    fits: Callable[[Recording], bool]
    asks: Callable[[Recording, Path, Answers], Sequence[Question]]
    fields: Callable[[Recording, str, Path, Answers], Mapping[str, str]]
    used: Callable[[Recording, Answers], set[str]]
    assumed: Callable[[Recording, Answers], Sequence[str]]


def quantity_in(unit: str) -> Callable[[str], float]:
    """A check: a positive number in `unit`, or with its own."""

    def check(text: str) -> float:
        found = split(text)
        value = in_si(found[0], found[1] or unit, unit) if found else None
        if value is None or not 0 < value < float("inf"):
            raise UsageError(f"a number above 0 in {unit}, or with its own unit, is expected")
        return value

    return check
