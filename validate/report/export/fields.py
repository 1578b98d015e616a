"""NetCDF-4 files of fields and traces, one per method and recording, read back by xarray.

import validate
u = validate.open_run("silicone_beam").to_xarray("newmark").u  # (frame, node, axis), m
"""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from validate.compare.result import MethodResult, Result
from validate.errors import UsageError
from validate.files import safe_name
from validate.installation import install_command
from validate.parameters import nearest_names

if TYPE_CHECKING:
    from pandas import DataFrame
    from xarray import Dataset

    from validate.solve.types import Run

_SMALL = 10_000  # bytes of an array that is not compressed
Variable = tuple[tuple[str, ...], NDArray[Any], str]  # dimensions, values, unit


def write_fields(result: Result, folder: Path) -> None:
    """Write `<method>.nc`, of later recordings `<method>_2.nc`, ...: all arrays of a run, SI.

    `u` and, where the method knows it, `sd` (frame, node, axis) at the steps `at` (frame,);
    `nodes` (node, axis), `cells` (cell, corner); `trace:<name>` (time,) at every step.
    """
    import h5py  # half a second: only where a run is written

    for method in result.methods:
        for i, run in enumerate(method.runs, start=1):
            with h5py.File(folder / _file(method.name, i), "w") as file:
                file.attrs["experiment"], file.attrs["method"] = result.name, method.name
                _write(file, dict(_variables(method, run)))


def open_fields(folder: Path | str, method: str, recording: int = 1) -> "Dataset":
    """Return the fields and traces of a method on the n-th recording of a stored run, read lazily.

    Every variable has its unit in `attrs["units"]`. Raises `UsageError` without xarray and
    h5netcdf, and for a method or a recording that the run does not have.
    """
    runs = Path(folder) / "runs"
    file = runs / _file(method, recording)
    if not file.is_file():
        known = {f.stem for f in runs.glob("*.nc")}
        raise UsageError(f"no fields of {file.stem} in {runs}; {nearest_names(file.stem, known)}")
    try:
        import h5netcdf  # noqa: F401 (xarray's reader of the file)
        from xarray import open_dataset
    except ImportError:
        raise UsageError(
            f"fields as a Dataset need xarray and h5netcdf: {install_command('tables')}"
        ) from None
    return open_dataset(file, engine="h5netcdf")


def as_dataset(rows: "DataFrame", along: list[str]) -> "Dataset":
    """Return the columns of a table as arrays over the columns `along`, NaN where no row is.

    Raises `UsageError` without xarray.
    """
    try:
        import xarray  # noqa: F401 (pandas makes the Dataset)
    except ImportError:
        raise UsageError(f"a Dataset needs xarray: {install_command('tables')}") from None
    found: Dataset = rows.set_index(along).to_xarray()
    return found


def _file(method: str, recording: int) -> str:
    return safe_name(method) + (f"_{recording}" if recording > 1 else "") + ".nc"


def _variables(method: MethodResult, run: "Run") -> Iterator[tuple[str, Variable]]:
    """Coordinates first: a dimension without numbers of its own counts."""
    mesh = method.scene.mesh
    frame = ("frame", "node", "axis")
    yield "time", (("time",), run.t, "s")
    yield "frame", (("frame",), run.t[run.at], "s")
    counted = {"node": len(mesh.nodes), "cell": len(mesh.cells), "corner": mesh.cells.shape[1]}
    yield from ((name, ((name,), np.arange(n), "1")) for name, n in counted.items())
    yield "axis", (("axis",), np.arange(1, mesh.nodes.shape[1] + 1), "1")
    yield "at", (("frame",), run.at, "1")
    yield "nodes", (("node", "axis"), mesh.nodes, "m")
    yield "cells", (("cell", "corner"), mesh.cells, "1")
    yield "u", (frame, run.u, "m")
    if run.sd is not None:
        yield "sd", (frame, run.sd, "m")
    for name, trace in run.traces.items():
        yield f"trace:{name.replace('/', '_')}", (("time",), trace.y, trace.unit)


def _write(file: Any, variables: dict[str, Variable]) -> None:
    """Arrays with their dimensions as NetCDF-4 has them: scales of HDF5."""
    for name, (dimensions, values, unit) in variables.items():
        large = {"compression": "gzip", "shuffle": True} if values.nbytes > _SMALL else {}
        data = file.create_dataset(name, data=values, **large)
        data.attrs["units"] = unit
        if dimensions == (name,):
            data.make_scale(name)
    for name, (dimensions, _, _) in variables.items():
        if dimensions != (name,):
            for i, dimension in enumerate(dimensions):
                file[name].dims[i].attach_scale(file[dimension])
