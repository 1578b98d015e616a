"""Mesh families: every refinement scales every direction by the same factor."""

from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

from validate.arrays import Floats
from validate.catalogue import experiment_files
from validate.commands.questions.scene import geometry_of
from validate.fem.system import build
from validate.parameters import describe, with_values
from validate.pipeline import load
from validate.pipeline.bodies.choices import MeasuredBody
from validate.pipeline.bodies.first_modes import model_of
from validate.pipeline.bodies.measured import measured_body, solid, static_scene
from validate.pipeline.bodies.mesh import mesh_of, unknowns_of
from validate.pipeline.experiment.tree import Meshes, Tree
from validate.pipeline.run import cost
from validate.pipeline.run.cost import fits
from validate.recording.types import Recording, Source
from validate.scene.geometries.box import divided, fitting, member, similarity
from validate.scene.geometries.specification import Box
from validate.scene.material import Material
from validate.scene.scene import Drive, Scene, Support
from validate.solve.static.quasi_static import QuasiStatic

PAD, BAR, BRICK = (0.050, 0.050, 0.008), (0.060, 0.030, 0.030), (0.060, 0.045, 0.070)
_COUNTS = ("along", "across", "up", "radial", "axial", "plane",
           "solid", "squares", "cells", "halvings", "divisions")  # fmt: skip
# What only the data tell.
SKIN = {"length": "100mm", "width": "50mm", "pad_length": "8mm", "pad_width": "8mm", "gap": "30mm"}
ROUND = {"diameter": "50mm", "height": "30mm"}
GEL = {"x": "0", "y": "0", "side": "100um", "bottom": "0", "middle": "50um", "top": "100um"}
OPEN = {
    name: {f"body.{k}": v for k, v in sizes.items()}
    for name, sizes in (("skin_pads", SKIN), ("gel_indentation", GEL), ("ecoflex_cylinder", ROUND))
}


def declared(cells: int = 6, *, budget: bool = True, **answers: str) -> Tree:
    """A body as answers make it, on a plate that it rests on where one `slides`."""
    slides = answers.pop("slides", "")
    said = {f"body.{name}": text for name, text in answers.items()}
    said |= {"body.shape": next(iter(answers)), "held.slides": slides}
    supports = (Support("zmin", (2,), rests=True),) if slides else (Support("zmin"),)
    drives = (Drive("load", "zmax", "-z"),)
    scene = Scene(geometry_of(said, cells, 2), Material(1e4, 0.4999), supports, drives=drives,
                  dilatation="by_element")  # fmt: skip
    return Tree("", scene, MeasuredBody(noted=(0.0, 1e-3), mesh=Meshes(budget=budget)))


def text(size: tuple[float, ...]) -> str:
    return ",".join(map(str, size))


def family(p: Tree) -> list[tuple[int, ...]]:
    """Cells per axis of the nominal mesh and of every level."""
    made = measured_body("b", "b", "x", p, {"m": solid("m")}, ("m",), (), Path())
    assert made.uncertainty is not None
    assert made.uncertainty.mesh is not None
    levels = [level(p).scene.body.cells for level in made.uncertainty.mesh.levels]
    return [p.scene.body.cells, *levels]


@pytest.mark.parametrize("size", [PAD, BAR, BRICK])
@pytest.mark.parametrize("cells", [4, 5, 6, 8, 10, 12])
@pytest.mark.parametrize("slides", ["", "zmin"])
def test_every_grid_of_a_block_is_similar_to_the_nominal_one(
    size: tuple[float, ...], cells: int, slides: str
) -> None:
    p = declared(cells, budget=False, block=text(size), slides=slides)
    nominal, *levels = family(p)
    across = 2 * max(size) / min(size) / 2  # cells twice as long as they are thick
    assert max(nominal) == pytest.approx(max(cells, across), abs=2)
    different = {nominal, *levels}
    assert len(different) >= 3
    for grid in different:
        assert similarity(nominal, grid) == pytest.approx(1, abs=1e-12)
        if slides:
            assert grid[0] % 2 == grid[1] % 2 == 0


@pytest.mark.parametrize("cells", [4, 6, 7, 9])
def test_every_grid_of_a_cylinder_is_similar(cells: int) -> None:
    nominal, *levels = family(declared(cells, cylinder="0.03,0.04"))
    assert {round(similarity(nominal, grid), 12) for grid in levels} == {1.0}
    assert len({nominal, *levels}) >= 3


def test_the_grids_of_the_issue() -> None:
    assert family(declared(block=text(PAD))) == [
        (6, 6, 2), (3, 3, 1), (3, 3, 1), (9, 9, 3)
    ]  # fmt: skip
    assert family(declared(block=text(BAR))) == [
        (6, 3, 3), (2, 1, 1), (4, 2, 2), (8, 4, 4)
    ]  # fmt: skip


def test_cells_that_are_given_are_kept_and_refined_alike(tmp_path: Path) -> None:
    p = declared(block=text(PAD)).with_scene(body=Box(PAD, (8, 8, 4), "hex8"))
    assert family(p) == [(8, 8, 4), (4, 4, 2), (6, 6, 3), (12, 12, 6)]
    assert len(mesh_of(p, tmp_path).nodes) == 9 * 9 * 5


def test_a_grid_that_does_not_fit_into_the_memory_is_replaced_by_a_coarser_similar_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def in_memory(cells: tuple[int, ...]) -> bool:
        return fits(3 * int(np.prod(2 * np.array(cells) + 1)), 0.0, None)

    assert fitting((12, 12, 6), in_memory) == (12, 12, 6)
    monkeypatch.setattr(cost, "free_memory", lambda: 2e8)
    smaller = fitting((12, 12, 6), in_memory)
    assert (2, 2, 1) < smaller < (12, 12, 6)
    assert similarity((12, 12, 6), smaller) == 1.0
    monkeypatch.setattr(cost, "free_memory", lambda: 1.0)
    assert fitting((12, 12, 6), in_memory) == (2, 2, 1)
    p = declared(cylinder="0.03,0.04")
    assert min(family(p)[1:]) == family(p)[-1]


