"""The ladder of a body that a probe touches: its rungs, its reference, what is said of sizes."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from beside import experiment
from touched import block

from validate.engine.cell import Where
from validate.errors import UsageError
from validate.fem.system import build
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.ladder.default import Divided, body_of, trial_of
from validate.pipeline.ladder.ladder import RUNGS, Trial
from validate.solve.regions.scheme import AsyncRegions
from validate.solve.types import StepTimes
from validate.study.choose.facts import facts
from validate.study.choose.study import Climb, Wanted, meeting, misses, require_judged
from validate.study.tradeoff.exhibits import pays, regions_exhibit, trade_exhibits
from validate.study.tradeoff.study import Trade, TradeRow


@pytest.fixture(scope="module")
def touched() -> Experiment:
    return experiment("async_block")


@pytest.fixture(scope="module")
def trial(touched: Experiment) -> Trial:
    return trial_of(touched, quick=True)


def test_a_touched_body_is_climbed_by_its_own_methods(trial: Trial) -> None:
    """Meshes that are not touched in the middle of a node's face are no meshes of this ladder."""
    assert {s.rung for s in trial.solvers} == {"modal", "prefactored", "regions"}
    assert {s.rung for s in trial.solvers if s.uneven} == {"regions"}
    element, finest = trial.reference
    for level in (*trial.meshes[element], finest):
        scene = trial.build(element, level, "linear")
        assert scene.tools[0].tip == pytest.approx((0.1, 0.05, 0.05))
        away = np.linalg.norm(scene.mesh.nodes - np.array(scene.tools[0].tip), axis=1)
        assert away.min() < 1e-9
    assert trial.steps == pytest.approx((2e-3, 1e-3))
    assert "shared by the nodes within" in trial.notes[1]


@pytest.mark.slow
def test_a_bar_is_refined_as_one_body() -> None:
    trial = trial_of(experiment("async_line"), quick=True)
    element, finest = trial.reference
    bodies = [trial.build(element, n, "linear") for n in (*trial.meshes[element], finest)]
    assert len({len(b.mesh.nodes) for b in bodies}) == len(bodies) >= 2
    for body in bodies:
        assert np.ptp(body.mesh.nodes, axis=0) == pytest.approx([0.1, 0.0025])


def test_the_reference_is_the_whole_solve_in_shorter_steps() -> None:
    """A step of eight parts is eight steps, the probe halfway after half of them."""
    scene, whole = block(5e3, 2, 2), AsyncRegions(1e-3, (), ())
    divided = Divided(whole, 8).prepare(build(scene))
    plain = whole.prepare(build(scene))
    a, b = divided.rest(), plain.rest()
    for k in range(1, 4):
        a = divided.step(a, np.array([-1e-3 * k, 0.0]))
        for i in range(1, 9):
            b = plain.step(b, np.array([-1e-3 * (k - 1 + i / 8), 0.0]))
    assert a.k == 3
    assert divided.field(a) == pytest.approx(plain.field(b), abs=1e-15)


def test_a_stability_map_has_no_probe(touched: Experiment) -> None:
    with pytest.raises(UsageError, match="is touched by the probe 'probe'"):
        body_of(touched)


def test_a_rate_is_held_by_the_slow_steps_of_regions(trial: Trial) -> None:
    times = StepTimes(1e-4, 2e-3, 3e-3, 100)
    solver = next(s for s in trial.solvers if s.rung == "regions")
    row = TradeRow(solver, "P1", 100, 1e-3, step=times, error=1e-5, total=None)
    want = Wanted(1e-4, 1000.0)
    assert misses(row, want, "error", dynamic=True) == pytest.approx((0.1, 2.0))
    assert meeting([row], want, "error", dynamic=True) == []
    even = replace(row, solver=replace(solver, uneven=False))
    assert meeting([even], want, "error", dynamic=True) == [even]


@pytest.mark.slow
def test_sizes_are_told_by_what_was_measured(touched: Experiment, tmp_path: Path) -> None:
    climbed = Climb(touched, quick=True, out=tmp_path, where=Where(workers=0))
    reached = {rung: climbed(rung, None) for rung in RUNGS}
    trades = {rung: found.trade for rung, found in reached.items() if found is not None}
    assert list(trades) == ["modal", "prefactored", "regions"]
    assert regions_exhibit(trades["prefactored"]) is None
    told: Trade = trades["regions"]
    words = list(pays(told))
    assert len(words) == len(told.trial.meshes["P1"]) + 1
    assert all("unknowns: regions (" in w for w in words[:-1])
    assert "regions" in [e.anchor for e in trade_exhibits(told)]
    assert facts(told, 1e-3)[1].name == "strain level (pilot, coarse mesh)"
    reduced = min(r.error for r in trades["modal"].rows if r.error is not None)
    assert reduced < 0.1 * told.moved
    forces = [r.force for record in told.done.records.values() if record.value
              for r in record.value.strides if r.u is not None]  # fmt: skip
    assert all(force is not None and np.abs(force).max() > 0 for force in forces)
    require_judged(told.trial, "N")
