"""Registry of readers, formats that have none, and the documentation's tables of formats."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from validate.errors import RecordingError, UsageError, ValidateError
from validate.parameters import nearest_names
from validate.plugins import Registry, kind_fault
from validate.recording.formats.matlab import MATLAB
from validate.recording.formats.rosbag import ROSBAG
from validate.recording.formats.slicer import FCSV, MARKUPS
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
from validate.recording.motion_capture.poses import require_chain
from validate.recording.motion_capture.qualisys import QUALISYS, QUALISYS_ANALOG
from validate.recording.motion_capture.trc import TRC
from validate.recording.motion_capture.vicon import VICON
from validate.recording.reader import MapOption, Options, Reader, head
from validate.recording.tables.point_table import POINTS
from validate.recording.tables.testing_machine import INSTRON
from validate.recording.tables.workbook import SHEETS, XLSX
from validate.recording.types import Recording

_FFMPEG = "ffmpeg -i {name} -c:v libx264 -crf 0 {stem}.mp4"
_SAVED = "`scipy.io.savemat('{{stem}}.mat', dict({}))`"
_NPZ = b"PK\3\4 .npy"  # an archive whose first file is so called
_FIRST: tuple[tuple[bytes, str, str], ...] = (
    (b"SQLite format 3\0", "an SQLite database (not a ROS bag)",
     "sqlite3 -header -csv {name} 'SELECT * FROM ...' > {stem}.csv"),
    (b"TDSm", "a LabVIEW TDMS file",
     "export it as CSV, for example with npTDMS: `tdmsinfo`, "
     "`TdmsFile(...).as_dataframe().to_csv(...)`"),
    (b"GIF8", "a GIF", _FFMPEG),
    (b"\x30\x26\xb2\x75\x8e\x66\xcf\x11", "a Windows Media video", _FFMPEG),
    (b"\0\0\1\xba", "a video (MPEG)", _FFMPEG),
    (b"\0\0\1\xb3", "a video (MPEG)", _FFMPEG),
    (b"\x89HDF", "an HDF5 file that is not from MATLAB",
     "save its arrays, for example with h5py and `scipy.io.savemat('{stem}.mat', ...)`"),
    *((title, "a text export of Vicon Nexus 1", "export the trial as C3D")
      for title in (b"TRAJECTORIES\r", b"TRAJECTORIES\n", b"ANALOG\r", b"ANALOG\n")),
    (b"FLV\1", "a video (Flash)", _FFMPEG),
    (b"\x1f\x8b", "compressed with gzip", "gunzip -k {name}"),
    (b"\x28\xb5\x2f\xfd", "compressed with Zstandard",
     "unzstd -k {name} -o {stem}; for a ROS bag, import the folder instead"),
    (b"\x93NUMPY", "a NumPy array", _SAVED.format("x=numpy.load('{name}')")),
    (_NPZ, "an archive of NumPy arrays", _SAVED.format("numpy.load('{name}')")),
    (b"PK\3\4", "a ZIP archive", "unzip {name} -d {stem}, then name the folder or a file in it"),
    (b"7z\xbc\xaf\x27\x1c", "a 7z archive", "unpack it and name the file or folder in it"),
    (b"Rar!", "a RAR archive", "unpack it and name the file or folder in it"),
    (b"%PDF", "a PDF", "export the numbers as CSV from the program that drew it"),
)  # fmt: skip


def known_unread(path: Path) -> str:
    """What a path is that no reader takes, and what to do; empty where nothing shows."""
    if path.is_dir():
        # A folder of bags, or of scans.
        name = path.resolve().name
        if dicom := sorted(p.name for p in path.glob("*.dcm")):
            return (
                f"{name} is a folder of DICOM files, read one by one: "
                f"validate import {name}/{dicom[0]}"
            )
        if bags := sorted(p.name for kind in ("db3", "mcap") for p in path.glob(f"*.{kind}")):
            return (
                f"{name} holds {'bags of ROS 2' if bags[0].endswith('db3') else 'MCAP files'} "
                f"without metadata.yaml of rosbag2; name one: validate import {name}/{bags[0]}"
            )
        return ""
    first = head(path, 64)
    if first.startswith(b"PK\3\4") and b".npy" in first:
        first = _NPZ
    return next(
        (
            f"{path.name} is {what}, which is not read; convert it: "
            + how.format(name=path.name, stem=path.stem)
            for magic, what, how in _FIRST
            if first.startswith(magic)
        ),
        "",
    )


_OWN: tuple[Reader, ...] = (
    MCAP, ROSBAG, C3D, TRC, VICON, QUALISYS, QUALISYS_ANALOG, OPTITRACK, NDI, DICOM, METAIMAGE,
    NRRD, FCSV, MARKUPS, MATLAB, XLSX, SHEETS, VIDEO, PNG_STACK, IMAGE_STACK, POINTS, INSTRON,
)  # fmt: skip


READERS: Registry[Reader] = Registry(
    "readers", _OWN, lambda reader: reader.name, lambda part: kind_fault(part, Reader)
)


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
            recording = reader.read(path, options)
            record = {**recording.metadata.get("provenance", {}), "read by": READERS.whose(reader)}
            return replace(recording, metadata={**recording.metadata, "provenance": record})
        except ValidateError:
            raise
        except Exception as error:  # code of others: whatever it does
            raise RecordingError(
                f"{path.name}: {READERS.whose(reader)} failed ({type(error).__name__}: {error}); "
                "ask its authors, or name another format with --as"
            ) from error

    return replace(reader, read=read)


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
    names = ", ".join(r.name for r in READERS)
    if path.is_dir():
        raise UsageError(
            f"{path}: a folder of unknown format; name a file, or the format with --as ({names})"
        )
    size = path.stat().st_size
    if size == 0:
        raise UsageError(f"{path}: the file is empty (0 bytes); record or copy it again")
    start = head(path)
    # Printable UTF-8, cut anywhere
    try:
        text = start.decode("utf-8")
    except UnicodeDecodeError as error:
        text = start[: error.start].decode("utf-8") if len(start) - error.start < 4 else ""
    printable = bool(text) and all(c.isprintable() or c in "\r\n\t" for c in text)
    what = "text" if printable else "binary data"
    raise UsageError(
        f"{path}: unknown format ({what}, {size} bytes, begins with {start[:8].hex()}); if it is "
        f"one of {names}, name it with --as"
    )


_BEGIN, _END = "<!-- {}: written by docs/format_tables.py -->", "<!-- end of {} -->"
_UNITS = {"": "text", "1": "number"}


def formats_table(readers: Iterable[Reader]) -> str:
    """Name, content, extensions and signature of each format, as a Markdown table."""
    rows = [
        [f"`{r.name}`", r.doc, " ".join(f"`{e}`" for e in r.extensions), r.sign] for r in readers
    ]
    return _table(("`--as`", "file", "extensions", "recognised because"), rows)


def options_table(readers: Sequence[Reader]) -> str:
    """Key, meaning, unit, default and formats of each `--map` key, as a Markdown table."""
    users: dict[MapOption, list[str]] = {}
    for reader in readers:
        for option in reader.options:
            users.setdefault(option, []).append(f"`{reader.name}`")
    rows = [
        [f"`{o.name}`", o.doc, _UNITS.get(o.unit, o.unit), o.default or "-", " ".join(names)]
        for o, names in sorted(users.items(), key=lambda pair: pair[0].name.lower())
    ]
    return _table(("key", "meaning", "unit of the value", "default", "formats"), rows)


def with_tables(page: str) -> str:
    """Return a page with the tables of the package's own readers between its marks.

    Raises `ValueError` for a page without them.
    """
    for name, table in (
        ("formats", formats_table(READERS.own)),
        ("keys", options_table(READERS.own)),
    ):
        begin, end = _BEGIN.format(name), _END.format(name)
        before, after = page.index(begin) + len(begin), page.index(end)
        page = f"{page[:before]}\n{table}\n{page[after:]}"
    return page


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)
