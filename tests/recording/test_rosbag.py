"""Bags of ROS that rosbags wrote, and one written by SQL as Humble's are: read as in MCAP."""

import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from command_line import here
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from test_mcap_ros2 import MADE, STORE, same

from validate.errors import RecordingError, UsageError
from validate.recording.formats import rosbag
from validate.recording.formats.rosbag import read_bag
from validate.recording.mcap.read import read_all, read_recording
from validate.recording.readers import recognised

pytestmark = pytest.mark.usefixtures("decoded_here")

# private: _opened: called alone, case by case.

KIND = "geometry_msgs/WrenchStamped"
SCALE = {"m_per_px": "0.1mm"}


def raw(kind: str, i: int) -> bytes:
    return bytes(STORE.serialize_cdr(MADE[kind][0](i), kind.replace("/", "/msg/")))


def bag(folder: Path, kind: str, storage: StoragePlugin = StoragePlugin.SQLITE3) -> Path:
    with Writer(folder / "bag", version=9, storage_plugin=storage) as writer:
        to = writer.add_connection("/x", kind.replace("/", "/msg/"), typestore=STORE)
        for i in range(3):
            writer.write(to, 200 * 10**9 + i, raw(kind, i))
    return folder / "bag"


def humbles(path: Path, kind: str = KIND) -> Path:
    """Tables as rosbag2 of Humble makes them (schema 3), which knows types by name alone."""
    with sqlite3.connect(path) as db:
        db.executescript(
            "CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);"
            "CREATE TABLE metadata(id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL,"
            "metadata TEXT NOT NULL);"
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,"
            "serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);"
            "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL,"
            "timestamp INTEGER NOT NULL, data BLOB NOT NULL);"
            "INSERT INTO schema VALUES (3, 'humble');"
        )
        topics = [("/x", kind.replace("/", "/msg/")), ("/own", "lab_msgs/msg/Needle")]
        for i, (name, own) in enumerate(topics):
            db.execute("INSERT INTO topics VALUES (?, ?, ?, 'cdr', '')", (i + 1, name, own))
        for i in range(3):
            db.execute(
                "INSERT INTO messages VALUES (NULL, 1, ?, ?)", (200 * 10**9 + i, raw(kind, i))
            )
        db.execute("INSERT INTO messages VALUES (NULL, 2, 7, ?)", (b"\0\1\0\0" + bytes(8),))
    db.close()
    return path


@pytest.mark.parametrize(
    "kind", [KIND, *(pytest.param(k, marks=pytest.mark.slow) for k in MADE if k != KIND)]
)
def test_a_bag_is_read_from_its_folder_and_from_its_file(kind: str, tmp_path: Path) -> None:
    folder = bag(tmp_path, kind)
    for path in (folder, *folder.glob("*.db3")):
        assert recognised(path).name == "rosbag"
        got = read_bag(path, SCALE)
        same(got, MADE[kind][1])
        assert got.source.path == path.name


def test_a_folder_of_mcap_is_the_mcap_in_it(tmp_path: Path) -> None:
    got = read_bag(folder := bag(tmp_path, KIND, StoragePlugin.MCAP), {})
    same(got, MADE[KIND][1])
    (one,) = folder.glob("*.mcap")
    assert got.source == read_all(one, {}).source


def test_types_that_a_bag_only_names_are_those_of_ros_2(tmp_path: Path) -> None:
    """A name with what an address would take for its own (?, #, %), and without an ending."""
    got = read_bag(humbles(tmp_path / "a?b#c%20"), {})
    same(got, MADE[KIND][1])
    assert got.unread["/own"] == "no definition of its type (lab_msgs/msg/Needle)"


def test_a_bag_of_ros_1_is_read(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS1_NOETIC)
    kind = "geometry_msgs/msg/WrenchStamped"
    with Ros1Writer(tmp_path / "x.bag") as writer:
        to = writer.add_connection("/x", kind, typestore=store)
        for i in range(3):
            sent = MADE[KIND][0](i)
            head = store.types["std_msgs/msg/Header"](i, sent.header.stamp, sent.header.frame_id)
            made = store.types[kind](head, sent.wrench)
            writer.write(to, 200 * 10**9 + i, bytes(store.serialize_ros1(made, kind)))
    assert recognised(tmp_path / "x.bag").name == "rosbag"
    same(read_bag(tmp_path / "x.bag", {}), MADE[KIND][1])


def test_own_types_are_numbers_by_their_path(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg("float64[2] load\n", "lab_msgs/msg/Cell"))
    with Writer(tmp_path / "bag", version=9) as writer:
        to = writer.add_connection("/cell", "lab_msgs/msg/Cell", typestore=store)
        for i in range(3):
            sent = store.types["lab_msgs/msg/Cell"](np.array([i, 2.5 * i]))
            writer.write(to, 10**9 * i, bytes(store.serialize_cdr(sent, "lab_msgs/msg/Cell")))
    got = read_bag(tmp_path / "bag", {"/cell.load.1": "N"})
    (force,) = got.signals.values()
    assert force.y.ravel().tolist() == [0, 2.5, 5.0]
    assert force.unit == "N"


def test_what_is_left_in_a_log_or_cut_off_is_told(tmp_path: Path) -> None:
    path = humbles(tmp_path / "x.db3")
    (tmp_path / "x.db3-wal").write_bytes(b"some")
    with pytest.raises(RecordingError, match=r"4 bytes.*x.db3-wal.*sqlite3 x.db3"):
        read_bag(path, {})
    (tmp_path / "x.db3-wal").unlink()
    whole = path.read_bytes()
    path.write_bytes(whole[:-5000])
    with pytest.raises(RecordingError, match=rf"bytes, .* {len(whole)}: truncated"):
        read_bag(path, {})


