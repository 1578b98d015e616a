"""Contract of a scheme that steps, on a block with the drives, loads or needle that it handles."""

from collections.abc import Callable
from dataclasses import FrozenInstanceError, replace
from functools import partial
from typing import cast

import numpy as np

from validate.arrays import Floats
from validate.fem.system import System, build
from validate.scene.contact import Needle
from validate.scene.geometries.box import box
from validate.scene.laws import LAWS
from validate.scene.material import LawName, Material
from validate.scene.scene import Drive, Load, Scene, Support
from validate.solve.types import Scheme
from validate.testing.pulled_cube import refusal, require, require_documented_settings

_DEPTH, _FORCE = 1e-5, 0.001  # m, N of a step
_INWARD = (-1.0, 0.0, 0.0)


def block(scheme: Scheme) -> System:
    """A block of 20 mm, of the last law that the scheme solves: pressed (m) where it takes drives,
    then pulled (N) where it takes loads; only touched by a needle where it takes one."""
    handles = scheme.handles
    damped = handles.law[-1] == "linear" and handles.inertia
    scene = Scene(
        box((0.02, 0.02, 0.02), (2, 2, 2)),
        Material(1e5, 0.45, handles.law[-1], rho=1000.0, mass_damping=5.0 if damped else 0.0),
        (Support("z0", (0, 1, 2)),),
    )
    if "needle" in handles.contact:
        return build(replace(scene, tools=(Needle("tip", "x1", (0.02, 0.01, 0.01), _INWARD),)))
    drives = (Drive("press", "z1", (0.0, 0.0, -1.0)),) if handles.drives else ()
    loads = (Load("pull", "x1", (1.0, 0.0, 0.0)),) if handles.loads else ()
    return build(replace(scene, drives=drives, loads=loads))


def _inputs(system: System) -> Floats:
    scene = system.scene
    if scene.tools:
        return _DEPTH * np.array(_INWARD)
    return np.array([_DEPTH] * len(scene.drives) + [_FORCE] * len(scene.loads))


def steps_from_rest(scheme: Scheme) -> None:
    """Rest is zero; a step counts, moves the body and has the numbers that `units` lists."""
    system = block(scheme)
    stepper, nodes = scheme.prepare(system), system.scene.mesh.nodes
    rest = stepper.rest()
    require(rest.k == 0, f"rest has k = {rest.k}")
    require(not stepper.field(rest).any(), "the body is displaced at rest")
    state = stepper.step(rest, _inputs(system))
    require(state.failure is None, f"the first step failed: {state.failure}")
    require(state.k == 1, f"after a step k = {state.k}")
    odd = set(state.numbers) ^ set(stepper.units)
    require(not odd, f"numbers without a unit, or units without a number: {sorted(odd)}")
    u = stepper.field(state)
    require(u.shape == nodes.shape, f"a field {u.shape}: expected {nodes.shape}")
    require(np.isfinite(u).all() and u.any(), "a step of 10 um or 1 mN moves nothing")
    held = u[system.scene.mesh.facet_nodes("z0")]
    require(not held.any(), "nodes that are held move")
    if system.scene.drives:
        off = np.abs(u[system.scene.mesh.facet_nodes("z1"), 2] + _DEPTH).max()
        require(off < 1e-12, f"the driven face is {off:.3g} m from where it is driven to")


def a_step_is_a_function_of_its_state(scheme: Scheme) -> None:
    """The same state and inputs give the same step, and leave the state as it was."""
    system = block(scheme)
    stepper = scheme.prepare(system)
    first = stepper.step(stepper.rest(), _inputs(system))
    before = stepper.field(first).copy()
    one, other = (stepper.step(first, 2 * _inputs(system)) for _ in range(2))
    same = np.array_equal(stepper.field(one), stepper.field(other))
    require(same, "two steps from one state differ")
    require(np.array_equal(stepper.field(first), before), "a step changes the state before it")
    try:
        one.updates = 7  # type: ignore[misc]
    except FrozenInstanceError:
        return
    raise AssertionError("a state can be changed: return a State, or another frozen dataclass")


def without_inputs_it_stays_at_rest(scheme: Scheme) -> None:
    """Zero drives and loads move nothing."""
    system = block(scheme)
    stepper = scheme.prepare(system)
    u = stepper.field(stepper.step(stepper.rest(), 0 * _inputs(system)))
    moved = float(np.abs(u).max())
    require(moved < 1e-15, f"without inputs a node moves by {moved:.3g} m")


def refuses_what_it_does_not_handle(scheme: Scheme) -> None:
    """A law outside of `handles` is one line that names what solves it."""
    scene = block(scheme).scene
    for law in ("linear", *(kind.name for kind in LAWS.own)):
        if scheme.handles.solves(law):
            continue
        other = build(replace(scene, material=scene.material.of_law(cast(LawName, law))))
        line = refusal(partial(scheme.prepare, other))
        require("; use " in line, f"the refusal names no scheme instead: {line}")


def every_setting_is_documented(scheme: Scheme) -> None:
    """Each field has a sentence and a unit."""
    require_documented_settings(type(scheme))


#: Checks of a scheme's settings.
scheme_contract: tuple[Callable[[Scheme], None], ...] = (
    steps_from_rest,
    a_step_is_a_function_of_its_state,
    without_inputs_it_stays_at_rest,
    refuses_what_it_does_not_handle,
    every_setting_is_documented,
)
