"""What `async_block` shows beside its checks: energies, a contact that slides, Fig. 2."""

from dataclasses import replace

import numpy as np
import pytest
from beside import beside
from touched import bar, block, pad_of

from experiments.async_line.runs import pushed
from experiments.async_line.tables import energy_table
from validate.solve.regions.krylov import TouchedKrylov
from validate.solve.regions.scheme import AsyncRegions

ring_nodes = beside("async_block", "published").ring_nodes
sliding = beside("async_block", "sliding")
drawn, sliding_exhibit = sliding.drawn, sliding.sliding_exhibit

H = 1e-3
WHOLE = AsyncRegions(H, (), ())
NEAR = AsyncRegions(H, (2,), (50.0,))


def test_a_layer_around_three_by_three_nodes_has_sixteen() -> None:
    assert ring_nodes() == {"ring.nodes": 16.0}


def test_the_path_goes_in_and_then_along() -> None:
    path = drawn(H, 3)
    assert path[199] == pytest.approx([-5e-3, 0.0, 0.0])
    assert path[-1] == pytest.approx([-5e-3, 0.03, 0.0])


def test_a_path_across_is_walked_and_one_along_x_is_a_depth() -> None:
    scene, depth = block(5e3, 2, 2), np.linspace(0.0, 5e-3, 40)
    path = np.stack([-depth, np.zeros(40)], axis=1)
    assert np.array_equal(pushed(scene, NEAR, path).force, pushed(scene, NEAR, depth).force)


@pytest.mark.slow
def test_a_contact_that_slides_changes_without_a_jump_of_the_force() -> None:
    shown = sliding_exhibit(
        block(5e3, 6, 2), {"whole": WHOLE, "near": NEAR, "few": TouchedKrylov()}, "whole"
    )
    slide, energy = shown.tables
    assert [row[0] for row in slide.rows] == ["whole", "near"]  # a reduced model keeps its contact
    for _, changes, at_one, elsewhere, _ in slide.rows:
        assert isinstance(changes, int)
        assert changes >= 1
        assert isinstance(at_one, float)
        assert isinstance(elsewhere, float)
        assert 0 < at_one < elsewhere
    assert slide.rows[0][4] == 0.0
    assert energy.name == "sliding_energy"


def test_energy_is_counted_by_hand() -> None:
    """A spring that pushes a still body: at the end all that the hand put in is in both springs."""
    ramp = 0.01 * np.minimum(np.arange(1, 1001) / 800, 1.0)
    scene = bar(5e3, 4)
    settings = replace(WHOLE, pad=pad_of(4))
    found = pushed(scene, settings, ramp, account=True)
    series = 200 * 1000 / 1200  # N/m
    assert found.put == pytest.approx(series * 0.01**2 / 2, rel=5e-2)
    assert found.made < 0.05 * found.put
    table = energy_table("Energy", scene, {"whole": settings}, ramp)
    assert table.rows[0][1:4] == pytest.approx(
        [1e3 * found.made, 1e3 * found.lost, 1e3 * found.put]
    )


def test_borders_that_lose_energy_say_so() -> None:
    swing = 5e-3 * np.sin(2 * np.pi * 1.5 * H * np.arange(1, 401))
    scene = block(5e3, 4, 2)
    whole, near = (pushed(scene, s, swing, account=True) for s in (WHOLE, NEAR))
    assert near.lost > 10 * whole.lost
    assert near.put > whole.put
