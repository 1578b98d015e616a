"""The cheapest method of a scene that meets an error and a rate: a ladder, climbed by pilot runs.

The pilots are the cells of the trade. Each rung of the ladder says what its best cell reaches; the
choice is the fastest cell that meets the error, if it meets the rate too. For a scene with inertia
it is run again with a new state at every tick of the rate before it is named.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from validate.arrays import Floats
from validate.errors import UsageError
from validate.fem.assemble import shape_gradients
from validate.fem.locking import LOCKING_FROM
from validate.fem.modes import modes_of
from validate.fem.system import build
from validate.replay.ladder import RUNGS, Rung, Trial
from validate.scene.mesh import Mesh
from validate.scene.scene import Scene
from validate.solve.fluid import ExactPressure
from validate.solve.quasi_static import QuasiStatic
from validate.study.trade import Trade, TradeRow
from validate.units import si_factor

_WATER = 1000.0  # kg/m3, of a soft tissue whose density nobody declared
_SLOW = 10.0  # periods of the lowest mode within which a load that rises is nearly static
_SMALL_STRAIN = 0.02  # strain at which the square terms of Green's strain are 1 % of the linear
_TRIES = 4  # cells that are run again at the rate's own step
_QUANTITY = re.compile(r"\s*([0-9.eE+-]+)\s*([^\d\s.].*)?")

_LEFT_OUT = "left out: --declared-law judges the linear law only"

Again = Callable[[TradeRow, float], TradeRow]
Meets = Literal["meets both", "too slow", "too wrong", "neither", "not the scene", "nothing ran"]


@dataclass(frozen=True)
class Wanted:
    """The largest error m and the least rate 1/s."""

    error: float
    rate: float

    def __post_init__(self) -> None:
        for value, what in ((self.error, "error"), (self.rate, "rate")):
            if not (np.isfinite(value) and value > 0):
                raise UsageError(f"--{what} {value:g}: a positive number with its unit")


@dataclass(frozen=True)
class Fact:
    """One of the scene's own numbers, and what it asks of a method."""

    name: str
    value: str
    means: str


@dataclass(frozen=True)
class Climbed:
    """One rung: cells run and scored, its row nearest to what is wanted, and the verdict."""

    rung: Rung
    run: int
    scored: int
    best: TradeRow | None
    verdict: Meets
    evidence: str


@dataclass(frozen=True)
class Choice:
    """What was found; `pick` is None where nothing meets both, `nearest` is what comes nearest.

    `by`: "total" counts what the declared law costs, "error" does not. `confirmed` is the pick with
    a state at every tick of the rate, where its own step is longer.
    """

    trade: Trade
    wanted: Wanted
    by: str
    facts: tuple[Fact, ...]
    ladder: tuple[Climbed, ...]
    pick: TradeRow | None
    confirmed: TradeRow | None
    nearest: TradeRow
    rejected: tuple[str, ...]


def wanted(error: str, rate: str) -> Wanted:
    """`0.5mm` and `1000Hz` in SI; raises `UsageError`, or `RecordingError` for an unknown unit."""
    number, unit = _split(error, "--error", "0.5mm")
    hertz, per = _split(rate, "--rate", "1000Hz")
    factors = {"hz": 1.0, "khz": 1e3, "mhz": 1e6}
    if per.lower() not in factors:
        raise UsageError(f"--rate {rate}: unit '{per}' is none of Hz, kHz, MHz; as in 1000Hz")
    return Wanted(number * si_factor(unit, "length"), hertz * factors[per.lower()])


def _split(text: str, option: str, example: str) -> tuple[float, str]:
    found = _QUANTITY.fullmatch(text)
    try:
        number = float(found[1]) if found else float("nan")
    except ValueError:
        number = float("nan")
    if found is None or not np.isfinite(number) or not found[2]:
        raise UsageError(f"{option} {text}: a number with its unit, as in {example}")
    return number, found[2].strip()


# --- which ---------------------------------------------------------------------------------------


def error_of(row: TradeRow, by: str) -> float | None:
    value = getattr(row, by)
    return None if value is None else float(value)


def misses(row: TradeRow, want: Wanted, by: str, dynamic: bool) -> tuple[float, float]:
    """Error over the one wanted, and time over the one there is: both at most 1 where it meets.

    A scene with inertia must also keep up with the clock: a step within its own dt.
    """
    error, time = error_of(row, by), row.time_s
    if error is None or time is None:
        return np.inf, np.inf
    late = time * want.rate
    return error / want.error, max(late, time / row.dt) if dynamic else late


