"""Explicit linear steps: exact motions, the critical step, switches, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest
from inertial_scenes import driven, orders, small

from experiments.needle_block.body import MP2, needle_block
from validate.errors import SceneError
from validate.fem.critical import CriticalStep
from validate.fem.system import DampingTerms, MassName, System, build, damping_of, mass_of
from validate.solve.dynamic.newmark import Newmark
from validate.solve.explicit.linear import ExplicitLinear, highest_frequency
from validate.solve.march import march
from validate.solve.types import Run, Scheme

END = 0.05  # s
EVERYTHING = [
    (mass, terms, update)
    for mass in ("consistent", "lumped")
    for terms in ("full", "mass")
    for update in ("printed", "lagged")
]


def run(scheme: Scheme, system: System, inputs: np.ndarray, dt: float) -> Run:
    steps = len(inputs)
    t = dt * np.arange(1, steps + 1)
    return march("explicit", scheme.prepare(system), t, inputs, np.array([steps - 1]), 0.0)


def end(scheme: Scheme, system: System, inputs: np.ndarray, dt: float) -> np.ndarray:
    got = run(scheme, system, inputs, dt)
    assert got.finished, got.outcome
    return got.u[-1]


@pytest.mark.slow
@pytest.mark.parametrize(("mass", "terms", "update"), EVERYTHING)
def test_every_variant_converges_to_the_implicit_motion_of_its_matrices(
    mass: MassName, terms: DampingTerms, update: str
) -> None:
    """C in the matrix: second order; lagged C: the half step's velocity makes it first order."""
    system = small()
    fine = 3200
    newmark = Newmark(END / fine, mass=mass, damping_terms=terms)
    truth = end(newmark, system, np.ones((fine, 1)), END / fine)

    def off(n: int) -> float:
        scheme = ExplicitLinear(END / n, mass, terms, update)  # type: ignore[arg-type]
        u = end(scheme, system, np.ones((n, 1)), END / n)
        return float(np.linalg.norm(u - truth) / np.linalg.norm(truth))

    expected = 1.0 if update == "lagged" else 2.0
    assert orders(off, (100, 200, 400)) == pytest.approx([expected] * 2, abs=0.15)


def test_one_step_is_the_papers_formula() -> None:
    """u' = u + h v + h^2/2 a, (M + h C/2) a' = f' - K u' - C (v + h a/2), the mean for v'."""
    system, h = small(), 0.001
    free = system.free
    u, v, a = np.random.default_rng(4).standard_normal((3, len(free)))
    M, C, K = (X[free][:, free].toarray() for X in (system.M, system.C, system.K))
    scheme = ExplicitLinear(h, "consistent", "full", beyond_limit="run")
    stepper = scheme.prepare(system)
    rest = stepper.rest()
    begun = replace(rest, k=1, inner=replace(rest.inner, u=u, v=v, a=a))
    got = stepper.step(begun, np.array([2.0])).inner
    u_new = u + h * v + h**2 / 2 * a
    f = 2.0 * system.loads[free, 0]
    a_new = np.linalg.solve(M + h / 2 * C, f - K @ u_new - C @ (v + h / 2 * a))
    for found, expected in ((got.u, u_new), (got.a, a_new), (got.v, v + h / 2 * (a + a_new))):
        assert found == pytest.approx(expected, rel=1e-11)


def test_drives_couple_through_all_matrices() -> None:
    """A slow ramp, all terms kept: implicit and explicit agree, the plate's force included."""
    system = build(replace(driven().scene, loads=()))
    n = 800
    ramp = 0.01 * np.linspace(1 / n, 1, n)[:, None] ** 3
    schemes = (Newmark(0.2 / n, a0="zero"), ExplicitLinear(0.2 / n, "consistent", "full"))
    implicit, explicit = (run(s, system, ramp, 0.2 / n) for s in schemes)
    assert explicit.u[-1] == pytest.approx(implicit.u[-1], abs=2e-5 * 0.01)
    forces = [r.traces["press.force"].y[-1] for r in (implicit, explicit)]
    assert forces[1] == pytest.approx(forces[0], rel=1e-3)


