"""Files of a folder in the order of the numbers in their names."""

import re
from itertools import pairwise
from pathlib import Path

from validate.errors import RecordingError
from validate.files import ANY_SIZE, member, members, open_file

SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".pgm")
OTHERS = tuple(s for s in SUFFIXES if s != ".png")


def pictures(folder: Path, kinds: tuple[str, ...] = (".png",)) -> list[Path]:
    """Files of these endings; hidden ones, as macOS leaves on foreign disks, are none."""
    return [f for f in members(folder) if f.suffix.lower() in kinds]


def number_key(stem: str) -> tuple[int, ...]:
    """Numbers in a name, by which files are in order."""
    return tuple(int(n) for n in re.findall(r"\d+", stem)[:8])


def numbered(folder: Path, kinds: tuple[str, ...] = (".png",)) -> list[Path]:
    """Its files of these kinds in the order of the numbers in their names.

    Raises `RecordingError` for a folder without any, for numbers that are alike, and for a pipe, a
    device or a link out of the folder.
    """
    files = pictures(folder, kinds)
    if not files:
        raise RecordingError(f"{folder}: no {' or '.join(f'*{kind}' for kind in kinds)} files")
    keys = {f: number_key(f.stem) for f in files}
    files.sort(key=lambda f: (keys[f], f.name))
    for a, b in pairwise(files):
        if keys[a] == keys[b]:
            raise RecordingError(
                f"{folder.name}: '{a.name}' and '{b.name}' have the same number; "
                "number the files in order of time"
            )
    for file in files:
        open_file(member(file), ANY_SIZE).close()
    return files
