"""What a diagonal damping matrix does to the motion (paper 002, section VII: left to the future).

Explicit steps with lumped masses want C diagonal. Lumping C = alpha M + beta K by its row sums
drops beta K altogether, since a translation feels no K: what is left is alpha M, the paper's. The
other diagonal forms here are alpha' M with the first mode's damping, and the diagonal of C itself,
which resists rigid motions as well.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import Chart, Entry, Exhibit, NumberTable, Series
from validate.compare.shapes.two_fields import FieldScores
from validate.fem.critical import Modes
from validate.fem.system import System, build
from validate.scene.scene import Scene
from validate.solve.dynamic.newmark import Newmark
from validate.solve.march import march
from validate.solve.types import Run

from .benchmark import IMPLICIT
from .errors import INSTANTS, Errors, errors_of, instants_table

FULL, PAPERS, MATCHED, DIAGONAL = "αM + βK", "αM", "α'M, first mode's damping", "diagonal of C"
_TABLED = (0, 1, 2, 5, 10, 20, 50)  # of the modes, as far as there are
_METRICS = ("E_n", "E_i")


def damping_exhibit(
    scene: Scene, inputs: Callable[[Floats], Floats], dt: float
) -> tuple[Exhibit, dict[str, float]]:
    """Damping ratios of the modes by the form of C, and the motion under alpha M and alpha' M
    against that under the whole C, implicit with consistent mass."""
    system = build(scene)
    omega, ratios = damping_ratios(system)
    errors = _errors(scene, system, float(2 * omega[0] * ratios[FULL][0]), inputs, dt)
    two = {n: e.at("E_n", 2.0) or 0.0 for n, e in errors.items()}
    numbers = {"damping.papers": two[PAPERS], "damping.matched": two[MATCHED]}
    table = instants_table(
        "diagonal_damping", "Implicit, consistent mass, C diagonal, against the full C.",
        errors, _METRICS, FieldScores.units(scene.mesh.dimension),
    )  # fmt: skip
    chart = Chart(
        "damping_ratios", "Damping of the modes by the form of C", "frequency / (1/s)",
        "damping ratio / 1", tuple(Series(n, omega, xi) for n, xi in ratios.items()),
        levels=(("critical", 1.0),), log="xy",
        caption="βK damps fast modes most and αM slow ones; a diagonal C cannot do both.",
    )  # fmt: skip
    shown = Exhibit("damping", "A diagonal damping matrix", _words(ratios, two),
                    (_by_mode(omega, ratios), table), (chart,))  # fmt: skip
    return shown, numbers


def damping_ratios(system: System) -> tuple[Floats, Mapping[str, Floats]]:
    """Frequencies w (r,) 1/s of all modes, and phi^T C phi / (2 w) (r,) of each by the form of C;
    the last two are exact on the diagonal, what they couple is left out."""
    modes = Modes.of(system)
    w = modes.omega
    alpha = system.scene.material.mass_damping
    C = system.C.diagonal()[system.free]
    return w, {
        FULL: modes.damping / (2 * w),
        PAPERS: alpha / (2 * w),
        MATCHED: modes.damping[0] / (2 * w),
        DIAGONAL: np.einsum("ir,i,ir->r", modes.shapes, C, modes.shapes) / (2 * w),
    }


def _errors(
    scene: Scene, system: System, matched: float, inputs: Callable[[Floats], Floats], dt: float
) -> dict[str, Errors]:
    """Of alpha M and of `matched` (1/s) M, at the instants."""
    other = replace(scene.material, mass_damping=matched)
    ways = {PAPERS: system, MATCHED: build(replace(scene, material=other))}
    truth = _run(system, replace(IMPLICIT, dt=dt), inputs)
    only = replace(IMPLICIT, dt=dt, damping_terms="mass")
    return {
        name: errors_of(_run(s, only, inputs), scene.mesh, truth.u, scene, _METRICS,
                        range(len(INSTANTS)), name)
        for name, s in ways.items()
    }  # fmt: skip


def _run(system: System, settings: Newmark, inputs: Callable[[Floats], Floats]) -> Run:
    at = np.array([round(t / settings.dt) - 1 for t in INSTANTS])
    t: Floats = settings.dt * np.arange(1, at[-1] + 2, dtype=np.float64)
    return march("damped", settings.prepare(system), t, inputs(t), at, 0.0)


def _by_mode(omega: Floats, ratios: Mapping[str, Floats]) -> NumberTable:
    shown = [k for k in (*_TABLED, len(omega) - 1) if k < len(omega)]
    rows: list[tuple[Entry, ...]] = [
        (k + 1, float(omega[k]), *(float(xi[k]) for xi in ratios.values())) for k in shown
    ]
    heads = ("mode", "frequency / (1/s)", *ratios)
    return NumberTable("damping_ratios", "Damping ratio of the modes by the form of C (1: "
                                         "critical damping).", heads, tuple(rows))  # fmt: skip


def _words(ratios: Mapping[str, Floats], two: Mapping[str, float]) -> tuple[str, ...]:
    full, papers, last = ratios[FULL], ratios[PAPERS], ratios[DIAGONAL]
    return (
        f"αM leaves the first mode {papers[0]:.2g} of critical damping instead of "
        f"{full[0]:.2g}, and the last of {len(full)} {papers[-1]:.2g} instead of "
        f"{full[-1]:.2g}: high modes that βK damps now ring.",
        f"Matched to the first mode, α'M has an E_n of {two[MATCHED]:.2g} at 2 s, compared "
        f"with {two[PAPERS]:.2g} of αM; the diagonal of C itself would damp the first mode "
        f"{last[0] / full[0]:.2g} times too much.",
    )
