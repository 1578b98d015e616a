"""How far solvers are from the implicit run, over time, in the metrics of paper 002, section III.

Also what both of its benchmarks show besides: lumping and the restricted damping one at a time, the
way to the static solution, critical steps, deformed shapes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import Chart, Entry, Exhibit, NodeMap, NumberTable, Series
from validate.compare.shapes.pair import Field
from validate.compare.shapes.two_fields import FieldScores
from validate.fem.assembly.locate import Rows
from validate.fem.system import System
from validate.pipeline.experiment.method import Method
from validate.pipeline.run.method_run import MethodRun
from validate.scene.mesh import Mesh
from validate.scene.scene import Scene
from validate.solve.explicit.linear import ExplicitLinear
from validate.solve.march import march
from validate.solve.types import Run

INSTANTS = (0.5, 1.0, 2.0, 3.0, 5.0, 10.0)  # s
RIVALS = ("explicit", "implicit_lumped", "explicit_lumped", "quasi_static")
DRAWN = ("E_n", "E_s", "E_i")
TABLED = ("E_n", "L2.relative", "energy.relative", "E_s", "E_i", "E_i.mean")
_EVERY = 5  # steps between two compared frames: 1/6 s shows every swing of both benchmarks


@dataclass(frozen=True)
class Errors:
    """Metrics of one method: times (k,) s, and by metric values (k,), NaN where `refused` says
    why there is none."""

    label: str
    t: Floats
    values: Mapping[str, Floats]
    refused: tuple[tuple[float, str, str], ...]

    def line(self, name: str, label: str = "") -> Series:
        """A metric over time, without the times that have none and exact zeros."""
        y = self.values[name]
        there = np.isfinite(y) & (y > 0)
        return Series(label or self.label, self.t[there], y[there])

    def at(self, name: str, t: float) -> float | None:
        """The metric at an instant; None where it was not compared or does not exist."""
        k = int(np.argmin(np.abs(self.t - t)))
        value = float(self.values[name][k])
        return value if abs(self.t[k] - t) < 1e-6 and np.isfinite(value) else None


def frames_of(t: Floats, at: Sequence[int]) -> list[int]:
    """Kept frames to be compared: the first, and each fifth step."""
    return [k for k, step in enumerate(at) if step == 0 or (step + 1) % _EVERY == 0]


def errors_of(
    one: Run,
    mesh: Mesh,
    truth: Floats,
    on: Scene,
    names: Sequence[str] = TABLED,
    frames: Sequence[int] | None = None,
    label: str = "",
) -> Errors:
    """A run with fields on `mesh` against `truth` (no, n, d) m of the same frames on the mesh of a
    scene `on`.

    Fields of another mesh are read at the nodes of `on`, located once for all frames.
    """
    rows = (
        None if np.array_equal(mesh.nodes, on.mesh.nodes) else Rows.barycentric(mesh, on.mesh.nodes)
    )
    onto: Scene | FieldScores = on
    chosen = frames_of(one.t, one.at.tolist()) if frames is None else list(frames)
    t = one.t[one.at[chosen]]
    values = {name: np.full(len(chosen), np.nan) for name in names}
    refused = []
    for i, k in enumerate(chosen):
        u = one.u[k] if rows is None else rows.apply(one.u[k])
        run, exact = Field(on.mesh, u, label or one.method), Field(on.mesh, truth[k], "truth")
        onto = found = FieldScores.of(run, exact, onto, names)
        for score in found.scores:
            values[score.name][i] = score.value
        refused += [(float(t[i]), name, why) for name, why in found.refused]
    return Errors(label or one.method, t, values, tuple(refused))


def l2_error(mesh: Mesh, u: Floats, on: Scene, truth: Floats) -> float:
    """Relative L2 norm of u (n, d) m on a mesh against `truth` (no, d) m on the mesh of `on`."""
    run, exact = Field(mesh, u, "field"), Field(on.mesh, truth, "truth")
    (score,) = FieldScores.of(run, exact, on, ("L2.relative",)).scores
    return score.value


def errors_on(case: Mapping[str, MethodRun], names: Sequence[str], methods: Sequence[str],
              frames: Sequence[int] | None = None) -> dict[str, Errors]:  # fmt: skip
    """Metrics of a case's methods against its truth, on the truth's mesh."""
    first = next(iter(case.values()))
    truth, mesh = first.truth.u, first.truth.mesh
    assert truth is not None
    assert mesh is not None
    on = replace(first.body, body=mesh)
    return {
        name: errors_of(
            case[name].run, case[name].scene.mesh, truth, on, names, frames, case[name].label
        )
        for name in methods
        if name in case and case[name].whole
    }


# --- exhibits ------------------------------------------------------------------------------------


def instants_table(name: str, title: str, errors: Mapping[str, Errors],
                   metrics: Sequence[str], units: Mapping[str, str]) -> NumberTable:  # fmt: skip
    """Rows of method and metric, columns of instants."""
    rows: list[tuple[Entry, ...]] = [
        (e.label, f"{metric} / {units.get(metric, '1')}", *(e.at(metric, t) for t in INSTANTS))
        for metric in metrics
        for e in errors.values()
        if metric in e.values
    ]
    heads = ("method", "metric", *(f"at {t:g} s" for t in INSTANTS))
    return NumberTable(name, title, heads, tuple(rows), _gaps(errors))


def _gaps(errors: Mapping[str, Errors]) -> str:
    """What has no value, and why, in one sentence."""
    reasons = {f"{metric}: {why}" for e in errors.values() for _, metric, why in e.refused}
    return f"Without a value: {'; '.join(sorted(reasons))}." if reasons else ""


def errors_exhibit(errors: Mapping[str, Errors], dimension: int, figures: Mapping[str, str],
                   words: tuple[str, ...]) -> Exhibit:  # fmt: skip
    """E_n, E_s and E_i over time, and every norm at the instants; `figures` are the captions."""
    units = FieldScores.units(dimension)
    charts = tuple(
        Chart(
            f"{name}_over_time", f"{name} against the implicit run", "time / s",
            f"{name} / {units[name]}", tuple(e.line(name) for e in errors.values()),
            log="y", caption=figures[name],
        )
        for name in DRAWN
    )  # fmt: skip
    table = instants_table(
        "solver_errors", "Errors against the implicit run, consistent mass, full damping.",
        errors, TABLED, units,
    )  # fmt: skip
    near = [errors[n].line("E_i") for n in ("explicit_lumped", "quasi_static") if n in errors]
    linear = Chart(
        "E_i_linear", "E_i, linear axis", "time / s", f"E_i / {units['E_i']}", tuple(near),
        caption=figures["E_i_linear"],
    )  # fmt: skip
    return Exhibit("solver-errors", "Errors of the solvers over time", words, (table,),
                   (*charts, linear))  # fmt: skip


def ordered_share(errors: Mapping[str, Errors], name: str = "E_i", until: float = 1e9) -> float:
    """Share of the compared times, after the first step and `until` s, at which explicit is less
    wrong than both lumped methods and these than quasi-static."""
    best, worst = errors["explicit"].values[name], errors["quasi_static"].values[name]
    lumped = np.stack([errors[n].values[name] for n in ("implicit_lumped", "explicit_lumped")])
    holds = (best < lumped.min(axis=0)) & (lumped.max(axis=0) < worst)
    return float(holds[1:][errors["explicit"].t[1:] <= until + 1e-9].mean())


def sum_ratio(errors: Mapping[str, Errors], name: str = "E_i") -> tuple[float, float]:
    """Median of explicit-lumped over (lumped + explicit), and of explicit over lumped."""
    explicit, lumped, both = (
        errors[n].values[name][1:] for n in ("explicit", "implicit_lumped", "explicit_lumped")
    )
    return float(np.median(both / (explicit + lumped))), float(np.median(explicit / lumped))


def read_off(errors: Mapping[str, Errors]) -> dict[str, float]:
    """What the paper's curves show at 2 s, by the names of its figures' numbers."""
    lumped, still = errors["explicit_lumped"], errors["quasi_static"]
    found = {f"{name}@2s": lumped.at(name, 2.0) for name in DRAWN}
    found["E_i@2s.quasi_static"] = still.at("E_i", 2.0)
    return {name: value for name, value in found.items() if value is not None}


SWITCHED = (
    "implicit_lumped_full",
    "implicit_restricted",
    "implicit_lumped",
    "explicit",
    "explicit_lumped_full",
    "explicit_restricted",
    "explicit_lumped",
)


def switches_exhibit(case: Mapping[str, MethodRun], dimension: int) -> tuple[Exhibit, float]:
    """Lumping and restriction apart, and how many times the restriction's E_i is lumping's at
    2 s."""
    some = next(iter(case.values())).run
    frames = at_instants(some)
    errors = errors_on(case, ("E_n", "E_i"), SWITCHED, frames)
    table = instants_table(
        "switches",
        "Lumped masses and the restriction of C to alpha M, one at a time. The paper's 'mass "
        "lumping' is both.", errors, ("E_n", "E_i"), FieldScores.units(dimension),
    )  # fmt: skip
    lumped = errors["implicit_lumped_full"].at("E_i", 2.0) or 0.0
    restricted = errors["implicit_restricted"].at("E_i", 2.0) or 0.0
    ratio = restricted / lumped if lumped else 0.0
    words = (
        f"At 2 s the restriction C = αM alone costs {ratio:.1f} times the E_i of lumped masses "
        "alone. A large part of what the paper calls the error of mass lumping is the damping "
        "that the diagonal form omits.",
    )
    return Exhibit("switches", "Lumping and the omitted damping", words, (table,)), ratio


def mesh_words(finer: Mapping[str, Errors], errors: Mapping[str, Errors]) -> str:
    """The mesh's own E_n beside the solvers', at the instants."""
    mesh = [finer["implicit"].at("E_n", t) or 0.0 for t in INSTANTS]
    worst = [max(errors[n].at("E_n", t) or 0.0 for n in RIVALS[:-1]) for t in INSTANTS]
    above = sum(m > w for m, w in zip(mesh, worst, strict=True))
    return (
        f"At {above} of {len(INSTANTS)} instants the E_n of the mesh ({min(mesh):.2g} to "
        f"{max(mesh):.2g}) exceeds that of every solver but quasi-static ({min(worst):.2g} to "
        f"{max(worst):.2g} for the worst of them)."
    )


def at_instants(run: Run) -> list[int]:
    """Kept frames at the tabled instants."""
    t = run.t[run.at]
    return [k for k in range(len(t)) if min(abs(t[k] - i) for i in INSTANTS) < 1e-6]


# --- the static solution -------------------------------------------------------------------------


def static_exhibit(
    system: System, methods: Mapping[str, Method], dt: float, steps: int, inputs: Floats
) -> tuple[Exhibit, float]:
    """|u - u_static| / |u_static| far beyond the benchmark's end, and the largest of the ends."""
    t: Floats = dt * np.arange(1, steps + 1, dtype=np.float64)
    at = np.arange(0, steps, _EVERY) + _EVERY - 1
    static = methods["quasi_static"].settings.prepare(system)
    last = static.step(static.rest(), inputs[-1])
    u_static = static.field(last)
    size = float(np.linalg.norm(u_static))
    lines = []
    for name, method in methods.items():
        if name == "quasi_static":
            continue
        run = march(name, replace(method.settings, dt=dt).prepare(system), t, inputs, at, 0.0)
        if run.finished:
            off = np.linalg.norm((run.u - u_static).reshape(len(run.u), -1), axis=1) / size
            lines.append(Series(method.label, run.t[run.at], off))
    chart = Chart(
        "static", "Distance to the static solution", "time / s",
        "|u − u_static| / |u_static| / 1", tuple(lines), log="y", scale=1.0,
        caption="Nodal norm. All solvers reach the same static solution, on different paths.",
    )  # fmt: skip
    ends = [float(s.y[-1]) for s in lines]
    words = (
        f"At {t[-1]:g} s the {len(lines)} dynamic methods are within {max(ends):.1e} of the "
        "static solution, which contains neither mass nor damping.",
    )
    return Exhibit("static", "Common static solution", words, (), (chart,)), max(ends)


