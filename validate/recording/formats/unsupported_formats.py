"""Formats without a reader, and the command that converts each to one that has a reader.

Known by their first bytes, never by their names: one line in place of "not recognised".
"""

from pathlib import Path

from validate.recording.reader import head

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
        return _folder(path)
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


def _folder(folder: Path) -> str:
    """A folder of bags, or of scans."""
    name = folder.resolve().name
    if dicom := sorted(p.name for p in folder.glob("*.dcm")):
        return (
            f"{name} is a folder of DICOM files, read one by one: validate import {name}/{dicom[0]}"
        )
    if bags := sorted(p.name for kind in ("db3", "mcap") for p in folder.glob(f"*.{kind}")):
        return (
            f"{name} holds {'bags of ROS 2' if bags[0].endswith('db3') else 'MCAP files'} without "
            f"metadata.yaml of rosbag2; name one: validate import {name}/{bags[0]}"
        )
    return ""
