"""What a reader of one format is, and what all of them need.

A new format is one file with its `Reader`, and a line in `readers.READERS`.
"""

import difflib
import hashlib
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

from validate.errors import UsageError
from validate.recording.types import Recording, Source

Options = Mapping[str, str]  # what a file does not say itself: `--map KEY=VALUE`


@dataclass(frozen=True)
class Reader:
    """One format; `name` is the KIND of `validate import --as KIND`, `sign` what it is known by.

    `recognises` looks at a path and its first bytes and raises nothing. `read` gives a `Recording`
    or raises one `ValidateError` of one line: for a path that cannot be read, a file that is empty,
    cut or of another kind, and an option that it does not know.
    """

    name: str
    doc: str
    recognises: Callable[[Path], bool]
    read: Callable[[Path, Options], Recording]
    sign: str


def head(path: Path, count: int = 4096) -> bytes:
    """The first bytes of a file; none of what is no readable file."""
    try:
        with path.open("rb") as stream:
            return stream.read(count)
    except OSError:
        return b""


def source_of(path: Path, integrity: str) -> Source:
    """A file's name, hash and size; `integrity` says what its bytes prove."""
    with path.open("rb") as stream:
        digest = hashlib.file_digest(stream, "sha256").hexdigest()
    return Source(path.name, digest, path.stat().st_size, integrity)


def require_known(options: Options, known: Collection[str]) -> None:
    """Raises `UsageError` naming the nearest known key for an option that is not `known`."""
    for key in options:
        if key not in known:
            listed = f"{did_you_mean(key, known)}known: {', '.join(known) or 'none'}"
            raise UsageError(f"--map {key}=...: no such key; {listed}")


def did_you_mean(text: str, known: Collection[str]) -> str:
    """A question with the nearest of the known texts; empty where none is near."""
    near = difflib.get_close_matches(text, known, n=1, cutoff=0.3)
    return f"did you mean '{near[0]}'? " if near else ""