# --- limits --------------------------------------------------------------------------------------


def limit_row(label: str, system: System, dt: float) -> tuple[Entry, ...]:
    """Critical steps ms: printed and lagged damping (full C), consistent and lumped mass."""
    steps = [1e3 * stable_of(system, mass, update) for update, mass in _TREATMENTS]
    return (label, *steps, "yes" if min(steps[:2]) > 1e3 * dt else "no")


_TREATMENTS: tuple[
    tuple[Literal["printed", "lagged"], Literal["consistent", "lumped"]], ...
] = (
    ("printed", "consistent"),
    ("printed", "lumped"),
    ("lagged", "consistent"),
    ("lagged", "lumped"),
)  # fmt: skip
LIMIT_HEADS = (
    "scene",
    *(f"{update} C, {mass} M / ms" for update, mass in _TREATMENTS),
    "33.3 ms stable as printed",
)


def stable_of(
    system: System, mass: Literal["consistent", "lumped"], update: Literal["printed", "lagged"]
) -> float:
    """The exact critical step s with full C."""
    return ExplicitLinear(1.0, mass, "full", update).stable_step(system)


# --- shapes --------------------------------------------------------------------------------------


def shape_maps(case: Mapping[str, MethodRun], methods: Sequence[str], t: float) -> list[NodeMap]:
    """The deformed body of methods at a time, coloured by the length of its displacement."""
    found = []
    for name in methods:
        followed = case.get(name)
        if followed is None or not followed.whole:
            continue
        run, mesh = followed.run, followed.scene.mesh
        k = int(np.argmin(np.abs(run.t[run.at] - t)))
        u = run.u[k]
        moved = Mesh(mesh.nodes + u, mesh.cells, mesh.kind)
        found.append(
            NodeMap(
                f"shape_{name}_{t:g}s".replace(".", "_"),
                f"{followed.label} at {run.t[run.at[k]]:g} s: length of the displacement",
                moved, 1e3 * np.linalg.norm(u, axis=1), "mm", f"the shapes at {t:g} s",
                "the deformed body",
            )
        )  # fmt: skip
    return found