def meeting(rows: Sequence[TradeRow], want: Wanted, by: str, dynamic: bool) -> list[TradeRow]:
    """The rows that meet both and leave nothing of the scene out, fastest first."""
    whole = [r for r in rows if not r.solver.lacks]
    good = [r for r in whole if max(misses(r, want, by, dynamic)) <= 1]
    return sorted(good, key=lambda r: r.time_s or 0.0)


def nearest(rows: Sequence[TradeRow], want: Wanted, by: str, dynamic: bool) -> TradeRow:
    """The row whose worse miss is least; raises `UsageError` when no row has an error."""
    scored = [r for r in rows if error_of(r, by) is not None and not r.solver.lacks]
    if not scored:
        raise UsageError(f"none of {len(rows)} pilot runs has an error; see 'study tradeoff'")
    return min(scored, key=lambda r: max(misses(r, want, by, dynamic)))


def choose(trade: Trade, want: Wanted, declared_law: bool, again: Again) -> Choice:
    """The choice from a measured trade; `again` runs a row's cell with another step s.

    Where large strain could not be solved, what the declared law costs is not counted either.
    """
    declared_law = declared_law or trade.gap is None
    by, dynamic = "error" if declared_law else "total", trade.trial.dynamic
    rows = [r for r in trade.rows if not declared_law or r.solver.law == "linear"]
    rejected: list[str] = []
    pick = confirmed = None
    for row in meeting(rows, want, by, dynamic)[:_TRIES]:
        dt = _rate_step(trade, row, want)
        tried = None if dt is None else again(row, dt)
        if tried is None or max(misses(tried, want, by, dynamic)) <= 1:
            pick, confirmed = row, tried
            break
        rejected.append(_refusal(tried, by))
    ladder = tuple(_climbed(trade, rung, rows, want, by) for rung in RUNGS)
    closest = nearest(rows, want, by, dynamic)
    return Choice(
        trade, want, by, facts(trade, want), ladder, pick, confirmed, closest, tuple(rejected)
    )


def _rate_step(trade: Trade, row: TradeRow, want: Wanted) -> float | None:
    """A step s no longer than a tick, where the row's own is longer and inertia matters."""
    if not trade.trial.dynamic or row.dt * want.rate <= 1 + 1e-9:
        return None
    apart = float(np.diff(trade.trial.frames).min())
    return float(apart / np.ceil(apart * want.rate - 1e-9))


def _refusal(row: TradeRow, by: str) -> str:
    error, time = error_of(row, by), row.time_s
    if error is None or time is None:
        return f"{row.label}: with a state every {1e3 * row.dt:.3g} ms: {row.failed}"
    return (
        f"{row.label}: with a state every {1e3 * row.dt:.3g} ms its error is "
        f"{1e3 * error:.3g} mm and a step takes {1e6 * time:.3g} us"
    )


def _climbed(trade: Trade, rung: Rung, rows: Sequence[TradeRow], want: Wanted, by: str) -> Climbed:
    dynamic = trade.trial.dynamic
    mine = [r for r in rows if r.solver.rung == rung]
    scored = [r for r in mine if error_of(r, by) is not None]
    if not scored:
        left = rung == "large strain" and len(rows) < len(trade.rows)
        why = _LEFT_OUT if left else _why_not(mine, dynamic)
        return Climbed(rung, len(mine), 0, None, "nothing ran", why)
    lacks = scored[0].solver.lacks
    if lacks:
        best = min(scored, key=lambda r: max(misses(r, want, by, dynamic)))
        words = f"{evidence(best, by)}; never chosen: it leaves out {lacks}"
        return Climbed(rung, len(mine), len(scored), best, "not the scene", words)
    good = meeting(scored, want, by, dynamic)
    best = good[0] if good else nearest(scored, want, by, dynamic)
    wrong, late = misses(best, want, by, dynamic)
    verdict: Meets = "meets both"
    if wrong > 1 or late > 1:
        verdict = "neither" if min(wrong, late) > 1 else "too wrong" if wrong > 1 else "too slow"
    words = f"{evidence(best, by)}; {len(good)} of its cells meet both"
    return Climbed(rung, len(mine), len(scored), best, verdict, words)


def evidence(row: TradeRow, by: str) -> str:
    """What a rung's best row reached, and what its error is made of."""
    error, time = error_of(row, by) or 0.0, row.time_s or np.nan
    words = f"{row.label}: {1e3 * error:.3g} mm at {1 / time:.3g} Hz"
    if row.solver_error is not None and row.mesh_error is not None:
        words += f" (mesh {1e3 * row.mesh_error:.3g} mm, solver {1e3 * row.solver_error:.3g} mm)"
    return words


