"""What `ekf_cube` shows of paper 003: rates over the size of the mesh, and what it leaves open."""

from typing import Any

import numpy as np

from validate.compare.exhibit import Exhibit
from validate.estimate.extended.node_ekf import NodeEKF
from validate.estimate.reduced.reduced_ekf import ReducedEKF
from validate.fem.critical import CriticalStep
from validate.fem.system import build as build_system
from validate.pipeline.experiment.experiment import Progress, ReportAdditions
from validate.pipeline.run.method_run import Cases
from validate.solve.dynamic.implicit import NewtonDynamics
from validate.solve.explicit.central import CentralDifference
from validate.solve.haptic.rates import RealTime

from .published import PRINTED_STEP
from .rates import VISUAL_HZ, Integrator, cells_at, measured_rates, rates_exhibit
from .tables import (
    fields_apart,
    locking_table,
    readings_table,
    steps_table,
)

EDGES = (1, 2, 3, 4, 6, 8, 9, 12, 16, 26)  # boxes along an edge: 6 to 105 456 tetrahedra
NU = (0.45, 0.49, 0.499)  # what locking is shown at
EXPLICIT, FILTER, REDUCED, IMPLICIT = (
    "NFEM, explicit", "node-level EKF", "reduced EKF, 20 modes", "NFEM, implicit Newton at 1 ms",
)  # fmt: skip
INTEGRATORS = (
    Integrator(EXPLICIT, lambda s, _, dt: CentralDifference(dt, watch=10_000).prepare(s)),
    Integrator(FILTER, lambda s, z, dt: NodeEKF(dt).prepare(s, z)),
    Integrator(REDUCED, lambda s, z, dt: ReducedEKF(dt).prepare(s, z), None, 100, 20_000),
    Integrator(IMPLICIT, lambda s, _, dt: NewtonDynamics(dt).prepare(s), PRINTED_STEP, 1, 2000),
)


def tell_cube(parameters: Any, cases: Cases, progress: Progress) -> ReportAdditions:
    """Rates over the size of the mesh, both readings of the force, critical steps, locking."""
    scene = cases[""]["nfem"].body
    progress("rates of 6 to 105 456 tetrahedra")
    side = float(np.ptp(scene.mesh.nodes[:, 0]))
    rates = measured_rates(scene.material, side, EDGES, INTEGRATORS)
    progress("readings of the force")
    readings = readings_table(scene, parameters.settings.loading.force, "x")
    limits = steps_table(scene, PRINTED_STEP)
    progress("locking")
    locked = locking_table(scene, NU)
    numbers = {
        "critical_step": CriticalStep.of(build_system(scene)).lanczos,
        "nodes": float(len(scene.mesh.nodes)),
        "cells": float(len(scene.mesh.cells)),
        "fields_apart": fields_apart(cases[""], ("ekf_held", "nfem")),
    }
    for name, label in (("explicit", EXPLICIT), ("filter", FILTER), ("implicit", IMPLICIT)):
        for hz in (VISUAL_HZ, RealTime.haptic_hz):
            cells = cells_at(rates, label, hz)
            numbers[f"cells.{name}@{hz:g}Hz"] = np.nan if cells is None else cells
    model = Exhibit(
        "model",
        "Choices that the printed numbers do not determine",
        ("The printed force, step and element each change the result more than the filter does.",),
        (readings, limits, locked),
    )
    return ReportAdditions((model, rates_exhibit(rates)), numbers)
