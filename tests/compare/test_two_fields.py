"""The contract of every metric of two fields, over all metrics and all cell kinds."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from validate.arrays import Floats
from validate.compare.force_error import FORCE_METRICS
from validate.compare.score import Metric
from validate.compare.shapes.pair import Common, Field, FieldPair, pair
from validate.compare.shapes.shape_error import BOUNDARY_METRICS
from validate.compare.shapes.two_fields import METRICS_OF_FIELDS, FieldScores, compared
from validate.errors import ComparisonError, UsageError
from validate.scene.geometries.box import box, grid
from validate.scene.material import Material
from validate.scene.mesh import Mesh
from validate.scene.scene import Scene

PLANE, SOLID = ((1.0, 0.8), (4, 3)), ((1.0, 0.8, 0.6), (3, 2, 2))
MESHES = {
    "tri3": box(*PLANE),
    "tri6": box(*PLANE).quadratic(),
    "quad4": grid(*PLANE),
    "tet4": box(*SOLID),
    "tet10": box(*SOLID).quadratic(),
    "hex8": grid(*SOLID),
    "hex27": grid(*SOLID).quadratic(),
}
# Exponent of a length in each unit; the energy norm's by dimension at unit thickness.
POWERS = {"1": 0.0, "m": 1.0, "m^2": 2.0, "m^3": 3.0}


@pytest.fixture(params=MESHES, name="mesh")
def _mesh(request: pytest.FixtureRequest) -> Mesh:
    return MESHES[request.param]


def wave(x: Floats) -> Floats:
    return 0.03 * np.sin(3 * x[:, ::-1]) + 0.01 * x


def other_wave(x: Floats) -> Floats:
    return wave(x) + 2e-3 * np.cos(4 * x)


def on(mesh: Mesh, factor: float = 1.0) -> tuple[Field, Field, Scene]:
    scaled = replace(mesh, nodes=factor * mesh.nodes)
    run = Field(scaled, factor * other_wave(mesh.nodes), "run")
    reference = Field(scaled, factor * wave(mesh.nodes), "reference")
    return run, reference, Scene(scaled, Material(1e4, 0.3, rho=1000.0))


def values(run: Field, reference: Field, onto: Scene) -> dict[str, float]:
    return {s.name: s.value for s in FieldScores.of(run, reference, onto).whole()}


def test_identical_fields_are_exactly_zero_in_every_metric(mesh: Mesh) -> None:
    _, reference, scene = on(mesh)
    found = values(reference, reference, scene)
    assert found == {m.name: 0.0 for m in METRICS_OF_FIELDS}


def test_every_metric_scales_as_its_unit_says(mesh: Mesh) -> None:
    units = {m.name: m.unit_of(pair(*on(mesh))) for m in METRICS_OF_FIELDS}
    plain, large = values(*on(mesh)), values(*on(mesh, 3.0))
    for name, unit in units.items():
        power = POWERS.get(unit, mesh.dimension / 2)
        assert large[name] == pytest.approx(3.0**power * plain[name], rel=1e-9, abs=0), name


@pytest.mark.slow
def test_symmetric_metrics_do_not_change_with_the_reference(mesh: Mesh) -> None:
    run, reference, scene = on(mesh)
    between = pair(run, reference, scene)
    for metric in METRICS_OF_FIELDS:
        swapped = metric.value(between.swapped)
        if metric.symmetric:
            assert swapped == pytest.approx(metric.value(between), rel=1e-12), metric.name
    other_way = values(reference, run, scene)
    assert {m.name: m.value(between.swapped) for m in METRICS_OF_FIELDS} == other_way
    assert values(run, reference, scene)["E_n"] != other_way["E_n"]


@pytest.mark.parametrize("metric", METRICS_OF_FIELDS, ids=lambda m: m.name)
def test_every_score_says_what_it_is(metric: Metric[FieldPair]) -> None:
    run, reference, scene = on(MESHES["tet4"])
    between = pair(run, reference, scene)
    score = metric.score(between)
    assert score.name == metric.name
    assert score.against == "reference"
    assert score.unit == metric.unit_of(between)
    assert "on a mesh of 36 nodes (tet4)" in score.definition
    assert score.count > 0 or metric.name.startswith("outside")


@pytest.mark.parametrize("metrics", [METRICS_OF_FIELDS, BOUNDARY_METRICS, FORCE_METRICS])
def test_metrics_are_told_apart_and_defined(metrics: Sequence[Metric[Any]]) -> None:
    names = [m.name for m in metrics]
    assert len(set(names)) == len(names)
    assert all(m.definition and m.counted.of and m.unit for m in metrics)


@pytest.mark.parametrize("shift", 10.0 ** np.arange(-12.0, 0.0))
@pytest.mark.slow
def test_a_rigid_shift_is_what_it_is(mesh: Mesh, shift: float) -> None:
    """A box 1 m long shifted by s along x: mean distance s, symmetric difference 2 s of 1."""
    rest = Field(mesh, np.zeros(mesh.nodes.shape), "reference")
    moved = Field(mesh, np.broadcast_to(shift * np.eye(mesh.dimension)[0], rest.u.shape), "run")
    found = compared(pair(moved, rest))
    scores = {s.name: s.value for s in found.scores}
    volume = 0.8 if mesh.dimension == 2 else 0.48
    assert scores["E_i.mean"] == pytest.approx(shift, rel=1e-12, abs=0)
    printed = shift * volume ** (1 - 1 / mesh.dimension)
    assert scores["E_i"] == pytest.approx(printed, rel=1e-12, abs=0)
    # Places near 1 m are rounded to 1e-16 m.
    assert scores["E_s"] == pytest.approx(2 * shift, rel=1e-6, abs=5e-16)
    assert scores["E_s.shell"] == pytest.approx(2 * shift, rel=1e-6, abs=5e-16)
    assert scores["surface.hausdorff"] == pytest.approx(shift, rel=1e-6, abs=5e-16)
    assert [name for name, _ in found.refused] == ["E_n", "L2.relative"]


def test_relative_norms_at_rest_are_refused_with_the_reason(mesh: Mesh) -> None:
    rest = Field(mesh, np.zeros(mesh.nodes.shape), "reference")
    with pytest.raises(ComparisonError, match=r"2 metrics.*E_n: E_n is 0/0: reference"):
        FieldScores.of(rest, rest).whole()


def test_without_a_scene_there_are_no_energy_norms(mesh: Mesh) -> None:
    run, reference, _ = on(mesh)
    names = {s.name for s in FieldScores.of(run, reference).whole()}
    assert {m.name for m in METRICS_OF_FIELDS} - names == {"energy", "energy.relative"}
    with pytest.raises(ComparisonError, match="needs moduli"):
        FieldScores.of(run, reference, metrics=[m.name for m in METRICS_OF_FIELDS]).whole()


@pytest.mark.parametrize("kinds", [("tri3", "quad4"), ("tri6", "tri3"), ("hex8", "tet10")])
def test_a_linear_field_is_the_same_on_any_mesh(kinds: tuple[str, str]) -> None:
    """Both meshes fill the same box: only rounding is left, and no point lies outside."""
    one, other = (MESHES[k] for k in kinds)
    gradient = 0.05 * np.random.default_rng(1).normal(size=(one.dimension, one.dimension))
    fields = [Field(m, m.nodes @ gradient, k) for m, k in zip((one, other), kinds, strict=True)]
    finer = (box((1.0, 0.8), (7, 5)) if one.dimension == 2 else box((1.0, 0.8, 0.6), (4, 3, 3)),)
    for onto in (None, one, *finer):
        found = {s.name: s for s in FieldScores.of(*fields, onto).whole()}
        assert all(abs(s.value) < 1e-13 for s in found.values()), found
    assert found["outside"].count == 2 * len(finer[0].nodes)
    assert f"0 of {found['outside'].count} carried nodes outside" in found["E_n"].definition


def test_nodes_outside_are_counted_and_measured() -> None:
    """A mesh 0.1 m longer than the run's: its last column of nodes lies outside by 0.1 m."""
    short, long = grid((1.0, 1.0), (4, 4)), grid((1.1, 1.0), (11, 4))
    run = Field(short, 0.1 + 0 * short.nodes, "run")
    reference = Field(long, 0.1 + 0 * long.nodes, "reference")
    found = {s.name: s for s in FieldScores.of(run, reference).whole()}
    assert (found["outside"].value, found["outside"].count) == (5, 60)
    assert found["outside.max"].value == pytest.approx(0.1, rel=1e-12)
    assert found["E_n"].value == pytest.approx(0, abs=1e-14)
    assert found["E_s"].value == pytest.approx(0.1 / 1.1, rel=1e-12)


