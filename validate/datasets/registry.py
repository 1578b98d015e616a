"""Registry of data sets: addresses by commit, licences, citations, hashes. It holds no data."""

import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from validate.errors import UsageError
from validate.parameters import nearest_names

RAW = "https://raw.githubusercontent.com"
_TABLE = Path(__file__).with_name("registry.toml")


@dataclass(frozen=True)
class DataFile:
    """One file: `name` below its set's folder, `source` below its repository at the commit, or of
    another one as in "/owner/name/commit/path".

    An empty source: the file was made from what lies there and cannot be brought. With `rows` it is
    made here: of that function's numbers in the source, below `header`.
    """

    name: str
    source: str
    sha256: str
    size: int  # bytes
    rows: str = ""
    header: str = ""


@dataclass(frozen=True)
class DataSet:
    """Recordings of one origin; `made` says what its files without a source were made from."""

    name: str
    folder: str
    title: str
    repository: str
    commit: str
    licence: str
    citation: str
    files: tuple[DataFile, ...]
    made: str = ""

    @property
    def page(self) -> str:
        """Where people look at it."""
        return f"https://github.com/{self.repository}/tree/{self.commit}"

    @property
    def brought(self) -> tuple[DataFile, ...]:
        """The files that are brought, or made of what is."""
        return tuple(file for file in self.files if file.source)

    def address(self, file: DataFile) -> str:
        """Of a file's source at its commit."""
        if file.source.startswith("/"):
            return f"{RAW}{file.source}"
        return f"{RAW}/{self.repository}/{self.commit}/{file.source}"


@cache
def data_sets() -> tuple[DataSet, ...]:
    """All that are registered, as the table lists them."""
    return tuple(_data_set(entry) for entry in tomllib.loads(_TABLE.read_text("utf-8"))["set"])


def _data_set(entry: dict[str, Any]) -> DataSet:
    return DataSet(**entry | {"files": tuple(DataFile(*row) for row in entry["files"])})


def named(name: str) -> DataSet:
    """The data set of that name or folder; `UsageError` naming the nearest where there is none."""
    plain = name.strip("/").replace("_", "-")
    for found in data_sets():
        if plain in (found.name, found.folder):
            return found
    known = {found.name for found in data_sets()}
    raise UsageError(f"unknown data set '{name}'; {nearest_names(plain, known)}")
