"""Arrays of MATLAB files as the streams that a user names: both versions, axes, units, contents."""

import re
from importlib import resources
from pathlib import Path
from typing import Any

import h5py
import hdf5storage
import numpy as np
import pytest
from scipy.io import savemat
from scipy.spatial import ConvexHull

from validate.commands.main import main
from validate.errors import RecordingError, UsageError
from validate.recording.formats import (
    matlab,
    matlab_arrays,
)
from validate.recording.formats import (
    matlab as matlab_named,
)
from validate.recording.formats.matlab import listing, read_matlab
from validate.recording.mcap.read import read_recording
from validate.recording.preflight import inspect_file
from validate.recording.types import Markers, Signal

# private: _times, _unnamed: called alone, case by case.

T = 0.01 * np.arange(5)
LOAD = np.array([0.0, 1.5, -2.25, 3.0, 4.125])
X = np.random.default_rng(3).normal(size=(5, 4, 3))  # times, points, coordinates
IMAGE = np.random.default_rng(4).integers(0, 255, (6, 7, 5)).astype(np.uint8)


def contents() -> dict[str, Any]:
    test = {"t": T[:, None], "load": {"N": LOAD[:, None], "cells": LOAD[None, :] * [[1], [2]]}}
    return {"data": {**test, "X": X, "name": "a test"}, "I": IMAGE, "file": np.eye(4)}


def old(path: Path) -> Path:
    savemat(path, contents(), do_compression=True)
    return path


def new(path: Path) -> Path:
    """By another program's writer of MATLAB 7.3: the file's own axes are turned round."""
    hdf5storage.savemat(str(path), contents(), format="7.3", oned_as="column")
    return path


