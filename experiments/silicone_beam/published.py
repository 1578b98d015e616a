"""End positions that the data set's authors computed by COMSOL, beside ours.

They are those of the markers' feet on the beam's surface, in their frame whose origin is the lower
corner of the free end: displacements are what is compared. The constants are the same.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from validate.compare.published import Figure
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.tree import Tree
from validate.recording.types import Recording

from .settings import DATA_SET, FEET, hung

_LENGTH = 0.1
_WITHIN = 1e-4  # m
#: mm, at rest, by the mass kg that hangs there.
COMSOL: Mapping[float, tuple[tuple[float, float, float], ...]] = {
    0.0: ((1.0147, 15.001, 23.226), (0.516, -0.001, 17.248), (-0.964, 30.0, -0.691)),
    0.052: ((2.084, 15.015, 12.669), (0.467, -0.106, 7.159), (-3.429, 30.016, -10.282)),
}


def figures(mass: float) -> tuple[Figure, ...]:
    """Of the load whose mass kg it is; none of others."""
    ends = COMSOL.get(round(mass, 6), ())
    return tuple(
        _figure(foot, axis, 1e-3 * end["xyz".index(axis)], mass)
        for (foot, end) in zip(FEET, ends, strict=False)
        for axis in ("z", "x")
    )


def _figure(foot: str, axis: str, at: float, mass: float) -> Figure:
    start = FEET[foot]["xyz".index(axis)] - (_LENGTH if axis == "x" else 0.0)
    word = {"z": "vertical", "x": "along the beam"}[axis]
    load = f"{1e3 * mass:g} g" if mass else "gravity alone"
    return Figure(
        f"COMSOL: displacement {word} of {foot}, {load}", f"told:{foot}.{axis}",
        round(at - start, 9), _WITHIN, "m", "reproduced",
        "the same constants; theirs is a force where ours is a mass, the same at rest",
        DATA_SET, scale=6e-3,
    )  # fmt: skip


def follows(experiment: Experiment, recordings: Sequence[Recording], tree: Tree) -> Experiment:
    """The figures are those of the load that hangs there."""
    return replace(experiment, published=figures(hung(tree)))
