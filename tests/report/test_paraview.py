"""Series for ParaView, opened by VTK's own readers and by meshio."""

from pathlib import Path
from xml.etree import ElementTree

import meshio
import numpy as np
import pytest
import pyvista as pv
from tracking_samples import tracking_result

from validate.report.observed import markers_seen
from validate.report.paraview import MOST, write_series
from validate.report.write import write_report
from validate.scene.scene import Scene


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("paraview")
    assert write_series(tracking_result(), folder, lambda _: None)
    return folder


def test_a_collection_names_files_that_are_there_in_order_of_time(folder: Path) -> None:
    (path,) = folder.glob("*.pvd")
    sets = list(ElementTree.parse(path).getroot().iter("DataSet"))
    bodies = [s for s in sets if s.get("part") == "0"]
    assert 1 < len(bodies) <= MOST
    times = [float(s.get("timestep", "nan")) for s in bodies]
    assert times == sorted(times)
    assert all((folder / s.get("file", "")).is_file() for s in sets)
    reader = pv.PVDReader(str(path))
    assert list(reader.time_values) == pytest.approx(sorted(set(times)))


def test_bodies_hold_displacement_strain_and_stress(folder: Path) -> None:
    result = tracking_result()
    method = next(m for m in result.methods if m.accepted)
    scene = method.scene
    assert isinstance(scene, Scene)
    file = sorted(folder.glob("*/body_*.vtu"))[-1]
    ours, theirs = pv.read(file), meshio.read(file)
    u = ours.point_data["displacement [m]"]
    assert np.abs(u - method.run.u[-1]).max() < 1e-15
    assert np.abs(theirs.point_data["displacement [m]"] - u).max() < 1e-15
    assert ours.cell_data["strain [1]"].shape == (len(scene.mesh.cells), 6)
    assert np.isfinite(ours.cell_data["von Mises [Pa]"]).all()
    assert ours.compute_cell_sizes()["Volume"].sum() > 0


def test_markers_are_where_they_were_measured_with_what_the_run_is_off_by(folder: Path) -> None:
    files = sorted(folder.glob("*/markers_*.vtp"))
    assert files
    points = pv.read(files[-1])
    assert points.n_points > 0
    method = next(m for m in tracking_result().methods if m.accepted)
    seen = markers_seen(method)
    assert seen is not None
    row = int(np.abs(seen.t - points.point_data["measured at [s]"][0]).argmin())
    assert np.abs(points.points - seen.x[row]).max() < 1e-12
    off = seen.simulated(method.run.u[-1]) - seen.x[row]
    assert np.abs(points.point_data["error [m]"] - off).max() < 1e-12


@pytest.mark.slow
def test_a_report_has_them_where_they_are_asked_for(tmp_path: Path) -> None:
    created = "2026-01-01T00:00:00+00:00"
    write_report(tracking_result(), tmp_path / "r", created=created, vtu=True)
    assert list((tmp_path / "r" / "paraview").glob("*.pvd"))
