"""How many updates of the pressure every law takes, and where the scalar law diverges.

Paper 000, section 3.3: "strains of order 0.3 % to 15 % solve to 1 % in a maximum of 1 update".
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import Chart, Entry, Exhibit, NumberTable, Series
from validate.errors import SceneError
from validate.fem.system import Responses
from validate.fem.system import build as build_system
from validate.fem.system import responses as responses_of
from validate.papers.fluid_block.block import FluidBlock, ToolName, slab
from validate.replay.experiment import Progress
from validate.scene.material import Material
from validate.solve.fluid import ElasticPressure, ExactPressure
from validate.solve.pressure_curve import slopes, still
from validate.solve.pressure_loop import PressureLoop, UpdateName, gain_matrix, spectral_radius
from validate.solve.pulse import MMHG, PulsePressure
from validate.solve.types import Scheme, State

TOLERANCES = (1e-2, 1e-3, 1e-12)
TOOLS: tuple[ToolName, ...] = ("needle", "patch", "plate")
_ONE: tuple[UpdateName, ...] = (
    "proportional", "retuned", "piecewise", "secant", "newton", "golden",
)  # fmt: skip
_SEVERAL: tuple[UpdateName, ...] = ("proportional", "retuned", "secant", "newton")
_MOST = 500
_SEPTA = (0.25, 0.5, 1.0, 2.0)  # of the septum as set


def pressed(p: FluidBlock, tool: ToolName, finer: int = 1, **cavities: Any) -> Responses:
    """The block of linear triangles under a tool, on a mesh so many times as fine."""
    material = Material(p.material.E, p.material.nu)
    made = replace(p.cavities, **cavities)
    scene = slab(p.body, made, finer * p.mesh.squares, p.mesh.order or 1, material, tool)
    return responses_of(build_system(scene))


def updates_exhibit(p: FluidBlock, progress: Progress) -> tuple[Exhibit, dict[str, float]]:
    """Tables of updates by law and strain for each tool, a chart, and the printed claims."""
    tables: list[NumberTable] = []
    lines: list[Series] = []
    numbers: dict[str, float] = {}
    for tool in TOOLS:
        progress(f"updates under a {tool}")
        r = pressed(p, tool)
        cold = _cold(r, p)
        tables.append(_table(tool, p.strains, cold))
        lines.append(Series(f"{tool}, the paper's law to 1 %", 100 * np.array(p.strains),
                            _seen(cold["proportional", 1e-2]), "points"))  # fmt: skip
        numbers |= {f"{tool}.cold": max(_seen(cold["proportional", 1e-2]))}
        numbers |= {f"{tool}.warm": max(_warm(r, p, 1e-3))}
    tables.append(_warm_table(p))
    chart = Chart(
        "updates", "Updates of the paper's law from a cold start", "strain / %", "updates / 1",
        tuple(lines), levels=(("the paper's claim", 1.0),),
    )  # fmt: skip
    words = (
        "Strain is read as the tool's displacement over the block's height; the paper is silent. "
        "A cold start begins at pressure zero, a warm one at the last state's.",
        "A needle is one node of the mesh: the volume it displaces shrinks with the mesh.",
        "exact: the root of the volume's polynomial, in Newton steps on one number; the others "
        "evaluate the whole wall once an update.",
    )
    return Exhibit("updates", "Updates of the pressure", words, tuple(tables), (chart,)), numbers


def _laws(p: FluidBlock) -> tuple[UpdateName, ...]:
    return _ONE if p.cavities.count == 1 else _SEVERAL


def _cold(r: Responses, p: FluidBlock) -> dict[tuple[str, float], list[State]]:
    """States by law and tolerance at every strain, each from rest."""
    found: dict[tuple[str, float], list[State]] = {}
    for name in _laws(p):
        for tolerance in TOLERANCES:
            loop = PressureLoop(update=name, tolerance=tolerance, max_updates=_MOST,
                                warm_start=False)  # fmt: skip
            found[name, tolerance] = _states(loop, r, p)
    found["exact", 1e-12] = _states(ExactPressure(), r, p)
    return found


def _states(scheme: Scheme, r: Responses, p: FluidBlock) -> list[State]:
    stepper = scheme.on(r)  # type: ignore[attr-defined]
    return [stepper.step(stepper.rest(), np.array([s * p.body.height])) for s in p.strains]


def _seen(states: Sequence[State]) -> Floats:
    return np.array([float(s.updates) for s in states])


def _table(
    tool: str, strains: Sequence[float], cold: dict[tuple[str, float], list[State]]
) -> NumberTable:
    rows: list[tuple[Entry, ...]] = []
    for (name, tolerance), states in cold.items():
        ends = sorted({s.failure[0] for s in states if s.failure})
        rows.append((name, f"{tolerance:g}", *(None if s.failure else s.updates for s in states),
                     ", ".join(ends) or "all settled"))  # fmt: skip
    heads = ("law", "tolerance of V/V0", *(f"{100 * s:g} %" for s in strains), "outcome")
    return NumberTable(f"updates_{tool}", f"Updates from a cold start under a {tool}.", heads,
                       tuple(rows))  # fmt: skip


def _warm(r: Responses, p: FluidBlock, tolerance: float) -> list[float]:
    """Updates a state along the strains, each begun at the last one's pressure."""
    stepper = PressureLoop(tolerance=tolerance, max_updates=_MOST).on(r)
    state, found = stepper.rest(), []
    for s in p.strains:
        state = stepper.step(state, np.array([s * p.body.height]))
        found.append(float(state.updates))
    return found


