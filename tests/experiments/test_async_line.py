"""Paper 004's bodies, oracle and tables: known numbers first, then its experiments."""

from dataclasses import replace

import numpy as np
import pytest
from beside import beside, experiment
from touched import AREA, LENGTH, bar, block, block_tree, pad_of

from experiments.async_block.methods import BLOCK
from experiments.async_line.probe import HapticProbe, HapticTest, chirp, growing, place
from experiments.async_line.runs import off, peak, pushed
from validate.errors import SceneError
from validate.fem.system import build
from validate.pipeline.experiment.tree import Built, Tree
from validate.solve.regions.scheme import AsyncRegions
from validate.twin.sensors import LoadCell

E, KS, H = 5e3, 1000.0, 1e-3
LINE, SIZES = beside("async_line", "twin"), beside("async_block", "sizes")
CONTINUOUS, TOUCHED_BLOCK = beside("async_line", "twin"), beside("async_block", "block")


def line_with(probe: HapticProbe, twin: LoadCell | None = None) -> Tree:
    tree: Tree = experiment("async_line").parameters
    return replace(tree, settings=HapticTest(probe, twin or LoadCell()))


WHOLE = AsyncRegions(H, (), (), pad=pad_of(10))


def test_the_bar_is_the_papers() -> None:
    system = build(bar(E, 40))
    assert len(system.free) == 2 * 40
    assert system.masses.sum() / 2 == pytest.approx(1000 * AREA * LENGTH)  # x and y


def test_impedance_by_hand_and_as_published() -> None:
    """At rest two springs in series; at 0.1, 0.5 and 1 Hz what a reconstruction published."""
    k = E * AREA / LENGTH
    assert CONTINUOUS.impedance(bar(E, 40), KS, np.array([0.0])) == pytest.approx(k * KS / (k + KS))
    assert pytest.approx(25.0) == 25e3 * AREA / LENGTH * KS / 2000 * 0.05
    exact = 0.01 * CONTINUOUS.impedance(bar(E, 40), KS, np.array([0.1, 0.5, 1.0]))
    assert exact == pytest.approx([1.66631, 1.65771, 1.63060], abs=5e-6)


def test_the_exact_force_settles_at_the_static_limit_and_swings_with_the_impedance() -> None:
    t = H * np.arange(8001)
    held = np.minimum(t / 2.0, 1.0) * 0.01
    body = bar(E, 40)
    assert CONTINUOUS.exact_force(body, KS, t, held)[5000] == pytest.approx(1.0 / 0.6, rel=1e-4)
    swing = CONTINUOUS.exact_force(body, KS, t, 0.01 * np.sin(2 * np.pi * t))
    assert swing[5000:].max() == pytest.approx(1.63060, rel=1e-4)


def test_signals_end_where_they_should() -> None:
    t = H * np.arange(40001)
    x = chirp(t, 0.01, 0.1, 1.0)
    assert x[[0, -1]] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert growing(t, 0.05, 0.25)[39000] == pytest.approx(-0.05 * 39 / 40)


def test_the_recording_is_not_the_models_own_and_drives_and_validates() -> None:
    p = line_with(HapticProbe(seconds=2.0), LoadCell(every=20))
    recording = LINE.record(p, lambda _: None)
    assert recording.metadata["provenance"]["same_model"] == "false"
    seen = place(recording, p, bar(E, 10))
    assert seen.inputs.shape == (2000, 2)
    assert seen.inputs[:, 0].min() == pytest.approx(-0.01, rel=0.01)
    assert [o.role for o in seen.compared] == ["validates"]
    again = LINE.record(p, lambda _: None).signal("force", "N").y
    assert np.array_equal(again, recording.signal("force", "N").y)


@pytest.mark.slow
def test_no_energy_is_made_by_borders_nor_by_their_moves() -> None:
    """No more than in the whole solve the spring, whose force is that of the tick's begin. Borders
    that were put back at a change made thousands of joules here."""
    t = H * np.arange(1, 1501)
    depth, scene = growing(t, 0.02, 2.0), bar(25e3, 10)
    whole = pushed(scene, WHOLE, depth, account=True)
    assert whole.made < 0.1 * whole.put
    fixed = replace(WHOLE, layers=(3,), rates=(50.0,))
    for settings in (
        fixed,
        replace(fixed, border="hold"),
        replace(fixed, layers=(1,), adapt="linear", most=8),
    ):
        found = pushed(scene, settings, depth, account=True)
        assert found.words == ()
        assert found.made <= whole.made
        assert found.put > 0.02


def test_a_failed_push_says_why() -> None:
    settings = replace(WHOLE, solvers=("explicit",), layers=(3,), rates=(100.0,))
    found = pushed(bar(E, 10), settings, np.zeros(3))
    assert len(found.force) == 0
    assert "its critical step of" in found.words[-1]


