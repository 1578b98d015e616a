"""The contract of `validate.testing` over every reader, and which reader a file is given to."""

import json
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path

import cv2
import ezc3d
import nrrd
import numpy as np
import openpyxl
import pytest
import xlwt
from exports import rows
from mcap_samples import sample_recording
from PIL import Image
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.uid import ExplicitVRLittleEndian
from rosbags.rosbag2 import Writer
from rosbags.typesys import Stores, get_typestore
from scipy.io import savemat
from sequences import tracked

from validate.errors import RecordingError, UsageError, ValidateError
from validate.recording.images.image import encode_png
from validate.recording.mcap.write import write_recording
from validate.recording.preflight import Inspection
from validate.recording.reader import Reader
from validate.recording.readers import READERS, in_order, named, recognised
from validate.recording.types import Signal
from validate.testing.pulled_cube import refusal
from validate.testing.readers import (
    ReaderSample,
    reader_contract,
    refuses_a_truncated_file,
    refuses_random_bytes,
)

pytestmark = pytest.mark.usefixtures("decoded_here")


def make_mcap(path: Path) -> None:
    write_recording(sample_recording(), path)


def make_export(path: Path) -> None:
    path.write_text("Time (s),Compressive extension (mm),Load (N)\n" + rows())


def make_rosbag(path: Path) -> None:
    store = get_typestore(Stores.ROS2_HUMBLE)
    stamp, point = (
        store.types[f"{n}"] for n in ("builtin_interfaces/msg/Time", "geometry_msgs/msg/Point")
    )
    header, kind = store.types["std_msgs/msg/Header"], "geometry_msgs/msg/PointStamped"
    with Writer(f"{path}.bag", version=9) as writer:
        to = writer.add_connection("/tip", kind, typestore=store)
        for i in range(3):
            sent = store.types[kind](header(stamp(i, 0), "lab"), point(0.1 * i, 0.2, 0.3))
            writer.write(to, i * 10**9, bytes(store.serialize_cdr(sent, kind)))
    next(Path(f"{path}.bag").glob("*.db3")).rename(path)
    shutil.rmtree(f"{path}.bag")


def make_xlsx(path: Path) -> None:
    book = openpyxl.Workbook()
    for line in ("Time (s),Compressive extension (mm),Load (N)\n" + rows()).splitlines():
        book.active.append([float(c) if c[-1].isdigit() else c for c in line.split(",")])
    book.save(path)


def make_sheets(path: Path) -> None:
    book = xlwt.Workbook()
    sheet = book.add_sheet("Data")
    for i, line in enumerate(["Time (s),Compressive extension (mm),Load (N)", *rows().split()]):
        for k, cell in enumerate(line.split(",")):
            sheet.write(i, k, float(cell) if cell[-1].isdigit() else cell)
    book.save(str(path))


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


def make_trc(path: Path) -> None:
    head = (
        "PathFileType\t4\t(X/Y/Z)\tx.trc\nDataRate\tNumFrames\tNumMarkers\tUnits\n100\t3\t2\tmm\n"
    )
    names = "Frame#\tTime\ttip\t\t\tbase\t\t\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n\n"
    body = [
        f"{i + 1}\t{0.01 * i:.3f}\t" + "\t".join(f"{i + k:.4f}" for k in range(6)) for i in range(3)
    ]
    path.write_text(head + names + "\n".join(body) + "\n")


def make_points(path: Path) -> None:
    head = "time (s),tip_x (mm),tip_y (mm),tip_z (mm),base_x (mm),base_y (mm),base_z (mm)\n"
    body = [f"{0.01 * i:.2f}," + ",".join(f"{i + k:.4f}" for k in range(6)) for i in range(3)]
    path.write_text(head + "\n".join(body) + "\n")


def make_vicon(path: Path) -> None:
    head = (
        "Trajectories\n100\n,,s:tip,,,s:base,,\nFrame,Sub Frame,X,Y,Z,X,Y,Z\n,,mm,mm,mm,mm,mm,mm\n"
    )
    body = [f"{i + 1},0," + ",".join(f"{i + k:.4f}" for k in range(6)) for i in range(3)]
    path.write_text(head + "\n".join(body) + "\n")


def make_qualisys(path: Path) -> None:
    head = "NO_OF_FRAMES\t3\nNO_OF_MARKERS\t2\nFREQUENCY\t100\nMARKER_NAMES\ttip\tbase\n"
    body = ["\t".join(f"{1 + i + k:.4f}" for k in range(6)) for i in range(3)]
    path.write_text(head + "\n".join(body) + "\n")