def test_given_rates_need_speeds_and_read_them_behind_their_jump() -> None:
    h, block = 1 / 30, build(needle_block(4))
    stepper = ExplicitLinear(h, "consistent", "full", drive_rates="given").prepare(block)
    state, rates = stepper.rest(), []
    for k in range(1, 63):
        state = stepper.step(state, np.array([0.08 * min(k * h, 2.0)]))
        rates.append(float(state.inner.inputs.rate[0]))
        assert state.inner.inputs.acceleration[0] == 0.0
    assert rates[0] == rates[58] == 0.08
    assert rates[59] == rates[61] == 0.0
    with pytest.raises(SceneError, match="drive 'press' has no speeds"):
        ExplicitLinear(drive_rates="given").prepare(driven())
    with pytest.raises(SceneError, match="an explicit step does not support"):
        ExplicitLinear(drive_rates="rule")


@pytest.mark.parametrize(
    ("mass", "update", "expected"),
    [
        ("consistent", "printed", 3.503975e-2),
        ("lumped", "printed", 6.471836e-2),
        ("consistent", "lagged", 5.9440e-3),
        ("lumped", "lagged", 1.8949e-2),
    ],
)
def test_critical_steps_of_the_needles_block(mass: MassName, update: str, expected: float) -> None:
    """MP1, n = 20, plane strain, C = alpha M + beta K: an independent reconstruction's digits."""
    settings = ExplicitLinear(0.01, mass, "full", update)  # type: ignore[arg-type]
    digits = 7 if update == "printed" else 5
    found = settings.stable_step(build(needle_block(20)))
    assert found == pytest.approx(expected, rel=0.6 * 10 ** (1 - digits))


def test_the_papers_microsecond_is_that_of_lagged_damping() -> None:
    """MP2, n = 30: below 1e-6 s lagged; with C in the matrix damping costs nothing."""
    system = build(needle_block(30, MP2))
    lagged = ExplicitLinear(mass="consistent", damping_terms="full", update="lagged")
    assert lagged.stable_step(system) == pytest.approx(9.27e-7, rel=1e-3)
    printed = replace(lagged, update="printed")
    assert printed.stable_step(system) == pytest.approx(4.3e-4, rel=5e-3)


def test_the_highest_frequency_is_that_of_all_modes() -> None:
    system = driven()
    K, M = (X[system.free][:, system.free].toarray() for X in (system.K, system.M))
    dense = np.sqrt(np.linalg.eigvals(np.linalg.solve(M, K)).real.max())
    assert highest_frequency(system, "consistent") == pytest.approx(dense, rel=1e-9)
    lanczos = CriticalStep.of(system, products=60).lanczos
    assert 2 / highest_frequency(system, "lumped") == pytest.approx(lanczos, rel=1e-6)


def test_a_step_above_the_limit_is_refused_and_says_under_which_damping() -> None:
    block = build(needle_block(4))
    lagged = ExplicitLinear(1 / 30, "consistent", "full", "lagged")
    limit = lagged.stable_step(block)
    ending = run(replace(lagged, dt=1.5 * limit), block, np.full((3, 1), 0.01), 1.5 * limit).outcome
    assert (ending.state, ending.step) == ("refused", 0)
    assert "is 1.5 times the critical step" in ending.why
    assert "consistent mass, lagged C = alpha M + beta K" in ending.why
    just_below = replace(lagged, dt=limit * (1 - 1e-9))
    assert run(just_below, block, np.full((3, 1), 0.01), just_below.dt).finished


def test_beyond_the_limit_a_run_goes_on_until_it_has_left_all_bounds() -> None:
    block = build(needle_block(4))
    settings = ExplicitLinear(1.0, beyond_limit="run")
    dt = 1.5 * settings.stable_step(block)
    got = run(replace(settings, dt=dt), block, np.full((400, 1), 0.01), dt)
    assert got.outcome.state == "diverged"
    assert 3 < got.outcome.step < 399
    assert "displacements over 100 body sizes; dt" in got.outcome.why
    assert len(got.t) == got.outcome.step


def test_lumped_damping_is_alpha_times_the_mass_in_use() -> None:
    system = small(mass_damping=3.0, stiffness_damping=0.01)
    for mass in ("consistent", "lumped"):
        M = mass_of(system, mass).toarray()  # type: ignore[arg-type]
        C = damping_of(system, mass, "mass").toarray()  # type: ignore[arg-type]
        assert pytest.approx(3.0 * M, abs=1e-15) == C
        full = damping_of(system, mass, "full").toarray()  # type: ignore[arg-type]
        assert full - C == pytest.approx(0.01 * system.K.toarray(), abs=1e-12)