def test_another_frame_and_another_dimension_are_refused() -> None:
    near, far = grid((1.0, 1.0), (2, 2)), grid((1.0, 1.0), (2, 2))
    far = replace(far, nodes=far.nodes + 5.0)
    still = [Field(m, np.ones(m.nodes.shape), "run") for m in (near, far, MESHES["tet4"])]
    with pytest.raises(ComparisonError, match="9 of 9 nodes lie outside"):
        FieldScores.of(still[0], still[1]).whole()
    with pytest.raises(ComparisonError, match="run is 2-D, run 3-D"):
        FieldScores.of(still[0], still[2]).whole()
    with pytest.raises(ComparisonError, match=r"shape \(9, 3\)"):
        Field(near, np.zeros((9, 3)), "run")


def test_the_common_mesh_assembles_once_over_many_frames() -> None:
    run, reference, scene = on(MESHES["tri3"])
    common = Common(scene.mesh, scene)
    first, second = pair(run, reference, common), pair(reference, run, common)
    assert first.common.K is second.common.K


def test_units_of_metrics_have_the_dimension() -> None:
    assert [FieldScores.units(d)["E_i"] for d in (2, 3)] == ["m^2", "m^3"]
    assert FieldScores.units(2)["E_n"] == "1"


def test_an_unknown_metric_is_refused_with_the_nearest() -> None:
    run, reference, _ = on(box((1.0, 1.0), (2, 2)))
    with pytest.raises(UsageError, match=r"no metric 'E_m'.*E_n"):
        FieldScores.of(run, reference, metrics=("E_m",))


def test_earlier_scores_stand_for_their_mesh() -> None:
    """So that its matrices are made once for all frames."""
    run, reference, scene = on(box((1.0, 1.0), (2, 2)))
    first = FieldScores.of(run, reference, scene, ("E_n",))
    again = FieldScores.of(run, reference, first, ("E_n",))
    assert again.pair.common is first.pair.common
    assert again.scores == first.scores
