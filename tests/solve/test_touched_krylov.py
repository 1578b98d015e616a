"""The reduced model of a touched body: exact statics, and the whole one at full rank."""

from dataclasses import replace

import numpy as np
import pytest
from touched import AREA, LENGTH, bar, block, pad_of

from experiments.async_line.runs import off, pushed
from validate.errors import SceneError
from validate.fem.system import build
from validate.solve.regions.krylov import KrylovStepper, TouchedKrylov
from validate.solve.regions.scheme import AsyncRegions

E, H, KS = 5e3, 1e-3, 1000.0
WHOLE = AsyncRegions(H, (), ())
SWING = 5e-3 * np.sin(2 * np.pi * 2.5 * H * np.arange(1, 301))


def test_one_vector_has_the_static_force_of_the_bar() -> None:
    """Two springs in series, EA/L behind the probe's."""
    k = E * AREA / LENGTH
    held = np.minimum(np.arange(1, 4001) / 500, 1.0) * 0.01
    settings = TouchedKrylov(H, vectors=1, pad=pad_of(12))
    assert pushed(bar(E, 12), settings, held).force[-1] == pytest.approx(
        0.01 * k * KS / (k + KS), rel=1e-6
    )


@pytest.mark.parametrize("dimension", [2, 3])
def test_as_many_vectors_as_unknowns_are_the_whole_solve(dimension: int) -> None:
    scene = block(E, 2, dimension)
    whole = pushed(scene, WHOLE, SWING).force
    assert pushed(scene, TouchedKrylov(H, 30), SWING).force == pytest.approx(whole, abs=1e-7)
    few = [off(pushed(scene, TouchedKrylov(H, r), SWING).force, whole) for r in (1, 2, 4)]
    assert few[0] > few[1] > few[2] > 1e-6


def test_fields_and_traces_are_those_of_the_touched_body() -> None:
    scene = block(E, 2, 2)
    stepper = TouchedKrylov(H, 30).prepare(build(scene))
    whole = WHOLE.prepare(build(scene))
    a, b = stepper.rest(), whole.rest()
    assert set(a.numbers) == set(stepper.units)
    for x in SWING[:50]:
        a, b = (s.step(state, np.array([-x, x / 2])) for s, state in ((stepper, a), (whole, b)))
    assert stepper.field(a) == pytest.approx(whole.field(b), abs=1e-9)
    assert a.numbers["probe.force.y"] == pytest.approx(b.numbers["probe.force.y"], abs=1e-7)
    assert a.numbers["probe.contact"] == 1.0


def test_a_probe_takes_hold_within_its_reach_and_the_force_begins_at_zero() -> None:
    scene = bar(E, 12)
    away = replace(scene.tools[0], tip=(LENGTH + 0.02, LENGTH / 24))
    states = []
    stepper = TouchedKrylov(H, pad=pad_of(12), reach=5e-3).prepare(
        build(replace(scene, tools=(away,)))
    )
    assert isinstance(stepper, KrylovStepper)
    assert not stepper.kept
    state = stepper.rest()
    for x in np.linspace(0.0, 0.025, 101):
        state = stepper.step(state, np.array([-x, 0.0]))
        states.append((state.numbers["probe.contact"], state.numbers["probe.force.x"]))
    touched = [i for i, (contact, _) in enumerate(states) if contact]
    assert touched[0] > 10
    assert all(force == 0 for _, force in states[: touched[0] + 1])
    assert states[-1][1] > 0


@pytest.mark.parametrize(
    ("changes", "words"),
    [({"dt": 0.0}, "tick of 0 s"), ({"vectors": 0}, "0 vectors"), ({"spring": -1.0}, "spring -1")],
)
def test_settings_that_make_no_model_are_refused(changes: dict[str, float], words: str) -> None:
    with pytest.raises(SceneError, match=words):
        replace(TouchedKrylov(), **changes)  # type: ignore[arg-type]


def test_a_scene_without_a_probe_is_refused() -> None:
    with pytest.raises(SceneError, match="0 probes and 0 drives"):
        TouchedKrylov().prepare(build(replace(block(E, 2, 2), tools=())))
