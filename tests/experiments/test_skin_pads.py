"""Skin between two pads: files that belong together, clocks paired by displacement, laws."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from beside import beside, experiment
from few_starts import from_few_starts

from validate.arrays import Floats
from validate.commands.main import run
from validate.errors import RecordingError, UsageError
from validate.parameters import with_values
from validate.pipeline.experiment.options import Options
from validate.pipeline.experiment.tree import Tree, mesh_of
from validate.pipeline.run.case_solution import solve
from validate.pipeline.run.pipeline import compare
from validate.recording.types import Recording
from validate.register.markers.markers import MarkerObservation
from validate.scene.mesh import Mesh
from validate.scene.scene import Scene

# private: _LARGEST: replaced by a small number: a short test.

EXPERIMENT = experiment("skin_pads")
files_module, placed, skin = (
    beside("skin_pads", name) for name in ("files", "registration", "skin")
)
FORCE, paired, read_folder = files_module.FORCE, files_module.paired, files_module.read_folder
Images, binned, place, spurious = placed.Images, placed.binned, placed.place, placed.spurious
build, load, stated = skin.build, skin.load, skin.stated

SCALE = 0.05  # mm per px
PULL = np.linspace(0.0, 4.0, 9)  # mm at rest and in eight images
SHARE = 0.7  # of the moving pad
GEO = "L = 60;\nH = 40; // drawn\nl_pad = 8.0;\nh_pad = 8.0;\ndL_pad = 30.0;\n"
SOON = with_values(
    EXPERIMENT.parameters, {"fit_to": "3mm", "predict_to": "6mm", "field": "2mm,3.5mm"}
)


def stretched(x: Floats, pull: float) -> Floats:
    """Points (k, 2) mm from the middle: a uniform stretch between pads 38 mm apart."""
    left, right = -19 - SHARE * pull, 19 + (1 - SHARE) * pull
    moved = left + (x[:, 0] + 19) / 38 * (right - left)
    return np.stack([moved, x[:, 1] * (1 - 0.3 * pull / 38)], axis=1)


def folder(path: Path, **changed: Floats) -> Path:
    """A recording of the kind: images in px, drifting across the pull; force 0.02 a mm."""
    grid = np.stack(np.meshgrid(np.linspace(-8, 8, 9), np.linspace(-4, 4, 5)), -1).reshape(-1, 2)
    marks = [np.array([[x, -12.0], [x, 12.0]]) for x in (-19.0, 19.0)]
    drift = np.stack([np.zeros(9), np.linspace(0, 0.4, 9)], axis=1)
    for names, points in (("x", grid), ("x_1", marks[0]), ("x_2", marks[1])):
        tail = f"_ref{names[1:]}" if len(names) > 1 else ""
        free = tail == ""
        states = np.array([
            (stretched(points, p) if free else points + [m, 0.0]) + d
            for p, d, m in zip(PULL, drift, _pads(names), strict=True)
        ]) / SCALE + [600.0, 400.0]  # fmt: skip
        for c, axis in enumerate("xy"):
            np.savetxt(path / f"{axis}0{tail}.dat", states[0, :, c : c + 1])
            np.savetxt(path / f"{axis}t{tail}.dat", states[1:, :, c].T)
    u = np.linspace(0.0, 6.5, 400)
    np.savetxt(path / "u_moving_pad.dat", changed.get("u", u))
    np.savetxt(path / "f_moving_pad.dat", changed.get("f", 0.05 + 0.02 * u))
    (path / "skin.geo").write_text(GEO)
    return path


def _pads(names: str) -> Floats:
    return np.asarray(-SHARE * PULL if names == "x_1" else (1 - SHARE) * PULL)


@pytest.fixture
def recording(tmp_path: Path) -> Recording:
    return read_folder(folder(tmp_path), (1.0, 1.0))


def scene_of(recording: Recording) -> tuple[Tree, Scene]:
    sizes = {path: repr(value) for path, value in stated(recording).items()}
    p = with_values(SOON, {**sizes, "material.E_neo": "26", "body.cells": "1"})
    return p, build(recording, p, EXPERIMENT.methods["neo_hooke"].scene)


def test_a_folder_is_a_recording_with_its_clocks_paired(recording: Recording) -> None:
    assert recording.record("pairing")["images"] == "8 of 8"
    assert recording.signal("force", FORCE).y.shape == (400, 1)
    assert stated(recording) == {
        "body.length": 0.06, "body.width": 0.04, "body.pad_length": 0.008,
        "body.pad_width": 0.008, "body.gap": 0.03,
    }  # fmt: skip
    assert float(recording.record("scale")["m_per_px"]) == pytest.approx(1e-3 * SCALE)
    t = recording.marker("points").t
    d = recording.signal("displacement", "m").y[t.astype(int), 0]
    assert d == pytest.approx(1e-3 * PULL, abs=1e-3 * 6.5 / 399)


def test_points_given_in_mm_say_the_scale_and_the_authors_curve_the_zero(tmp_path: Path) -> None:
    folder(tmp_path)
    x, y = (np.loadtxt(tmp_path / f"{a}0.dat") for a in "xy")
    np.savetxt(tmp_path / "processed_xt_dic_0000.out", 0.06 * np.stack([x, y], axis=1))
    np.savetxt(tmp_path / "processed_ux_pad_mov.out", -np.linspace(0, 6.2, 300))
    found = read_folder(tmp_path, (1.0, 1.0))
    assert float(found.record("scale")["m_per_px"]) == pytest.approx(6e-5)
    assert float(found.record("zero")["displacement_m"]) == pytest.approx(0.3e-3)
    np.savetxt(tmp_path / "processed_xt_dic_0000.out", np.stack([0.06 * x, 0.05 * y], axis=1))
    with pytest.raises(RecordingError, match=r"not the points of x0\.dat"):
        read_folder(tmp_path, (1.0, 1.0))


def test_signs_are_declared_and_tested(tmp_path: Path) -> None:
    u = np.linspace(0.0, 6.5, 400)
    folder(tmp_path, u=-u, f=-0.02 * u)
    with pytest.raises(RecordingError, match=r"displacement .* signs\.displacement=-1"):
        read_folder(tmp_path, (1.0, 1.0))
    with pytest.raises(RecordingError, match=r"the force .* --set signs\.force=-1"):
        read_folder(tmp_path, (-1.0, 1.0))
    assert read_folder(tmp_path, (-1.0, -1.0)).signal("force", FORCE).y[-1, 0] > 0
    with pytest.raises(UsageError, match="each 1 or -1"):
        with_values(SOON, {"signs.force": "2"})


def test_images_that_cannot_be_paired_are_refused() -> None:
    here, machine = Path("here"), np.linspace(0, 1e-3, 50)
    t, matched = paired(here, np.array([0.0, 0.5e-3, 2e-3]), machine)
    assert (len(t), matched) == (2, 1)
    with pytest.raises(RecordingError, match="0 of 2 images matched"):
        paired(here, np.array([0.0, 2e-3, 3e-3]), machine)
    with pytest.raises(RecordingError, match="3 mm nearer to each other"):
        paired(here, np.array([0.0, -1e-3, -3e-3]), machine)


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [("yt.dat", "1 2\n3", "no matrix"), ("xt.dat", "1 2\n3 4\n", "files of shapes"),
     ("f_moving_pad.dat", "1\n2\n", "2 forces"), ("y0.dat", "nan\n", "not finite"),
     ("x0_ref_1.dat", None, "no x0_ref_1.dat")],
)  # fmt: skip
def test_files_that_are_no_such_recording(
    tmp_path: Path, name: str, text: str | None, words: str
) -> None:
    folder(tmp_path)
    (tmp_path / name).unlink() if text is None else (tmp_path / name).write_text(text)
    with pytest.raises(RecordingError, match=words):
        read_folder(tmp_path, (1.0, 1.0))


def test_force_is_averaged_from_its_zero_and_spikes_are_left_out(recording: Recording) -> None:
    curve = binned(recording, SOON.settings)
    assert curve.force == pytest.approx(20 * curve.d, rel=0.02, abs=1e-4)
    assert curve.left_out == 0
    force = recording.signal("force", FORCE)
    y = force.y + 1e-4 * np.random.default_rng(1).normal(size=force.y.shape)
    y[100] += 1.0
    with_spike = replace(recording, signals={**recording.signals, "force": replace(force, y=y)})
    again = binned(with_spike, SOON.settings)
    assert again.left_out >= 1
    assert again.force == pytest.approx(curve.force, abs=1e-3)


def test_points_are_where_the_sheet_is_and_windows_are_apart(recording: Recording) -> None:
    """What both pads share across the pull is taken off; the pads drive by their own shares."""
    p, scene = scene_of(recording)
    seen = place(recording, p, scene)
    (points,) = seen.of(MarkerObservation)
    expected = stretched(1e3 * points.rest, 3.5)
    assert 1e3 * points.x[-1] == pytest.approx(expected, abs=1e-6)
    assert seen.inputs[-1, 0] / seen.inputs[-1].sum() == pytest.approx(SHARE, abs=1e-6)
    fitted, predicted = (next(s for s in seen.selections if s.label == n)
                         for n in ("fitted", "predicted"))  # fmt: skip
    assert fitted.t is not None
    assert predicted.t is not None
    assert fitted.t.max() < predicted.t.min()
    assert {s.label for s in seen.selections} >= {"2.0mm", "3.5mm", "end"}
    assert any(note.startswith("8 of 8 images are paired") for note in seen.findings)
    with pytest.raises(RecordingError, match="set fit_to"):
        place(recording, with_values(p, {"fit_to": "7mm"}), scene)
    with pytest.raises(RecordingError, match="0 matched"):
        place(recording, with_values(p, {"field": "5mm"}), scene)


def test_a_run_answers_each_stream_where_it_is_compared(recording: Recording) -> None:
    """Force in its unit, points at the holds; twice the modulus is twice the force, same field."""
    p, _ = scene_of(recording)
    one, two = (
        solve(EXPERIMENT, (recording,), "neo_hooke", EXPERIMENT.methods["neo_hooke"],
              with_values(p, {"material.E_neo": E})).residuals
        for E in ("20", "40")
    )  # fmt: skip
    assert set(one) == {
        "force@fitted", "force@predicted", "force@end", "field.axial@2.0mm", "field.axial@3.5mm",
        "field.lateral@2.0mm", "field.lateral@3.5mm",
    }  # fmt: skip
    assert one["force@end"].unit == FORCE
    force = [r["force@end"].values + r["force@end"].reference for r in (one, two)]
    assert force[1] == pytest.approx(2 * force[0])
    assert (one["field.axial@3.5mm"].values == two["field.axial@3.5mm"].values).all()


def test_a_point_that_moves_otherwise_than_its_neighbours_is_spurious() -> None:
    x = np.stack(np.meshgrid(np.arange(10.0), np.arange(8.0)), -1).reshape(-1, 2)
    moved = 0.05 * x + 1e-3 * np.random.default_rng(1).normal(size=x.shape)
    moved[37] += 0.5
    assert np.flatnonzero(spurious(x, moved)).tolist() == [37]


def meshed(p: Tree, values: dict[str, str]) -> Mesh:
    return mesh_of(None, with_values(p, values), Path())


def test_meshes_are_parts_of_finer_ones_and_reach_beyond_the_pads(recording: Recording) -> None:
    p, _ = scene_of(recording)
    coarse, fine = (meshed(p, {"body.cells": n}).nodes for n in ("1", "2"))
    apart = np.abs(coarse[:50, None] - fine[None]).max(axis=2).min(axis=1)
    assert apart.max() < 1e-9
    assert np.ptp(fine, axis=0) == pytest.approx([0.06, 0.04])
    with pytest.raises(UsageError, match="must reach beyond"):
        meshed(p, {"body.length": "0.04"})


def test_the_data_set_is_paired_whole(shared_data: Path) -> None:
    data = {"data": str(shared_data / "force" / "skin-pads")}
    tree = with_values(EXPERIMENT.parameters, data)
    (recording,), p = load(tree, Path()), tree.settings
    assert recording.record("pairing")["images"] == "49 of 49"
    assert float(recording.record("scale")["m_per_px"]) == pytest.approx(24e-3 / 448.5, rel=1e-4)
    images, curve = Images(recording), binned(recording, p)
    assert 1e3 * images.pulled[-1] == pytest.approx(3.823, abs=0.002)
    assert images.share == pytest.approx(0.711, abs=0.002)
    assert 1e3 * curve.d[-1] == pytest.approx(8.34, abs=0.02)
    assert curve.force[-1] == pytest.approx(0.293, abs=0.005)
    assert images.held(p.field)[2] < 20


@pytest.mark.slow
def test_a_linear_law_fitted_to_4_mm_differs_at_8_mm(shared_data: Path) -> None:
    """Skin stiffens: what was fitted is no evidence, what was predicted lies far below."""
    values = {"data": str(shared_data / "force" / "skin-pads"), "body.cells": "1"}
    asked = Options(values, ("linear",), quick=True)
    result = compare(EXPERIMENT, asked, identify=from_few_starts)
    (linear,) = result.methods
    verdicts = {c.name: c.verdict for c in linear.checks}
    assert verdicts["force.max@predicted"] == "not good enough"
    assert "force.max@fitted" not in verdicts
    residual = linear.residuals["force@end"]
    assert residual.values.mean() == pytest.approx(-0.08, abs=0.01)
    assert linear.scene.force_unit == FORCE
    found = {s.name: s.value for s in result.identified}
    assert found["material.E_linear"] == pytest.approx(28.1, rel=0.03)


def test_files_of_a_test_that_do_not_belong_together_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.dat").write_text("1 2\n3 4\n")
    assert files_module.numbers(tmp_path / "a.dat").tolist() == [[1, 2], [3, 4]]
    monkeypatch.setattr(files_module, "_LARGEST", 7)
    with pytest.raises(RecordingError, match=r"a.dat: 8 bytes, the limit is 7"):
        files_module.numbers(tmp_path / "a.dat")


# A recording of which the pads' marks are points of the field: 105 states, 50 points on each edge.
STEPS = np.linspace(0.0, 4.0, 105)
ROWS, COLUMNS = 50, 21
EDGE = 24.0  # mm between the outermost points of an edge


def grid_folder(path: Path, rows: int = ROWS) -> Path:
    """Points in a grid from pad to pad, at 38 mm; files of marks are written by the test."""
    columns = np.linspace(-19, 19, COLUMNS), np.linspace(-EDGE / 2, EDGE / 2, rows)
    grid = np.stack(np.meshgrid(*columns, indexing="ij"), -1).reshape(-1, 2)
    drift = np.stack([np.zeros(105), np.linspace(0, 0.4, 105)], axis=1)
    states = np.array([stretched(grid, p) + d for p, d in zip(STEPS, drift, strict=True)])
    write(path, "", states / SCALE + [600.0, 400.0])
    u = np.linspace(0.0, 9.0, 600)
    np.savetxt(path / "u_moving_pad.dat", u)
    noise = 1e-4 * np.random.default_rng(1).normal(size=len(u))
    np.savetxt(path / "f_moving_pad.dat", 0.05 + 0.02 * u + noise)
    (path / "skin.geo").write_text(GEO)
    return path


def write(path: Path, tail: str, states: Floats, rest_as: str = "column") -> None:
    """States (nt, k, 2) px as the four files of points or of marks; one mark a row or a column."""
    for c, axis in enumerate("xy"):
        rest, later = states[0, :, c : c + 1], states[1:, :, c].T
        if rest_as == "row":
            rest, later = rest.T, later.T
        np.savetxt(path / f"{axis}0{tail}.dat", rest)
        np.savetxt(path / f"{axis}t{tail}.dat", later)


def edge_marks(path: Path, states: int, rest_as: str, off: float = 0.0) -> None:
    """The edges of the grid as marks, displaced in some states, `off` px beside the points."""
    for pad, x in ((1, -19.0), (2, 19.0)):
        edge = np.stack([np.full(ROWS, x), np.linspace(-EDGE / 2, EDGE / 2, ROWS)], axis=1)
        marks = np.repeat((edge / SCALE + [600.0, 400.0] + [off, 0.0])[None], states, axis=0)
        write(path, f"_ref_{pad}", marks, rest_as)


def require_the_motion(found: Recording) -> None:
    """The pads separate by the truth, to its shares; what they follow is not compared."""
    images = Images(found)
    assert 1e3 * images.pulled == pytest.approx(STEPS, abs=1e-6)
    assert images.share == pytest.approx(SHARE, abs=1e-6)
    assert 1e3 * found.marker("pads").x[0, 1, 0] - 1e3 * found.marker("pads").x[0, 0, 0] == (
        pytest.approx(38.0)
    )
    first_column = {f"p{i + 1:04d}" for i in range(len(found.marker("points").names) // 19)}
    assert not first_column & set(found.marker("points").names)


@pytest.mark.parametrize("rest_as", ["column", "row"])
@pytest.mark.parametrize("states", [2, 50])
def test_marks_may_be_points_at_the_edges_of_the_field(
    tmp_path: Path, rest_as: str, states: int
) -> None:
    """One displaced state or several, fewer than the points have; one mark a row or a column."""
    edge_marks(grid_folder(tmp_path), states, rest_as, off=3.0)
    found = read_folder(tmp_path, (1.0, 1.0), window=1e-3 * EDGE)
    require_the_motion(found)
    assert found.record("pads")["follow"].startswith("50 and 50 edge points of the field")
    assert found.marker("points").x.shape == (105, ROWS * (COLUMNS - 2), 2)
    assert float(found.record("scale")["m_per_px"]) == pytest.approx(1e-3 * SCALE)


def test_a_history_of_two_marks_may_have_one_mark_a_column(tmp_path: Path) -> None:
    expected = read_folder(folder(tmp_path), (1.0, 1.0))
    for path in tmp_path.glob("*_ref_*.dat"):
        np.savetxt(path, np.loadtxt(path, ndmin=2).T)
    found = read_folder(tmp_path, (1.0, 1.0))
    assert found.marker("pads").x == pytest.approx(expected.marker("pads").x)
    assert found.metadata == expected.metadata
    assert "pads" not in found.metadata


def test_the_scale_of_edge_points_is_requested_and_never_24_mm(tmp_path: Path) -> None:
    edge_marks(grid_folder(tmp_path), 50, "column")
    with pytest.raises(RecordingError, match=r"480\.0 px apart, .* pads\.window=8mm"):
        read_folder(tmp_path, (1.0, 1.0))
    x, y = (np.loadtxt(tmp_path / f"{a}0.dat") for a in "xy")
    np.savetxt(tmp_path / "processed_xt_dic_0000.out", SCALE * np.stack([x, y], axis=1))
    require_the_motion(read_folder(tmp_path, (1.0, 1.0)))
    with pytest.raises(UsageError, match=r"pads\.window = -8 mm: must be above 0 mm"):
        with_values(SOON, {"pads.window": "-8mm"})


def test_a_history_of_other_than_two_marks_has_no_known_length(tmp_path: Path) -> None:
    """With as many states as the points have, marks are a history, also where they name points."""
    edge_marks(grid_folder(tmp_path), 105, "row")
    with pytest.raises(RecordingError, match=r"480\.0 px apart, .* \(only two marks"):
        read_folder(tmp_path, (1.0, 1.0))
    edge_marks(tmp_path, 105, "column")
    x = np.loadtxt(tmp_path / "xt_ref_1.dat")
    np.savetxt(tmp_path / "xt_ref_1.dat", x[:49])
    with pytest.raises(RecordingError, match="marks of pad 1: files of shapes"):
        read_folder(tmp_path, (1.0, 1.0))


def test_marks_of_other_images_are_refused_with_both_readings(tmp_path: Path) -> None:
    """Inside a grid most places are near to a point: that alone makes no edge."""
    grid_folder(tmp_path)
    other = np.zeros((50, 2, 2)) + [[100.0, 0.0], [100.0, 450.0]]
    for pad in (1, 2):
        write(tmp_path, f"_ref_{pad}", other + [700.0 * (pad - 1), 0.0])
    both = r"105 states of the points, \[50, 50\] of the marks; and .* up to \[200, 160\.3\] px"
    with pytest.raises(RecordingError, match=both + r".*--set pads\.follow=edges"):
        read_folder(tmp_path, (1.0, 1.0))
    inside = np.loadtxt(tmp_path / "x0.dat")[300:302], np.loadtxt(tmp_path / "y0.dat")[300:302]
    for pad in (1, 2):
        marks = np.stack(inside, axis=1) + [190.0 * (pad - 1), 0.0]  # five columns
        write(tmp_path, f"_ref_{pad}", np.repeat(marks[None], 50, axis=0))
    with pytest.raises(RecordingError, match=r"\[2, 2\] points .*, \[0, 0\] of these"):
        read_folder(tmp_path, (1.0, 1.0))


def test_one_mark_a_pad_is_no_edge(tmp_path: Path) -> None:
    edge_marks(grid_folder(tmp_path), 50, "column")
    for axis in "xy":
        for name in (f"{axis}0_ref_2.dat", f"{axis}t_ref_2.dat"):
            np.savetxt(tmp_path / name, np.loadtxt(tmp_path / name, ndmin=2)[:1])
    with pytest.raises(RecordingError, match=r"\[50, 1\] points \(2 needed\)"):
        read_folder(tmp_path, (1.0, 1.0), window=1e-3 * EDGE)


def test_pads_can_follow_the_edges_without_any_marks(tmp_path: Path) -> None:
    """As in the authors' second recording; two of twelve points of an edge are spurious."""
    grid_folder(tmp_path, rows=12)
    xt = np.loadtxt(tmp_path / "xt.dat")
    xt[[1, 5]] += 40.0
    np.savetxt(tmp_path / "xt.dat", xt)
    found = read_folder(tmp_path, (1.0, 1.0), "edges", 1e-3 * EDGE)
    require_the_motion(found)
    assert found.record("pads")["follow"].startswith("12 and 12 edge points")


