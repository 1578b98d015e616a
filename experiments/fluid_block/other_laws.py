"""Other laws of the fluid than a constant volume: a reservoir, a compressible one, a pulse.

Paper 000, section 3.2, names blood pressure in time; the reservoir is beyond the paper.
"""

from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import Chart, Entry, Exhibit, NumberTable, Series
from validate.fem.system import Responses
from validate.pipeline.experiment.tree import Tree
from validate.solve.fluid.cavities import ElasticPressure, ExactPressure, PulsePressure
from validate.solve.types import State

from .block import FluidLaws
from .updates import pressed

_INSTANTS = 100  # of two pulses
_MMHG = 133.322387415  # Pa
_LINEAR_TO = 0.3  # of volume, either way: as far as the paper draws its line


def laws_exhibit(p: Tree) -> Exhibit:
    """A reservoir by Newton where substitution diverges, a compressible fluid, and a pulse."""
    r = pressed(p, "plate")
    drive = np.array([p.settings.strains[-1] * p.scene.body.height])
    slope = float(r.rest_volumes[0] / (3 * r.volumes[0, 0, 0, 1 + r.drives]))  # Pa, at rest
    rows: list[tuple[Entry, ...]] = []
    for times in (0.1, 0.5, 0.9, 1.1, 2.0, 10.0):
        law = ElasticPressure(p.settings.laws.preset, times * slope)
        rows.append((f"P = Pe - B(V/V0 - 1), B = {times:g} slopes", *_told(_one(law, r, drive)),
                     _substituted(r, drive, law)))  # fmt: skip
    own = ElasticPressure(p.settings.laws.preset, p.settings.laws.stiffness)
    rows.append((f"P = Pe - B(V/V0 - 1), B = {p.settings.laws.stiffness:.4g} Pa",
                 *_told(_one(own, r, drive)), _substituted(r, drive, own)))  # fmt: skip
    for K in (1e4, 1e6, p.settings.laws.bulk_modulus):
        state = _one(ExactPressure(1.0, K), r, drive)
        rows.append((f"compressible, bulk modulus {K:.3g} Pa", *_told(state), None))
    rows.append(("incompressible", *_told(_one(ExactPressure(), r, drive)), None))
    table = NumberTable(
        "laws", "The plate at the largest strain.",
        ("law", "pressure / Pa", "V/V0 / 1", "Newton steps", "outcome", "substitutions to 1e-9"),
        tuple(rows),
        f"Pe = {p.settings.laws.preset:g} Pa. No number of substitutions: it diverges, as expected "
        "where B exceeds the slope.",
    )  # fmt: skip
    pulse, words = _pulse(r, p)
    return Exhibit("laws", "Other pressure laws", words, (table,), (pulse,))


def _one(scheme: Any, r: Responses, drive: Floats) -> State:
    stepper = scheme.on(r)
    state: State = stepper.step(stepper.rest(), drive)
    return state


def _told(state: State) -> tuple[Entry, ...]:
    if state.failure:
        return None, None, None, f"{state.failure[0]}: {state.failure[1]}"
    n = state.numbers
    return n["cavity0.pressure"], n["cavity0.volume_ratio"], state.updates, "settled"


def _substituted(r: Responses, drive: Floats, law: ElasticPressure) -> int | None:
    """Substitutions of the law from zero until it moves by 1e-9; None: it diverges."""
    z = np.concatenate([[1.0], drive, np.zeros(len(r.volumes))])
    for count in range(1, 1000):
        ratio = float(r.volumes[0] @ z @ z @ z) / float(r.rest_volumes[0])
        new = law.preset - law.stiffness * (ratio - 1)
        if not abs(new) < 1e3 * (abs(law.stiffness) + abs(law.preset)):
            return None
        if abs(new - z[2]) <= 1e-9 * abs(new):
            return count
        z[2:] = new
    return None


def _pulse(r: Responses, p: Tree) -> tuple[Chart, tuple[str, ...]]:
    """Two pulses of the prescribed pressure, no tool, and where a linear model ends."""
    laws: FluidLaws = p.settings.laws
    low, high, rate = laws.pulse_low, laws.pulse_high, laws.pulse_rate
    dt = (2 / rate if rate else 1.0) / _INSTANTS
    stepper = PulsePressure(low, high, rate, dt).on(r)
    state, found = stepper.rest(), []
    for _ in range(_INSTANTS):
        state = stepper.step(state, np.zeros(r.drives))
        found.append([state.numbers[f"cavity0.{k}"]
                      for k in ("pressure", "volume_ratio", "beyond_linear")])  # fmt: skip
    P, V, beyond = np.array(found).T
    t: Floats = dt * np.arange(1, _INSTANTS + 1, dtype=np.float64)
    name = f"{low / _MMHG:.4g} to {high / _MMHG:.4g} mmHg, {60 * rate:.3g} a minute"
    chart = Chart(
        "pulse", f"A pulse of {name}", "time / s", "pressure / 100 mmHg, V/V0 / 1",
        (Series("pressure", t, P / (100 * _MMHG)), Series("V/V0", t, V)),
        levels=(("130 %", 1 + _LINEAR_TO),),
    )  # fmt: skip
    if not beyond.any():
        return chart, (f"A pulse of {name}: V/V0 stays within 0.7 to 1.3, {V.max():.3f} at most.",)
    return chart, (
        f"Warning: a pulse of {name} leaves the range of a linear model. At {int(beyond.sum())} of "
        f"{len(t)} instants V/V0 is beyond 0.7 to 1.3, {V.max():.2f} at most.",
    )
