"""Files that laboratories have and no reader takes, and the command by which one does.

Known by their first bytes, never by their names: one line in place of "not recognised".
"""

from pathlib import Path

from validate.recording.reader import head

_FFMPEG = "ffmpeg -i {name} -c:v libx264 -crf 0 {stem}.mp4"
_BAG = "pip install rosbags; rosbags-convert --src {where} --dst {stem}_mcap --dst-storage mcap"
_FIRST: tuple[tuple[bytes, str, str], ...] = (
    (b"#ROSBAG V", "a ROS 1 bag", _BAG),
    (b"SQLite format 3\0", "an SQLite database (as of rosbag2)",
     _BAG),
    (b"TDSm", "a TDMS file of LabVIEW",
     "export it as CSV, as by npTDMS: `tdmsinfo`, `TdmsFile(...).as_dataframe().to_csv(...)`"),
    (b"GIF8", "a GIF", _FFMPEG),
    (b"\x30\x26\xb2\x75\x8e\x66\xcf\x11", "a video of Windows Media", _FFMPEG),
    (b"\0\0\1\xba", "a video (MPEG)", _FFMPEG),
    (b"\0\0\1\xb3", "a video (MPEG)", _FFMPEG),
    (b"\x89HDF", "an HDF5 file that is none of MATLAB",
     "save its arrays, as by h5py and `scipy.io.savemat('{stem}.mat', ...)`"),
    (b"FLV\1", "a video (Flash)", _FFMPEG),
    (b"\x1f\x8b", "packed by gzip", "gunzip -k {name}"),
    (b"PK\3\4", "a ZIP archive", "unzip {name} -d {stem}, then name the folder or a file in it"),
    (b"7z\xbc\xaf\x27\x1c", "a 7z archive", "unpack it and name the file or folder in it"),
    (b"Rar!", "a RAR archive", "unpack it and name the file or folder in it"),
    (b"%PDF", "a PDF", "export the numbers as CSV from the program that drew it"),
)  # fmt: skip


def known_unread(path: Path) -> str:
    """What a path is that no reader takes, and what to do; empty where nothing shows."""
    if path.is_dir():
        return _folder(path)
    first = head(path, 16)
    where = path.resolve().parent.name if first.startswith(b"SQLite") else path.name
    return next(
        (
            f"{path.name} is {what}, which is not read here; make it one that is: "
            + how.format(name=path.name, stem=path.stem, where=where)
            for magic, what, how in _FIRST
            if first.startswith(magic)
        ),
        "",
    )


def _folder(folder: Path) -> str:
    """A folder as rosbag2 writes it, or of scans."""
    name = folder.resolve().name
    mcap = sorted(p.name for p in folder.glob("*.mcap"))
    if mcap and (folder / "metadata.yaml").is_file():  # else logs beside what became of them
        return (
            f"{name} is a folder of recordings (MCAP); name one: validate import {name}/{mcap[0]}"
        )
    if dicom := sorted(p.name for p in folder.glob("*.dcm")):
        return (
            f"{name} is a folder of DICOM files, read one by one: validate import {name}/{dicom[0]}"
        )
    if any(folder.glob("*.db3")):
        how = _BAG.format(where=name, stem=name)
        return f"{name} is a ROS 2 bag (SQLite), which is not read here; make it MCAP: {how}"
    return ""