def _warm_table(p: FluidBlock) -> NumberTable:
    rows: list[tuple[Entry, ...]] = []
    for tool in TOOLS:
        r = pressed(p, tool)
        rows += [(tool, f"{tolerance:g}", *_warm(r, p, tolerance)) for tolerance in TOLERANCES]
    heads = ("tool", "tolerance of V/V0", *(f"{100 * s:g} %" for s in p.strains))
    return NumberTable("updates_warm", "The paper's law, each strain begun at the last pressure.",
                       heads, tuple(rows))  # fmt: skip


# --- several cavities -----------------------------------------------------------------------------


def several_exhibit(p: FluidBlock, progress: Progress) -> tuple[Exhibit, dict[str, float]]:
    """One to three cavities and thinner septa: scalar gains, one common, the matrix."""
    progress("several cavities")
    rows: list[tuple[Entry, ...]] = []
    numbers = {}
    for count in (1, 2, 3):
        for share in _SEPTA if count > 1 else (1.0,):
            try:
                r = pressed(p, "plate", 2, count=count, septum=share * p.cavities.septum)
            except SceneError as refused:
                rows.append((count, 1e3 * share * p.cavities.septum, "-", None, None, str(refused)))
                continue
            for gains in ("own", "common", "matrix"):
                row, radius = _row(r, p, gains)
                rows.append((count, 1e3 * share * p.cavities.septum, *row))
                numbers[f"{count}.{share:g}.{gains}"] = radius
    table = NumberTable(
        "several", "The plate at the largest strain, to 1 % from a cold start.",
        ("cavities", "septum / mm", "gains", "spectral radius / 1", "updates", "outcome"),
        tuple(rows),
        "Spectral radius of I - (dV/dP / V0) G at the solution: above 1 the law diverges.",
    )  # fmt: skip
    words = (
        "A pressure in one cavity swells the others through a thin wall: scalar gains know nothing "
        "of that, the matrix of the rest shape does.",
    )
    return Exhibit("several", "Several cavities", words, (table,)), numbers


def _row(r: Responses, p: FluidBlock, gains: Any) -> tuple[tuple[Entry, ...], float]:
    drive = np.array([p.strains[-1] * p.body.height])
    exact = ExactPressure().on(r)
    solved = exact.step(exact.rest(), drive)
    z = np.concatenate([[1.0], solved.inner.z])
    loop = PressureLoop(gains=gains, max_updates=_MOST)
    radius = spectral_radius(r, z, gain_matrix(r, loop))
    stepper = loop.on(r)
    state = stepper.step(stepper.rest(), drive)
    ends = "settled" if state.failure is None else f"{state.failure[0]}: {state.failure[1]}"
    return (gains, radius, None if state.failure else state.updates, ends), radius


