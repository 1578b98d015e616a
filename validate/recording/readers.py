"""Registry of readers: built-in ones, plug-ins and those of scripts."""

from dataclasses import replace
from pathlib import Path

from validate.errors import RecordingError, UsageError, ValidateError
from validate.parameters import nearest_names
from validate.plugins import Registry
from validate.recording.chain import require_chain
from validate.recording.formats.matlab import MATLAB
from validate.recording.formats.rosbag import ROSBAG
from validate.recording.formats.slicer import FCSV, MARKUPS
from validate.recording.formats.unsupported_formats import known_unread
from validate.recording.images.dicom import DICOM
from validate.recording.images.image_stack import IMAGE_STACK
from validate.recording.images.metaimage import METAIMAGE
from validate.recording.images.nrrd import NRRD
from validate.recording.images.png_stack import PNG_STACK
from validate.recording.images.video import VIDEO
from validate.recording.mcap import read as mcap
from validate.recording.mcap.read import MCAP
from validate.recording.motion_capture.c3d import C3D
from validate.recording.motion_capture.ndi import NDI
from validate.recording.motion_capture.optitrack import OPTITRACK
from validate.recording.motion_capture.qualisys import QUALISYS, QUALISYS_ANALOG
from validate.recording.motion_capture.trc import TRC
from validate.recording.motion_capture.vicon import VICON
from validate.recording.reader import Options, Reader, head
from validate.recording.tables.point_table import POINTS
from validate.recording.tables.testing_machine import INSTRON
from validate.recording.tables.workbook import SHEETS, XLSX
from validate.recording.types import Recording

_OWN: tuple[Reader, ...] = (
    MCAP, ROSBAG, C3D, TRC, VICON, QUALISYS, QUALISYS_ANALOG, OPTITRACK, NDI, DICOM, METAIMAGE,
    NRRD, FCSV, MARKUPS, MATLAB, XLSX, SHEETS, VIDEO, PNG_STACK, IMAGE_STACK, POINTS, INSTRON,
)  # fmt: skip


def _faults(part: object) -> str:
    return "" if isinstance(part, Reader) else f"{part!r}: expected a Reader"


READERS: Registry[Reader] = Registry("readers", _OWN, lambda reader: reader.name, _faults)


def in_order() -> tuple[Reader, ...]:
    """All readers in the order in which they are asked: first those that know their own files, the
    package's before those of plug-ins."""
    return tuple(sorted(READERS, key=lambda reader: reader.general))


def recognises(reader: Reader, path: Path) -> bool:
    """Return whether a reader recognises a file; a plug-in that fails there does not, with a
    warning."""
    return READERS.answer(reader, lambda r: bool(r.recognises(path)), False)


def told_apart(path: Path) -> str:
    """What a file is whose format shows, and the command that takes it; empty where none shows (any
    text may be a testing machine's)."""
    reader = next((r for r in in_order() if r is not INSTRON and recognises(r, path)), None)
    if reader is None:
        return ""
    takes = "new NAME --from {}" if reader is MCAP else "import {} -o " + f"{path.stem}.mcap"
    return f"{path.name} is {reader.doc}: validate {takes.format(path.name)}"


def read_recording(path: Path | str) -> Recording:
    """Return the recording in an MCAP file (`mcap.read.read_recording`), its frames without
    contradiction; a file of another format is called by its name in the error, with the command
    that takes it."""
    file = Path(path)
    try:
        recording = mcap.read_recording(file)
    except RecordingError as error:
        raise no_mcap(file, error) from None
    require_chain(recording)
    return recording


def no_mcap(path: Path, error: RecordingError) -> RecordingError:
    """Return the error about a file that was expected to be MCAP, with what it is instead."""
    if MCAP.recognises(path):
        return error
    if said := told_apart(path):
        return RecordingError(said)
    may = INSTRON.recognises(path)
    way = f"; if it is {INSTRON.doc}: validate import {path.name} -o {path.stem}.mcap"
    what = f"{path.name}: the first 8 bytes are not the MCAP magic"
    return RecordingError(f"{what} ({head(path, 8).hex()}){way}") if may else error


def named(kind: str) -> Reader:
    """Return the reader of that name; raises `UsageError` naming the nearest."""
    found = {r.name: r for r in READERS}
    if kind not in found:
        raise UsageError(f"unknown kind '{kind}'; {nearest_names(kind, set(found))}")
    return _shielded(found[kind])


def _shielded(reader: Reader) -> Reader:
    """The reader. Recordings by a plug-in name it in their provenance, and what it raises against
    its contract is one error that names it."""
    if reader in READERS.own:
        return reader

    def read(path: Path, options: Options) -> Recording:
        try:
            return _stamped(reader.read(path, options), reader)
        except ValidateError:
            raise
        except Exception as error:  # code of others: whatever it does
            raise RecordingError(
                f"{path.name}: {READERS.whose(reader)} failed ({type(error).__name__}: {error}); "
                "ask its authors, or name another format with --as"
            ) from error

    return replace(reader, read=read)


def _stamped(recording: Recording, reader: Reader) -> Recording:
    record = {**recording.metadata.get("provenance", {}), "read by": READERS.whose(reader)}
    return replace(recording, metadata={**recording.metadata, "provenance": record})


def recognised(path: Path) -> Reader:
    """Return the first reader that recognises the path; raises `UsageError` where none does, with
    what to do where it is of a kind that is known but not read, and where there is no such file."""
    if not path.exists():
        raise UsageError(f"{path}: no such file or folder")
    for reader in in_order():
        if reader.general and (said := known_unread(path)):
            raise UsageError(said)
        if recognises(reader, path):
            return _shielded(reader)
    raise UsageError(f"{path}: {_unknown(path)}")


def _unknown(path: Path) -> str:
    """What a file is that no reader recognises: a folder, empty, text or other bytes."""
    names = ", ".join(r.name for r in READERS)
    if path.is_dir():
        return f"a folder of unknown format; name a file, or the format with --as ({names})"
    size = path.stat().st_size
    if size == 0:
        return "the file is empty (0 bytes); record or copy it again"
    start = head(path)
    what = "text" if _is_text(start) else "binary data"
    return (
        f"unknown format ({what}, {size} bytes, begins with {start[:8].hex()}); if it is one of "
        f"{names}, name it with --as"
    )


def _is_text(start: bytes) -> bool:
    """Whether bytes are printable UTF-8, cut anywhere."""
    try:
        text = start.decode("utf-8")
    except UnicodeDecodeError as error:
        text = start[: error.start].decode("utf-8") if len(start) - error.start < 4 else ""
    return bool(text) and all(c.isprintable() or c in "\r\n\t" for c in text)
