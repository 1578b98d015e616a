"""The printed error of paper 001 over many noise seeds, and an independent oracle of its filter."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.stats import t as student

from validate.arrays import Floats
from validate.compare.exhibit import Exhibit, NumberTable
from validate.compare.row import LongRow, RowBlock
from validate.compare.view import View
from validate.estimate.filterpy.oracle import oracle_table
from validate.estimate.kalman.modal_kf import ModalKf
from validate.estimate.measurements import Measurements
from validate.fem.assembly.locate import Rows
from validate.fem.system import System
from validate.fem.system import build as build_system
from validate.pipeline.experiment.experiment import Progress, ReportAdditions
from validate.pipeline.run.method_run import Cases, MethodRun

SEEDS = 50
VARIANCES = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1)  # mm^2
PRINTED = 1e-3  # mm^2, the paper's noise intensity
PRINTED_NRMSE = 0.0116
_MM2 = 1e-6
_SEED = 1000  # of the first repetition
_SETTLING = 100  # steps in which gains that do not decay have settled


def tell(parameters: Any, cases: Cases, progress: Progress) -> ReportAdditions:
    """NRMSE over 50 noise seeds for every Q and both recursions, and the oracle's table."""
    found = {
        (Q, recursion): _nrmse(parameters, cases[""]["kf_printed"], Q, recursion, progress)
        for Q in VARIANCES
        for recursion in ("prior", "posterior")
    }
    raw = _raw(parameters, cases[""]["kf_printed"])
    mean, half = _interval(found[PRINTED, "prior"])
    exact = _nrmse(parameters, cases[""]["kf_printed"], 0.0, "prior", progress)
    mesh = cases[""]["kf_printed"].scene.mesh
    numbers = {"nodes": float(len(mesh.nodes)), "elements": float(len(mesh.cells))}
    numbers |= {"nrmse.mean": mean, "nrmse.half_interval": half, "nrmse.raw": _interval(raw)[0]}
    numbers |= {
        "nrmse.without_q": float(exact.mean()),
        "uncertain.steps": _uncertain_steps(parameters, cases[""]["kf_printed"]),
    }
    return ReportAdditions((_oracle(),), numbers, tuple(_rows(found, raw)))


def _nrmse(
    parameters: Any, followed: MethodRun, Q: float, recursion: str, progress: Progress
) -> Floats:
    """NRMSE (seeds,) at the measured node, along z, of the filter as printed."""
    progress(f"{SEEDS} seeds, Q = {Q:g} mm2, {recursion}")
    system = build_system(followed.body)
    stepper = _printed(parameters, followed, system, Q, recursion)
    row = _z_row(system, followed)
    batch = stepper.batch(followed.seen.inputs, _noisy(followed), row)
    assert batch is not None
    reference = followed.truth.probes["node_A"][:, 2]
    off = batch.values[..., 0] - reference
    return np.asarray(np.sqrt((off**2).mean(axis=1)) / np.ptp(reference))


def _printed(parameters: Any, followed: MethodRun, system: System, Q: float, recursion: str) -> Any:
    """The filter as printed, seen at the observed node at every step."""
    settings = ModalKf(
        parameters.settings.clock.dt, Q * _MM2, PRINTED * _MM2, PRINTED * _MM2,
        recursion=recursion, gains="shared", a0=parameters.settings.loading.a0,
    )  # fmt: skip
    given = Measurements.taken(followed.seen, system.scene.mesh).of("node_A")
    every = replace(given, t=followed.seen.t, z=np.zeros((len(followed.run.t), 3)))
    return settings.prepare(system, every)


def _uncertain_steps(parameters: Any, followed: MethodRun) -> float:
    """Steps after which the claimed sd of the observed node stays within 1 % of its last."""
    system = build_system(followed.body)
    stepper = _printed(parameters, followed, system, PRINTED, "prior")
    point = next(p.point for p in followed.scene.probes if p.name == "node_A")
    node = system.scene.mesh.nearest_node(np.array(point))
    state, sd = stepper.rest(), []
    for load in followed.seen.inputs[:_SETTLING]:
        state = stepper.step(state, load)
        sd.append(float(stepper.sd(state)[node, 2]))
    away = np.flatnonzero(np.abs(np.array(sd) / sd[-1] - 1) > 0.01)
    return float(away[-1] + 1) if len(away) else 0.0


