"""What the printed numbers of paper 003 leave open: readings of the force, steps, elements, fields
that are "nearly same"."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from validate.compare.exhibit import Entry, NumberTable
from validate.fem.critical import CriticalStep
from validate.fem.system import build as build_system
from validate.pipeline.run.method_run import MethodRun
from validate.scene.scene import Load, Scene
from validate.solve.march import march
from validate.solve.static.newton import StaticNewton

from .locking import locking_factor


def readings_table(scene: Scene, force: float, axis: str) -> NumberTable:
    """Static displacements under the printed force read as a total and as a force on every node."""
    c = "xyz".index(axis)
    rows: list[tuple[Entry, ...]] = []
    for spread in ("consistent", "nodal", "per_node"):
        loads = tuple(
            replace(load, spread=spread) for load in scene.loads if isinstance(load, Load)
        )
        system = build_system(replace(scene, loads=loads))
        total = float(np.abs(system.loads.sum())) * force
        stepper = StaticNewton().prepare(system)
        run = march("static", stepper, np.ones(1), np.full((1, 1), force), np.zeros(1, int), 0.0)
        ended = run.outcome.state if run.finished else f"{run.outcome.state}: {run.outcome.why}"
        moved = [
            1e3 * float(run.traces[f"{p.name}.{'xyz'[c]}"].y[-1]) if run.finished else None
            for p in scene.probes
        ]
        rows.append((spread, total, *moved, ended))
    heads = (f"static u_{axis} at {p.name} / mm" for p in scene.probes)
    return NumberTable(
        "force_readings",
        f"'A linear force of (0, {force:g} N)': as a total (consistent or equal shares) or on "
        "every node of the face.",
        ("reading", "total force / N", *heads, "ended"),
        tuple(rows),
    )


def steps_table(scene: Scene, printed: float) -> NumberTable:
    """Critical steps by four rules, and the printed step beside."""
    limits = CriticalStep.of(build_system(scene))
    named: tuple[tuple[str, float | None], ...] = (
        ("2/omega_max by Lanczos (the limit)", limits.lanczos),
        ("recommended: limit less margin", limits.recommended),
        ("Gershgorin (safe bound)", limits.gershgorin),
        ("largest element frequency (safe bound)", limits.element),
        ("eq 16, least altitude over wave speed", limits.eq_16_altitude),
        ("eq 16, shortest edge over wave speed", limits.eq_16_edge),
        ("printed", printed),
    )
    rows = tuple(
        (name, 1e3 * value, value / limits.lanczos) for name, value in named if value is not None
    )
    return NumberTable(
        "critical_steps",
        f"Time steps of central difference on this mesh, by rule; {limits.limited_by}.",
        ("rule", "step / ms", "over the limit / 1"),
        rows,
        "Above 1 a run is unstable: eq 16 is not a bound.",
    )


def locking_table(scene: Scene, values: tuple[float, ...]) -> NumberTable:
    """Displacement of these linear cells over that of quadratic ones, by Poisson ratio."""
    rows, probes = [], scene.probes[:2]
    for nu in values:
        changed = replace(scene, material=replace(scene.material, nu=nu))
        rows.append((nu, *(locking_factor(changed, p.name) for p in probes)))
    return NumberTable(
        "locking",
        "Locking: static displacement of linear over quadratic tetrahedra of the same mesh.",
        ("nu / 1", *(f"at {p.name} / 1" for p in probes)),
        tuple(rows),
        "1: no locking. A value below 1 is excess stiffness of the element, not of the tissue.",
    )


def fields_apart(methods: Mapping[str, MethodRun], names: tuple[str, str]) -> float:
    """Largest distance of two methods' fields at the last common frame over the largest
    displacement of the second there; NaN where one of them was not run, or ended early."""
    if any(name not in methods or not methods[name].whole for name in names):
        return float("nan")
    one, other = (methods[name] for name in names)
    u, reference = one.run.u[-1], other.run.u[-1]
    apart = np.linalg.norm(u - reference, axis=1).max()
    return float(apart / np.linalg.norm(reference, axis=1).max())
