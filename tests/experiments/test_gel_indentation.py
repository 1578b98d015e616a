"""Pairs of particle clouds in general, and the public one: what is predicted, to which error."""

from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from beside import beside, experiment
from few_starts import from_few_starts
from scipy.io import savemat

from experiments.gel_indentation import box as box_module
from experiments.gel_indentation import particles as pair_module
from experiments.gel_indentation import poisson_ratio as between_module
from experiments.gel_indentation.box import FACES, GelBoxes, _axis, load, stated
from experiments.gel_indentation.particles import checked_links, motion, side_of
from experiments.gel_indentation.poisson_ratio import RATIOS, best_ratio, solved
from validate.compare.exhibit import NumberTable
from validate.errors import RecordingError, RegistrationError, UsageError
from validate.parameters import with_values
from validate.pipeline.experiment.options import Options
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.run.pipeline import compare
from validate.scene.geometries.box import grid
from validate.scene.material import Material
from validate.scene.places import nodes_of
from validate.scene.scene import Scene, Support

# private: _FEWEST: a limit or list of the code, which the test must meet exactly.
# private: _axis: positions of points that no shipped recording has.
# private: _require: called alone, case by case.


def tree(**values: str) -> Tree:
    found: Tree = with_values(experiment("gel_indentation").parameters, values)
    return found


def pair(folder: Path, count: int = 3000) -> Path:
    """A block of particles pressed a little from above, unlinked, in pixels."""
    rng = np.random.default_rng(4)
    x = rng.uniform(0, (300, 300, 250), (count, 3))
    r2 = ((x[:, :2] - 150) ** 2).sum(axis=1)
    u = np.zeros_like(x)
    u[:, 2] = -20 * (x[:, 2] / 250) ** 2 * np.exp(-r2 / 2 / 90**2)
    y = rng.permutation(x + u + rng.normal(0, 0.1, x.shape))
    folder.mkdir()
    savemat(folder / "one.mat", {"P": x})
    savemat(folder / "two.mat", {"Q": y})
    return folder


@pytest.mark.slow
def test_another_pair_is_linked_in_the_scale_that_is_said(tmp_path: Path) -> None:
    folder = pair(tmp_path / "other")
    p = tree(data=str(folder))
    with pytest.raises(UsageError, match=r"one\.mat is in pixels .*voxel=0\.4um"):
        load(p, tmp_path)
    (folder / "SOURCE.txt").write_text("0.5 um per pixel in x, y, z")
    (recording,) = load(p, tmp_path)
    told = recording.record("linking")
    assert float(told["voxel_m"]) == 0.5e-6
    assert int(told["linked"]) > 2700
    x, u = motion(recording)
    assert u[:, 2].min() == pytest.approx(-20 * 0.5e-6, rel=0.2)
    files = (folder / "one.mat", folder / "two.mat")
    *_, linked, backward, otherwise, known, wrong = checked_links(recording, files, 0.5e-6).rows[-1]
    assert (linked > 90, backward > 98, otherwise < 1, known > 80, wrong < 1) == (True,) * 5
    ends = stated(recording)
    assert ends["body.x"] == pytest.approx(75e-6, abs=15e-6)
    assert ends["body.bottom"] < ends["body.middle"] < ends["body.top"] < x[:, 2].max()


def test_a_small_deep_contact_beside_the_indenter_does_not_draw_the_axis() -> None:
    rng = np.random.default_rng(6)
    x = rng.uniform(0, (400, 400, 200), (4000, 3))
    wide, small = (
        ((x[:, :2] - at) ** 2).sum(axis=1) / (2 * r**2) for at, r in ((220, 70), ((120, 290), 18))
    )
    u = np.zeros_like(x)
    u[:, 2] = -((x[:, 2] / 200) ** 2) * (10 * np.exp(-wide) + 20 * np.exp(-small))
    low, high = np.array([100.0, 100, 0]), np.array([300.0, 300, 200])
    assert _axis(x, u, low, high, 50) == pytest.approx((220, 220), abs=20)


@pytest.mark.parametrize("nu", [0.2, 0.45])
def test_the_ratio_that_moved_a_box_is_found_in_it(nu: float) -> None:
    mesh = grid((1.0, 1.0, 0.5), (2, 2, 2)).quadratic()
    rng = np.random.default_rng(5)
    held = nodes_of(mesh, FACES)
    moved = [1e-2 * rng.standard_normal((len(held), 3))]
    faces = (Support(FACES),)
    scenes = [Scene(mesh, Material(1.0, v), supports=faces) for v in (nu, *RATIOS)]
    fields = [solved(scene, held, moved)[0] for scene in scenes]
    seen = fields[0] + 1e-4 * rng.standard_normal(fields[0].shape)
    found, sd, left = best_ratio(np.stack([u - seen for u in fields[1:]]), np.full(3, 1e-4))
    assert found == pytest.approx(nu, abs=0.01)
    assert sd is not None
    assert left == pytest.approx(1e-4 * 3**0.5, rel=0.2)


def test_a_ratio_at_its_bound_has_no_standard_deviation() -> None:
    errors = np.linspace(1, 2, len(RATIOS))[:, None, None] * np.ones((1, 10, 3))
    assert best_ratio(errors, np.ones(3))[:2] == (0.0, None)


@pytest.mark.slow
def test_which_files_are_a_pair_is_asked_for(tmp_path: Path) -> None:
    folder = pair(tmp_path / "other")
    savemat(folder / "three.mat", {"R": np.ones((4, 3))})
    with pytest.raises(RecordingError, match="3 MATLAB files; a pair is needed"):
        load(tree(data=str(folder), voxel="1um"), tmp_path)
    named = tree(data=str(folder), voxel="1um", before="one.mat", after="two.mat")
    assert load(named, tmp_path)[0].name == "one to two"


