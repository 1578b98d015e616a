"""Every reader under attack: a recording that can be written, or one typed line with the file.

A decoder in a subprocess costs 0.3 s a call: its readers get fewer cuts and flips, and
`benchmarks/robust.py` makes many more of each.
"""

import os
from collections.abc import Mapping
from pathlib import Path

import pytest
from attacks import damaged
from click.testing import CliRunner
from test_readers import EACH, MAKE, files_of, make_c3d, make_metaimage, make_vicon, sample

from validate.commands.main import cli, run
from validate.errors import RecordingError, UsageError, ValidateError
from validate.recording.mcap.write import write_recording
from validate.recording.reader import Reader
from validate.recording.readers import READERS, named, read_recording, recognised, told_apart

APART = ("rosbag", "c3d", "dicom", "nrrd", "matlab", "xlsx", "sheets", "video", "image-stack")
IN_PROCESS = pytest.mark.parametrize(
    "reader", [r for r in READERS if r.name not in APART], ids=lambda r: r.name
)
# These tests are long: each reader may go to another worker.
APIECE = pytest.mark.parametrize("reader", [
    pytest.param(r, id=r.name, marks=pytest.mark.xdist_group(f"damaged {r.name}")) for r in READERS
])  # fmt: skip
SPARSE = 4 * 2**30  # bytes


def attacked(reader: Reader, path: Path, options: Mapping[str, str], name: str) -> None:
    """What it reads can be written; what it refuses is one line that can be shown."""
    try:
        write_recording(reader.read(path, options), path.parent / "out.mcap")
    except ValidateError as error:
        said = str(error)
        assert said.isprintable()
        assert name in said or "out.mcap" in said


def under_attack(reader: Reader, folder: Path, cuts: int, flips: int) -> None:
    path, options = sample(reader, folder)
    for file in files_of(path)[:1]:
        for data in damaged(file.read_bytes(), cuts, flips):
            file.write_bytes(data)
            attacked(reader, path, options, file.name)
    assert {p.name for p in folder.iterdir()} <= {"sample", "out.mcap"}


@IN_PROCESS
def test_some_cuts_and_flips_are_a_recording_or_one_line(reader: Reader, tmp_path: Path) -> None:
    under_attack(reader, tmp_path, cuts=10, flips=20)


@pytest.mark.slow
@APIECE
def test_cuts_and_flips_are_a_recording_or_one_line(reader: Reader, tmp_path: Path) -> None:
    cuts, flips = (4, 16) if reader.name in APART else (60, 600)
    under_attack(reader, tmp_path, cuts, flips)


@EACH
@pytest.mark.parametrize("headed", [False, True])
def test_four_gigabytes_of_zeros_are_refused(reader: Reader, headed: bool, tmp_path: Path) -> None:
    """With the beginning of a good file before them, too: nothing reads to their end."""
    path, options = sample(reader, tmp_path)
    zeros = tmp_path / "zeros"
    zeros.write_bytes(path.read_bytes() if headed and path.is_file() else b"")
    os.truncate(zeros, SPARSE)
    with pytest.raises(ValidateError, match="zeros"):
        reader.read(zeros, options)
    assert headed or not reader.recognises(zeros)


@EACH
@pytest.mark.parametrize("what", ["loop", "pipe", "device", "long", "nul", "newline"])
def test_what_is_no_file_is_one_line(reader: Reader, what: str, tmp_path: Path) -> None:
    """A pipe and a device are not opened: they would not end."""
    _, options = MAKE[reader.name]
    path = {
        "loop": tmp_path / "loop", "pipe": tmp_path / "pipe", "device": Path("/dev/zero"),
        "long": tmp_path / ("x" * 300), "nul": tmp_path / "a\0b", "newline": tmp_path / "a\nb",
    }[what]  # fmt: skip
    if what == "loop":
        path.symlink_to(path)
    if what == "pipe":
        os.mkfifo(path)
    assert not reader.recognises(path)
    with pytest.raises(ValidateError) as raised:
        reader.read(path, options)
    assert str(raised.value).isprintable()


@EACH
@pytest.mark.slow
def test_a_wrong_extension_and_an_odd_name_change_nothing(reader: Reader, tmp_path: Path) -> None:
    path, options = sample(reader, tmp_path)
    plain = reader.read(path, options)
    for name in ("Gewebe 力 é.mcap", "-o\nb.c3d"):  # the second is wrong for MCAP, too
        other = path.rename(tmp_path / name)
        assert recognised(other) is reader
        got = reader.read(other, options)
        assert got.streams.keys() == plain.streams.keys()
        write_recording(got, tmp_path / "out.mcap")
        path = other


@pytest.mark.parametrize("reader", [r for r in READERS if r is not named("mcap")],
                         ids=lambda r: r.name)  # fmt: skip
