"""The fields of a guest's answer: `fields.npz`, or .vtu files listed in `fields.pvd`."""

import stat
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats
from validate.errors import RecordingError, UsageError, ValidateError
from validate.files import npz_arrays
from validate.recording.formats.apart import decoded
from validate.solve.guests.job import GuestJob
from validate.solve.guests.ran import plain

_HEADER_BYTES = 4096
_NUMBER_BYTES = 32  # of a number in a .vtu, as text
_LIST_BYTES = 1_000_000
_SAME = 1e-9  # of the body's size: points that are the job's
_SECONDS = 300  # of reading a series, whose files are beside the list


class NoAnswerError(ValidateError):
    """Files that are no answer to the job."""


def fields_of(folder: Path, job: GuestJob) -> dict[str, NDArray[Any]]:
    """t (k,), u (k, n, 3) and, where given, reactions of that shape, with k at most the job's."""
    npz, pvd = folder / "fields.npz", folder / "fields.pvd"
    if pvd.exists() and not npz.exists():
        return _shaped(_series(pvd, job), pvd.name, job)
    return _shaped(_arrays(npz, job), npz.name, job)


def _series(path: Path, job: GuestJob) -> dict[str, NDArray[Any]]:
    """Of the files beside the list, whose points are the job's nodes in their order."""
    regular(path, _LIST_BYTES)
    mesh = job.scene.mesh
    most = _NUMBER_BYTES * (4 * mesh.nodes.size + 2 * mesh.cells.size) + _LIST_BYTES
    for file in sorted(path.parent.glob("*.vtu")):
        regular(file, max(most, (path.parent / "mesh.vtu").stat().st_size))
    try:
        found = decoded("validate.scene.vtu_series", path, None, _SECONDS)
    except (RecordingError, UsageError) as error:
        raise NoAnswerError(plain(str(error))) from None
    points = found.pop("points")
    slack = _SAME * float(np.ptp(mesh.nodes, axis=0).max())
    if points.shape != mesh.nodes.shape or np.abs(points - mesh.nodes).max() > slack:
        raise NoAnswerError(
            f"{path.name}: {len(points)} points that differ from the {len(mesh.nodes)} nodes "
            "of the job's mesh; expected its nodes at rest in the same order"
        )
    return found


def _arrays(path: Path, job: GuestJob) -> dict[str, NDArray[Any]]:
    nodes, most = job.scene.mesh.nodes.size, len(job.times)
    room = 8 * most * (2 * nodes + 1) + 3 * _HEADER_BYTES
    regular(path, room + _HEADER_BYTES)
    try:
        found = npz_arrays(path, room)
    except RecordingError as error:
        raise NoAnswerError(plain(str(error))) from None
    wanted = [name for name in ("t", "u", "reactions") if name in found]
    return {name: _number_array(found[name], name) for name in wanted}


def _shaped(found: dict[str, NDArray[Any]], file: str, job: GuestJob) -> dict[str, NDArray[Any]]:
    """Raises `NoAnswerError` for arrays that are missing or of other shapes than the job's."""
    if not {"t", "u"} <= set(found):
        raise NoAnswerError(f"{file}: arrays {sorted(found)}, expected t and u")
    k = len(np.atleast_1d(found["t"]))
    for name, array in found.items():
        shape = (k,) if name == "t" else (k, *job.scene.mesh.nodes.shape)
        if array.shape != shape or k > len(job.times):
            raise NoAnswerError(f"{file}: {name} of shape {array.shape}, expected {shape}")
    return found


def _number_array(array: NDArray[Any], name: str) -> Floats:
    if array.dtype.kind not in "fiu":
        raise NoAnswerError(f"fields.npz: {name} of type {array.dtype}, expected numbers")
    return array.astype(np.float64)


def regular(path: Path, most: int) -> Path:
    """The path of an ordinary file of so many bytes: no link, pipe or device is opened."""
    try:
        found = path.lstat()
    except OSError:
        raise NoAnswerError(f"{path.name} was not written") from None
    if not stat.S_ISREG(found.st_mode) or found.st_size > most:
        raise NoAnswerError(
            f"{path.name}: {found.st_size} bytes: expected an ordinary file of at most {most} bytes"
        )
    return path
