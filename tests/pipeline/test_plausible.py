"""Doubts of sizes, strain, stress and modulus, each with its factor."""

from dataclasses import replace

import numpy as np
import pytest

from validate.parameters import Parameter
from validate.pipeline.checks.plausibility import doubts
from validate.pipeline.run.method_run import MethodRun
from validate.recording.types import Frames, Recording, Signal, Source
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.scene.geometries.box import box
from validate.scene.material import Material
from validate.scene.scene import Drive, Scene

SIDE, T = 0.1, np.arange(5.0)  # m: a cube's
SCENE = Scene(
    box((SIDE, SIDE, SIDE), (1, 1, 1)), Material(10e3, 0.4), (),
    drives=(Drive("stage", "z1", (0.0, 0.0, -1.0)),),
)  # fmt: skip


def said(
    *parameters: Parameter,
    recorded: float = 0.01,
    compared: float = 0.01,
    force: float = 1.0,
    scene: Scene = SCENE,
    **stated: float,
) -> tuple[str, ...]:
    """Of a cube pressed to `recorded` m, of which `compared` m are used, with `force` N."""
    ramp = T[:, None] / T[-1]
    recording = Recording("r", Source("x", "", 0, "x"), 0,
                          signals={"stage": Signal(T, recorded * ramp, "m", 0.0, "f")})  # fmt: skip
    stage = SignalObservation("stage", "drives", T, compared * ramp, "m", 0.0)
    cell = SignalObservation("cell", "validates", T, force * ramp, "N", 0.0, "force", "stage.force")
    seen = Registered((stage, cell))
    first = MethodRun("m", "m", "", scene, (seen,), (), {})
    return doubts(parameters, stated, (recording,), first)


def sized(value: float | None, unit: str = "m", path: str = "block") -> Parameter:
    return Parameter(path, "float", unit, value, "", "entered")


def test_what_is_plausible_is_not_doubted() -> None:
    assert said(sized(0.05), sized(None), sized(15e3, "Pa", "material.E"), block=0.05) == ()
    assert said(sized(0.0502), block=0.05) == ()


@pytest.mark.parametrize(
    ("value", "unit", "path", "factor"),
    [
        (50.0, "m", "block", "50 m is 1000 times 50 mm: check its unit"),
        (10.0, "Pa", "material.E", "modulus of 10 Pa, 1/10 of 100 Pa, the least"),
        (2e8, "Pa", "material.E_slip", "modulus of 2e+08 Pa, 20 times 1e+07 Pa, the largest"),
        (-5.0, "Pa", "material.E", "modulus of -5 Pa"),
    ],
)
def test_a_value_beyond_soft_tissue(value: float, unit: str, path: str, factor: str) -> None:
    (found,) = said(sized(value, unit, path))
    assert factor in found


def test_what_the_recording_says_otherwise() -> None:
    (found,) = said(sized(0.06), block=0.05)
    assert found == "block = 0.06 m was entered; the recording has 0.05 m, 1.2 times"


def test_strain_and_stress_of_the_whole_recording() -> None:
    (high,) = said(recorded=0.3)
    assert "moves by 300 mm, 3 times the body's 100 mm" in high
    (strained,) = said(recorded=0.04, compared=0.04)
    assert "strain of 0.4 by a linear law" in strained
    neo = replace(SCENE, material=replace(SCENE.material, law="neo_hooke"))
    assert said(recorded=0.04, compared=0.04, scene=neo) == ()
    (soft,) = said(force=1e-3)
    assert "1e+04 mm2 is a stress of 0.1 Pa, 1/10 of 1 Pa" in soft
    (hard,) = said(force=1e6)
    assert "stress of 1e+08 Pa, 10 times" in hard


def test_a_run_doubts_images_beyond_reason() -> None:
    image = np.zeros((300, 400), np.uint8)
    frames = Frames(np.array([0.0]), (image,), (8.0, 8.0), np.eye(4), "probe")
    recording = Recording("r", Source("x", "", 0, "x"), 0, frames={"us": frames})
    stage = SignalObservation("stage", "drives", T, 0 * T[:, None], "m", 0.0)
    point = MethodRun(
        "m", "m", "", replace(SCENE, drives=()), (Registered((stage,)),), (), {}
    )  # fmt: skip
    (found,) = doubts((), {}, (recording,), point)
    assert found.startswith(
        "r: 'us': 8 m per pixel is outside 1e-06 to 0.01 m: an image of 3.2e+03"
    )