def _why_not(mine: Sequence[TradeRow], dynamic: bool) -> str:
    if mine:
        return f"all {len(mine)} cells failed, the first: {mine[0].failed}"
    if dynamic:
        return "not for this scene: no plate drives it and no cavity is in it"
    return (
        "not for this scene: it declares no density, and linear schemes with inertia know no "
        "fluid in cavities"
    )


# --- the scene's own numbers ---------------------------------------------------------------------


def facts(trade: Trade, want: Wanted) -> tuple[Fact, ...]:
    """Loading against the lowest frequency, strain, law, Poisson ratio, fluid, noise."""
    scene = trade.trial
    element = "P1" if "P1" in scene.meshes else next(iter(scene.meshes))
    body = scene.build(element, scene.meshes[element][0], "linear")
    return (
        _loading(scene, body), _strain(scene, body, trade), _poisson(body), _fluid(body),
        _noise(scene, want), _mesh(trade),
    )  # fmt: skip


def _loading(scene: Trial, body: Scene) -> Fact:
    density = body.material.rho or _WATER
    solid = replace(body, cavities=(), material=replace(body.material, rho=density))
    modes = modes_of(build(solid), 1)
    f, ratio = modes.omega[0] / (2 * np.pi), modes.damping[0] / (2 * modes.omega[0])
    assumed = "" if body.material.rho else f", at an assumed {_WATER:g} kg/m3"
    name = "loading rate against lowest frequency"
    if scene.rise_s == 0:
        return Fact(
            name, f"switched on at once; {f:.3g} Hz, damping ratio {ratio:.2g}{assumed}",
            "the load has no rise time: inertia and damping are needed until the motion is over",
        )  # fmt: skip
    periods = scene.rise_s * f
    slow = "nearly static: statics may do" if periods > _SLOW else "not static: inertia matters"
    return Fact(name, f"rises in {scene.rise_s:.3g} s; {f:.3g} Hz{assumed}: {periods:.3g} periods",
                slow)  # fmt: skip


def _strain(scene: Trial, body: Scene, trade: Trade) -> Fact:
    stepper = (ExactPressure() if body.cavities else QuasiStatic()).prepare(build(body))
    u = stepper.field(stepper.step(stepper.rest(), scene.largest_inputs))
    strain = principal_strains(body.mesh, u)
    peak, most = float(strain.max()), float(np.quantile(strain, 0.95))
    cost = f"large strain was not solved ({trade.law_words})"
    if trade.law_error is not None:
        moved = f"{1e3 * trade.law_error:.3g} mm"
        cost = f"large strain changes the answer by {moved} ({trade.law_words})"
    means = "within small strain" if peak < _SMALL_STRAIN else "large strain is on the ladder"
    return Fact("strain level (static pilot, coarse mesh)",
                f"peak {100 * peak:.2g} %, 95 % of cells below {100 * most:.2g} %",
                f"{means}; measured, {cost}")  # fmt: skip


def principal_strains(mesh: Mesh, u: Floats) -> Floats:
    """Largest |principal small strain| of every simplex (e,), from u (n, d) m at its corners."""
    if mesh.bricks:
        mesh = Mesh(mesh.nodes, mesh.simplices, "tri3" if mesh.dimension == 2 else "tet4")
    H = np.einsum("eai,eaj->eij", u[mesh.corners], shape_gradients(mesh))
    return np.asarray(np.abs(np.linalg.eigvalsh((H + np.swapaxes(H, 1, 2)) / 2)).max(axis=1))


def _poisson(body: Scene) -> Fact:
    nu = body.material.nu
    locks = f"above {LOCKING_FROM:g} linear tetrahedra lock: see P1 beside the other elements"
    return Fact("Poisson ratio", f"{nu:g}", locks if nu >= LOCKING_FROM else "no locking to expect")


def _fluid(body: Scene) -> Fact:
    n = len(body.cavities)
    means = (
        "condensed columns with the pressure of constant volume" if n else "no pressure code runs"
    )
    return Fact("fluid", f"{n} cavity" if n == 1 else f"{n} cavities" if n else "none", means)


def _noise(scene: Trial, want: Wanted) -> Fact:
    if scene.noise is None:
        return Fact("noise", "no recording", "nothing to say")
    sd, where = scene.noise
    means = "a recording can tell such an error" if sd < want.error else (
        "a recording could not tell such an error at a single point"
    )  # fmt: skip
    return Fact("noise", f"{1e3 * sd:.3g} mm, {where}", means)


def _mesh(trade: Trade) -> Fact:
    return Fact(
        "reference", f"{trade.trial.reference[0]} mesh {trade.trial.reference[1]}, its own error "
        f"about {1e3 * trade.floor:.2g} mm (Richardson)", "errors below it say nothing",
    )  # fmt: skip