def test_where_mcap_is_expected_another_format_is_called_by_its_name(
    reader: Reader, tmp_path: Path
) -> None:
    path, _ = sample(reader, tmp_path)
    with pytest.raises(RecordingError) as raised:
        read_recording(path)
    said = str(raised.value)
    assert reader.doc in said
    assert "validate import sample -o sample.mcap" in said


def test_a_log_given_for_a_recording_is_not_called_a_damaged_one(tmp_path: Path) -> None:
    """It was to be copied again from its source."""
    (tmp_path / "log.csv").write_text("Time (s),Extension (mm),Load (N)\n0,0,0\n", "utf-8")
    with pytest.raises(RecordingError) as raised:
        read_recording(tmp_path / "log.csv")
    assert "copy" not in str(raised.value)
    assert "validate import log.csv -o log.mcap" in str(raised.value)


def test_every_command_calls_a_c3d_a_c3d(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    make_c3d(tmp_path / "x.c3d")
    file, out = str(tmp_path / "x.c3d"), str(tmp_path / "y.mcap")
    says = "x.c3d is motion capture (C3D): validate import x.c3d -o x.mcap"
    assert told_apart(tmp_path / "x.c3d") == says
    own = ["new", "own", "--from", file, "-o", str(tmp_path / "own.py")]
    for argv in (["run", file], ["compare", file], ["merge", file, "-o", out], own):
        assert run(argv) == 2
        assert capsys.readouterr().err == f"validate: {says}\n"
    assert run(["inspect", file]) == 0
    assert "read as c3d (motion capture (C3D))" in capsys.readouterr().out
    assert [p.name for p in tmp_path.iterdir()] == ["x.c3d"]


def test_a_failed_import_leaves_nothing(tmp_path: Path) -> None:
    make_c3d(tmp_path / "x.c3d")
    with (tmp_path / "x.c3d").open("r+b") as file:
        file.truncate(700)
    (tmp_path / "y.mcap").write_bytes(b"old")
    argv = ["import", str(tmp_path / "x.c3d"), "-o", str(tmp_path / "y.mcap")]
    assert isinstance(CliRunner().invoke(cli, argv).exception, ValidateError)
    assert {p.name for p in tmp_path.iterdir()} == {"x.c3d", "y.mcap"}
    assert (tmp_path / "y.mcap").read_bytes() == b"old"


def test_what_a_file_holds_cannot_write_to_a_terminal() -> None:
    assert str(RecordingError("a\x1b[2Jb\nc\udcff")) == "a\\x1b[2Jb c\\udcff"
    assert str(UsageError("Gewebe 力: 3 µm")) == "Gewebe 力: 3 µm"


def test_a_vicon_file_without_a_title_is_one_line(tmp_path: Path) -> None:
    make_vicon(tmp_path / "x")
    (tmp_path / "x").write_bytes((tmp_path / "x").read_bytes().replace(b"Traj", b"Trax"))
    with pytest.raises(RecordingError, match="neither trajectories nor devices"):
        named("vicon").read(tmp_path / "x", {})


def test_a_metaimage_whose_last_key_goes_on_is_one_line(tmp_path: Path) -> None:
    make_metaimage(tmp_path / "x")
    whole = (tmp_path / "x").read_bytes()
    (tmp_path / "x").write_bytes(whole.replace(b"ElementDataFile", b"ElementDataFilf"))
    with pytest.raises(RecordingError, match="does not end with 'ElementDataFile"):
        named("metaimage").read(tmp_path / "x", {})
    (tmp_path / "x").write_bytes(whole.replace(b"ElementDataFile", b"ElementDataFileX"))
    with pytest.raises(RecordingError, match="does not end with 'ElementDataFile"):
        named("metaimage").read(tmp_path / "x", {})


def test_a_time_that_is_blank_names_the_file(tmp_path: Path) -> None:
    make_vicon(tmp_path / "x")
    (tmp_path / "x").write_bytes((tmp_path / "x").read_bytes().replace(b"\n3,0", b"\nnan,0"))
    with pytest.raises(RecordingError, match=r"^x: markers t"):
        named("vicon").read(tmp_path / "x", {})


@pytest.mark.parametrize("reader", [named("trc"), named("qualisys")], ids=lambda r: r.name)
def test_a_count_in_raised_digits_is_no_bug(reader: Reader, tmp_path: Path) -> None:
    """They are digits, but no number to `int`."""
    path, options = sample(reader, tmp_path)
    whole = path.read_bytes()
    for stated in (b"MARKERS\t2", b"\t2\tmm"):
        path.write_bytes(whole.replace(stated, stated.replace(b"2", "²".encode())))
        attacked(reader, path, options, "sample")
