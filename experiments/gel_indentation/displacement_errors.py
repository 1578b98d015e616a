"""Errors of the methods' displacements in a box, and in the box that calibrated: no evidence."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats, rms
from validate.compare.exhibit import Entry, Heat, NumberTable
from validate.compare.score import Score
from validate.parameters import with_given
from validate.pipeline.experiment.experiment import Identified
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.tree import Tree
from validate.recording.types import Recording
from validate.register.markers.displacements import DisplacementObservation
from validate.solve.march import run_scheme

from .box import GelBoxes, Same, build, place, strain_norms
from .particle_linking import local_fit, noise
from .particles import motion
from .poisson_ratio import GelRatio, between, scatter

BANDS = (0.0, 0.02, 0.04, 0.06, 0.1, 0.15, 0.2, 0.3, 0.5, 1.0)  # strain norms
SMOOTH = 80  # particles that a strain is read from
_HEIGHTS, _ACROSS, _FEW = 4, 10, 5  # layers, columns of a map; fewest particles of a number
_UM = 1e6


def strains(whose: Same, box: GelBoxes, seen: DisplacementObservation) -> Floats:
    """Strain norms (k,) at the particles judged, by local quadratics of all linked ones."""
    x, u = motion(whose.recording)
    low, _ = box.ends()
    return strain_norms(local_fit(x, u, seen.points + low, SMOOTH).slopes)


@dataclass(frozen=True)
class GelErrors:
    """Particles `seen` in one box, `errors` (k, 3) m by method, `strain` norms (k,) there."""

    seen: DisplacementObservation
    errors: Mapping[str, Floats]
    strain: Floats

    @cached_property
    def _noise(self) -> tuple[Floats, Floats]:
        return noise(self.seen.points, self.seen.u)

    @property
    def floor(self) -> Floats:
        return self._noise[0]

    @property
    def sd(self) -> Floats:
        return self._noise[1]

    def over_strain(self, name: str, title: str) -> NumberTable:
        parts = [(f"{a:g} to {b:g}", (self.strain >= a) & (self.strain < b))
                 for a, b in pairwise(BANDS)]  # fmt: skip
        return self._table(name, title, "strain norm (1)", parts)

    def over_height(self, name: str, title: str) -> NumberTable:
        z = _UM * self.seen.points[:, 2]
        edges = np.linspace(z.min(), z.max() + 1e-9, _HEIGHTS + 1)
        parts = [(f"{a:.1f} to {b:.1f}", (z >= a) & (z < b)) for a, b in pairwise(edges)]
        return self._table(name, title, "z in the box (µm)", parts)

    def _table(
        self, name: str, title: str, heading: str, parts: Sequence[tuple[str, NDArray[np.bool_]]]
    ) -> NumberTable:
        """Rms errors and their ratio to the floor, of every part with enough particles."""
        rows: list[tuple[Entry, ...]] = []
        for text, those in (*parts, ("all", np.ones(len(self.floor), dtype=bool))):
            if those.sum() < _FEW:
                continue
            least = rms(self.floor[those])
            each = [rms(e[those]) for e in self.errors.values()]
            shown = [x for e in each for x in (round(_UM * e, 4), round(e / least, 3))]
            rows.append((text, int(those.sum()), round(_UM * least, 4), *shown))
        heads = [h for m in self.errors for h in (f"{m} (µm)", f"{m} / floor (1)")]
        return NumberTable(
            name, title, (heading, "particles (1)", "floor (µm)", *heads), tuple(rows)
        )

    def words(self) -> tuple[str, ...]:
        best = min(self.errors, key=lambda name: rms(self.errors[name]))
        least, floor = rms(self.errors[best]), rms(self.floor)
        noise_alone = float(np.linalg.norm(self.sd))
        left = float(np.sqrt(max(least**2 - noise_alone**2, 0.0)))
        bias = _UM * self.errors[best].mean(axis=0)
        return (
            f"{len(self.floor)} linked particles inside, strain norms {self.strain.min():.3f} "
            f"to {self.strain.max():.3f} (local quadratics of {SMOOTH} neighbours, in the box "
            f"or not). Noise of a displacement: {', '.join(f'{_UM * s:.3f}' for s in self.sd)} "
            f"µm along x, y, z (standard deviations), {_UM * noise_alone:.3f} µm in all; about "
            f"a local quadratic of 20 neighbours {_UM * floor:.3f} µm remain: the floor.",
            f"Best is '{best}', rms {_UM * least:.3f} µm, {least / floor:.2f} floors. A "
            f"perfect model would show the noise, {noise_alone / floor:.2f} floors; the "
            f"rest is {_UM * left:.3f} µm, of mean {', '.join(f'{b:+.3f}' for b in bias)} µm "
            "along x, y, z.",
        )

    def map(self, name: str, label: str) -> Heat:
        """Rms error over x and z, of particles at all y."""
        x, z = self.seen.points[:, 0], self.seen.points[:, 2]
        xs, zs = (np.linspace(c.min(), c.max() + 1e-12, n + 1) for c, n in
                  ((x, _ACROSS), (z, _HEIGHTS)))  # fmt: skip
        values = np.full((_HEIGHTS, _ACROSS), np.nan)
        for i in range(_HEIGHTS):
            for j in range(_ACROSS):
                here = (z >= zs[i]) & (z < zs[i + 1]) & (x >= xs[j]) & (x < xs[j + 1])
                if here.sum() >= _FEW:
                    values[i, j] = _UM * rms(self.errors[name][here])
        return Heat(
            f"map_{name}", f"Where the errors are: {label}", "x in the box (µm)",
            "z in the box (µm)",
            tuple(f"{_UM * (a + b) / 2:.0f}" for a, b in pairwise(xs)),
            tuple(f"{_UM * (a + b) / 2:.1f}" for a, b in pairwise(zs)),
            values, "rms error (µm)",
        )  # fmt: skip


_WORDS = "rms error of displacement vectors in the lower box over that about local quadratics"
_SPREAD = "standard deviation of the ratios fitted in several boxes, with faces smoothed otherwise"


def fitted_box(
    recordings: Sequence[Recording], tree: Tree, methods: Mapping[str, Method]
) -> Identified:
    """Errors over the floor in the lower box, under the Poisson ratio that was found there, and
    the scatter of that ratio between boxes, which goes on as an uncertainty."""
    whose = Same(recordings[0])
    judged = in_lower(whose, tree, methods)
    count, least = len(judged.floor), rms(judged.floor)
    over = {name: rms(e) / least for name, e in judged.errors.items()}
    found = between(whose, tree.scene.body)
    spread = tree.settings.between or scatter(found)
    scores = (
        *(Score(f"lower.over_floor.{name}", ratio, "1", count, "what calibrates", _WORDS)
          for name, ratio in over.items()),
        Score("nu.between_boxes", spread, "1", len(found), "what calibrates", _SPREAD),
    )  # fmt: skip
    each = ", ".join(f"{name} {ratio:.2f}" for name, ratio in over.items())
    note = f"In the lower box, {count} particles, errors over the floor there: {each} (fitted)."
    used = with_given(tree, {"between": spread})
    return Identified(used, scores, (note, _scatters(found, spread)))


def _scatters(found: Sequence[GelRatio], spread: float) -> str:
    ratios = [f.nu for f in found]
    return (
        f"The interval of material.nu is of this one box. In {len({f.box for f in found})} boxes, "
        f"faces smoothed in {len({f.neighbours for f in found})} ways, it is fitted as "
        f"{min(ratios):.3f} to {max(ratios):.3f}, standard deviation {spread:.3f}: input 'box'."
    )


def in_lower(whose: Same, tree: Tree, methods: Mapping[str, Method]) -> GelErrors:
    """The lower box as every method that comes to an end has it."""
    lower = with_given(tree, {"body.which": "lower", "between": 0.0})
    return _run(whose, lower, tuple(methods.items()))


@lru_cache(maxsize=2)
def _run(whose: Same, tree: Tree, methods: tuple[tuple[str, Method], ...]) -> GelErrors:
    errors = {}
    for name, method in methods:
        scene = build(whose.recording, tree, method.scene)
        placed = place(whose.recording, tree, scene)
        last = np.zeros(1, dtype=np.int64)
        run = run_scheme(name, method.settings, scene, placed.t, placed.inputs, last)
        (seen,) = placed.of(DisplacementObservation)
        if run.finished:
            errors[name] = seen.simulated(run.u[-1]) - seen.u
    return GelErrors(seen, errors, strains(whose, tree.scene.body, seen))
