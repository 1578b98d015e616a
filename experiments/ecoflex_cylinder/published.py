"""The printed moduli of the ten logs, and the experiment as its logs have it.

Title, limit and printed figures belong to a material.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from validate.compare.published import Figure, Values
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.tree import Tree
from validate.recording.types import Recording

from .cylinder import DATA_SET, LoggedCylinder, size, window
from .specimens import material_of, split

_TEN = f"{DATA_SET}: ten repeats, two specimens"


def _shear_modulus(values: Values) -> float:
    """Of neo-Hooke between slipping plates, nearly incompressible: a third of its modulus."""
    return float(values["identified"]["modulus.neo_slip"]) / 3


PUBLISHED = (
    Figure(
        "modulus.E, 0.5-5 % strain", "identified:modulus.E", 104e3, 9e3, "Pa", "reproduced",
        "within two sd (4.5 kPa) of the scatter between specimens", _TEN, 107.666e3, 10.0,
    ),
    Figure(
        "sd of modulus.E", "identified:modulus.E.sd_repeats", 4.5e3, None, "Pa", "not comparable",
        "ours is of repeats on one specimen: the second one's logs are missing", _TEN,
        1.052e3, 1.0,
    ),
    Figure(
        "neo-Hooke shear modulus over the whole log",
        _shear_modulus, 36.7e3, None, "Pa", "not comparable",
        "theirs is fitted to 66 % strain, ours to 50 % with slipping plates", _TEN, 30.391e3, 10.0,
    ),
)  # fmt: skip


MATERIAL = "EF30_0T"  # Ecoflex 00-30 without thinner, as the data set calls it
LOGS = frozenset(f"{MATERIAL}_A{k}" for k in range(1, 6))


def follows(experiment: Experiment, recordings: Sequence[Recording], tree: Tree) -> Experiment:
    """The experiment for the logs given.

    Other logs of the printed material are held to its figure, not to our value of the five logs.
    Another material has its own title and limit, and no printed figure.
    """
    p: LoggedCylinder = tree.settings
    apart = split(recordings, p.judged).apart
    loads = (*((window(p.fit_to),) if apart else ()), window(p.limit_linear))
    judged = tuple(replace(a, loads=loads) for a in experiment.accept)
    experiment = replace(experiment, accept=judged)
    materials = tuple(dict.fromkeys(material_of(r) for r in recordings))
    if {r.name for r in recordings} == LOGS and materials == (MATERIAL,):
        return experiment
    logs = f"{len(recordings)} log{'s' if len(recordings) > 1 else ''}"
    title = f"{', '.join(materials)}: cylinder compressed between plates, {logs}"
    if materials == (MATERIAL,):
        own = tuple(replace(f, expected=None, drift=None) for f in experiment.published)
        return replace(experiment, title=title, published=own)
    return _foreign(replace(experiment, title=title), recordings, tree, materials)


def _foreign(
    experiment: Experiment,
    recordings: Sequence[Recording],
    tree: Tree,
    materials: tuple[str, ...],
) -> Experiment:
    """Another material: nothing of the printed one is taken for its own without saying so."""
    limit, strain = _tenth(recordings, tree), tree.settings.limit_linear
    reason = f"a tenth of the force measured at {100 * strain:g} % strain, these logs"
    other = f"printed for {MATERIAL}; not compared with this data ({', '.join(materials)})"
    uncertainty = experiment.uncertainty
    return replace(
        experiment,
        source=f"logs in {', '.join(sorted({Path(r.source.path).name for r in recordings}))}",
        accept=tuple(replace(a, limit=limit, reason=reason) for a in experiment.accept),
        published=tuple(replace(f, other=other) for f in experiment.published),
        uncertainty=uncertainty
        and replace(
            uncertainty,
            inputs=tuple(
                replace(i, source=f"assumed, as for {MATERIAL}: {i.source}")
                for i in uncertainty.inputs
            ),
        ),
    )


def _tenth(recordings: Sequence[Recording], tree: Tree) -> float:
    """A tenth of the force N at the linear law's strain, mean over the logs."""
    forces = []
    for recording in recordings:
        moved, force = recording.signal("displacement", "m"), recording.signal("force", "N")
        last = int(np.argmax(moved.y[:, 0] >= tree.settings.limit_linear * size(tree).height))
        forces.append(float(np.interp(moved.t[last], force.t, force.y[:, 0])))
    return 0.1 * float(np.mean(forces))