def test_the_pad_that_moves_more_comes_first_wherever_it_is(tmp_path: Path) -> None:
    """The images may be mirrored or turned by a right angle."""
    grid_folder(tmp_path, rows=12)
    x = {name: np.loadtxt(tmp_path / f"{name}.dat", ndmin=2) for name in ("x0", "xt", "y0", "yt")}
    for state in ("0", "t"):
        np.savetxt(tmp_path / f"y{state}.dat", 1200.0 - x[f"x{state}"])
        np.savetxt(tmp_path / f"x{state}.dat", x[f"y{state}"])
    pads = read_folder(tmp_path, (1.0, 1.0), "edges", 1e-3 * EDGE).marker("pads").x
    moved = 1e3 * np.linalg.norm(pads[-1] - pads[0], axis=1)
    assert moved == pytest.approx(np.hypot([SHARE * 4, (1 - SHARE) * 4], 0.4))


def test_an_edge_of_one_point_is_refused(tmp_path: Path) -> None:
    grid_folder(tmp_path, rows=12)
    for name in ("x0", "xt"):
        x = np.loadtxt(tmp_path / f"{name}.dat", ndmin=2)
        x[0] -= 100.0
        np.savetxt(tmp_path / f"{name}.dat", x)
    with pytest.raises(RecordingError, match=r"1 and 12 points within .* px"):
        read_folder(tmp_path, (1.0, 1.0), "edges", 1e-3 * EDGE)