# --- pressure laws --------------------------------------------------------------------------------


def laws_exhibit(p: FluidBlock) -> Exhibit:
    """A reservoir by Newton where substitution diverges, a compressible fluid, and a pulse."""
    r = pressed(p, "plate")
    drive = np.array([p.strains[-1] * p.body.height])
    slope = 1 / float(slopes(r, still(r))[0, 0])
    rows: list[tuple[Entry, ...]] = []
    for times in (0.1, 0.5, 0.9, 1.1, 2.0, 10.0):
        state = _one(ElasticPressure(0.0, times * slope), r, drive)
        rows.append((f"P = -B(V/V0 - 1), B = {times:g} slopes", *_told(state),
                     _substituted(r, drive, times * slope)))  # fmt: skip
    for K in (1e4, 1e6, 2.2e9):
        state = _one(ExactPressure(1.0, K), r, drive)
        rows.append((f"compressible, bulk modulus {K:.3g} Pa", *_told(state), None))
    rows.append(("incompressible", *_told(_one(ExactPressure(), r, drive)), None))
    table = NumberTable(
        "laws", "The plate at the largest strain.",
        ("law", "pressure / Pa", "V/V0 / 1", "Newton steps", "substitutions to 1e-9"), tuple(rows),
        "No number of substitutions: it diverges, as it must where B exceeds the slope.",
    )  # fmt: skip
    pulse, words = _pulse(r)
    return Exhibit("laws", "Other pressure laws", words, (table,), (pulse,))


def _one(scheme: Any, r: Responses, drive: Floats) -> State:
    stepper = scheme.on(r)
    state: State = stepper.step(stepper.rest(), drive)
    return state


def _told(state: State) -> tuple[Entry, ...]:
    if state.failure:
        return None, None, None
    n = state.numbers
    return n["cavity0.pressure"], n["cavity0.volume_ratio"], state.updates


def _substituted(r: Responses, drive: Floats, B: float) -> int | None:
    """Substitutions of P = -B (V/V0 - 1) from zero until it moves by 1e-9; None: it diverges."""
    z = np.concatenate([[1.0], drive, np.zeros(len(r.volumes))])
    for count in range(1, 1000):
        new = -B * (float(r.volumes[0] @ z @ z @ z) / float(r.rest_volumes[0]) - 1)
        if not abs(new) < 1e3 * B:
            return None
        if abs(new - z[2]) <= 1e-9 * abs(new):
            return count
        z[2:] = new
    return None


def _pulse(r: Responses) -> tuple[Chart, tuple[str, ...]]:
    settings = PulsePressure(dt=0.02)
    stepper = settings.on(r)
    state, found = stepper.rest(), []
    for _ in range(60):
        state = stepper.step(state, np.zeros(r.drives))
        found.append([state.numbers[f"cavity0.{k}"]
                      for k in ("pressure", "volume_ratio", "beyond_linear")])  # fmt: skip
    P, V, beyond = np.array(found).T
    t: Floats = settings.dt * np.arange(1, 61, dtype=np.float64)
    chart = Chart(
        "pulse", "A pulse of 80 to 120 mmHg, 70 a minute", "time / s",
        "pressure / 100 mmHg, V/V0 / 1",
        (Series("pressure", t, P / (100 * MMHG)), Series("V/V0", t, V)),
        levels=(("130 %", 1.3),),
    )  # fmt: skip
    words = (
        f"At {int(beyond.sum())} of {len(t)} instants of the pulse V/V0 is beyond 0.7 to 1.3, "
        f"{V.max():.2f} at most: arterial pressure is not for a linear model of this modulus.",
    )
    return chart, words
