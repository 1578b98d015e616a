"""The touched bodies of paper 004, resolved with other numbers than the declared ones."""

from beside import beside, experiment

from experiments.async_line.probe import pad_of as pad_of_bar
from validate.parameters import with_given
from validate.pipeline.experiment.tree import Built, Tree
from validate.scene.scene import Scene

LENGTH, AREA, DENSITY, DAMPING = 0.1, 40e-4, 1000.0, 6.5


def bar(E: float, cells: int) -> Scene:
    scene: Scene = beside("async_line", "twin").with_cells(_of("async_line", E), cells)
    return scene


def pad_of(cells: int) -> float:
    return pad_of_bar(bar(5e3, cells))


def block_tree(E: float, cells: int, dimension: int, nu: float = 0.45) -> Tree:
    tree: Tree = beside("async_block", "sizes").sized(_of("async_block", E), dimension, cells)
    given: Tree = with_given(tree, {"material.nu": nu})
    return given


def block(E: float, cells: int, dimension: int, nu: float = 0.45) -> Scene:
    return Built()(None, block_tree(E, cells, dimension, nu))


def _of(name: str, E: float) -> Tree:
    tree: Tree = with_given(experiment(name).parameters, {"material.E": E})
    return tree
