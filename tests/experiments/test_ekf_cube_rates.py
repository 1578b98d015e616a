"""Rates against the size of the mesh: interpolation by hand, and two tiny cubes."""

import numpy as np
import pytest

from experiments.ekf_cube.rates import Integrator, Rate, cells_at, measured_rates, rates_exhibit
from validate.estimate.extended.node_ekf import NodeEKF
from validate.fem.critical import CriticalStep
from validate.fem.system import build
from validate.scene.geometries.box import box
from validate.scene.material import Material
from validate.scene.scene import Scene, Support
from validate.solve.explicit.central import CentralDifference
from validate.solve.haptic.rates import RealTime

SOFT = Material(30e3, 0.45, "svk", 1000.0)


def rate(cells: int, hz: float, label: str = "x") -> Rate:
    return Rate(label, cells, cells // 4, RealTime(hz, 1e-4, 2e-4))


def test_cells_at_a_rate_are_interpolated_between_logarithms() -> None:
    """Halving the rate for every fourfold mesh: 100 Hz to 25 Hz over 10 to 160 cells is 50 Hz at
    40, whatever the order of the rows; other integrators do not matter."""
    rows = (rate(160, 25.0), rate(1000, 50.0, "other"), rate(10, 100.0))
    assert cells_at(rows, "x", 50.0) == pytest.approx(40.0, rel=1e-12)
    assert cells_at(rows, "x", 100.0) == pytest.approx(10.0, rel=1e-12)
    assert cells_at(rows, "x", 25.0) == pytest.approx(160.0, rel=1e-12)
    three = (*rows, rate(1600, 20.0))
    between = 160 * 10 ** (np.log(25 / 22) / np.log(25 / 20))
    assert cells_at(three, "x", 22.0) == pytest.approx(between, rel=1e-12)


def test_there_is_no_number_beyond_the_meshes() -> None:
    rows = (rate(10, 100.0), rate(160, 25.0))
    assert cells_at(rows, "x", 101.0) is None
    assert cells_at(rows, "x", 24.0) is None
    assert cells_at(rows, "y", 50.0) is None
    assert cells_at((rate(10, 100.0),), "x", 50.0) is None


@pytest.mark.slow
def test_every_integrator_is_measured_on_the_meshes_it_may_be() -> None:
    """Steps are 0.9 of the critical one where none is given; cells outside a range are left out."""
    integrators = (
        Integrator("plain", lambda s, _, dt: CentralDifference(dt).prepare(s)),
        Integrator("filter", lambda s, z, dt: NodeEKF(dt).prepare(s, z), None, 7),
        Integrator("given", lambda s, _, dt: CentralDifference(dt).prepare(s), 1e-5, 1, 6),
    )
    rates = measured_rates(SOFT, 0.1, (1, 2), integrators)
    assert [(r.label, r.cells, r.nodes) for r in rates] == [
        ("plain", 6, 8), ("given", 6, 8), ("plain", 48, 27), ("filter", 48, 27),
    ]  # fmt: skip
    for n in (1, 2):
        scene = Scene(box((0.1,) * 3, (n,) * 3), SOFT, (Support("z0", (0, 1, 2)),))
        limit = CriticalStep.of(build(scene)).lanczos
        for r in (r for r in rates if r.cells == 6 * n**3):
            assert r.times.critical_dt == pytest.approx(limit, rel=1e-3)
            assert r.times.rate_hz > 0
            assert r.times.dt == (1e-5 if r.label == "given" else 0.9 * r.times.critical_dt)
            assert r.times.factor == pytest.approx(r.times.rate_hz * r.times.dt, rel=1e-12)


def test_the_table_has_the_step_and_the_real_time_factor_of_every_rate() -> None:
    """2 kHz of 0.1 ms steps simulate 0.2 s a second, at half of the critical step."""
    shown = rates_exhibit((rate(10, 2000.0), rate(20, 500.0), rate(10, 50.0, "y")))
    (table,) = shown.tables
    row = dict(zip(table.headings, table.rows[0], strict=True))
    assert row == {
        "integrator": "x", "tetrahedra": 10, "nodes": 2, "rate / Hz": 2000.0,
        "dt / ms": pytest.approx(0.1), "critical dt / ms": pytest.approx(0.2),
        "dt over critical / 1": pytest.approx(0.5), "real-time factor / 1": pytest.approx(0.2),
    }  # fmt: skip
    (chart,) = shown.charts
    assert [(s.label, s.x.tolist(), s.y.tolist()) for s in chart.series] == [
        ("x", [10.0, 20.0], [2000.0, 500.0]), ("y", [10.0], [50.0]),
    ]  # fmt: skip
    assert [value for _, value in chart.levels] == [30.0, 1000.0]
