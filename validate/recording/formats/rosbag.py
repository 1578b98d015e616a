"""Reader of ROS bags (rosbag2 SQLite or folder, ROS 1), converted to MCAP messages. The only file
that imports rosbags.
"""

import re
import tempfile
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.errors import RecordingError
from validate.files import ANY_SIZE, member, members, open_file, read_text
from validate.recording.formats.subprocess_decoder import decoded
from validate.recording.mcap.read import OPTIONS, read_all
from validate.recording.reader import Options, Reader, head, source_of
from validate.recording.types import Recording, Source

LIBRARIES = ("rosbags.rosbag1", "rosbags.rosbag2", "rosbags.typesys", "mcap.writer")
ROS1 = b"#ROSBAG V"
_HEADER = "std_msgs/msg/Header"


@dataclass(frozen=True)
class _Bag:
    """An open bag; `text` gives the definition of a connection's type, empty where there is none,
    `cdr` a message as ROS 2 has it."""

    reader: Any
    text: Callable[[Any], str]
    cdr: Callable[[bytes, str], bytes]


def arrays(path: Path) -> dict[str, NDArray[Any]]:
    """`mcap`: every message whose type is defined, in the bag or by ROS 2 Humble, at its time;
    `undefined` (k, 2): other topics and their types.

    Types of their own are named as ROS 2 names them (`sensor_msgs/msg/Image`).
    """
    from mcap.writer import CompressionType, Writer

    with tempfile.TemporaryDirectory(prefix="validate-") as folder:
        out = Path(folder) / "bag.mcap"
        with _opened(path, Path(folder)) as bag:
            known = {id(c): text for c in bag.reader.connections if (text := bag.text(c))}
            unknown = [(c.topic, c.msgtype) for c in bag.reader.connections if id(c) not in known]
            if unknown and not known:
                first = " of type ".join(unknown[0])
                raise RecordingError(f"no definition of any of its {len(unknown)} types: {first}")
            defined = [(c, known[id(c)]) for c in bag.reader.connections if id(c) in known]

            with out.open("wb") as file:
                writer: Any = Writer(file, compression=CompressionType.NONE)
                writer.start(profile="ros2", library="rosbags")
                to = {}
                for c, text in defined:
                    schema = writer.register_schema(c.msgtype, "ros2msg", text.encode())
                    to[c.id, c.topic] = writer.register_channel(c.topic, "cdr", schema)
                for c, ns, raw in bag.reader.messages([c for c, _ in defined]) if defined else ():
                    writer.add_message(to[c.id, c.topic], ns, bag.cdr(raw, c.msgtype), ns)
                writer.finish()
        return {
            "mcap": np.fromfile(out, dtype=np.uint8),
            "undefined": np.array(unknown, dtype=str).reshape(-1, 2),
        }


@contextmanager
def _opened(path: Path, folder: Path) -> Iterator[_Bag]:
    from rosbags import rosbag1, rosbag2
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    one = head(path, len(ROS1)) == ROS1
    # A plain name with its ending: the library goes by that, and makes an address of the name.
    link = folder / ("bag" if path.is_dir() else "bag.bag" if one else "bag.db3")
    link.symlink_to(path.resolve())
    reader: Any = rosbag1.Reader(link) if one else rosbag2.Reader(link)
    try:
        reader.open()
    except KeyError as error:  # so rosbag2 calls it where the recorder did not have the type
        if error.args != ("unknown",):
            raise
        raise RecordingError(
            "it has types without a definition, which are not read; remove them from a copy of "
            'the bag: sqlite3 FILE.db3 "DELETE FROM message_definitions WHERE '
            "encoding = 'unknown'\""
        ) from None
    with closing(reader):
        if not one:
            yield _Bag(reader, _defined, lambda raw, _: raw)
            return
        store = get_typestore(Stores.EMPTY)
        header = {_HEADER: get_typestore(Stores.ROS2_HUMBLE).fielddefs[_HEADER]}
        for c in reader.connections:  # the number in ROS 1's header is dropped from messages
            store.register({**get_types_from_msg(c.msgdef.data, c.msgtype), **header})
        yield _Bag(
            reader,
            lambda c: store.generate_msgdef(c.msgtype, ros_version=2)[0],
            lambda raw, kind: bytes(store.ros1_to_cdr(raw, kind)),
        )