def make_optitrack(path: Path) -> None:
    head = (
        "Format Version,1.23,Export Frame Rate,100.0,Length Units,Meters\n\n"
        ",Type,Marker,Marker,Marker\n,Name,tip,tip,tip\n,ID,1,1,1\n,,Position,Position,Position\n"
        "Frame,Time (Seconds),X,Y,Z\n"
    )
    body = [f"{i},{0.01 * i:.4f}," + ",".join(f"{i + k:.4f}" for k in range(3)) for i in range(3)]
    path.write_text(head + "\n".join(body) + "\n")


def make_ndi(path: Path) -> None:
    body = [f"{0.02 * i:.3f},{i:.4f},1.0000,2.0000,0.0000,0.0000,0.0000,1.0000" for i in range(3)]
    path.write_text("Time (s),Tx,Ty,Tz,Qx,Qy,Qz,Q0\n" + "\n".join(body) + "\n")


def make_dicom(path: Path) -> None:
    ds = Dataset()
    ds.SOPClassUID, ds.SOPInstanceUID = "1.2.840.10008.5.1.4.1.1.3.1", "1.2.3.4"
    ds.Modality, ds.PhotometricInterpretation, ds.SamplesPerPixel = "US", "MONOCHROME2", 1
    ds.Rows, ds.Columns, ds.NumberOfFrames, ds.FrameTime = 6, 8, 3, 40.0
    ds.BitsAllocated = ds.BitsStored = 8
    ds.HighBit, ds.PixelRepresentation, ds.PixelSpacing = 7, 0, [0.1, 0.2]
    ds.PixelData = np.arange(144, dtype=np.uint8).tobytes()
    ds.file_meta = FileMetaDataset()
    ds.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
    ds.save_as(path, enforce_file_format=True)


def make_qualisys_analog(path: Path) -> None:
    head = "NO_OF_SAMPLES\t4\nFREQUENCY\t1000\nDATA_INCLUDED\tANALOG\nCHANNEL_NAMES\tFx\tFz\n"
    path.write_text(head + "".join(f"{0.1 * i:.3f}\t{i}.5\n" for i in range(4)))


def make_fcsv(path: Path) -> None:
    head = "# Markups fiducial file version = 5.0\n# CoordinateSystem = LPS\n"
    rows = [f"{i},{i}.5,2,3,0,0,0,1,1,1,0,F-{i},,,2,0\n" for i in range(3)]
    path.write_text(head + "".join(rows))


def make_markups(path: Path) -> None:
    points = [{"label": f"F-{i}", "position": [i, 2.0, 3.0]} for i in range(3)]
    lists = [{"type": "Fiducial", "coordinateSystem": "LPS", "controlPoints": points}]
    schema = "https://example.org/markups-schema-v1.0.3.json#"
    path.write_text(json.dumps({"@schema": schema, "markups": lists}))


def make_video(path: Path) -> None:
    code = cv2.VideoWriter.fourcc(*"MJPG")
    video = cv2.VideoWriter(f"{path}.avi", cv2.CAP_FFMPEG, code, 25.0, (32, 24))
    for i in range(3):
        video.write(np.full((24, 32, 3), 60 * i, np.uint8))
    video.release()
    Path(f"{path}.avi").rename(path)


def make_images(path: Path) -> None:
    path.mkdir()
    for i, kind in enumerate((".jpg", ".tif", ".bmp")):
        image = np.random.default_rng(i).integers(0, 255, (9, 8)).astype(np.uint8)
        Image.fromarray(image).save(path / f"f{i}{kind}")


KINDS = ["domain", "domain", "list"]
MAKE: Mapping[str, tuple[Callable[[Path], None], Mapping[str, str]]] = {
    "mcap": (make_mcap, {}),
    "rosbag": (make_rosbag, {}),
    "c3d": (make_c3d, {}),
    "trc": (make_trc, {}),
    "vicon": (make_vicon, {}),
    "points": (make_points, {}),
    "qualisys": (make_qualisys, {}),
    "optitrack": (make_optitrack, {}),
    "ndi": (make_ndi, {}),
    "qualisys-analog": (make_qualisys_analog, {}),
    "fcsv": (make_fcsv, {}),
    "dicom": (make_dicom, {}),
    "markups": (make_markups, {}),
    "metaimage": (make_metaimage, {}),
    "nrrd": (make_nrrd, {}),
    "instron": (make_export, {}),
    "xlsx": (make_xlsx, {}),
    "sheets": (make_sheets, {}),
    "matlab": (make_matlab, {"unit": "0.4um"}),
    "png-stack": (make_stack, {"m_per_px": "1e-4", "rate": "10"}),
    "image-stack": (make_images, {"m_per_px": "1e-4", "rate": "10"}),
    "video": (make_video, {"m_per_px": "1e-4"}),
}
#: Written line by line: what a program that was ended left of the last line is left out, and said.
LINEWISE = ("trc", "vicon", "qualisys", "qualisys-analog", "optitrack", "ndi", "points")
EACH = pytest.mark.parametrize("reader", READERS, ids=lambda r: r.name)


