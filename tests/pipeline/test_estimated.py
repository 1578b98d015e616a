"""What filters found of the model itself, told from hand-made traces."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_consistency_tables import STEPS, followed

from validate.errors import UsageError
from validate.pipeline import load, run_in_memory
from validate.pipeline.exhibits.standard import doubt, estimated_exhibit, sentences
from validate.pipeline.run.method_run import MethodRun
from validate.solve.types import Trace


def estimating(left: float, tie: float = 0.0, unit: str = "Pa") -> MethodRun:
    """A stiffness of 10 to 12 kPa whose sd falls to `left`, beside a load."""
    one = np.ones(STEPS)
    f = followed(one, one)
    found = {}
    for name, value, of in (("stiffness", 11e3, unit), ("load.pull", 1.0, "1")):
        key = f"estimate.{name}"
        found |= {key: Trace(value * one, of), f"{key}.low": Trace(0.9 * value * one, of)}
        found |= {f"{key}.high": Trace(1.1 * value * one, of)}
        found[f"{key}.left"] = Trace(np.linspace(1, left, STEPS), "1")
    found["correlation.stiffness~load.pull"] = Trace(tie * one, "1")
    f.run.__dict__["traces"] = {**f.run.traces, **found}
    return f


def test_the_table_has_values_in_their_units() -> None:
    found = estimated_exhibit({"kf": estimating(0.1)}, {})
    assert found is not None
    assert found.words == ()
    rows = found.tables[0].rows
    assert [r[2] for r in rows] == ["stiffness", "load.pull"]
    value, low, high = (rows[0][i] for i in (3, 4, 5))
    assert [getattr(v, "text", "") for v in (value, low, high)] == ["11 kPa", "9.9 kPa", "12.1 kPa"]
    assert [getattr(v, "value", 0) for v in (value, low)] == [11e3, 0.9 * 11e3]
    assert rows[1][6:] == (0.1, "identified")
    chart = found.charts[0]
    assert chart.y == "stiffness / kPa"
    assert chart.series[1].y[-1] == 11.0
    assert chart.series[0].upper is not None


def test_what_markers_cannot_tell_is_said_and_with_what_it_is_tied() -> None:
    loose = estimating(0.7)
    assert doubt(loose, "stiffness") == (
        "not identifiable from these markers: 0.7 of the sd at the start is left"
    )
    tied = sentences(estimating(0.7, -0.998))
    assert len(tied) == 2
    assert tied[0].startswith("filter, stiffness: not identifiable")
    assert tied[0].endswith("known only together with load.pull, correlation -0.998")
    assert doubt(estimating(0.49, 0.999), "stiffness") == ""


def test_an_interval_that_the_innovations_contradict_is_said_not_to_hold() -> None:
    f = estimating(0.1)
    f.run.__dict__["traces"] = {**f.run.traces, "nis": Trace(np.full(STEPS, 2.5), "1")}
    assert doubt(f, "stiffness").startswith(
        "the interval does not hold: NIS 2.5 per degree of freedom, at most 1.9"
    )


def test_without_parameters_nothing_is_shown() -> None:
    one = np.ones(STEPS)
    assert estimated_exhibit({"kf": followed(one, one)}, {}) is None
    case = estimated_exhibit({}, {"soft": {"kf": estimating(0.1)}})
    assert case is not None
    assert case.charts == ()


@pytest.mark.slow
def test_on_the_road_parameters_are_chosen_by_name_and_the_report_has_them(
    project_root: Path,
) -> None:
    """`--set methods.roukf.parameters=...`; the block creeps alike whatever its modulus."""
    cube = load("kf_cube")
    methods = {name: cube.methods[name] for name in ("fem", "roukf")}
    short = replace(
        cube, methods=methods, accepted=("fem",), cases=(), published=(), exhibits=None, frames=5
    )
    result = run_in_memory(short, {"methods.roukf.parameters": "stiffness,load.pull"})
    found = next(e for e in result.exhibits if e.anchor == "estimates")
    assert [row[2] for row in found.tables[0].rows] == ["stiffness", "load.pull"]
    assert all("correlation 1.000" in str(row[-1]) for row in found.tables[0].rows)
    scores = {s.name for m in result.methods if m.name == "roukf" for s in m.scores}
    assert {"nis.per_dof", "node_B.nees.per_dof"} <= scores
    with pytest.raises(UsageError, match=r"'stiffness.core'.*load.pull"):
        run_in_memory(short, {"methods.roukf.parameters": "stiffness.core"})