def _defined(connection: Any) -> str:
    """As the bag has it; older ones have none, and their types are those of ROS 2."""
    from rosbags.interfaces import MessageDefinitionFormat
    from rosbags.typesys import Stores, get_typestore

    if connection.msgdef.format == MessageDefinitionFormat.MSG:
        return str(connection.msgdef.data)
    store = get_typestore(Stores.ROS2_HUMBLE)
    if connection.msgtype not in store.fielddefs:
        return ""
    return str(store.generate_msgdef(connection.msgtype, ros_version=2)[0])


_SQLITE, _TABLES = b"SQLite format 3\0", (b"topics", b"messages")
_PAGE = 65536  # bytes: the first page, which lists the tables, is no longer
_NAMED = re.compile(
    r"""^\s*-\s+(?:path:\s*)?["']?(?:.*/)?([^/\n]+?\.(?:db3|mcap)(?:\.zstd)?)["']?\s*$""", re.M
)
_PACKED = re.compile(r"""compression_mode:\s*["']?message""", re.I)
_YAML, _SAYS = "metadata.yaml", b"rosbag2_bagfile_information"


def read_bag(path: Path, options: Options) -> Recording:
    """Return the messages of a bag that mean something, as `validate.recording.mcap.read.read_all`
    has them, with its options; a folder is read whole, in the order of its files.

    A bag that holds no definitions of its types is read by those of ROS 2 Humble. Raises
    `RecordingError` for a bag that is cut or damaged, or of which nothing is a stream.
    """
    if not path.exists():
        raise RecordingError(f"{path}: no such file or folder")
    if not _recognises(path):
        raise RecordingError(f"{path.name}: not a ROS bag")
    # All files of a folder; of a single file, that it can be read without its metadata.
    listing = (path if path.is_dir() else path.parent) / _YAML
    told = read_text(member(listing)) if listing.is_file() else ""
    names, packed = list(dict.fromkeys(_NAMED.findall(told))), bool(_PACKED.search(told))
    if path.is_dir():
        # A bag of one MCAP file is what the reader of MCAP knows, whatever its name.
        mcap = [member(f) for f in members(path) if f.suffix == ".mcap"]
        if len(mcap) == 1 and len(names) < 2 and not packed:
            return read_all(mcap[0], options)
        if missing := [name for name in names if not (path / name).is_file()]:
            raise RecordingError(
                f"{path.name}: its {_YAML} names {len(names)} files, but {missing[0]} is missing; "
                f"copy it too, or import the others one by one"
            )
    elif packed and path.name in names:
        raise RecordingError(
            f"{path.name}: each message is compressed, see {_YAML}; import the folder"
        )
    for file in map(member, members(path)) if path.is_dir() else (path,):
        open_file(file, ANY_SIZE).close()
        if file.suffix != ".mcap":
            # A database by its own count of pages, and nothing of it left in a log beside it
            first = head(file, 32)
            log = file.with_name(f"{file.name}-wal")
            if log.is_file() and log.stat().st_size:
                raise RecordingError(
                    f"{file.name}: {log.stat().st_size} bytes are still in {log.name}; merge them "
                    f"with: sqlite3 {file.name} 'PRAGMA wal_checkpoint(TRUNCATE)'"
                )
            if first.startswith(_SQLITE):
                page = int.from_bytes(first[16:18]) or 1
                needs = (_PAGE if page == 1 else page) * int.from_bytes(first[28:32])
                if (size := file.stat().st_size) < needs:
                    raise RecordingError(
                        f"{file.name}: {size} bytes, but its header declares {needs}: truncated"
                    )
    found = decoded("validate.recording.formats.rosbag", path, extra="ros2")
    with tempfile.TemporaryDirectory(prefix="validate-") as folder:
        whole = Path(folder) / (path.name or "bag")  # errors name it
        found["mcap"].tofile(whole)
        got = read_all(whole, options)
    never = {topic: f"no definition of its type ({kind})" for topic, kind in found["undefined"]}
    said = "a bag keeps no checksum: integrity not provable"
    source = Source(path.resolve().name, "", 0, said) if path.is_dir() else source_of(path, said)
    return replace(got, source=source, unread={**got.unread, **never})


def _recognises(path: Path) -> bool:
    if _SAYS in head(path / _YAML):
        return True
    first = head(path, _PAGE)
    bag = first.startswith(_SQLITE) and all(name in first for name in _TABLES)
    return bag or first.startswith(ROS1)


ROSBAG = Reader(
    "rosbag",
    "a ROS bag",
    _recognises,
    read_bag,
    "it is SQLite with messages and topics, a folder with metadata of rosbag2, or begins with "
    "#ROSBAG",
    options=OPTIONS,
    extensions=(".db3", ".bag"),
)
