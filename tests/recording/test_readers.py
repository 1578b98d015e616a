"""One contract over every reader: a checked recording, or one typed error of one line."""

import shutil
from collections.abc import Callable, Mapping
from pathlib import Path

import ezc3d
import nrrd
import numpy as np
import pytest
from exports import rows
from mcap_samples import sample_recording
from scipy.io import savemat
from sequences import tracked

from validate.errors import RecordingError, UsageError, ValidateError
from validate.recording.digest import digest
from validate.recording.images.image import encode_png
from validate.recording.mcap.read import read_recording
from validate.recording.mcap.write import write_recording
from validate.recording.preflight import inspect_recording
from validate.recording.reader import Reader
from validate.recording.readers import READERS, named, recognised
from validate.recording.types import Recording, Signal

LENGTH = 3  # bytes cut off an end: a record, a number and a chunk are incomplete without them


def make_mcap(path: Path) -> None:
    write_recording(sample_recording(), path)


def make_export(path: Path) -> None:
    path.write_text("Time (s),Extension (mm),Load (N)\n" + rows())


def make_stack(path: Path) -> None:
    path.mkdir()
    for i in range(3):
        image = np.random.default_rng(i).integers(0, 255, (9, 7)).astype(np.uint8)
        (path / f"f{i}.png").write_bytes(encode_png(image))


