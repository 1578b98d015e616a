"""Whether a test pulls or presses: by the user, the header, the columns, or the sign of strain."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

from validate.errors import UsageError
from validate.recording.exports.vocabulary import (
    BESIDE_THE_TEST,
    COMPRESSION,
    TENSION,
    kind_word,
    plain,
    terms,
)

KindName = Literal["compression", "tension"]
KINDS: dict[str, KindName] = {"compression": "compression", "tension": "tension"}
ASK = "give --map test=compression or --map test=tension"


@dataclass(frozen=True)
class Kind:
    """The kind of test and what says so; `said`: by the user, whom nothing contradicts."""

    name: KindName
    why: str
    said: bool = False


def kind_of_test(said: str | None, header: Mapping[str, str], labels: Iterable[str]) -> Kind | None:
    """What is stated; None where nothing is, or header and columns contradict each other.

    A line that names both (`Load cell: tension/compression`) tells nothing, nor does one on the
    material, the machine's parts, who tested, a remark or a path: a compression moulded sheet is
    pulled as well. Raises `UsageError` for a kind that is neither.
    """
    if said is not None:
        if said not in KINDS:
            raise UsageError(f"--map test={said}: expected tension or compression")
        return Kind(KINDS[said], "given by --map", said=True)
    lines = [
        value if key.startswith("line ") else f"{key}: {value}"
        for key, value in header.items()
        if _of_the_test(key, value)
    ]
    found = {**_stated(labels, "column"), **_stated(lines, "header")}
    return next(iter(found.values())) if len(found) == 1 else None


def _of_the_test(key: str, value: str) -> bool:
    """Whether a header's line can say what was done, by its key, and by a value that is no path."""
    beside = any(word in plain(key) for word in terms(BESIDE_THE_TEST))
    return not beside and "\\" not in value and value.count("/") < 2


def _stated(texts: Iterable[str], where: str) -> dict[KindName, Kind]:
    """The kinds that the texts name, each with the first text that does."""
    found: dict[KindName, Kind] = {}
    for text in texts:
        words = {"compression": kind_word(text, COMPRESSION), "tension": kind_word(text, TENSION)}
        named = [KINDS[name] for name, word in words.items() if word]
        if len(named) == 1:
            found.setdefault(named[0], Kind(named[0], f"the {where} contains '{text[:60]}'"))
    return found