def sample(reader: Reader, folder: Path) -> tuple[Path, Mapping[str, str]]:
    make, options = MAKE[reader.name]
    make(folder / "sample")
    return folder / "sample", options


def files_of(path: Path) -> list[Path]:
    return sorted(path.iterdir()) if path.is_dir() else [path]


SLOW = (refuses_a_truncated_file, refuses_random_bytes)


@EACH
@pytest.mark.parametrize(
    "check",
    [pytest.param(c, marks=[pytest.mark.slow] if c in SLOW else []) for c in reader_contract],
    ids=lambda check: check.__name__,
)
def test_a_reader_keeps_its_contract(
    check: Callable[[ReaderSample, Path], None], reader: Reader, tmp_path: Path
) -> None:
    make, options = MAKE[reader.name]
    check(ReaderSample(reader, make, options, linewise=reader.name in LINEWISE), tmp_path)


@EACH
def test_it_alone_recognises_its_files(reader: Reader, tmp_path: Path) -> None:
    path, _ = sample(reader, tmp_path)
    claimed = [r.name for r in in_order() if r.recognises(path)]
    assert claimed[0] == reader.name
    assert {*claimed[1:]} <= {"points", "instron"}  # any table may be one of points, or a machine's
    assert recognised(path) is reader is named(reader.name)


def test_a_folder_without_images_is_no_stack(tmp_path: Path) -> None:
    path, options = sample(named("png-stack"), tmp_path)
    for file in files_of(path):
        file.unlink()
    assert "no *.png files" in refusal(lambda: named("png-stack").read(path, options))
    assert not named("png-stack").recognises(path)
    shutil.rmtree(path)


def test_what_no_reader_recognises_names_them_all(tmp_path: Path) -> None:
    (tmp_path / "x").write_bytes(bytes(range(32)))
    with pytest.raises(
        UsageError,
        match=r"format .* mcap, .* ndi, .* instron",
    ):
        recognised(tmp_path / "x")
    with pytest.raises(UsageError, match="no such file"):
        recognised(tmp_path / "absent")
    with pytest.raises(UsageError, match="unknown kind 'instrom'; nearest: instron"):
        named("instrom")


@pytest.mark.parametrize("first", ["APO-Zentrum;8", '"Procédure";"x"', "\tProbe"])
def test_text_with_a_p_as_its_second_letter_is_no_c3d(first: str, tmp_path: Path) -> None:
    """The key of C3D, 80, is that letter: such exports were called a damaged C3D."""
    (tmp_path / "x").write_text(f"{first}\nTime (s),Force (N)\n" + rows(), encoding="utf-8")
    assert recognised(tmp_path / "x").name == "instron"


def test_an_export_in_utf_16_is_text(tmp_path: Path) -> None:
    (tmp_path / "x").write_text("Time (s),力 (N)\n" + rows(), encoding="utf-16")
    assert recognised(tmp_path / "x").name == "instron"


def test_the_pre_flight_check_of_another_format_says_how_to_import_it(tmp_path: Path) -> None:
    path, _ = sample(named("instron"), tmp_path)
    with pytest.raises(ValidateError, match=r"validate import sample -o sample\.mcap"):
        Inspection.of(path)


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


@pytest.mark.parametrize(
    ("first", "said"),
    [
        (b"SQLite format 3\0", "an SQLite database.*sqlite3 -header -csv x.dat"),
        (b"GIF89a", "a GIF.*ffmpeg -i x.dat"),
        (b"TDSm", "LabVIEW.*CSV"),
        (b"\x93NUMPY", r"a NumPy array.*savemat\('x.mat', dict\(x=numpy.load\('x.dat'\)\)\)"),
        (b"PK\3\4" + bytes(26) + b"V.npy", r"of NumPy arrays.*dict\(numpy.load\('x.dat'\)\)\)"),
        (b"PK\3\4" + bytes(26) + b"V.txt", "a ZIP archive.*unzip x.dat -d x"),
        (b"\x28\xb5\x2f\xfd", "Zstandard.*unzstd -k x.dat -o x; for a ROS bag"),
    ],
)
def test_a_file_that_is_known_but_not_read_is_called_so(
    tmp_path: Path, first: bytes, said: str
) -> None:
    (tmp_path / "x.dat").write_bytes(first + bytes(64))
    with pytest.raises(UsageError, match=said):
        recognised(tmp_path / "x.dat")


@pytest.mark.parametrize("kind", ["db3", "mcap"])
def test_a_folder_of_bags_without_its_metadata_names_one(kind: str, tmp_path: Path) -> None:
    (tmp_path / f"x_0.{kind}").touch()
    with pytest.raises(UsageError, match=rf"validate import .*/x_0\.{kind}"):
        recognised(tmp_path)
