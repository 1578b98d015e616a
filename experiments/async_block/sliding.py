"""A probe that is pushed into a block and drawn along its face: the contact changes from node to
node, and the regions with it."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import Chart, Entry, Exhibit, NumberTable, Series
from validate.scene.scene import Scene
from validate.solve.regions.krylov import TouchedKrylov
from validate.solve.regions.scheme import AsyncRegions

from ..async_line.runs import off, pushed
from ..async_line.tables import ENERGY, energy_table

_DEEP, _FAR = 5e-3, 0.03  # m, into the face and along it
_PUSHED, _DRAWN = 0.2, 0.6  # s
_SOFT = 100.0  # N/m: a stiffer spring drags its node along, and no other ever is the nearest


def drawn(dt: float, dimension: int) -> Floats:
    """The probe's path (nt, d) m: inward, then along the face."""
    t: Floats = dt * np.arange(1, round((_PUSHED + _DRAWN) / dt) + 1, dtype=np.float64)
    path = np.zeros((len(t), dimension))
    path[:, 0] = -_DEEP * np.minimum(t / _PUSHED, 1.0)
    path[:, 1] = _FAR * np.maximum(t - _PUSHED, 0.0) / _DRAWN
    return path


def sliding_exhibit(
    scene: Scene, rivals: Mapping[str, AsyncRegions | TouchedKrylov], reference: str
) -> Exhibit:
    """Force, changes of contact and energies of the regions among `rivals`, by their labels."""
    slide = {
        label: replace(s, slides=True, spring=_SOFT)
        for label, s in rivals.items() if isinstance(s, AsyncRegions)
    }  # fmt: skip
    dt = slide[reference].dt
    path = drawn(dt, scene.mesh.dimension)
    whole = pushed(scene, slide[reference], path).force
    rows: list[tuple[Entry, ...]] = []
    series = []
    for label, settings in slide.items():
        found = pushed(scene, settings, path)
        t: Floats = dt * np.arange(1, len(found.force) + 1, dtype=np.float64)
        jumps = np.abs(np.diff(found.force, prepend=0.0))
        at = found.changed & (t > _PUSHED)
        rows.append((label, int(at.sum()), float(jumps[at].max(initial=0.0)),
                     float(jumps[~found.changed].max(initial=0.0)),
                     100 * off(found.force, whole[: len(t)])))  # fmt: skip
        series.append(Series(label, t, found.force))
    heads = ("method", "changes of contact or regions / 1", "largest step of the force at one / N",
             "at other ticks / N", "rms force error / %")  # fmt: skip
    title = (
        f"Pushed in by {1e3 * _DEEP:g} mm in {_PUSHED:g} s, drawn {1e3 * _FAR:g} mm along the face "
        f"in {_DRAWN:g} s behind {_SOFT:g} N/m; the contact goes to the "
        "nearest node with the force that the spring has."
    )
    chart = Chart("sliding", "Force across the face while the probe is drawn along it",
                  "time / s", "force on the hand / N", tuple(series))  # fmt: skip
    words = (
        "The regions of every contact are computed once, at the first tick that needs them. A "
        "node that moves to another region keeps the displacement that was shown.",
        ENERGY,
    )
    energies = replace(energy_table("Energy of the same run.", scene, slide, path),
                       name="sliding_energy")  # fmt: skip
    table = NumberTable("sliding", title, heads, tuple(rows))
    return Exhibit("sliding", "Sliding contact", words, (table, energies), charts=(chart,))
