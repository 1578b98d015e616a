"""Only what a scene requires is made: calls of the parts that cost are counted."""

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from phantoms import COARSE_GRID, phantom_mesh, phantom_scene

import validate.fem.system as matrices_module
import validate.fem.system as system_module
import validate.solve.explicit.central as central_module
from validate.fem.cavity import CavitySurface
from validate.fem.large_strain.hyperelastic import Body
from validate.fem.system import build
from validate.scene.geometries.box import box
from validate.scene.material import Material
from validate.scene.scene import Load, Scene, Support
from validate.solve.dynamic.implicit import NewtonDynamics
from validate.solve.dynamic.modal import Modal
from validate.solve.dynamic.newmark import Newmark
from validate.solve.explicit.central import CentralDifference
from validate.solve.explicit.linear import ExplicitLinear
from validate.solve.fluid.cavities import ExactPressure, NoFluid
from validate.solve.static.newton import StaticNewton
from validate.solve.static.quasi_static import QuasiStatic
from validate.solve.types import Scheme

PARTS = {
    "stiffness": (system_module, "stiffness"),
    "mass": (system_module, "mass"),
    "damping": (system_module, "stiffness_damping"),
    "mass of damping": (matrices_module, "mass_matrix"),
    "cavity": (system_module, "cavity_surface"),
    "pressure load": (CavitySurface, "pressure_load"),
    "volume": (system_module, "volume_form"),
    "large volume": (CavitySurface, "volume"),
    "mass at large strain": (central_module, "mass"),
    "tangent": (Body, "tangent"),
}
INERTIA = {"mass", "damping", "mass of damping", "mass at large strain"}
PRESSURE = {"cavity", "pressure load", "volume", "large volume"}


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """How often each part was called."""
    counter: Counter[str] = Counter()

    def counted(name: str, call: Callable[..., Any]) -> Callable[..., Any]:
        def counting(*args: Any, **named: Any) -> Any:
            counter[name] += 1
            return call(*args, **named)

        return counting

    for name, (owner, attribute) in PARTS.items():
        monkeypatch.setattr(owner, attribute, counted(name, getattr(owner, attribute)))
    return counter


def block(material: Material) -> Scene:
    """A block that is pulled upward; no cavity."""
    return Scene(
        box((0.02, 0.02, 0.02), (2, 2, 2)),
        material,
        (Support("z0", (0, 1, 2)),),
        loads=(Load("pull", "z1", (0.0, 0.0, 1.0)),),
    )


WITHOUT_DENSITY = Material(1e4, 0.3)
DENSE = Material(1e4, 0.3, rho=1000.0, stiffness_damping=1e-3)
LARGE = Material(1e4, 0.3, "neo_hooke", rho=1000.0)


def stepped(scheme: Scheme, scene: Scene, value: float) -> None:
    stepper = scheme.prepare(build(scene))
    state = stepper.rest()
    for _ in range(3):
        state = stepper.step(state, np.array([value]))
    assert state.failure is None
    assert np.abs(stepper.field(state)).max() > 0


LINEAR_DYNAMICS = (
    Newmark(1e-3),
    Modal(1e-3),
    ExplicitLinear(1e-4, damping_terms="mass"),
    ExplicitLinear(1e-4, mass="consistent"),
)


def test_statics_need_no_density_and_make_no_mass(calls: Counter[str]) -> None:
    stepped(QuasiStatic(), block(WITHOUT_DENSITY), 0.1)
    assert calls == {"stiffness": 1}


def test_statics_of_a_body_with_density_make_no_mass_either(calls: Counter[str]) -> None:
    stepped(QuasiStatic(), block(DENSE), 0.1)
    assert calls == {"stiffness": 1}


@pytest.mark.parametrize("scheme", LINEAR_DYNAMICS, ids=lambda s: f"{type(s).__name__}-{s.dt}")
def test_linear_dynamics_build_no_tangent_and_run_no_pressure_code(
    scheme: Scheme, calls: Counter[str]
) -> None:
    stepped(scheme, block(DENSE), 0.01)
    assert calls["tangent"] == 0
    assert not PRESSURE & set(calls)
    assert calls["stiffness"] == 1
    assert calls["mass"] <= 2  # M, and alpha M of C


def test_a_quadratic_body_without_mass_damping_is_lumped_without_a_warning() -> None:
    scene = block(replace(DENSE, stiffness_damping=0.0))
    stepped(ExplicitLinear(1e-4), replace(scene, body=scene.mesh.quadratic()), 0.01)


def test_an_explicit_step_at_large_strain_makes_neither_stiffness_nor_tangent(
    calls: Counter[str],
) -> None:
    stepped(CentralDifference(1e-4), block(LARGE), 0.01)
    assert calls["stiffness"] == calls["tangent"] == calls["damping"] == 0
    assert not PRESSURE & set(calls)


def test_large_strain_makes_tangents_where_it_must(calls: Counter[str]) -> None:
    stepped(NewtonDynamics(1e-3), block(LARGE), 0.01)
    assert calls["tangent"] > 0
    assert calls["stiffness"] == 0
    calls.clear()
    stepped(StaticNewton(), block(replace(LARGE, rho=None)), 0.01)
    assert not INERTIA & set(calls)


def test_a_phantom_without_cavity_runs_no_pressure_code(calls: Counter[str]) -> None:
    full = phantom_scene(phantom_mesh(COARSE_GRID))
    stepped(NoFluid(), replace(full, cavities=()), 0.001)
    assert calls == {"stiffness": 1}
    calls.clear()
    stepped(ExactPressure(), full, 0.001)
    assert calls["stiffness"] == calls["cavity"] == calls["pressure load"] == calls["volume"] == 1
    assert not INERTIA & set(calls)
    assert calls["tangent"] == 0


def test_large_strain_without_cavity_runs_no_pressure_code(calls: Counter[str]) -> None:
    full = phantom_scene(phantom_mesh(COARSE_GRID))
    large = replace(full, material=replace(full.material, law="neo_hooke"))
    stepped(StaticNewton(), replace(large, cavities=()), 0.001)
    assert not (PRESSURE | INERTIA) & set(calls)
    calls.clear()
    stepped(StaticNewton(), large, 0.001)
    assert calls["large volume"] > 0
