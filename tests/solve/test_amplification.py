"""Spectral radii: modes against steppers, the limits of explicit steps, the misprint."""

from dataclasses import replace

import numpy as np
import pytest
from amplification import amplification
from inertial_scenes import driven, small

from experiments.bending_rod.body import bending_rod
from experiments.needle_block.body import needle_block
from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.system import System, build
from validate.scene.material import Region
from validate.solve.dynamic.linear import Moving
from validate.solve.dynamic.newmark import Newmark
from validate.solve.dynamic.newmark_rule import Rule
from validate.solve.explicit.linear import ExplicitLinear
from validate.solve.study_entries import explicit_maps, spectral_radii
from validate.solve.types import Stepper

SCHEMES = [
    Newmark(0.004),
    Newmark(0.004, "backward_euler", mass="lumped"),
    Newmark(0.004, "generalised_alpha", rho_inf=0.5, damping_terms="mass"),
    Newmark(0.004, update="misprinted"),
    ExplicitLinear(0.002, "consistent", "full"),
    ExplicitLinear(0.002, "lumped", "mass"),
    ExplicitLinear(0.002, "lumped", "full", "lagged"),
    ExplicitLinear(0.02, "consistent", "mass", "lagged", beyond_limit="run"),
]


def step_matrix(stepper: Stepper, system: System) -> Floats:
    """The map (3 m, 3 m) of (u, v, a) of the free unknowns, by steps from unit states."""
    m, rest = len(system.free), stepper.rest()
    assert isinstance(rest.inner, Moving)
    still = np.zeros(len(system.scene.inputs))
    columns = np.empty((3 * m, 3 * m))
    for j in range(3 * m):
        x = np.zeros((3, m))
        x[j // m, j % m] = 1.0
        # A state that has been under way: the first step treats loads in its own way.
        one = replace(rest, k=1, inner=replace(rest.inner, u=x[0], v=x[1], a=x[2]))
        after: Moving = stepper.step(one, still).inner
        columns[:, j] = np.concatenate([after.u, after.v, after.a])
    return columns


@pytest.mark.parametrize("scheme", SCHEMES, ids=lambda s: f"{type(s).__name__}")
@pytest.mark.parametrize("system", [small(), driven()], ids=["loaded", "driven"])
def test_modes_have_the_radius_of_the_steppers_own_map(
    scheme: Newmark | ExplicitLinear, system: System
) -> None:
    whole = np.abs(np.linalg.eigvals(step_matrix(scheme.prepare(system), system))).max()
    assert amplification(system, scheme).radius == pytest.approx(whole, rel=1e-7)


@pytest.mark.parametrize("mass", ["consistent", "lumped"])
@pytest.mark.parametrize("terms", ["full", "mass"])
@pytest.mark.parametrize("update", ["printed", "lagged"])
@pytest.mark.parametrize("scene", [needle_block(8), bending_rod(2)], ids=["needle", "rod"])
def test_the_critical_step_parts_radii_below_one_from_those_above(
    mass: str, terms: str, update: str, scene: object
) -> None:
    system = build(scene)  # type: ignore[arg-type]
    scheme = ExplicitLinear(0.01, mass, terms, update)  # type: ignore[arg-type]
    limit = scheme.stable_step(system)
    below, above = (amplification(system, replace(scheme, dt=r * limit)) for r in (0.999, 1.001))
    assert below.radius < 1 < above.radius
    assert above.omega == pytest.approx(above.omegas[-1], rel=1e-3)


def test_heavy_damping_grows_slowly_beyond_its_limit() -> None:
    """MP1 as printed, 2 % above 2/w: a run would look stable for hundreds of steps."""
    system = build(needle_block(20))
    scheme = ExplicitLinear(0.01, "consistent", "full")
    grown = amplification(system, replace(scheme, dt=1.02 * scheme.stable_step(system)))
    assert 1.0001 < grown.radius < 1.05


@pytest.mark.parametrize(("xi", "limit"), [(0.0, 1.155), (0.1, 1.29), (0.3, 1.55)])
def test_the_misprinted_update_is_unstable_from(xi: float, limit: float) -> None:
    """w h of paper 002's u' = u + h v' + ...: 2/sqrt(3) undamped."""

    def radius(x: float) -> float:
        c, k = np.array([2 * xi * x]), np.array([x * x])
        return float(spectral_radii(Rule.of("average", 1.0).maps(c, k, misprinted=True))[0])

    assert radius(limit - 0.006) < 1 + 1e-9
    assert radius(limit + 0.006) > 1 + 1e-6
    assert xi > 0 or radius(2 / np.sqrt(3) + 1e-4) > 1 + 1e-6


def test_average_acceleration_neither_grows_nor_decays_undamped() -> None:
    x = np.array([0.01, 1.0, 100.0])
    radii = spectral_radii(Rule.of("average", 1.0).maps(np.zeros(3), x**2))
    assert radii == pytest.approx(np.ones(3), abs=1e-7)


def test_an_explicit_modes_radius_is_the_quadratics() -> None:
    """Undamped, w h = 2 cosh(s)... above 2: the roots of z^2 - (2 - x^2) z + 1."""
    x = np.array([0.5, 1.9, 2.1, 3.0])
    radii = spectral_radii(explicit_maps(1.0, np.zeros(4), x**2, "printed"))
    roots = [np.abs(np.roots([1.0, y * y - 2.0, 1.0])).max() for y in x]
    assert radii == pytest.approx(roots, abs=1e-7)


def test_what_it_cannot_do_is_refused() -> None:
    system = driven()
    cells = np.arange(len(system.scene.mesh.cells) // 2)
    other = replace(system.scene.material, stiffness_damping=0.1)
    mixed = build(replace(system.scene, regions=(Region("half", cells, other),)))
    with pytest.raises(SceneError, match="damping couples the modes; use Rayleigh"):
        amplification(mixed, Newmark())
    large = build(needle_block(34))
    with pytest.raises(SceneError, match="unknowns: all modes need at most 2000"):
        amplification(large, Newmark())