def test_a_grid_too_slow_for_a_first_answer_waits_for_refine() -> None:
    quick = declared(20, block=text(BRICK))
    whole = quick.with_settings(mesh=Meshes(budget=False))
    assert np.prod(family(quick)[-1]) < np.prod(family(whole)[-1])
    assert family(quick)[0] == family(whole)[0]


@pytest.mark.parametrize("body", [
    {"block": "0.1,0.01,0.01"}, {"block": "0.05,0.05,0.001"}, {"cylinder": "0.01,0.1"},
])  # fmt: skip
def test_a_slender_or_thin_body_has_two_cells_across_and_stays_small(body: dict[str, str]) -> None:
    p = declared(**body)
    grid = p.scene.body.cells
    assert min(grid) >= 2
    sides = [float(part) for part in next(iter(body.values())).split(",")]
    lengths = sides if len(sides) == 3 else (sides[0] / 2, sides[1])
    edges = np.array(lengths) / grid
    unknowns = unknowns_of(p, 2, Path())
    assert unknowns < 1.6e4
    assert edges.max() / edges.min() < 2.5 or unknowns > 6e3


def test_a_grid_without_a_common_factor_has_the_most_similar_neighbours() -> None:
    assert similarity((8, 9, 14), member((8, 9, 14), 0.625)) < 1.07
    assert member((5, 2), 2.0) == (10, 4)
    assert np.prod(member((3, 5), 0.9)) < 15 < np.prod(member((3, 5), 1.1))


def test_a_pad_s_cells_are_as_near_to_cubes_as_two_layers_allow() -> None:
    assert divided((6.0, 6.0, 0.96)) == (6, 6, 2)
    assert divided((6.0, 3.0, 3.0)) == (6, 3, 3)
    assert divided((8.0, 8.0, 8.0)) == (8, 8, 8)


def counts(parameters: Any) -> Floats:
    """Numbers that say how many cells the grid in use has, from cards called mesh or body."""
    body = getattr(getattr(parameters, "scene", parameters), "body", None)
    unused = {"plane": "solid", "solid": "plane"}.get(getattr(body, "space", ""))
    found: list[float] = []
    for p in describe(parameters):
        card, _, name = p.path.rpartition(".")
        whole = p.type.startswith(("int", "tuple[int"))
        if (
            card in ("mesh", "body")
            and name in _COUNTS
            and name != unused
            and whole
            and p.default is not None
        ):
            value = 2.0**p.default if name == "halvings" else p.default
            less = 1 if name.startswith("nodes_") else 0
            found += [float(x) - less for x in np.ravel(value)]
    return np.array(found)


def shipped(project_root: Path) -> list[Path]:
    return sorted(experiment_files(project_root).values())


def test_every_level_of_every_shipped_experiment_is_similar(project_root: Path) -> None:
    """Counts per axis are refined by one factor, within 10 % after rounding to whole cells."""
    walked = 0
    for path in shipped(project_root):
        experiment = load(str(path))
        ladder = experiment.uncertainty and experiment.uncertainty.mesh
        if not ladder:
            continue
        p = with_values(experiment.parameters, OPEN.get(experiment.name, {}))
        own, sizes = counts(p), {round(ladder.size(p), 9)}
        for level in ladder.levels:
            changed = level(p)
            n = counts(changed)
            moved = n != own
            ratio = n[moved] / own[moved] if moved.any() else np.ones(1)
            still = own[~moved]
            assert ratio.max() / ratio.min() < 1.10, (experiment.name, own, n)
            assert not moved.any() or set(still) <= {1.0}, (experiment.name, own, n)  # 2**halvings
            by = ladder.size(p) / ladder.size(changed)
            assert by == pytest.approx(np.exp(np.mean(np.log(ratio))), rel=0.05), experiment.name
            sizes.add(round(ladder.size(changed), 9))
        assert len(sizes) >= 3, experiment.name
        walked += 1
    assert walked >= 10


def test_a_level_that_scales_one_direction_alone_is_found(project_root: Path) -> None:
    """The beam's levels of 4 and 3 cells along it and two across it were no family."""
    p = load("silicone_beam").parameters
    once = with_values(p, {"body.cells": "4,2,2"})
    ratio = counts(once) / counts(p)
    assert ratio.max() / ratio.min() > 1.10


def test_a_bonded_pad_that_keeps_its_volume_does_not_lock() -> None:
    """Its force on the nominal grid is that of one half as fine again within 4 %; without the mixed
    dilatation it is far stiffer."""

    def force(cells: tuple[int, ...], order: Literal[1, 2]) -> float:
        element: Any = "hex27" if order == 2 else "hex8"
        p = declared(block=text(PAD)).with_scene(body=Box(PAD, cells, element))
        across = (Support("zmin"), Support("zmax", (0, 1)))
        nothing = Recording("log", Source("x", "", 0, "x"), 0)
        scene = static_scene(nothing, p.with_scene(supports=across), model_of("linear"), Path())
        stepper = QuasiStatic().prepare(build(scene))
        return stepper.step(stepper.rest(), np.array([1e-3])).numbers["load.force"]

    converged = force((9, 9, 3), 2)
    assert force((6, 6, 2), 2) == pytest.approx(converged, rel=0.04)
    assert force((6, 6, 2), 1) < 1.5 * converged