def test_a_box_without_volume_is_refused() -> None:
    box = GelBoxes(x=0.0, y=0.0, side=1e-4, bottom=2e-5, middle=1e-5, top=5e-5)
    with pytest.raises(UsageError, match=r"side 100\.0 um"):
        replace(box, which="lower").ends()
    assert box.ends()[1].tolist() == pytest.approx([5e-5, 5e-5, 5e-5])


def test_the_public_pair_has_the_scale_of_its_source(shared_data: Path) -> None:
    assert side_of(None, shared_data / "field/gel-indentation/parCoordA.mat") == 0.4e-6


@pytest.mark.slow
def test_the_upper_box_is_predicted_by_the_lower_one(
    shared_data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ratios of the error to the floor; aims: 1.5 in the lower box, 2.2 in the upper one."""
    monkeypatch.setenv("VALIDATE_SHARED_DATA", str(shared_data))
    # The links are checked on a smaller pair: on this one it takes a sixth of the time.
    none = NumberTable("links", "Links", ("z (µm)",), ())
    monkeypatch.setattr(beside("gel_indentation", "exhibits"), "checked_links", lambda *_: none)
    shipped = experiment("gel_indentation")
    some = {name: shipped.methods[name] for name in ("linear", "laplace")}
    assert shipped.exhibits is not None
    shown = partial(shipped.exhibits, methods=some)
    fewer = replace(shipped, methods=some, accepted=("linear",), exhibits=shown)
    result = compare(fewer, Options({}), identify=from_few_starts)
    assert result.as_expected  # two axes undecided, one good enough
    (nu,) = (s for s in result.identified if s.name == "material.nu")
    assert 0.44 < nu.value < 0.49
    lower = {s.name: s.value for s in result.identified}
    assert lower["lower.over_floor.linear"] < 1.5 < lower["lower.over_floor.laplace"]
    (upper,) = (t for e in result.exhibits for t in e.tables if t.name == "errors_over_strain")
    row = dict(zip(upper.headings, upper.rows[-1], strict=True))
    assert row["linear / floor (1)"] < 2.0 < 2.4 < row["laplace / floor (1)"]  # type: ignore[operator]


def test_boxes_with_too_few_particles_are_refused_or_left_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    boxes = SimpleNamespace(which="lower")
    fewest = box_module._FEWEST
    box_module._require(fewest, boxes, 2e-6)  # type: ignore[arg-type]
    with pytest.raises(RegistrationError, match=rf"{fewest - 1} linked particles .* 2.0 um"):
        box_module._require(fewest - 1, boxes, 2e-6)  # type: ignore[arg-type]

    def few(whose: object, name: str, other: object) -> list[str]:
        if name == "empty":
            raise RegistrationError("3 linked particles")
        return [name]

    inside = SimpleNamespace(ends=lambda: (np.full(3, 0.4), np.full(3, 0.6)))
    beyond = SimpleNamespace(ends=lambda: (np.full(3, 0.4), np.full(3, 1.6)))
    around = [("own", inside), ("empty", inside), ("beyond", beyond), ("other", inside)]
    for name, found in (
        ("motion", lambda recording: (np.array([np.zeros(3), np.ones(3)]), None)),
        ("replace", lambda box, **changes: box), ("_around", lambda box: around), ("_fitted", few),
    ):  # fmt: skip
        monkeypatch.setattr(between_module, name, found)
    whose = SimpleNamespace(recording=None)
    assert between_module.between.__wrapped__(whose, None) == ("own", "other")  # type: ignore[arg-type]


def test_a_ratio_that_is_open_and_clouds_that_are_none_are_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    sizes = {"x": "0", "y": "0", "side": "1mm", "bottom": "0", "middle": "1mm", "top": "2mm"}
    p = tree(**{f"body.{name}": text for name, text in sizes.items()})
    with pytest.raises(UsageError, match=r"material.nu.*--set material.nu="):
        box_module.build(None, p, None)  # type: ignore[arg-type]
    points = SimpleNamespace(x=np.zeros((1, 4, 2)))
    for markers, says in (
        ({}, "a.mat: 0 clouds of points, one needed"),
        ({"P": points}, "a.mat: points in 2 dimensions, 3 needed"),
    ):
        recording = SimpleNamespace(markers=markers, source=None)
        reader = SimpleNamespace(read=lambda *_, recording=recording: recording)
        monkeypatch.setattr(pair_module, "recognised", lambda path, reader=reader: reader)
        with pytest.raises(RecordingError, match=says):
            pair_module.cloud(Path("a.mat"), 1e-6)


def test_a_folder_of_one_file_and_pixels_of_no_size_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pair_module, "data_path", lambda *_: tmp_path)
    (tmp_path / "a.mat").write_bytes(b"1")
    with pytest.raises(RecordingError, match=r"1 MATLAB.*--set"):
        pair_module.files(None, (None, None), tmp_path)
    (tmp_path / "b.mat").write_bytes(b"2")
    both = (tmp_path / "a.mat", tmp_path / "b.mat")
    assert pair_module.files(None, (None, None), tmp_path) == both
    assert pair_module.side_of(4e-7, both[0]) == 4e-7
    with pytest.raises(UsageError, match=r"a.mat is in pixels of unknown size"):
        pair_module.side_of(None, both[0])
