"""Series for ParaView, opened by VTK's own readers and by meshio."""

from pathlib import Path
from xml.etree import ElementTree

import meshio
import numpy as np
import pytest
import pyvista as pv
from tracking_samples import SIDE, tracking_result

from validate.report.export.paraview import MOST, write_series
from validate.report.sections.observations import markers_seen
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
    assert ours.compute_cell_sizes()["Volume"].sum() == pytest.approx(SIDE**3, rel=1e-12)
    # A shear of the whole body: e_xz is half the angle, s_xz = 2 mu e_xz, von Mises sqrt(3) s_xz.
    angle = u[np.abs(u[:, 0]).argmax(), 0] / SIDE
    mu = scene.material.E / (2 * (1 + scene.material.nu))
    for read in (ours.cell_data, {k: np.vstack(v) for k, v in theirs.cell_data.items()}):
        strain, stress = np.zeros((2, len(scene.mesh.cells), 6))
        strain[:, 5] = angle / 2
        stress[:, 5] = mu * angle
        assert np.abs(read["strain [1]"] - strain).max() < 1e-12
        assert np.abs(read["stress [Pa]"] - stress).max() < 1e-9 * mu
        mises = np.ravel(read["von Mises [Pa]"])
        assert mises == pytest.approx(np.sqrt(3) * mu * abs(angle), rel=1e-9)


def test_meshio_finds_the_same_cells(folder: Path) -> None:
    scene = next(m for m in tracking_result().methods if m.accepted).scene
    theirs = meshio.read(sorted(folder.glob("*/body_*.vtu"))[0])
    ((kind, cells),) = ((block.type, block.data) for block in theirs.cells)
    assert kind == {"tet4": "tetra", "hex8": "hexahedron"}[scene.mesh.kind]
    assert np.array_equal(cells, scene.mesh.cells)
    assert np.array_equal(theirs.points, scene.mesh.nodes)


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
