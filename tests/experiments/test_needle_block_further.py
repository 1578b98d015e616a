"""Paper 002's future work: penalties against the exact constraint, sensitivities, diagonal C."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csc_array

from experiments.bending_rod.body import MP3, bending_rod
from experiments.needle_block.body import MP1, needle_block, needle_depth, pressed_block
from experiments.needle_block.diagonal_damping import (
    DIAGONAL,
    FULL,
    MATCHED,
    PAPERS,
    damping_exhibit,
    damping_ratios,
)
from experiments.needle_block.penalty import (
    NEARLY,
    WEIGHTS,
    ExactStatics,
    Squeezed,
    exactly,
    kept,
    motion,
    penalty_exhibit,
    volume_share,
)
from experiments.needle_block.sensitivity import (
    TurnedBench,
    material_turns,
    mesh_turn,
    moved_nodes,
    sensitivity_exhibit,
    slope,
    solve,
)
from validate.fem.critical import CriticalStep, Modes
from validate.fem.system import build
from validate.scene.geometries.box import box, grid

# --- penalty --------------------------------------------------------------------------------------


def squeezed(cells: int = 10) -> Squeezed:
    unlocked = replace(pressed_block(10, replace(MP1, nu=NEARLY)), dilatation="mixed")
    return Squeezed(
        lambda n, m: pressed_block(n, m, box), MP1, cells, 20, ("mixed quadrilaterals", unlocked)
    )


@pytest.fixture(scope="module")
def exact() -> ExactStatics:
    return exactly(squeezed())


def test_the_same_lambda_over_mu_moves_alike_whatever_makes_it(exact: ExactStatics) -> None:
    """Compliances differ by the shear modulus alone: 1.3 against 1 + nu, at all weights."""
    body = squeezed()
    for weight in (1.0, 100.0):
        raised, area = (kept(body, exact, way, weight) for way in ("raised", "area"))
        ratio = 1.5 + weight
        shear = (1 + ratio / (2 * (ratio + 1))) / 1.3
        assert area.compliance * shear == pytest.approx(raised.compliance, rel=1e-9)
        assert area.step * shear**0.5 == pytest.approx(raised.step, rel=1e-4)
        assert area.volume == pytest.approx(raised.volume, rel=1e-9)
        assert area.net == area.growth == 0


def test_a_heavier_penalty_keeps_the_volume_costs_steps_and_locks(exact: ExactStatics) -> None:
    body = squeezed()
    line = [kept(body, exact, "area", w) for w in WEIGHTS]
    for name in ("volume", "step", "compliance"):
        values = [getattr(k, name) for k in line]
        assert values == sorted(values, reverse=True)
    assert line[-1].step == pytest.approx(line[-2].step / 10**0.5, rel=0.01)
    assert line[-1].compliance < 0.02
    assert min(k.error for k in line) > 0.5


def test_unit_normals_invent_a_force_on_the_rod() -> None:
    def make(n: int, material: object) -> object:
        return bending_rod(n, material, box)  # type: ignore[arg-type]

    unlocked = bending_rod(2, replace(MP3, nu=NEARLY))
    body = Squeezed(make, MP3, 2, 2, ("none", unlocked))  # type: ignore[arg-type]
    exact = exactly(body)
    unit, area = (kept(body, exact, way, 100.0) for way in ("unit", "area"))
    assert area.net == 0
    assert unit.net == pytest.approx(0.8435, abs=1e-3)
    assert unit.growth > 0.1


def test_steps_of_a_matrix_that_is_not_symmetric() -> None:
    """w^2 = 4 and 9 of a skewed pair; a rotation of frequencies grows by the imaginary part."""
    skewed = csc_array(np.array([[4.0, 1.0], [0.0, 9.0]]))
    assert motion(skewed, np.ones(2)) == pytest.approx((2 / 3, 0.0))
    turning = csc_array(np.array([[3.0, 4.0], [-4.0, 3.0]]))  # w^2 = 3 + 4i, w = 2 + i
    assert motion(turning, np.ones(2)) == pytest.approx((2 / 5**0.5, 1.0))
    system = build(bending_rod(1))
    K, masses = system.K[system.free][:, system.free], system.masses[system.free]
    found, growth = motion(csc_array(K), masses)
    assert growth == 0
    assert found == pytest.approx(CriticalStep.by_lanczos(lambda x: K @ x, masses).limit, rel=1e-6)


@pytest.mark.parametrize("cells", [grid, box])
@pytest.mark.parametrize("d", [2, 3])
def test_volume_shares_of_known_strains(cells: object, d: int) -> None:
    """A dilation: theta = d, |e| = root d; a shear keeps the volume."""
    scene = pressed_block(10, MP1, cells) if d == 2 else bending_rod(1, MP3, cells)  # type: ignore[arg-type]
    x = scene.mesh.nodes
    assert volume_share(scene, x) == pytest.approx(d**0.5)
    assert volume_share(scene, np.roll(x, 1, axis=1)) < 1e-12


def test_the_penalty_is_shown_with_its_numbers() -> None:
    shown, numbers = penalty_exhibit(squeezed())
    (table,) = shown.tables
    assert len(table.rows) == 3 * len(WEIGHTS) + 1
    assert {c.name for c in shown.charts} == {"penalty_error", "penalty_volume"}
    best = min(row[3] for row in table.rows[5:10] if isinstance(row[3], float))
    assert numbers["penalty.best"] == pytest.approx(best / 100)
    assert numbers["penalty.instead"] < 0.2 < numbers["penalty.best"]
    assert "happen to" in shown.words[2]


# --- sensitivities --------------------------------------------------------------------------------


def test_a_slope_is_that_of_a_power() -> None:
    assert slope(3 * 2.0**1.5, 3 * 4.0**1.5, 2.0) == pytest.approx(1.5)
    assert slope(None, 1.0, 2.0) is slope(1.0, None, 2.0) is slope(0.0, 1.0, 2.0) is None


def test_errors_follow_modulus_over_density() -> None:
    """A motion prescribed in place and time depends on E/rho alone: twice both changes nothing."""
    soft, every = needle_block(6), ("implicit", "explicit_lumped", "quasi_static")
    assert soft.material.rho is not None
    doubled = replace(soft, material=replace(soft.material, E=400.0, rho=2 * soft.material.rho))
    one, other = solve(soft, needle_depth, every), solve(doubled, needle_depth, every)
    for method in every[1:]:
        found = one.against(one, method)
        assert other.against(other, method) == pytest.approx(found, rel=1e-7)
    assert other.against(one) == pytest.approx(dict.fromkeys(found, 0.0), abs=1e-9)


def test_turned_inputs_are_off_by_what_they_say() -> None:
    scene = bending_rod(2)
    turns = {t.name: t for t in material_turns(scene, 0.05)}
    assert turns["E"].low[1].material.E == turns["E"].low[0] == pytest.approx(6300)
    assert turns["ν"].high[1].material.nu == turns["ν"].high[0] == pytest.approx(0.21)
    assert turns["β"].high[1].material.stiffness_damping == pytest.approx(0.11)
    size = mesh_turn("cells", scene, (5, 2, 2), (2, 2, 2))
    assert (size.nominal, size.low[0], size.high[0]) == pytest.approx((0.125, 0.1, 0.25))
    assert size.off is size.high
    assert len(size.low[1].mesh.cells) == 20


def test_moved_nodes_are_the_inner_ones_by_less_than_a_share() -> None:
    scene = needle_block(6)
    by = moved_nodes(scene, 0.2).mesh.nodes - scene.mesh.nodes
    edge = ((scene.mesh.nodes < 1e-9) | (scene.mesh.nodes > 1 - 1e-9)).any(axis=1)
    assert not by[edge].any()
    assert 0.15 / 6 < np.abs(by[~edge]).max() <= 0.2 / 6


def test_a_method_that_is_refused_has_no_number_and_says_so() -> None:
    """Cells a third as long are beyond the critical step; slopes of the others stay."""
    scene = needle_block(4)
    turn = mesh_turn("cells", scene, (60, 4), (4, 4))
    shown = sensitivity_exhibit(
        TurnedBench(scene, needle_depth, (turn,), {"moved": moved_nodes(scene)})
    )
    costs, slopes = shown.tables
    rows = {(row[0], row[1]): row for row in slopes.rows}
    assert rows["explicit", "E_n"][3] is None
    assert isinstance(rows["quasi-static", "E_n"][3], float)
    assert "cells: explicit is refused" in slopes.note
    assert [row[0] for row in costs.rows][:2] == ["cells / m", "moved"]


# --- diagonal damping -----------------------------------------------------------------------------


def test_row_sums_of_the_whole_damping_are_alpha_m() -> None:
    """What lumping C leaves: a translation feels no stiffness, so beta K is gone."""
    system = build(bending_rod(2))
    nodes = system.scene.mesh.nodes
    for c in range(3):
        e = np.zeros_like(nodes)
        e[:, c] = 1
        alpha = system.scene.material.mass_damping
        assert system.C @ e.ravel() == pytest.approx(alpha * (system.M @ e.ravel()), abs=1e-10)


def test_damping_ratios_by_the_form_of_c() -> None:
    system = build(needle_block(6))
    w, ratios = damping_ratios(system)
    assert ratios[FULL] == pytest.approx((1.0 / w + 0.1 * w) / 2, rel=1e-9)
    assert ratios[PAPERS] == pytest.approx(1 / (2 * w))
    assert ratios[MATCHED][0] == pytest.approx(ratios[FULL][0])
    assert ratios[MATCHED][-1] < 0.1 * ratios[FULL][-1]
    assert ratios[DIAGONAL][0] > 3 * ratios[FULL][0]


def test_diagonal_damping_is_shown_with_its_numbers() -> None:
    shown, numbers = damping_exhibit(needle_block(6), needle_depth, 1 / 30)
    by_mode, errors = shown.tables
    assert by_mode.rows[-1][0] == len(Modes.of(build(needle_block(6))).omega)
    at_2 = {row[0]: row[4] for row in errors.rows if row[1] == "E_n / 1"}
    assert at_2 == pytest.approx(
        {PAPERS: numbers["damping.papers"], MATCHED: numbers["damping.matched"]}
    )
    assert 1e-3 < numbers["damping.papers"] < 0.1