def test_a_log_without_samples_at_its_zero_needs_a_larger_bin() -> None:
    t = np.arange(50.0)
    d = np.append(np.zeros(2), np.linspace(5e-3, 9e-3, 48))
    signals = {"displacement": d, "force": 1e3 * d}
    recording = SimpleNamespace(
        name="r", record=lambda name: {"displacement_m": "0"},
        signal=lambda name, unit: SimpleNamespace(t=t, y=signals[name][:, None]),
    )  # fmt: skip
    p = SimpleNamespace(bin=1e-3, predict_to=9e-3)
    with pytest.raises(RecordingError, match="r: 2 samples within 1 mm"):
        binned(recording, p)


def test_a_run_is_driven_by_the_edge_points(tmp_path: Path) -> None:
    """The pads of the simulated sheet move by the truth at every load step with an image."""
    edge_marks(grid_folder(tmp_path), 50, "column")
    p = with_values(SOON, {"data": str(tmp_path), "pads.window": "24mm", "body.cells": "1",
                           "material.E_linear": "28"})  # fmt: skip
    recordings = load(p, Path())
    p = with_values(p, {path: repr(value) for path, value in stated(recordings[0]).items()})
    ended = solve(EXPERIMENT, recordings, "linear", EXPERIMENT.methods["linear"], p)
    assert ended.whole
    pads = ended.seen.inputs[ended.seen.inputs.sum(axis=1) <= 4e-3]
    assert len(pads) > 10
    assert 1e3 * pads[:, 0] == pytest.approx(SHARE * 1e3 * pads.sum(axis=1), abs=1e-4)
    assert 1e3 * ended.seen.inputs[-1].sum() == pytest.approx(6.0, abs=0.2)
    assert any("50 and 50 edge points" in text for text in ended.seen.findings)


@pytest.mark.slow
def test_validate_run_reports_what_the_pads_follow(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "data").mkdir()
    edge_marks(grid_folder(tmp_path / "data"), 50, "row")
    arguments = [
        "run", "skin_pads", "--quick", "--methods", "linear", "--out", str(tmp_path / "out"),
        "--set", f"data={tmp_path / 'data'}", "--set", "body.cells=1",
    ]  # fmt: skip
    assert run(arguments) == 2
    assert "pass it with its unit, as in --set pads.window=8mm" in capsys.readouterr().err
    assert run([*arguments, "--set", "pads.window=24mm"]) == 1  # the truth is no sheet's field
    assert "material.E_linear" in capsys.readouterr().out
    (page,) = (tmp_path / "out").glob("skin_pads*/report.html")
    assert "The pads follow 50 and 50 edge points of the field" in page.read_text("utf-8")