def split(folder: Path, storage: StoragePlugin, name: str) -> Path:
    """A bag in two files, as rosbag2 splits one that grows too large."""
    first = bag(folder, KIND, storage)
    (part,) = (file for file in first.iterdir() if file.suffix != ".yaml")
    for i in range(2):
        (first / f"{name}_{i}{part.suffix}").write_bytes(part.read_bytes())
    part.unlink()
    yaml = first / "metadata.yaml"
    names = [f"{name}_{i}{part.suffix}" for i in range(2)]
    told = yaml.read_text()
    assert f"- {part.name}\n" in told
    for line in [line for line in told.splitlines() if line.endswith(f"- {part.name}")]:
        told = told.replace(line, "\n".join(line.replace(part.name, f"'{n}'") for n in names))
    yaml.write_text(told)
    return first


@pytest.mark.parametrize("storage", [StoragePlugin.SQLITE3, StoragePlugin.MCAP])
def test_a_bag_of_which_a_file_is_missing_is_refused(
    storage: StoragePlugin, tmp_path: Path
) -> None:
    """Not read as far as it is there, as one of MCAP was."""
    whole = split(tmp_path, storage, "a b")
    assert all(len(signal.t) == 6 for signal in read_bag(whole, {}).signals.values())
    (missing,) = whole.glob("a b_1.*")
    missing.unlink()
    with pytest.raises(RecordingError, match=f"names 2 files, but {missing.name} is missing"):
        read_bag(whole, {})


@pytest.mark.parametrize("storage", [StoragePlugin.SQLITE3, StoragePlugin.MCAP])
def test_messages_that_are_compressed_one_by_one_are_read(
    storage: StoragePlugin, tmp_path: Path
) -> None:
    """By the folder; of a database alone that is said, which was called damaged."""
    writer = Writer(tmp_path / "bag", version=9, storage_plugin=storage)
    writer.set_compression(CompressionMode.MESSAGE, CompressionFormat.ZSTD)
    with writer:
        to = writer.add_connection("/x", KIND.replace("/", "/msg/"), typestore=STORE)
        for i in range(3):
            writer.write(to, 200 * 10**9 + i, raw(KIND, i))
    same(read_bag(tmp_path / "bag", {}), MADE[KIND][1])
    for file in (tmp_path / "bag").glob("*.db3"):
        with pytest.raises(RecordingError, match=r"message is compressed.*the folder"):
            read_bag(file, {})


def test_a_log_beside_a_database_of_a_folder_is_told(tmp_path: Path) -> None:
    folder = bag(tmp_path, KIND)
    (file,) = folder.glob("*.db3")
    file.with_name(f"{file.name}-wal").write_bytes(b"some")
    with pytest.raises(RecordingError, match="4 bytes are still in"):
        read_bag(folder, {})


def changed(path: Path, by: str) -> None:
    with closing(sqlite3.connect(path)) as db, db:
        db.execute(by)


def test_types_without_a_definition_are_told(tmp_path: Path) -> None:
    """A recorder that did not have a type writes so; by the advice the rest is read."""
    (path,) = bag(tmp_path, KIND).glob("*.db3")
    changed(path, "UPDATE message_definitions SET encoding = 'unknown'")
    with pytest.raises(RecordingError, match=r"types without a definition.*DELETE FROM"):
        read_bag(path, {})
    changed(path, "DELETE FROM message_definitions WHERE encoding = 'unknown'")
    same(read_bag(path, {}), MADE[KIND][1])
    changed(path, "UPDATE topics SET type = 'lab_msgs/msg/Own'")
    with pytest.raises(RecordingError, match=r"1 types: /x.*lab_msgs/msg/Own"):
        read_bag(path, {})


def test_a_database_of_another_kind_is_called_so(tmp_path: Path) -> None:
    with sqlite3.connect(tmp_path / "x.db") as db:
        db.execute("CREATE TABLE runs(force REAL)")
    db.close()
    with pytest.raises(UsageError, match=r"\(not.*bag\).*> x.csv"):
        recognised(tmp_path / "x.db")


def test_import_of_a_bag_by_the_command(tmp_path: Path) -> None:
    code, said, err = here("import", str(bag(tmp_path, KIND)), "-o", str(tmp_path / "y.mcap"))
    assert code == 0, err
    assert "read as rosbag" in said + err
    same(read_recording(tmp_path / "y.mcap"), MADE[KIND][1])


def test_another_missing_key_is_no_missing_definition(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Reader:
        def __init__(self, path: Path) -> None: ...

        def open(self) -> None:
            raise KeyError(self.missing)

    (tmp_path / "x.db3").write_bytes(b"SQLite format 3\0")
    monkeypatch.setattr("rosbags.rosbag2.Reader", Reader)
    for missing, raised in (("topics", KeyError), ("unknown", RecordingError)):
        monkeypatch.setattr(Reader, "missing", missing, raising=False)
        folder = tmp_path / missing
        folder.mkdir()
        with (
            pytest.raises(raised, match=r"topics|types without a definition"),
            rosbag._opened(tmp_path / "x.db3", folder),
        ):
            pass


def test_a_bag_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="nowhere: no such file or folder"):
        read_bag(tmp_path / "nowhere", {})
