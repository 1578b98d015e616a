"""Changes of the beam that are no single value: finer cells with their steps, the loss as it is
identified."""

from collections.abc import Callable
from typing import Any

from validate.parameters import with_given
from validate.pipeline.experiment.tree import Tree

from .settings import hung


def finer(share: float) -> Callable[[Tree], Any]:
    """Cells in every direction and steps at once: both errors are of order two."""

    def change(tree: Tree) -> Any:
        finer = tree.with_scene(body=tree.scene.body.scaled(share))
        by = edge(finer) / edge(tree)
        return with_given(finer, {"swing.dt": tree.settings.swing.dt * by})

    return change


def edge(tree: Tree) -> float:
    """The edge m of a cube as large as a cell."""
    length, width, height = tree.scene.body.size
    along, across, _ = tree.scene.body.cells
    return float((length * width * height / along / across**2) ** (1 / 3))


def heavier(tree: Tree, z: float) -> Any:
    """No mass is none, whatever its uncertainty."""
    mass = hung(tree)
    return with_given(tree, {"masses.load.mass": mass and mass + z * tree.settings.ranges.mass})


def higher(tree: Tree, z: float) -> Any:
    """Another height of the section."""
    length, width, height = tree.scene.body.size
    return with_given(tree, {"body.size": (length, width, height + z * tree.settings.ranges.size)})


def sooner(tree: Tree, z: float) -> Any:
    """What is identified is the loss, g tau of a short time: the modulus goes the other way."""
    card, by = tree.settings.relaxation, 1 + z * tree.settings.ranges.fast_time
    return with_given(tree, {
        "relaxation.fast_time": card.fast_time and card.fast_time * by,
        "relaxation.fast": card.fast and card.fast / by,
    })  # fmt: skip


def gravity_alone(tree: Tree) -> Any:
    """The recording under gravity, on which what stands open is identified."""
    return with_given(tree, {"recording": tree.settings.calibration, "masses.load.mass": 0.0})
