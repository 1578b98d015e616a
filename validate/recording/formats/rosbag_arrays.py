"""Conversion of a ROS bag to the bytes of one MCAP file. The only file that imports rosbags."""

import tempfile
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.errors import RecordingError
from validate.recording.reader import head

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
    with tempfile.TemporaryDirectory(prefix="validate-") as folder:
        out = Path(folder) / "bag.mcap"
        with _opened(path, Path(folder)) as bag:
            known = {id(c): text for c in bag.reader.connections if (text := bag.text(c))}
            unknown = [(c.topic, c.msgtype) for c in bag.reader.connections if id(c) not in known]
            if unknown and not known:
                first = " of type ".join(unknown[0])
                raise RecordingError(f"no definition of any of its {len(unknown)} types: {first}")
            _write(bag, [(c, known[id(c)]) for c in bag.reader.connections if id(c) in known], out)
        return {
            "mcap": np.fromfile(out, dtype=np.uint8),
            "undefined": np.array(unknown, dtype=str).reshape(-1, 2),
        }


@contextmanager
def _opened(path: Path, folder: Path) -> Iterator[_Bag]:
    from rosbags import rosbag1, rosbag2

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
        yield _ros1(reader) if one else _Bag(reader, _defined, lambda raw, _: raw)


def _ros1(reader: Any) -> _Bag:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.EMPTY)
    header = {_HEADER: get_typestore(Stores.ROS2_HUMBLE).fielddefs[_HEADER]}
    for c in reader.connections:  # the number in ROS 1's header is dropped as messages are turned
        store.register({**get_types_from_msg(c.msgdef.data, c.msgtype), **header})
    return _Bag(
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


def _write(bag: _Bag, known: list[tuple[Any, str]], out: Path) -> None:
    from mcap.writer import CompressionType, Writer

    with out.open("wb") as file:
        writer: Any = Writer(file, compression=CompressionType.NONE)
        writer.start(profile="ros2", library="rosbags")
        to = {}
        for c, text in known:
            schema = writer.register_schema(c.msgtype, "ros2msg", text.encode())
            to[c.id, c.topic] = writer.register_channel(c.topic, "cdr", schema)
        for c, ns, raw in bag.reader.messages([c for c, _ in known]) if known else ():
            writer.add_message(to[c.id, c.topic], ns, bag.cdr(raw, c.msgtype), ns)
        writer.finish()
