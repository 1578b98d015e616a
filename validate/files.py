"""Safe reading of untrusted files: regular files only, within a size limit, inside a folder.

A pipe would wait for ever, a device never end, and a name inside a file may lead anywhere on the
machine. Whatever reads a file that a user names, or that such a file names, opens it here.
"""

import hashlib
import json
import os
import re
import zipfile
import zlib
from io import BufferedReader, BytesIO
from pathlib import Path
from stat import S_ISREG
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.errors import RecordingError

# --- Names of files and folders made of any text: of a probe, a marker, a channel, a specimen.

_ODD = re.compile(r"[^A-Za-z0-9._+ -]")
_LONGEST = 100  # characters: an ending and a folder's parts come on top


def safe_name(text: str) -> str:
    """Return a name that every file system takes, the text itself where it is one.

    Other signs become `_`, and six digits of a hash keep different texts apart.
    """
    plain = _ODD.sub("_", text)[:_LONGEST].strip(" .")
    if text and plain == text:
        return text
    mark = hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()[:6]
    return f"{plain}-{mark}" if plain else mark


# -------------------------------------------------------------------------------------------------

LARGEST = 2**29  # bytes of a file that is read as a whole
ANY_SIZE = 2**63  # bytes: of a file that is read by parts
MOST_MEMBERS = 100_000  # entries of a folder
_SAFE_INTEGER = 18  # digits: more are no count and no index
# A pipe that is opened so does not wait for a writer.
_FLAGS = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0)


def open_file(path: Path, limit: int = LARGEST) -> BufferedReader:
    """Open a regular file of at most `limit` bytes for reading.

    Raises `RecordingError` with the reason for a path that cannot be opened, a folder, pipe, socket
    or device, and a larger file.
    """
    try:
        stream = os.fdopen(os.open(path, _FLAGS), "rb")
    except (OSError, ValueError) as error:  # ValueError: a NUL in its name
        raise unreadable(path, error) from None
    found = os.fstat(stream.fileno())
    if not S_ISREG(found.st_mode):
        stream.close()
        raise RecordingError(f"{path.name}: a folder, pipe or device; expected a regular file")
    if found.st_size > limit:
        stream.close()
        raise too_large(path, found.st_size, limit)
    return stream


def read_bytes(path: Path, limit: int = LARGEST) -> bytes:
    """Return the content of a regular file; raises as `open_file`, also where it grows meanwhile or
    states no size."""
    try:
        with open_file(path, limit) as stream:
            data = stream.read(limit + 1)
    except OSError as error:
        raise unreadable(path, error) from None
    if len(data) > limit:
        raise too_large(path, len(data), limit)
    return data


def read_text(
    path: Path, limit: int = LARGEST, encoding: str = "utf-8", errors: str = "replace"
) -> str:
    """Return the content of a regular text file; raises as `read_bytes`."""
    return read_bytes(path, limit).decode(encoding, errors)


def buffered(path: Path, limit: int = LARGEST) -> BytesIO:
    """Return the content of a regular file as a stream, for a library that seeks in it."""
    return BytesIO(read_bytes(path, limit))


def first_bytes(path: Path, count: int) -> bytes:
    """Return the first bytes of a regular file of any size; none of what cannot be read."""
    try:
        with open_file(path, ANY_SIZE) as stream:
            return stream.read(count)
    except (OSError, RecordingError):
        return b""


def members(folder: Path, most: int = MOST_MEMBERS) -> list[Path]:
    """Return the entries of a folder that are no folders, by name, hidden ones left out.

    Links that lead out of the folder are kept: `inside` refuses them by name when they are read.
    Raises `RecordingError` for a folder that cannot be read, or of more than `most` entries.
    """
    try:
        with os.scandir(folder) as entries:
            found = []
            for count, entry in enumerate(entries):
                if count >= most:
                    raise RecordingError(f"{folder.name}: over {most} entries; split the folder")
                if not entry.name.startswith(".") and not entry.is_dir():
                    found.append(folder / entry.name)
    except (OSError, ValueError) as error:
        raise unreadable(folder, error) from None
    return sorted(found)


def inside(folder: Path, name: str) -> Path:
    """Return the file that a name read from a file of `folder` stands for.

    Only names below the folder are followed, and no symbolic link out of it. Raises
    `RecordingError` for any other name; the file need not exist.
    """
    said = name.replace("\\", "/")
    if not said.strip() or not said.isprintable():
        raise RecordingError(f"{name[:60]!r} is not a file name")
    try:
        path = (folder / said).resolve()
        root = folder.resolve()
        path.exists()
    except (OSError, RuntimeError, ValueError):  # a name too long, or links in a loop
        raise RecordingError(f"'{name[:60]}' cannot be followed; expected a file name") from None
    if said.startswith("/") or said[1:2] == ":" or not path.is_relative_to(root):
        raise RecordingError(
            f"'{name[:60]}' is outside its folder '{root.name}' and is not read; copy it there "
            f"and give only its name"
        )
    return path


def member(path: Path) -> Path:
    """Return a member of a folder; raises as `inside` for a symbolic link out of it."""
    return inside(path.parent, path.name)


def json_value(data: bytes | str) -> Any:
    """Return the value of a JSON text; integers beyond 18 digits are floating-point numbers.

    Raises `ValueError` for what is no JSON, also for one that nests beyond the interpreter's depth.
    """
    try:
        return json.loads(data, parse_int=_integer)
    except RecursionError:
        raise ValueError("nested too deeply") from None


def _integer(digits: str) -> int | float:
    return int(digits) if len(digits) <= _SAFE_INTEGER else float(digits)


def npz_arrays(path: Path, most: int) -> dict[str, NDArray[Any]]:
    """Return the arrays of an `npz` file by name, without pickles, at most `most` bytes unpacked.

    Raises `RecordingError` for what cannot be opened, is no such file, is damaged (CRC-32), or
    unpacks to more.
    """
    stream = buffered(path)
    try:
        with zipfile.ZipFile(stream) as archive:
            size = sum(entry.file_size for entry in archive.infolist())
            if size > most:
                raise RecordingError(f"{path.name}: {size} bytes unpacked, the limit is {most}")
        stream.seek(0)
        with np.load(stream, allow_pickle=False) as found:
            return {name: found[name] for name in found.files}
    except (
        ValueError, EOFError, KeyError, OSError, MemoryError, RuntimeError, NotImplementedError,
        zipfile.BadZipFile, zlib.error,
    ) as error:  # fmt: skip
        why = " ".join(str(error).split())[:80] or type(error).__name__
        raise RecordingError(f"{path.name}: not an archive of arrays, or damaged ({why})") from None


def too_large(path: Path, size: int, limit: int) -> RecordingError:
    return RecordingError(f"{path.name}: {size} bytes, the limit is {limit}; split it")


def unreadable(path: Path, error: Exception) -> RecordingError:
    """The error of a path that the system does not open, with its reason."""
    why = getattr(error, "strerror", None) or error
    return RecordingError(f"{path}: cannot be read ({why})")


def modified(path: Path) -> int:
    """When a file was changed last, ns; 0 for one that is not there."""
    return path.stat().st_mtime_ns if path.is_file() else 0
