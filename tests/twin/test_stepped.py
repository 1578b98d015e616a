"""A twin that steps finer than the models: it ends each of their steps with them."""

from collections.abc import Callable

import numpy as np
import pytest

from validate.arrays import Floats
from validate.scene.geometries.box import box
from validate.scene.material import Material
from validate.scene.scene import Drive, Probe, Scene, Support
from validate.solve.fluid.cavities import NoFluid
from validate.solve.types import Scheme
from validate.twin.tracker import Camera, Origin, SteppedTwin

SCENE = Scene(
    box((0.1, 0.1, 0.1), (1, 1, 1)),
    Material(3e4, 0.3),
    (Support("z0", (0, 1, 2)),),
    drives=(Drive("press", "z1", (0.0, 0.0, -1.0)),),
    probes=(Probe("top", (0.05, 0.05, 0.1)),),
)
DT, STEPS = 0.2, 5


def pressed(t: Floats) -> Floats:
    return 1e-3 * t**2


def twin(finer: int, scheme: Callable[[float], Scheme] = lambda dt: NoFluid()) -> SteppedTwin:
    return SteppedTwin(SCENE, scheme, pressed, DT, STEPS, finer)


@pytest.mark.parametrize("finer", [1, 3])
def test_it_ends_every_step_of_the_models_with_them(finer: int) -> None:
    steps: list[float] = []

    def scheme(dt: float) -> Scheme:
        steps.append(dt)
        return NoFluid()

    at, t = np.array([0, 3]), DT * np.arange(1, STEPS + 1)
    run = twin(finer, scheme).run(at)
    assert steps == [pytest.approx(DT / finer)]
    assert run.t == pytest.approx(t)
    assert run.at.tolist() == at.tolist()
    assert run.traces["top.z"].y == pytest.approx(-pressed(t))
    top = SCENE.mesh.facet_nodes("z1")
    assert run.u[:, top, 2] == pytest.approx(-np.outer(pressed(t[at]), np.ones(len(top))))


def test_its_recording_declares_the_material_and_keeps_the_time() -> None:
    corners = {f"base{i}": (x, y, 0.0) for i, (x, y) in enumerate(((0, 0), (0.1, 0), (0.1, 0.1)))}
    told = twin(3).record(
        Origin("cube", 1, False, {"element": "P1"}), corners, Camera(0.0), lambda run: {}, print
    )
    provenance, seen = told.record("provenance"), told.markers["markers"]
    assert (provenance["E_Pa"], provenance["nu"]) == (repr(3e4), repr(0.3))
    assert provenance["element"] == "P1"
    assert seen.t == pytest.approx(DT * np.arange(STEPS + 1))
    up = np.array([float(v) for v in told.record("camera")["up"].split()])
    assert (seen.x[:, 0] - seen.x[0, 0]) @ up == pytest.approx(-pressed(seen.t), abs=1e-15)
