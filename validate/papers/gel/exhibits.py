"""What `gel_indentation` shows: errors over strain and height against the floor, and a map.

The floor is what no smooth prediction falls below: the rms of measured displacements about a local
quadratic through each particle and its nearest, 20 in all, which fits a part of the noise itself.
"""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats, rms
from validate.compare.exhibit import Entry, Exhibit, Heat, NumberTable
from validate.papers.gel.box import GelIndentation, strain_norms
from validate.register.displacements import DisplacementObservation
from validate.register.scattered import local_fit, noise
from validate.replay.experiment import Progress, Told
from validate.replay.followed import Cases, Followed

Errors = Mapping[str, Floats]  # (k, 3) m by method

BANDS = (0.0, 0.06, 0.1, 0.15, 0.2, 0.3, 0.5, 1.0)  # strain norms
_SMOOTH = 40  # particles that a strain is read from
_HEIGHTS, _ACROSS, _FEW = 4, 10, 5  # layers, columns of a map; fewest particles of a number
_UM = 1e6


def tell(parameters: GelIndentation, cases: Cases, progress: Progress) -> Told:
    """Tables and maps of the particles judged, and the ratios of prediction to floor."""
    progress("errors inside")
    main = {name: f for name, f in cases[""].items() if f.run.finished}
    errors = {name: _errors(f) for name, f in main.items()}
    inside = _Inside(next(iter(main.values())))
    maps = (_map(name, main[name].label, e, inside.seen) for name, e in errors.items())
    shown = Exhibit(
        "inside", "Errors inside the body", inside.words(errors), inside.tables(errors),
        heats=tuple(maps),
    )  # fmt: skip
    return Told((shown,), {f"ratio.{n}": rms(e) / rms(inside.floor) for n, e in errors.items()})


class _Inside:
    """The particles of one box: floor, noise and strain there."""

    def __init__(self, followed: Followed) -> None:
        (self.seen,) = followed.registered[0].of(DisplacementObservation)
        x, u = self.seen.points, self.seen.u
        self.floor, self.sd = noise(x, u)
        self.strain = strain_norms(local_fit(x, u, x, min(_SMOOTH, len(x)), 1).slopes)

    def tables(self, errors: Errors) -> tuple[NumberTable, ...]:
        z = _UM * self.seen.points[:, 2]
        edges = np.linspace(z.min(), z.max() + 1e-9, _HEIGHTS + 1)
        bands = [(f"{a:g} to {b:g}", (self.strain >= a) & (self.strain < b))
                 for a, b in pairwise(BANDS)]  # fmt: skip
        layers = [(f"{a:.1f} to {b:.1f}", (z >= a) & (z < b)) for a, b in pairwise(edges)]
        return (
            _table("errors_over_strain", "Over the strain norm", "strain norm (1)", bands,
                   errors, self.floor),
            _table("errors_over_height", "Over the height in the box", "z (µm)", layers,
                   errors, self.floor),
        )  # fmt: skip

    def words(self, errors: Errors) -> tuple[str, ...]:
        return _words(errors, self.floor, self.sd, self.strain)


def _errors(followed: Followed) -> Floats:
    (seen,) = followed.registered[0].of(DisplacementObservation)
    return seen.simulated(followed.run.u[-1]) - seen.u


def _words(errors: Errors, floor: Floats, sd: Floats, strain: Floats) -> tuple[str, ...]:
    best = min(errors, key=lambda name: rms(errors[name]))
    least = rms(errors[best])
    noise_alone = float(np.linalg.norm(sd))
    left = float(np.sqrt(max(least**2 - noise_alone**2, 0.0)))
    bias = _UM * errors[best].mean(axis=0)
    return (
        f"{len(floor)} linked particles inside, strain norms {strain.min():.3f} to "
        f"{strain.max():.3f} (affine fits of {_SMOOTH} neighbours). Noise of a displacement: "
        f"{', '.join(f'{_UM * s:.3f}' for s in sd)} µm along x, y, z (standard deviations), "
        f"{_UM * noise_alone:.3f} µm in all; about a local quadratic of 20 neighbours "
        f"{_UM * rms(floor):.3f} µm are left: the floor.",
        f"Best is '{best}', rms {_UM * least:.3f} µm, {least / rms(floor):.2f} floors. A "
        f"perfect model would show the noise, {noise_alone / rms(floor):.2f} floors; what is left "
        f"beyond it is {_UM * left:.3f} µm, of mean {', '.join(f'{b:+.3f}' for b in bias)} µm "
        "along x, y, z.",
        "Displacement alone sees the Poisson ratio and no modulus: every force is in a unit that "
        "nobody stated.",
    )


def _table(
    name: str,
    title: str,
    heading: str,
    parts: Sequence[tuple[str, NDArray[np.bool_]]],
    errors: Errors,
    floor: Floats,
) -> NumberTable:
    """Rms errors and their ratio to the floor, of every part with enough particles."""
    rows: list[tuple[Entry, ...]] = []
    for text, those in (*parts, ("all", np.ones(len(floor), dtype=bool))):
        if those.sum() < _FEW:
            continue
        least = rms(floor[those])
        each = [rms(e[those]) for e in errors.values()]
        shown = [x for e in each for x in (round(_UM * e, 4), round(e / least, 3))]
        rows.append((text, int(those.sum()), round(_UM * least, 4), *shown))
    heads = [h for m in errors for h in (f"{m} (µm)", f"{m} / floor (1)")]
    return NumberTable(
        name, f"{title}: rms errors of displacement vectors",
        (heading, "particles (1)", "floor (µm)", *heads), tuple(rows),
    )  # fmt: skip


def _map(name: str, label: str, error: Floats, seen: DisplacementObservation) -> Heat:
    """Rms error over x and z, of particles at all y."""
    x, z = seen.points[:, 0], seen.points[:, 2]
    xs, zs = (np.linspace(c.min(), c.max() + 1e-12, n + 1) for c, n in
              ((x, _ACROSS), (z, _HEIGHTS)))  # fmt: skip
    values = np.full((_HEIGHTS, _ACROSS), np.nan)
    for i in range(_HEIGHTS):
        for j in range(_ACROSS):
            here = (z >= zs[i]) & (z < zs[i + 1]) & (x >= xs[j]) & (x < xs[j + 1])
            if here.sum() >= _FEW:
                values[i, j] = _UM * rms(error[here])
    return Heat(
        f"map_{name}", f"Where the errors are: {label}", "x in the box (µm)", "z in the box (µm)",
        tuple(f"{_UM * (a + b) / 2:.0f}" for a, b in pairwise(xs)),
        tuple(f"{_UM * (a + b) / 2:.1f}" for a, b in pairwise(zs)),
        values, "rms error (µm)",
    )  # fmt: skip
