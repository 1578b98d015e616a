"""Registry of third-party data sets and their local folders.

Registry of data sets: addresses by commit, licences, citations, hashes. It holds no data.
"""

import functools
import os
import tomllib
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from validate.errors import RecordingError, UsageError
from validate.parameters import nearest_names
from validate.places import cache

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


@functools.cache
def data_sets() -> tuple[DataSet, ...]:
    """All that are registered, as the table lists them."""
    entries = tomllib.loads(_TABLE.read_text("utf-8"))["set"]
    return tuple(
        DataSet(**entry | {"files": tuple(DataFile(*row) for row in entry["files"])})
        for entry in entries
    )


def data_set_of(name: str) -> DataSet:
    """The data set of that name or folder; `UsageError` naming the nearest where there is none."""
    plain = name.strip("/").replace("_", "-")
    for found in data_sets():
        if plain in (found.name, found.folder):
            return found
    known = {found.name for found in data_sets()}
    raise UsageError(f"unknown data set '{name}'; {nearest_names(plain, known)}")


SHARED = "VALIDATE_SHARED_DATA"


def data_path(
    folder: str, name: str | None, beside: Path, own: str | None = None, by: str = ""
) -> Path:
    """A file of a data set, or its folder where `name` is None.

    `folder` is the data set's, as in `markers/silicone-beam`; `beside` the folder of the experiment
    that asks, for a shared folder that lies next to its project; `own` a path that its user gave
    for the parameter `by`, which is taken as it is, or the bare name of another file of the data
    set. Raises `RecordingError` naming the command that downloads it.
    """
    if own:
        sibling = sought(folder, own, beside) if name and Path(own).name == own else None
        given = Path(own)
        if sibling and not given.exists():
            return sibling
        if not (given.is_file() if name else given.is_dir()):
            raise RecordingError(f"no {'file' if name else 'folder'} {given}")
        return given
    path = sought(folder, name, beside)
    if path is None:
        theirs = data_set_of(folder)
        what = f"{folder}/{name}" if name else f"{folder}/"
        by = by or ("recording" if name else "data")
        brings = f"`validate data get {theirs.name}` downloads it"
        if not any(f.source for f in theirs.files if name in (None, f.name)):
            brings = f"`validate data get {theirs.name}` describes how to make it"
        raise RecordingError(
            f"{what} is missing: {brings} ({theirs.repository} {theirs.commit[:7]}, "
            f"{theirs.licence}); or pass --set {by}={'FILE' if name else 'FOLDER'}, or set "
            f"{SHARED} to a folder that holds it"
        )
    return path


def sought(folder: str, name: str | None, beside: Path) -> Path | None:
    """As `data_path`, of what an experiment can do without: None where it is not here.

    The places are looked through in order; what lies in the cache counts where its hash is the
    registered one.
    """
    has = (place / folder for place in searched(beside) if _has(place, folder, name))
    path = next(has, None)
    return path / name if path and name else path


def searched(beside: Path) -> tuple[Path, ...]:
    """The folders that may hold data sets, first the one that the environment names."""
    shared = os.environ.get(SHARED)
    experiments = beside.parent if beside.parent.name == "experiments" else beside
    return (
        Path(shared) if shared else experiments.parent.parent / "shared" / "data",
        cache_folder(),
    )


def cache_folder() -> Path:
    """Where `validate data get` brings files to."""
    return cache("data")


def whole(path: Path, file: DataFile) -> bool:
    """Whether a file is there to its last byte: size and hash are the registered ones."""
    if not path.is_file() or path.stat().st_size != file.size:
        return False
    return sha256(path.read_bytes()).hexdigest() == file.sha256


def _has(place: Path, folder: str, name: str | None) -> bool:
    """A folder counts where it holds anything: which files of it are wanted, its user knows."""
    if place != cache_folder():
        path = place / folder
        return (path / name).is_file() if name else path.is_dir() and any(path.iterdir())
    files = [f for f in data_set_of(folder).files if name in (None, f.name)]
    return bool(files) and all(whole(place / folder / f.name, f) for f in files)
