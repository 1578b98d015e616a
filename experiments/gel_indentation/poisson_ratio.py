"""What the choice of a box does to the Poisson ratio: it is fitted in several boxes, with the faces
smoothed more and less.

The profile interval of one box holds its noise and misfit and not that choice. What the ratios
scatter by is therefore an uncertain input of what is predicted with one of them.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from validate.arrays import Floats, rms
from validate.errors import RegistrationError
from validate.fem.system import build
from validate.parameters import with_given
from validate.pipeline.experiment.tree import Tree
from validate.scene.material import Material
from validate.scene.places import nodes_of
from validate.scene.scene import Scene, Support

from .box import (
    FACES,
    GelBoxes,
    GelFaces,
    Same,
    faces_of,
    inside_of,
    neighbours_of,
)
from .particle_linking import noise
from .particles import motion

SMOOTHINGS = (0.5, 1.0, 2.0)
_CELLS = (6, 3)  # a third of the nominal mesh's unknowns: no ratio moves by .01
RATIOS = (0.0, 0.1, 0.2, 0.27, 0.33, 0.38, 0.42, 0.445, 0.465, 0.48, 0.49, 0.4975)
_FINE, _STEP = 40, 1e-3  # ratios tried at once; step of the second difference at the best


@dataclass(frozen=True)
class GelRatio:
    """One box: its particles, the ratio fitted there with its standard deviation (widened by the
    misfit; none where that has no least value within the range), the rms error over the floor."""

    box: str
    neighbours: int
    count: int
    nu: float
    sd: float | None
    over_floor: float


@lru_cache(maxsize=2)
def between(whose: Same, box: GelBoxes) -> tuple[GelRatio, ...]:
    """The ratio in the lower box and in those around it; boxes with too few particles,
    and those that reach beyond the particles, are left out."""
    found: list[GelRatio] = []
    x, _ = motion(whose.recording)
    lower = replace(box, which="lower", cells=_CELLS, element="hex27")
    for k, (name, other) in enumerate(_around(lower)):
        low, high = other.ends()
        if k and ((low < x.min(axis=0)) | (high > x.max(axis=0))).any():
            continue
        try:
            found += _fitted(whose, name, other)
        except RegistrationError:
            continue
    return tuple(found)


def scatter(found: tuple[GelRatio, ...]) -> float:
    """Standard deviation of the ratios between boxes and neighbours; 0 for a single one."""
    return float(np.std([f.nu for f in found], ddof=1)) if len(found) > 1 else 0.0


def _around(box: GelBoxes) -> Iterator[tuple[str, GelBoxes]]:
    x, y, side, bottom, middle = (
        float(v) for v in (box.x, box.y, box.side, box.bottom, box.middle) if v is not None
    )
    high = middle - bottom
    yield "the lower box", box
    yield "a quarter lower top", replace(box, middle=middle - high / 4)
    yield "a quarter higher top", replace(box, middle=middle + high / 4)
    yield "a quarter higher bottom", replace(box, bottom=bottom + high / 4)
    yield "3/4 of the side", replace(box, side=0.75 * side)
    yield "5/4 of the side", replace(box, side=1.25 * side)
    for word, step in (("back", -side / 4), ("on", side / 4)):
        yield f"a quarter {word} along x", replace(box, x=x + step)
        yield f"a quarter {word} along y", replace(box, y=y + step)


def _fitted(whose: Same, name: str, box: GelBoxes) -> list[GelRatio]:
    seen = inside_of(whose, box)
    count = neighbours_of(whose, box)
    moved = [faces_of(whose, box, GelFaces(count, times)) for times in SMOOTHINGS]
    mesh = box.resolved(Path())
    held = nodes_of(mesh, FACES)
    faces = (Support(FACES),)
    scenes = (Scene(mesh, Material(1.0, nu), supports=faces) for nu in RATIOS)
    fields = np.stack([solved(scene, held, moved) for scene in scenes])
    floor, sd = noise(seen.points, seen.u)
    rows = []
    for k, times in enumerate(SMOOTHINGS):
        errors = np.stack([seen.simulated(u) - seen.u for u in fields[:, k]])
        nu, spread, best = best_ratio(errors, sd)
        rows.append(GelRatio(name, round(count * times), len(floor), nu, spread, best / rms(floor)))
    return rows


def solved(scene: Scene, held: np.ndarray, moved: list[Floats]) -> Floats:
    """Fields (c, n, 3) m of a body whose supported nodes `held` are moved in c ways."""
    system = build(scene)
    u = np.zeros((scene.mesh.nodes.size, len(moved)))
    u[(3 * held[:, None] + np.arange(3)).ravel()] = np.stack([m.ravel() for m in moved], axis=1)
    u[system.free] = -system.factor().solve(np.asarray((system.K @ u)[system.free]))
    return u.T.reshape(len(moved), -1, 3)


def best_ratio(errors: Floats, sd: Floats) -> tuple[float, float | None, float]:
    """Ratio of least misfit of errors (ratios, k, 3) m, its standard deviation, the rms there."""
    field = CubicSpline(RATIOS, errors)

    def misfit(nus: Floats) -> Floats:
        return np.asarray(((field(nus) / sd) ** 2).sum(axis=(1, 2)))

    low, high, nu, step = RATIOS[0], RATIOS[-1], 0.0, 0.0
    for _ in range(3):
        nus = np.linspace(low, high, _FINE)
        nu, step = float(nus[np.argmin(misfit(nus))]), float(nus[1] - nus[0])
        low, high = max(nu - step, RATIOS[0]), min(nu + step, RATIOS[-1])
    left = math.sqrt((field(nu) ** 2).sum(axis=1).mean())
    if not RATIOS[0] < nu < RATIOS[-1]:
        return nu, None, left
    step = min(_STEP, nu - RATIOS[0], RATIOS[-1] - nu)
    one, least, other = misfit(nu + step * np.array([-1.0, 0.0, 1.0]))
    bend = (one - 2 * least + other) / step**2
    return nu, math.sqrt(2 * least / errors[0].size / bend), left


OTHER_BOXES = f"absolute between, at least {RATIOS[0]:g}, at most {RATIOS[-1]:g}"


def smoothed(tree: Tree, z: float) -> Tree:
    """Half as many neighbours at the faces at z = -sqrt(3), twice as many at sqrt(3)."""
    by = 2 ** (z / math.sqrt(3))
    smoothed: Tree = with_given(tree, {"faces.smoothing": tree.settings.faces.smoothing * by})
    return smoothed