def _noisy(followed: MethodRun) -> Floats:
    """Measurements z (seeds, nt, 3) m of the observed node at every step."""
    clean = followed.truth.probes["node_A"]
    rng = np.random.default_rng(_SEED)
    noise = rng.standard_normal((SEEDS, *clean.shape))
    return clean + float(np.sqrt(PRINTED * _MM2)) * noise


def _z_row(system: System, followed: MethodRun) -> Floats:
    """Row (1, N) that reads the observed node's z."""
    point = next(p.point for p in followed.scene.probes if p.name == "node_A")
    weights = Rows.barycentric(system.scene.mesh, np.array([point])).weights.toarray()
    return np.asarray(np.kron(weights, np.array([[0.0, 0.0, 1.0]])))


def _raw(parameters: Any, followed: MethodRun) -> Floats:
    """NRMSE (seeds,) of the measurement itself."""
    reference = followed.truth.probes["node_A"][:, 2]
    off = _noisy(followed)[..., 2] - reference
    return np.asarray(np.sqrt((off**2).mean(axis=1)) / np.ptp(reference))


def _interval(values: Floats) -> tuple[float, float]:
    """Mean and half of its 95 % confidence interval (Student's t)."""
    n = len(values)
    half = float(student.ppf(0.975, n - 1)) * float(values.std(ddof=1)) / np.sqrt(n)
    return float(values.mean()), float(half)


def _rows(found: Mapping[tuple[float, str], Floats], raw: Floats) -> Iterator[RowBlock]:
    """Statistics of the NRMSE by Q and recursion, and of the measurement itself; every Q."""
    one = LongRow(part="seeds", quantity="nrmse", unit="1")
    for (Q, recursion), values in found.items():
        at = VARIANCES.index(Q)
        yield from _statistics(one._replace(method=recursion, point=at, variation=f"Q {Q:g} mm2"),
                               values)  # fmt: skip
    yield from _statistics(one._replace(method="measurement itself"), raw)
    printed = one._replace(method="printed", statistic="mean")
    yield RowBlock(printed, np.array([PRINTED_NRMSE]))
    yield RowBlock(LongRow(part="seeds", quantity="Q", unit="m2"), _MM2 * np.array(VARIANCES))


def _statistics(of: LongRow, values: Floats) -> Iterator[RowBlock]:
    mean, half = _interval(values)
    of = of._replace(n=len(values))
    for name, value in (("mean", mean), ("half", half), ("sd", float(values.std(ddof=1)))):
        yield RowBlock(of._replace(statistic=name), np.array([value]))


VIEWS = (
    View(
        "nrmse_by_q", "Printed error over many noise seeds: NRMSE against process noise",
        {"part": "seeds", "quantity": "nrmse", "statistic": "mean"}, "lines", x="Q", by="method",
        log="x",
        caption="v and a recursed from the prior or the posterior displacement. With a perfect "
        "model the plain FEM has no error and any white Q makes the filter worse: Q = 0 is best "
        "here. The filter is useful where the model is wrong.",
    ),
    View(
        "seeds", f"NRMSE of u_z at the measured node over {SEEDS} noise seeds",
        {"part": "seeds", "quantity": "nrmse"}, x=("variation", "method"), by="statistic",
        also=("n",),
        caption="half: half of the 95 % interval of the mean. Normaliser: range of the reference "
        "over the run. R = P0 = 0.001 mm2. The paper prints 0.0116, but not its Q, unit, recursion "
        "or normaliser.",
    ),
)  # fmt: skip


def _oracle() -> Exhibit:
    rows = tuple((r.pair, r.states, r.steps, r.largest) for r in oracle_table())
    table = NumberTable(
        "oracle",
        "Filters of validate against filterpy on small systems: largest difference in any "
        "entry of state or covariance (of order 1).",
        ("pair", "states", "steps", "largest difference / 1"),
        rows,
    )
    return Exhibit("oracle", "Comparison with an independent implementation", (), (table,))
