"""Errors over time, orders and limits of paper 002's claims, on small inputs with known answers."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from experiments.needle_block.body import MP1, needle_block, needle_depth, needle_from_above
from experiments.needle_block.errors import (
    Errors,
    errors_of,
    ordered_share,
    read_off,
    shape_maps,
    stable_of,
    sum_ratio,
)
from experiments.needle_block.integration_rules import limit_of, rules_exhibit
from validate.compare.exhibit import NodeMap
from validate.fem.system import build
from validate.report.scenes.maps import ranges, words
from validate.solve.march import march
from validate.solve.static.quasi_static import QuasiStatic
from validate.solve.types import Run


def still(n: int, scale: float = 1.0) -> Run:
    """Five quasi-static steps of the needle."""
    t = np.arange(1, 6) / 30
    stepper = QuasiStatic().prepare(build(needle_block(n)))
    return march("still", stepper, t, scale * needle_depth(t), np.arange(5), 0.0)


def test_a_scaled_field_has_the_scale_as_relative_error() -> None:
    scene, one, truth = needle_block(4), still(4, 1.1), still(4)
    found = errors_of(one, scene.mesh, truth.u, scene)
    assert found.t == pytest.approx([1 / 30, 5 / 30])
    for name in ("E_n", "L2.relative", "energy.relative"):
        assert found.values[name] == pytest.approx(0.1, rel=1e-9)
        assert found.at(name, 1 / 6) == pytest.approx(0.1)
    assert found.at("E_n", 1.0) is None
    assert found.refused == ()


def test_a_truth_at_rest_has_no_relative_error_and_says_why() -> None:
    scene, one = needle_block(4), still(4)
    found = errors_of(one, scene.mesh, 0 * one.u, scene, ("E_n", "E_i"))
    assert len(found.line("E_n").x) == 0
    assert found.at("E_n", 1 / 6) is None
    assert (found.values["E_i"] > 0).all()
    assert "does not move" in found.refused[0][2]


def test_fields_of_another_mesh_are_read_at_the_truths_nodes() -> None:
    """A field that is linear within coarse cells is the same on the fine mesh."""
    coarse, fine = needle_block(4), needle_block(8)
    run, truth = still(4), still(8)
    linear = np.array([[0.01, 0.002], [-0.003, 0.02]])
    one = replace(run, u=np.stack([coarse.mesh.nodes @ linear] * 5))
    same = np.stack([fine.mesh.nodes @ linear] * len(truth.u))
    found = errors_of(one, coarse.mesh, same, fine, ("E_n", "E_i"))
    assert found.values["E_n"] == pytest.approx(0, abs=1e-12)


def made(**values: list[float]) -> dict[str, Errors]:
    t = np.arange(4.0)
    return {k: Errors(k, t, {"E_i": np.array(v)}, ()) for k, v in values.items()}


def test_the_papers_order_is_a_share_of_the_times_after_the_first_step() -> None:
    errors = made(
        explicit=[9, 1, 1, 1],
        implicit_lumped=[1, 2, 2, 0.5],
        explicit_lumped=[1, 3, 5, 3],
        quasi_static=[1, 4, 4, 4],
    )
    assert ordered_share(errors) == pytest.approx(1 / 3)
    assert ordered_share(errors, until=1.0) == 1.0
    assert sum_ratio(errors) == pytest.approx((5 / 3, 0.5))


def test_limits_of_the_printed_rules() -> None:
    """sqrt 8 for beta .25 in the paper's notation; 2/sqrt 3, 1.29 and 1.55 for the misprint."""
    _, numbers = rules_exhibit()
    assert numbers["clash"] == pytest.approx(8**0.5, abs=1e-6)
    assert numbers["misprint.0"] == pytest.approx(2 / 3**0.5, abs=1e-6)
    assert numbers["misprint.1"] == pytest.approx(1.29, abs=5e-3)
    assert numbers["misprint.3"] == pytest.approx(1.55, abs=5e-3)
    assert numbers["order"] == pytest.approx(2, abs=0.01)
    assert limit_of(lambda wh: np.full(len(wh), 0.5)) == np.inf


def test_curves_are_read_off_at_two_seconds() -> None:
    t, zero = np.array([1.0, 2.0]), np.zeros(2)
    lumped = {"E_n": np.array([1.0, 2.0]), "E_s": np.array([3.0, np.nan]), "E_i": zero + 4}
    errors = {
        "explicit_lumped": Errors("lumped", t, lumped, ()),
        "quasi_static": Errors("still", t, {"E_i": np.array([5.0, 6.0])}, ()),
    }
    assert read_off(errors) == {"E_n@2s": 2.0, "E_i@2s": 4.0, "E_i@2s.quasi_static": 6.0}


def test_critical_steps_of_the_block() -> None:
    """MP1, n = 20, plane strain: an independent reconstruction."""
    system = build(needle_block(20))
    assert stable_of(system, "consistent", "printed") == pytest.approx(3.503975e-2, rel=1e-6)
    assert stable_of(system, "lumped", "printed") == pytest.approx(6.471836e-2, rel=1e-6)
    assert stable_of(system, "consistent", "lagged") == pytest.approx(5.9440e-3, rel=1e-4)
    assert stable_of(system, "lumped", "lagged") == pytest.approx(1.8949e-2, rel=1e-4)


def test_the_needle_from_above_is_the_block_turned() -> None:
    turned = needle_from_above(4, MP1)
    depth = np.array([0.08])
    across, above = (QuasiStatic().prepare(build(s)) for s in (needle_block(4), turned))
    u = across.field(across.step(across.rest(), depth))
    v = above.field(above.step(above.rest(), depth))
    x, y = needle_block(4).mesh.nodes, turned.mesh.nodes
    for i, place in enumerate(x):
        j = int(np.argmin(np.linalg.norm(y - place[::-1], axis=1)))
        assert v[j] == pytest.approx(u[i][::-1], abs=1e-12)


def test_a_map_on_a_deformed_body_says_so() -> None:
    mesh = needle_block(2).mesh
    shown = NodeMap("m", "A map", mesh, np.ones(9), "mm", surface="the deformed body")
    assert "at 9 nodes, on the deformed body" in words(shown, ranges([shown])["m"])


def test_a_shape_is_the_body_moved_by_its_displacement() -> None:
    """In the frame nearest to the time; a method that did not come to its end has none."""
    run = still(2)
    done = SimpleNamespace(whole=True, run=run, scene=needle_block(2), label="Still")
    case = {"done": done, "ended": SimpleNamespace(whole=False)}
    (shown,) = shape_maps(case, ("done", "ended", "absent"), 0.11)  # type: ignore[arg-type]
    assert shown.mesh.nodes == pytest.approx(done.scene.mesh.nodes + run.u[2], abs=1e-16)
    assert shown.values == pytest.approx(1e3 * np.linalg.norm(run.u[2], axis=1))
    assert "Still at 0.1 s" in shown.title
