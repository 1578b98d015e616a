"""Every format that names other files follows them inside its own folder, and reads no pipe."""

import os
import re
from collections.abc import Callable
from pathlib import Path

import cv2
import h5py
import numpy as np
import pytest
from command_line import refused
from test_readers import make_dicom, make_rosbag

SECRET = bytes(range(64)) * 64


def nrrd(name: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        header = f"NRRD0005\ntype: uint8\ndimension: 3\nsizes: 8 8 4\nencoding: raw\n{name}\n\n"
        (folder / "x.nhdr").write_text(header)
        return folder / "x.nhdr"

    return make


def mha(name: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        (folder / "x.mha").write_text(
            "ObjectType = Image\nNDims = 3\nDimSize = 8 8 4\nElementType = MET_UCHAR\n"
            f"ElementDataFile = {name}\n"
        )
        return folder / "x.mha"

    return make


def pictures(odd: Callable[[Path], object]) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        images = folder / "images"
        images.mkdir()
        for i in range(2):
            cv2.imwrite(str(images / f"{i}.png"), np.zeros((8, 8), np.uint8))
        odd(images / "2.png")
        return images

    return make


def outside(path: Path) -> None:
    """A link to a good picture that lies elsewhere."""
    there = path.parents[2] / "elsewhere.png"
    cv2.imwrite(str(there), np.zeros((8, 8), np.uint8))
    path.symlink_to(there)


def bag(folder: Path) -> Path:
    """A folder of rosbag2 whose database lies elsewhere, with a link in its place."""
    place = folder / "bag"
    place.mkdir()
    make_rosbag(folder.parent / "elsewhere.db3")
    (place / "bag_0.db3").symlink_to(folder.parent / "elsewhere.db3")
    (place / "metadata.yaml").write_text(
        "rosbag2_bagfile_information:\n  relative_file_paths:\n    - bag_0.db3\n"
    )
    return place


def series(folder: Path) -> Path:
    """A folder of DICOM, one of whose files lies elsewhere."""
    place = folder / "series"
    place.mkdir()
    make_dicom(place / "a.dcm")
    make_dicom(folder.parent / "b.dcm")
    (place / "b.dcm").symlink_to(folder.parent / "b.dcm")
    return place


ODD = {
    "nrrd absolute": (nrrd("data file: {secret}"), "is outside its folder"),
    "nrrd above": (nrrd("data file: ../secret"), "is outside its folder"),
    "nrrd link": (nrrd("data file: link"), "'link' is outside its folder"),
    "nrrd old key": (nrrd("datafile: ../secret"), "is outside its folder"),
    "nrrd list": (nrrd("data file: LIST"), "cannot be read"),
    "nrrd pipe": (nrrd("data file: pipe"), "a folder, pipe or device"),
    "mha absolute": (mha("{secret}"), "is outside its folder"),
    "mha above": (mha("../secret"), "is outside its folder"),
    "mha link": (mha("link"), "'link' is outside its folder"),
    "mha list": (mha("LIST"), "one file in the same folder is read"),
    "mha pattern": (mha("%03d.raw 1 4 1"), "one file in the same folder is read"),
    "mha pipe": (mha("pipe"), "a folder, pipe or device"),
    "images pipe": (pictures(os.mkfifo), r"2\.png: a folder, pipe or device"),
    "images zero": (pictures(lambda p: p.symlink_to("/dev/zero")), "'2.png' is outside"),
    "images link": (pictures(outside), "'2.png' is outside its folder 'images'"),
    "bag link": (bag, "'bag_0.db3' is outside its folder 'bag'"),
    "dicom link": (series, "'b.dcm' is outside its folder 'series'"),
}


@pytest.mark.parametrize("case", ODD)
def test_it_is_one_line_and_nothing_is_copied(case: str, tmp_path: Path) -> None:
    make, why = ODD[case]
    folder = tmp_path / "data"
    folder.mkdir()
    (tmp_path / "secret").write_bytes(SECRET)
    (folder / "link").symlink_to(tmp_path / "secret")
    os.mkfifo(folder / "pipe")
    path = make(folder)
    if path.is_file():
        path.write_text(path.read_text().format(secret=tmp_path / "secret"))
    rate = () if case == "bag link" else ("--rate", "10")  # a bag has its own times
    line = refused("import", str(path), "--m-per-px", "1mm", *rate, "-o", str(tmp_path / "o.mcap"))
    assert re.search(why, line), line
    assert not (tmp_path / "o.mcap").exists()


def test_a_log_folder_s_links_and_pipes_are_refused(tmp_path: Path) -> None:
    folder = tmp_path / "logs"
    folder.mkdir()
    (tmp_path / "secret.csv").write_text("Time (s),Load (N)\n0,0\n1,2\n2,4\n")
    (folder / "a.csv").symlink_to(tmp_path / "secret.csv")
    line = refused("import", str(folder), "-o", str(tmp_path / "o.mcap"))
    assert "'a.csv' is outside its folder 'logs'" in line
    (folder / "a.csv").unlink()
    os.mkfifo(folder / "a.csv")
    assert "a.csv" in refused("import", str(folder), "-o", str(tmp_path / "o.mcap"))


def test_data_of_hdf5_in_other_files_is_not_followed(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "other.h5", "w") as other:
        other["x"] = np.arange(12.0)
    (tmp_path / "raw").write_bytes(np.arange(12.0).tobytes())
    path = tmp_path / "x.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        file["linked"] = h5py.ExternalLink("other.h5", "x")
        file.create_dataset("outer", (12,), "f8", external=[(str(tmp_path / "raw"), 0, 96)])
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file".ljust(126) + b"\x00\x02IM")
    line = refused(
        "import", str(path), "--map", "force=outer:N", "--map", "rate=10", "-o",
        str(tmp_path / "o.mcap"),
    )  # fmt: skip
    assert "outer" in line
    assert not (tmp_path / "o.mcap").exists()