@pytest.fixture(autouse=True)
def _here(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Decoded in this process, except by the command: one of its own takes half a second."""
    if "command" not in request.node.name and "damaged" not in request.node.name:
        homes = {
            "validate.recording.formats.matlab_arrays": matlab_arrays,
        }
        monkeypatch.setattr(matlab, "decoded", lambda name, path: homes[name].arrays(path))


@pytest.fixture(params=[old, new])
def file(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    return Path(request.param(tmp_path / "x.mat"))


def test_fields_of_structs_come_in_as_they_were_written(file: Path) -> None:
    got = read_matlab(
        file,
        {
            "time": "data.t:s", "force": "data.load.N:kN:-", "cells": "data.load.cells:V",
            "markers": "data.X:mm", "images": "I:px", "m_per_px": "0.1mm", "rate": "100",
            "axes.markers": "tpx",
        },
    )  # fmt: skip
    force = got.signal("force", "N")
    assert force.y.ravel().tolist() == (-1000 * LOAD).tolist()
    assert force.t.tolist() == T.tolist()
    assert got.signal("cells", "V").y.tolist() == [[v, 2 * v] for v in LOAD]
    assert got.marker("markers").x == pytest.approx(X / 1000, rel=1e-15)
    assert [i.tolist() for i in got.frame("images").images] == np.moveaxis(IMAGE, -1, 0).tolist()
    assert got.unread == {"data.name": "char", "file": "(4, 4) float64"}


def test_which_axis_is_which_is_told_by_times_or_asked_for(file: Path) -> None:
    # 5 times: (5, 4, 3) can be only times, points, coordinates
    told = read_matlab(file, {"time": "data.t:s", "m": "data.X:mm"})
    assert told.marker("m").x.shape == (5, 4, 3)
    with pytest.raises(UsageError, match=r"m.*\(5, 4, 3\).*axes.m=tpx"):
        read_matlab(file, {"m": "data.X:mm", "rate": "9"})
    other = read_matlab(file, {"m": "data.X:mm", "rate": "9", "axes.m": "ptx"})
    assert other.marker("m").x.shape == (4, 5, 3)
    one = read_matlab(file, {"m": "file:mm", "rate": "9", "axes.m": "tc"} | {"m": "file:V"})
    assert one.signal("m", "V").y.tolist() == np.eye(4).tolist()
    with pytest.raises(UsageError, match=r"axes.m=txp: an array"):
        read_matlab(file, {"m": "data.X:mm", "rate": "9", "axes.m": "txp"})


@pytest.mark.parametrize(
    ("options", "asks"),
    [
        ({"force": "data.load.N"}, r"has no unit; give it, as --map force=data.load.N:N"),
        ({"force": "data.load.N:N"}, r"force has no times; .*time=PATH:s or --map rate"),
        ({"force": "data.lod.N:N"}, r"is no array; did you mean 'data.load.N'\?"),
        ({"force": "data.name:N"}, r"'data.name' is char, no real numbers"),
        ({"force": "data.load.N:N:+"}, r"expected PATH:UNIT or PATH:UNIT:-"),
        ({"force": "data.load.N:N", "time": "data.t:mm"}, r"expected a vector and a unit of time"),
        ({"force": "I:V", "time": "data.t:s", "unit": "mm"}, r"unit=...: give the unit with each "
                                                             r"named array"),
        ({"m": "data.X:N", "time": "data.t:s"}, r"m: coordinates in 'N'; expected a length"),
        ({"axes.m": "tpx"}, r"axes.m=...: no stream of that name"),
        ({"f": "file:N", "time": "data.t:s"}, r"\(4, 4\) and 5 times do not show"),
        ({}, "has no unit|no array's role|has no unit of length"),
    ],
)  # fmt: skip
def test_what_is_not_said_is_asked_for(file: Path, options: dict[str, str], asks: str) -> None:
    with pytest.raises(UsageError, match=asks):
        read_matlab(file, options)


def test_inspect_lists_the_arrays_before_anything_is_said(file: Path) -> None:
    got = inspect_file(file, None, {})
    assert {t.name: t.kind for t in got.topics} == {
        "data.t": "not read: (5, 1) float64", "data.load.N": "not read: (5, 1) float64",
        "data.load.cells": "not read: (2, 5) float64", "data.X": "not read: (5, 4, 3) float64",
        "data.name": "not read: char", "I": "not read: (6, 7, 5) uint8",
        "file": "not read: (4, 4) float64",
    }  # fmt: skip
    assert got.defects == ()
    assert got.facts[0].startswith("still needed: x.mat: I has no unit of length")
    assert "m_per_px" in got.facts[0]
    with pytest.raises(UsageError, match="is no array"):
        inspect_file(file, "matlab", {"force": "nothing:N"})


@pytest.mark.slow
def test_import_and_inspect_by_the_command(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = file.with_suffix(".mcap")
    said = ["--map", "force=data.load.N:N", "--map", "time=data.t:ms"]
    with pytest.raises(SystemExit, match="0"):
        main(["inspect", str(file), *said])
    assert "force" in capsys.readouterr().out
    with pytest.raises(SystemExit, match="0"):
        main(["import", str(file), "--as", "matlab", "-o", str(out), *said])
    force = read_recording(out).signal("force", "N")
    assert force.y.ravel().tolist() == LOAD.tolist()
    assert force.t == pytest.approx(T / 1000)


def test_what_is_no_array_of_numbers_is_named(tmp_path: Path) -> None:
    """As MATLAB itself lays them out in HDF5: cells and arrays of structs refer elsewhere."""
    with h5py.File(tmp_path / "x.mat", "w", userblock_size=512) as file:
        file["n"] = np.arange(6.0).reshape(2, 3)
        file["n"].attrs["MATLAB_class"] = np.bytes_("double")
        kept = file.create_group("#refs#").create_dataset("a", data=[1.0])
        for name, kind in (("c", "cell"), ("s/f", "double")):
            file.create_dataset(name, data=[[kept.ref]], dtype=h5py.ref_dtype)
            file[name].attrs["MATLAB_class"] = np.bytes_(kind)
        file["s"].attrs["MATLAB_class"] = np.bytes_("struct")
        file["z"] = np.array([[(1.0, 2.0)]], dtype=[("real", "f8"), ("imag", "f8")])
        file["gone"] = np.zeros(2, np.uint64)
        file["gone"].attrs["MATLAB_class"] = np.bytes_("double")
        file["gone"].attrs["MATLAB_empty"] = 1
        file["away"] = h5py.ExternalLink("/etc/passwd", "/x")
        file["back"] = h5py.SoftLink("/")
        file["loop"] = h5py.SoftLink("/loop")
        file.create_dataset("out", (4,), "f8", external=[("/etc/passwd", 0, 32)])
    whole = (tmp_path / "x.mat").read_bytes()
    (tmp_path / "x.mat").write_bytes(b"MATLAB 7.3 MAT-file".ljust(512) + whole[512:])
    got = inspect_file(tmp_path / "x.mat", None, {})
    assert {t.name: t.kind.removeprefix("not read: ") for t in got.topics} == {
        "n": "(3, 2) float64", "c": "cell", "s.f": "struct array", "z": "(1, 1) complex",
        "gone": "empty double", "away": "a link, not followed", "back": "a link, not followed",
        "loop": "a link, not followed", "out": "data in another file, not followed",
    }  # fmt: skip


@pytest.mark.slow
def test_a_damaged_file_of_the_new_kind_costs_a_line(tmp_path: Path) -> None:
    whole = new(tmp_path / "y.mat").read_bytes()
    path = tmp_path / "x.mat"
    for count in (11, 600, len(whole) // 2):
        path.write_bytes(whole[:count])
        with pytest.raises(RecordingError, match=r"x\.mat: damaged"):
            read_matlab(path, {"force": "data.load.N:N"})


MATLAB_WROTE = {
    "testmulti_7.4_GLNX86": {"a": "(3, 5) float64", "theta": "(1, 9) float64"},
    "teststruct_7.4_GLNX86": {
        "teststruct.stringfield": "char", "teststruct.doublefield": "(1, 3) float64",
        "teststruct.complexfield": "(1, 3) complex128",
    },
    "teststructarr_7.4_GLNX86": {"teststructarr": "struct array"},
    "testcellnest_7.1_GLNX86": {"testcellnest": "cell"},
    "testfunc_7.4_GLNX86": {"testfunc": "function"},
    "testobject_7.4_GLNX86": {"testobject": "object"},
    "testsparse_7.4_GLNX86": {"testsparse": "sparse"},
    "testbool_8_WIN64": {"testbools": "(2, 1) bool"},
}  # fmt: skip


def matlab_s(name: str) -> Path:
    """A file that MATLAB itself wrote, as scipy carries them."""
    return Path(str(resources.files("scipy.io.matlab") / "tests" / "data" / f"{name}.mat"))


def test_files_that_matlab_wrote_are_listed_whatever_they_hold() -> None:
    for name, held in MATLAB_WROTE.items():
        assert listing(matlab_arrays.arrays(matlab_s(name))) == held


def test_numbers_that_matlab_wrote_are_read_with_their_class() -> None:
    """Its whole doubles are stored in a byte each: they are no images."""
    said = {"theta": "theta:1", "rate": "10", "a": "a:V", "axes.a": "ct"}
    got = read_matlab(matlab_s("testmulti_7.4_GLNX86"), said)
    assert got.signal("theta", "1").y.ravel() == pytest.approx(np.pi / 4 * np.arange(9))
    assert got.signal("a", "V").y.T.tolist() == [[1, 2, 3, 4, 5], [2, 0, 0, 0, 0], [3, 0, 0, 0, 0]]


def told_of(path: Path, **said: str) -> tuple[object, str]:
    got = read_matlab(path, said)
    (name,) = got.streams
    return got.streams[name], str(got.metadata["provenance"][name])


def test_residuals_beside_the_coordinates_of_qualisys_are_left_out_and_told(
    tmp_path: Path,
) -> None:
    """Points, (x, y, z, residual), frames; which axis is which must be said."""
    data = np.arange(24.0).reshape(2, 4, 3)
    savemat(tmp_path / "x.mat", {"q": {"Data": data}})
    with pytest.raises(UsageError, match="x coordinates, r those and a residual"):
        read_matlab(tmp_path / "x.mat", {"m": "q.Data:mm", "rate": "9"})
    said = {"m": "q.Data:mm", "rate": "9", "axes.m": "prt"}
    markers, told = told_of(tmp_path / "x.mat", **said)
    assert isinstance(markers, Markers)
    np.testing.assert_allclose(1e3 * markers.x, data[:, :3].transpose(2, 0, 1))
    assert told == "q.Data:mm: the last of 4 numbers of each point left out"


def test_three_channels_in_mm_may_be_a_point_and_it_is_said(tmp_path: Path) -> None:
    savemat(tmp_path / "x.mat", {"tip": np.arange(12.0).reshape(4, 3), "t": np.arange(4.0)})
    made, told = told_of(tmp_path / "x.mat", tip="tip:mm", time="t:s")
    assert isinstance(made, Signal)
    assert told.endswith("if they are a point's coordinates: --map axes.tip=tx")
    made, told = told_of(tmp_path / "x.mat", tip="tip:mm", rate="9", **{"axes.tip": "tx"})
    assert isinstance(made, Markers)
    assert told == "tip:mm"


def test_samples_without_a_number_are_left_out_and_told(tmp_path: Path) -> None:
    savemat(tmp_path / "x.mat", {"f": np.array([1.0, np.nan, 3.0])})
    made, told = told_of(tmp_path / "x.mat", f="f:N", rate="10")
    assert isinstance(made, Signal)
    assert (made.t.tolist(), made.y.ravel().tolist()) == ([0, 0.2], [1, 3])
    assert told == "f:N: 1 samples without a number left out"


V = np.random.default_rng(5).normal(size=(12, 3))
FACES = ConvexHull(V / np.linalg.norm(V, axis=1)[:, None]).simplices + 1.0  # (20, 3), 1 to 12
EDGES = np.array([[i, i % 12 + 1] for i in range(1, 13)], dtype=float)
POINTS = {"unit": "mm"}


def file_of(folder: Path, **arrays: Any) -> Path:
    savemat(folder / "x.mat", arrays)
    return folder / "x.mat"


@pytest.mark.parametrize("kind", ["int8", "uint8", "int32", "uint16", "uint64", "float64"])
@pytest.mark.parametrize(("values", "what"), [(FACES, "triangles"), (EDGES, "edges")])
def test_a_list_of_indices_is_no_points(
    tmp_path: Path, values: np.ndarray, what: str, kind: str
) -> None:
    """It was read as points in mm, and one of uint8 as an image three px wide."""
    shape = f"{values.shape} {kind}".replace("(", r"\(").replace(")", r"\)")
    why = rf"{shape}: a list of {what} by the rows of another array \(whole numbers 1 to 12\), not"
    path = file_of(tmp_path, K=values.astype(kind))
    named = {"tip": "K:mm", "axes.tip": "px"}
    for options in ({}, POINTS, {"m_per_px": "1mm"}, named):
        with pytest.raises(RecordingError, match=rf"x\.mat: K:? {why}"):
            read_matlab(path, options)
    turned = file_of(tmp_path, K=values.astype(kind).T)
    with pytest.raises(RecordingError, match=f"a list of {what} by the rows"):
        read_matlab(turned, {"tip": "K:mm", "axes.tip": "xp"})
    got = read_matlab(turned, {"counts": "K:V", "axes.counts": "ct", "rate": "10"})
    assert got.signal("counts", "V").y.shape == values.shape


def test_whole_numbers_of_a_whole_type_are_no_points(tmp_path: Path) -> None:
    path = file_of(tmp_path, P=np.array([[101, 33], [57, 240]], dtype="int16"))
    with pytest.raises(RecordingError, match=r"numbers 33 to 240\)"):
        read_matlab(path, POINTS)


@pytest.mark.parametrize(
    "arrays",
    [
        {"V": V, "K": FACES.astype("int32")},
        {"V": V, "K": FACES[(FACES != 3).all(axis=1)]},  # a part of the surface
        {"V": V, "T": FACES[:2]},
        {"V": V, "surface": {"faces": FACES[:2]}},
    ],
)
def test_vertices_beside_their_triangles_are_points(tmp_path: Path, arrays: dict[str, Any]) -> None:
    got = read_matlab(file_of(tmp_path, **arrays), POINTS)
    assert list(got.markers) == ["V"]
    (told,) = got.unread.values()
    assert ": a list of triangles by the rows of another array (whole numbers" in told


@pytest.mark.parametrize(
    "X",
    [
        np.array([[101.0, 33.0], [57.0, 240.0], [12.0, 8.0]]),  # whole px
        np.stack(np.meshgrid(*[np.arange(4.0)] * 3), -1).reshape(-1, 3),  # a lattice, in mm
        FACES - 3,
        FACES + 0.5,
    ],
)
def test_whole_numbers_may_be_coordinates(tmp_path: Path, X: np.ndarray) -> None:
    got = read_matlab(file_of(tmp_path, X=X, V=V), POINTS)
    assert set(got.markers) == {"X", "V"}


@pytest.mark.parametrize(
    ("arrays", "why"),
    [
        ({"vol": IMAGE}, "its name says so"),
        ({"mri_2": IMAGE}, "its name says so"),
        ({"I": IMAGE, "info": {"PixelSpacing": np.ones((1, 3))}}, "info.PixelSpacing has three"),
    ],
)
def test_a_volume_is_no_film(tmp_path: Path, arrays: dict[str, Any], why: str) -> None:
    """Its slices were images over time, by the rate that was asked for."""
    path, scale = file_of(tmp_path, **arrays), {"m_per_px": "0.1mm", "rate": "10"}
    for options in ({}, scale, {**scale, "images": f"{next(iter(arrays))}:px"}):
        with pytest.raises(RecordingError, match=rf"\(6, 7, 5\) uint8: a volume \({why}"):
            read_matlab(path, options)


def test_a_stack_that_may_be_a_film_is_never_taken_for_one_unasked(tmp_path: Path) -> None:
    path = file_of(tmp_path, I=IMAGE, spacing=np.ones((1, 2)), volume=3.5)
    with pytest.raises(UsageError, match=r"if its last axis is time \(a volume"):
        read_matlab(path, {"m_per_px": "0.1mm"})
    assert len(read_matlab(path, {"m_per_px": "0.1mm", "rate": "10"}).frame("I").images) == 5


@pytest.mark.parametrize("shape", [(20, 1), (4, 5)])
def test_a_displacement_field_is_no_signal(tmp_path: Path, shape: tuple[int, int]) -> None:
    """Its coordinates were a force over time, by the example that was printed."""
    columns = {name: np.arange(20.0).reshape(shape) for name in ("x", "y", "u", "v", "exx")}
    path = file_of(tmp_path, dic=columns)
    field = rf"{re.escape(str(shape))} of x, y, u, v, exx: a field of displacements or strains"
    for options in (
        {},
        {"force": "dic.x:N", "rate": "100", "axes.force": "tc"[: 1 + shape[1] // 5]},
    ):
        with pytest.raises(RecordingError, match=field):
            read_matlab(path, options)
    with pytest.raises(UsageError, match=r"--map force=PATH:N"):
        read_matlab(file_of(tmp_path, x=np.arange(4.0), y=np.arange(4.0)), {})


def test_displacements_of_one_point_have_times(tmp_path: Path) -> None:
    names = ("t", "x", "y", "u", "v")
    path = file_of(tmp_path, **{name: np.arange(4.0) for name in names})
    assert read_matlab(path, {"u": "u:mm", "rate": "10"}).signal("u", "m").t[1] == 0.1
    path = file_of(tmp_path, s=np.arange(4.0), **{name: np.arange(4.0) for name in names[1:]})
    assert read_matlab(path, {"u": "u:mm", "time": "s:s"}).signal("u", "m").t[1] == 1


def test_times_have_no_sign_and_as_many_samples_as_what_they_tell(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    t = np.arange(4.0)
    with pytest.raises(UsageError, match="--map time=t:s:-"):
        matlab_named.named_array("time", "t:s:-", {"t": t})
    with pytest.raises(UsageError, match=r"force: 3 samples.*--map.*4"):
        matlab_named._times("force", 3, t, {})
    assert matlab_named._times("force", 4, t, {}) is t
    with h5py.File(tmp_path / "x.mat", "w") as out:
        out["P"] = np.zeros((4, 5))
    monkeypatch.setattr(matlab_arrays, "MOST_NUMBERS", 19)
    with pytest.raises(RecordingError, match="20 numbers, the limit is 19; split it"):
        matlab_arrays.arrays(tmp_path / "x.mat")


def test_a_file_of_words_alone_and_one_of_curves_list_what_they_contain() -> None:
    word = {"note": np.array("text")}
    with pytest.raises(RecordingError, match=r"\(n, 2 or 3\) nor uint8 images.*; it"):
        matlab._unnamed(Path("x.mat"), word, {})
    curve = {"F": np.zeros(50), "d": np.zeros(9)}
    with pytest.raises(UsageError, match=r"role is clear.*--map force=PATH:N --map"):
        matlab._unnamed(Path("x.mat"), curve, {})
