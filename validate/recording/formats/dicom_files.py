"""Which files are DICOM: known by what stands at byte 128."""

from pathlib import Path

from validate.errors import RecordingError
from validate.files import member, members
from validate.recording.reader import head

MAGIC, AT = b"DICM", 128
_MOST = 20_000  # files of one folder


def is_dicom(path: Path) -> bool:
    """Whether the file begins as one."""
    return head(path, AT + 4)[AT:] == MAGIC


def begins_as_dicom(path: Path) -> bool:
    """Whether a file is one, or a folder's first file by name; raises nothing."""
    try:
        if not path.is_dir():
            return is_dicom(path)
        first = min((f for f in members(path) if _may_be(f)), default=None)
    except (OSError, RecordingError):  # a name too long; a folder of too many entries
        return False
    return first is not None and is_dicom(first)


def files_of(folder: Path) -> list[Path]:
    """The DICOM files of a folder by name; raises `RecordingError` where others lie beside them, or
    there are more than `_MOST`."""
    files = [member(f) for f in members(folder) if _may_be(f)]
    others = [f.name for f in files if not is_dicom(f)]
    if others:
        said = f"{len(others)} of {len(files)} files are not DICOM ({', '.join(others[:3])})"
        raise RecordingError(f"{said}; take them out")
    if len(files) > _MOST:
        raise RecordingError(f"{len(files)} files, the limit is {_MOST}; split the folder")
    return files


def _may_be(path: Path) -> bool:
    return path.name != "DICOMDIR"