def test_peaks_and_differences_by_hand() -> None:
    t, y = np.arange(5.0), np.array([0.0, 3.0, 1.0, 9.0, 0.0])
    assert peak(y, t, 1.0, 1.0) == 3.0
    assert off(np.array([3.0, 4.0]), np.array([3.0, 3.0])) == pytest.approx(np.sqrt(0.5) / 3)


def grows(settings: AsyncRegions) -> float:
    return settings.prepare(build(bar(E, 10))).growth()


def test_growth_is_that_of_the_tick() -> None:
    """A period of one tick and one of ten decay alike where nothing depends on the far region."""
    one = grows(WHOLE)
    assert 0.9 < one < 1
    slow = replace(WHOLE, layers=(9,), rates=(100.0,))
    assert grows(slow) == pytest.approx(one, rel=2e-2)
    assert grows(replace(WHOLE, spring=200e3)) > 1.0


def test_a_spring_that_is_too_stiff_is_warned_of() -> None:
    """The limit of the paper's bar at 5 kPa is 26.8 kN/m (an independent reconstruction)."""
    for spring, warned in ((1e3, False), (26e3, False), (28e3, True)):
        words = beside("async_line", "exhibits").spring_words(line_with(HapticProbe(spring=spring)))
        assert bool(words) is warned
    assert "spring of 28000 N/m is too stiff for ticks of 0.001 s" in words[0]


def test_a_block_in_no_dimension_is_refused() -> None:
    with pytest.raises(SceneError, match="block of 6 cells in 6 dimensions"):
        block(E, 6, 6)


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_blocks_recording_is_its_whole_solve_and_says_so(dimension: int) -> None:
    tree = block_tree(E, 2, dimension)
    p = replace(tree, settings=HapticTest(HapticProbe(seconds=0.2), LoadCell()))
    recording = TOUCHED_BLOCK.record(p, lambda _: None)
    assert recording.metadata["provenance"]["same_model"] == "true"
    scene = Built()(recording, p)
    seen = place(recording, p, scene)
    assert seen.inputs.shape == (200, dimension)
    whole = pushed(scene, BLOCK["whole"].given(TOUCHED_BLOCK.sets(p, seen)), -seen.inputs[:, 0])
    measured = recording.signal("force", "N").y[1:, 0]
    assert measured == pytest.approx(whole.force[9::10], abs=5 * p.settings.twin.noise)
    assert np.abs(whole.force).max() > 5 * p.settings.twin.noise


def test_sizes_stand_in_one_table() -> None:
    near = AsyncRegions(H, (1,), (100.0,))
    rows = SIZES.size_rows(
        block_tree(E, 6, 3), ((2, 2), (3, 2)), near, np.full(40, 1e-3), 2, lambda _: None
    )
    assert [row[:3] for row in rows[:3]] == [
        (2, 9, "whole, prefactored"), (2, 9, "regions"), (2, 9, "4 Krylov vectors"),
    ]  # fmt: skip
    assert [row[1] for row in rows[3:]] == [27] * 3
    assert rows[0][6:] == (0.0, 0.0)
    assert SIZES.size_table(rows).headings == SIZES.HEADS


@pytest.mark.slow
def test_the_rows_of_table_1_that_are_printed() -> None:
    """1.65, 1.66, 1.76 and 1.70 N near 20 s; 2.86 N is not what the algorithm gives."""
    t = H * np.arange(1, 21001)
    depth = 0.01 * np.sin(2 * np.pi * (0.1 * t + 0.9 / 80 * t**2))
    base = replace(WHOLE, pad=pad_of(40))
    rows = (((), (), 1.65), ((30,), (500.0,), 1.66), ((30,), (50.0,), 1.76), ((5,), (500.0,), 1.70))
    for layers, rates, theirs in rows:
        found = pushed(bar(E, 40), replace(base, layers=layers, rates=rates), depth)
        assert peak(found.force, t, 20.0, 1.0) == pytest.approx(theirs, abs=0.02)


@pytest.mark.slow
def test_sentences_of_the_paper_as_numbers() -> None:
    """A linear model's relative error knows no size; eq 4 is 2/w_max of the bar, nearly."""
    p = line_with(HapticProbe(seconds=3.0))
    errors = {"error.n5_f5": 100.0, "error.n5_f500": 2.0, "error.n30_f50": 5.0}
    found = beside("async_line", "exhibits").claims(p, errors)
    assert found["error.by.size"] == pytest.approx(1, abs=1e-9)
    assert found["eq4"] == pytest.approx(1, abs=1e-3)
    assert found["size.over.rate"] == 0.4
    assert found["stiff.over.soft"] == found["stiff.error"] / 100
    assert 4.5 < found["stiff.whole"] < 5.5  # static: 5 N