def make_c3d(path: Path) -> None:
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [50.0]
    file["parameters"]["POINT"]["LABELS"]["value"] = ("tip", "base")
    file["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    points = np.ones((4, 2, 16))  # 512 bytes: data up to the file's end
    points[:3] = np.arange(96.0).reshape(3, 2, 16)
    file["data"]["points"] = points
    file.write(f"{path}.c3d")  # it adds the ending where it is missing
    path.write_bytes(Path(f"{path}.c3d").read_bytes().removesuffix(bytes(512)))
    Path(f"{path}.c3d").unlink()


def make_matlab(path: Path) -> None:
    savemat(path, {"points": np.arange(30.0).reshape(10, 3)}, appendmat=False)


def make_metaimage(path: Path) -> None:
    path.write_bytes(tracked())


def make_nrrd(path: Path) -> None:
    own = {f"Seq_Frame000{i}_Timestamp": f"{0.1 * i}" for i in range(3)}
    pixels = np.random.default_rng(0).integers(0, 255, (5, 4, 3)).astype(np.uint8)
    nrrd.write(f"{path}.nrrd", pixels, {"spacings": [0.1, 0.1, 1.0], "kinds": KINDS, **own})
    Path(f"{path}.nrrd").rename(path)


KINDS = ["domain", "domain", "list"]
MAKE: Mapping[str, tuple[Callable[[Path], None], Mapping[str, str]]] = {
    "mcap": (make_mcap, {}),
    "c3d": (make_c3d, {}),
    "metaimage": (make_metaimage, {}),
    "nrrd": (make_nrrd, {}),
    "instron": (make_export, {}),
    "matlab": (make_matlab, {"unit": "0.4um"}),
    "png-stack": (make_stack, {"m_per_px": "1e-4", "rate": "10"}),
}
EACH = pytest.mark.parametrize("reader", READERS, ids=lambda r: r.name)


def sample(reader: Reader, folder: Path) -> tuple[Path, Mapping[str, str]]:
    make, options = MAKE[reader.name]
    make(folder / "sample")
    return folder / "sample", options


def refused(reader: Reader, path: Path, options: Mapping[str, str]) -> str:
    with pytest.raises(ValidateError) as raised:
        reader.read(path, options)
    (line,) = str(raised.value).splitlines()
    return line


def files_of(path: Path) -> list[Path]:
    return sorted(path.iterdir()) if path.is_dir() else [path]


@EACH
def test_it_gives_a_recording_that_can_be_written(reader: Reader, tmp_path: Path) -> None:
    path, options = sample(reader, tmp_path)
    got = reader.read(path, options)
    assert isinstance(got, Recording)
    assert got.streams.keys() == got.clock.keys()
    assert min(s.t[0] for s in got.streams.values()) == 0
    assert got.source.path == "sample"
    assert got.source.integrity
    write_recording(got, tmp_path / "again.mcap")
    assert digest(read_recording(tmp_path / "again.mcap")) == digest(got)


@EACH
def test_it_alone_recognises_its_files(reader: Reader, tmp_path: Path) -> None:
    path, _ = sample(reader, tmp_path)
    assert [r.name for r in READERS if r.recognises(path)] == [reader.name]
    assert recognised(path) is reader is named(reader.name)
    assert reader.doc


@EACH
def test_what_is_not_there_or_of_another_kind_is_one_line(reader: Reader, tmp_path: Path) -> None:
    path, options = sample(reader, tmp_path)
    assert "absent" in refused(reader, tmp_path / "absent", options)
    other = tmp_path / "other"
    if path.is_dir():
        other.write_bytes(b"a file")
    else:
        other.mkdir()
    assert "other" in refused(reader, other, options)
    assert not reader.recognises(other)
    assert not reader.recognises(tmp_path / "absent")


@EACH
def test_an_unknown_option_is_one_line_with_its_name(reader: Reader, tmp_path: Path) -> None:
    path, options = sample(reader, tmp_path)
    assert "--map frobnicate=...: no such key" in refused(
        reader, path, {**options, "frobnicate": ""}
    )


@EACH
@pytest.mark.parametrize("damage", ["empty", "cut", "garbage"])
def test_damage_is_one_line_with_the_name_of_the_file(
    reader: Reader, damage: str, tmp_path: Path
) -> None:
    path, options = sample(reader, tmp_path)
    for file in files_of(path):
        whole = file.read_bytes()
        garbage = np.random.default_rng(len(whole)).bytes(len(whole))
        file.write_bytes({"empty": b"", "cut": whole[:-LENGTH], "garbage": garbage}[damage])
        assert file.name in refused(reader, path, options)
        file.write_bytes(whole)
    reader.read(path, options)


def test_a_folder_without_images_is_no_stack(tmp_path: Path) -> None:
    path, options = sample(named("png-stack"), tmp_path)
    for file in files_of(path):
        file.unlink()
    assert "no *.png files" in refused(named("png-stack"), path, options)
    assert not named("png-stack").recognises(path)
    shutil.rmtree(path)


def test_what_no_reader_recognises_names_them_all(tmp_path: Path) -> None:
    (tmp_path / "x").write_bytes(bytes(range(32)))
    with pytest.raises(
        UsageError, match=r"not recognised .* mcap .* c3d .* instron .* matlab .* png-stack"
    ):
        recognised(tmp_path / "x")
    with pytest.raises(UsageError, match="no such file"):
        recognised(tmp_path / "absent")
    with pytest.raises(UsageError, match="unknown kind 'instrom'; nearest: instron"):
        named("instrom")


def test_an_export_in_utf_16_is_text(tmp_path: Path) -> None:
    (tmp_path / "x").write_text("Time (s),力 (N)\n" + rows(), encoding="utf-16")
    assert recognised(tmp_path / "x").name == "instron"


def test_the_pre_flight_check_of_another_format_says_how_to_import_it(tmp_path: Path) -> None:
    path, _ = sample(named("instron"), tmp_path)
    with pytest.raises(ValidateError, match=r"`validate import sample --as instron -o X\.mcap`"):
        inspect_recording(path)


def test_every_reader_is_in_the_tuple_and_has_a_sample(project_root: Path) -> None:
    """A `Reader` made in a module of the floor and left out of `READERS` fails here."""
    made = sum(
        file.read_text("utf-8").count("= Reader(")
        for file in (project_root / "validate" / "recording").rglob("*.py")
    )
    assert len(READERS) == made == len({r.name for r in READERS})
    assert MAKE.keys() == {r.name for r in READERS}


@pytest.mark.parametrize("sd", [-0.1, np.nan, np.inf])
def test_a_standard_deviation_below_zero_or_none_is_refused(sd: float) -> None:
    with pytest.raises(RecordingError, match="is not a number >= 0"):
        Signal(np.zeros(1), np.zeros((1, 1)), "N", sd, "cell")
