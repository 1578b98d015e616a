"""Every format that becomes a recording."""

from pathlib import Path

from validate.errors import RecordingError, UsageError
from validate.parameters import nearest_names
from validate.recording.chain import require_chain
from validate.recording.exports.instron import INSTRON
from validate.recording.exports.xlsx import SHEETS, XLSX
from validate.recording.formats.c3d import C3D
from validate.recording.formats.dicom import DICOM
from validate.recording.formats.matlab import MATLAB
from validate.recording.formats.metaimage import METAIMAGE
from validate.recording.formats.ndi import NDI
from validate.recording.formats.nrrd import NRRD
from validate.recording.formats.optitrack import OPTITRACK
from validate.recording.formats.point_table import POINTS
from validate.recording.formats.qualisys import QUALISYS
from validate.recording.formats.qualisys_analog import QUALISYS_ANALOG
from validate.recording.formats.rosbag import ROSBAG
from validate.recording.formats.slicer import FCSV, MARKUPS
from validate.recording.formats.trc import TRC
from validate.recording.formats.unread import known_unread
from validate.recording.formats.vicon import VICON
from validate.recording.formats.video import VIDEO
from validate.recording.images.image_stack import IMAGE_STACK
from validate.recording.images.png_stack import PNG_STACK
from validate.recording.mcap import read as mcap
from validate.recording.mcap.read import MCAP
from validate.recording.reader import Reader, head
from validate.recording.types import Recording

# Any text may be a testing machine's: its reader is asked after all that know their own.
READERS: tuple[Reader, ...] = (
    MCAP, ROSBAG, C3D, TRC, VICON, QUALISYS, QUALISYS_ANALOG, OPTITRACK, NDI, DICOM, METAIMAGE,
    NRRD, FCSV, MARKUPS, MATLAB, XLSX, SHEETS, VIDEO, PNG_STACK, IMAGE_STACK, POINTS, INSTRON,
)  # fmt: skip


def told_apart(path: Path) -> str:
    """What a file is whose format shows, and the command that takes it; empty where none shows (any
    text may be a testing machine's)."""
    reader = next((r for r in READERS if r is not INSTRON and r.recognises(path)), None)
    if reader is None:
        return ""
    takes = "new NAME --from {}" if reader is MCAP else "import {} -o " + f"{path.stem}.mcap"
    return f"{path.name} is {reader.doc}: validate {takes.format(path.name)}"


def read_recording(path: Path) -> Recording:
    """The recording in an MCAP file (`mcap.read.read_recording`), its frames without contradiction;
    a file of another format is called by its name in the error, with the command that takes it."""
    try:
        recording = mcap.read_recording(path)
    except RecordingError as error:
        raise no_mcap(path, error) from None
    require_chain(recording)
    return recording


def no_mcap(path: Path, error: RecordingError) -> RecordingError:
    """The error about a file that was expected to be MCAP, with what it is instead."""
    if MCAP.recognises(path):
        return error
    if said := told_apart(path):
        return RecordingError(said)
    may = INSTRON.recognises(path)
    way = f"; if it is {INSTRON.doc}: validate import {path.name} -o {path.stem}.mcap"
    what = f"{path.name}: the first 8 bytes are not the MCAP magic"
    return RecordingError(f"{what} ({head(path, 8).hex()}){way}") if may else error


def named(kind: str) -> Reader:
    """The reader of that name; raises `UsageError` naming the nearest."""
    found = {r.name: r for r in READERS}
    if kind not in found:
        raise UsageError(f"unknown kind '{kind}'; {nearest_names(kind, set(found))}")
    return found[kind]


def recognised(path: Path) -> Reader:
    """The first reader that recognises the path; raises `UsageError` where none does, with what to
    do where it is of a kind that is known but not read, and where there is no such file."""
    if not path.exists():
        raise UsageError(f"{path}: no such file or folder")
    for reader in READERS:
        if reader in (POINTS, INSTRON) and (said := known_unread(path)):
            raise UsageError(said)
        if reader.recognises(path):
            return reader
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
