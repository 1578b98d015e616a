"""What both benchmarks show of paper 002's future work: penalty forces, sensitivities, diagonal
damping."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from validate.arrays import Floats
from validate.compare.exhibit import Exhibit
from validate.pipeline.experiment.experiment import Progress
from validate.scene.geometries.box import box
from validate.scene.material import Material
from validate.scene.scene import Scene

from .body import (
    MP1,
    MP2,
    STEP,
    needle_block,
    needle_depth,
    pressed_block,
)
from .diagonal_damping import damping_exhibit
from .penalty import NEARLY, Squeezed, penalty_exhibit
from .sensitivity import (
    TurnedBench,
    material_turns,
    mesh_turn,
    moved_nodes,
    sensitivity_exhibit,
)


@dataclass(frozen=True)
class PaperBody:
    """A benchmark's scene as printed, its inputs (nt, k) at times (nt,) s, and what is done to
    it."""

    scene: Callable[[], Scene]
    inputs: Callable[[Floats], Floats]
    squeezed: Callable[[], Squeezed]
    turned: Callable[[], TurnedBench]


def beyond(body: PaperBody, progress: Progress) -> tuple[tuple[Exhibit, ...], dict[str, float]]:
    """The three exhibits and their numbers."""
    progress("penalty")
    penalty, kept = penalty_exhibit(body.squeezed())
    progress("material and mesh")
    turned = sensitivity_exhibit(body.turned())
    progress("diagonal damping")
    damped, numbers = damping_exhibit(body.scene(), body.inputs, STEP)
    return (damped, turned, penalty), {**kept, **numbers}


def _squeezed_block() -> Squeezed:
    """Pressed on a fifth of its free side."""
    unlocked = replace(pressed_block(10, replace(MP1, nu=NEARLY)), dilatation="mixed")

    def make(n: int, material: Material) -> Scene:
        return pressed_block(n, material, box)

    return Squeezed(make, MP1, 10, 40, ("mixed quadrilaterals", unlocked))


def _turned_block() -> TurnedBench:
    """12 cells a side, so that every method is stable at both ends of every input; nu by a
    hundredth, because a tenth more is beyond .5."""
    base = needle_block(12)
    turns = (
        *material_turns(base, 0.01),
        mesh_turn("cells, along both sides", base, (14, 14), (10, 10)),
        mesh_turn("cells, along x alone", base, (14, 12), (10, 12)),
    )
    beside = {
        "inner nodes moved by up to a fifth of a cell": moved_nodes(base),
        "the material MP2": replace(base, material=MP2),
    }
    return TurnedBench(base, needle_depth, turns, beside)


BLOCK = PaperBody(lambda: needle_block(20), needle_depth, _squeezed_block, _turned_block)
