"""The box that calibrated: how far every method is off there, which is no evidence."""

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np

from validate.arrays import rms
from validate.compare.score import Score
from validate.papers.gel.between import GelRatio, between, scatter
from validate.papers.gel.box import Same, build, place
from validate.papers.gel.judged import GelErrors, strains
from validate.parameters import with_given
from validate.recording.types import Recording
from validate.register.displacements import DisplacementObservation
from validate.replay.experiment import Identified
from validate.replay.method import Method
from validate.replay.tree import Tree
from validate.solve.march import run_scheme

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
