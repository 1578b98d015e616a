"""The law that is judged is the law that was identified, and its modulus carries its budget."""

import json
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from machine_logs import machine_log, on_a_body, pressed_cylinder
from scipy.optimize import brentq

from validate.arrays import Floats
from validate.compare.result import Result
from validate.compare.verdict import Accept
from validate.pipeline import run_in_memory
from validate.pipeline.bodies.choices import MeasuredBody, SeenOf
from validate.pipeline.bodies.measured import solid
from validate.pipeline.calibration.fitted_moduli import Moves, sentence
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.plates.compression import compression
from validate.pipeline.plates.scene import Compression, CompressionRanges
from validate.recording.mcap.write import write_recording
from validate.recording.types import Recording
from validate.report.stored.store import document, schema
from validate.scene.geometries.specification import Box
from validate.scene.material import Material
from validate.scene.scene import Drive, Scene, Support
from validate.solve.fluid.cavities import NoFluid
from validate.solve.static.load_table import Tabulated
from validate.solve.static.newton import StaticNewton

DIAMETER, HEIGHT, E, NU = 0.03, 0.02, 25e3, 0.45
AREA = np.pi * DIAMETER**2 / 4
LAWS = {
    "linear": Method("linear", NoFluid()),
    "neo": Method("neo-Hooke", Tabulated(StaticNewton("none")), {"material.law": "neo_hooke"}),
}


def uniaxial(strain: Floats, nu: float = NU) -> Floats:
    """Force N of a compressible neo-Hooke cylinder between slipping plates: the stretch across
    that leaves no stress there, W = mu/2 (I1 J^(-2/3) - 3) + kappa/2 (J - 1)^2."""
    mu, kappa = E / 2 / (1 + nu), E / 3 / (1 - 2 * nu)

    def slopes(along: float, across: float) -> tuple[float, float]:
        """dW by the stretch along, and by that across."""
        I1, J = along**2 + 2 * across**2, along * across**2
        iso, p = mu / 2 * J ** (-2 / 3), kappa * (J - 1)
        return (
            iso * (2 * along - 2 / 3 * I1 / along) + p * across**2,
            iso * (4 * across - 4 / 3 * I1 / across) + 2 * p * along * across,
        )

    def force(e: float) -> float:
        across = brentq(lambda a: slopes(1 - e, a)[1], 0.5, 2.0)
        return -AREA * slopes(1 - e, across)[0]

    return np.array([force(e) for e in strain])


def log(noise: float, *, large: bool, seed: int = 0) -> Recording:
    """A test to 11 % of strain, the plate 1 % away at first, the cell off by 0.3 N."""
    t = np.arange(0.0, 40.0, 0.2)
    strain = 0.12 * t / t[-1] - 0.01
    grid = np.linspace(0.0, 0.12, 121)
    curve = uniaxial(grid) if large else E * AREA * grid
    force = np.interp(strain, grid, curve) + 0.3
    force = force + np.random.default_rng(seed).normal(0.0, noise, len(t))
    return machine_log(t, strain * HEIGHT, force)


def experiment(folder: Path, seen: Recording, **ranges: float) -> Experiment:
    write_recording(seen, folder / "log.mcap")
    settings = Compression(ranges=CompressionRanges(**ranges))
    parameters = pressed_cylinder(
        DIAMETER, HEIGHT, nu=NU, cells=(2, 2), element="tet4", settings=settings
    )
    made = compression(
        "gel", "gel", "x", parameters, LAWS, ("linear", "neo"), (Accept("force", 0.1, "test"),)
    )
    return replace(made, path=folder / "gel.py")


@cache
def judged(folder: Path, large: bool, noise: float = 5e-3) -> Result:
    return run_in_memory(experiment(folder, log(noise, large=large)))


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> Sequence[Path]:
    return [tmp_path_factory.mktemp(name) for name in ("small", "large")]


def values(result: Result) -> dict[str, Any]:
    return {v.by: v for v in result.identified_values}


def checks(result: Result, method: str) -> dict[str, Any]:
    (found,) = (m for m in result.methods if m.name == method)
    return {c.name: c for c in found.checks}


def test_each_law_is_identified_by_itself(folders: Sequence[Path]) -> None:
    """The linear slope of a neo-Hooke body is 6 % high; handed to neo-Hooke it would be wrong."""
    found = values(judged(folders[1], large=True))
    assert found["neo"].value == pytest.approx(E, rel=5e-3)
    assert found["linear"].value > 1.04 * E
    found = values(judged(folders[0], large=False))
    assert found["linear"].value == pytest.approx(E, rel=5e-3)
    assert found["neo"].value < 0.97 * E


def test_the_right_law_predicts_and_the_wrong_one_is_named(folders: Sequence[Path]) -> None:
    result = judged(folders[1], large=True)
    right, wrong = (checks(result, name)["force.max@beyond"] for name in ("neo", "linear"))
    assert right.ratio < 1
    assert wrong.ratio > 1
    assert values(result)["neo"].finding == ""
    assert "rises faster" in values(result)["linear"].finding
    slower = values(judged(folders[0], large=False))
    assert slower["linear"].finding == ""
    assert "rises slower" in slower["neo"].finding


def test_the_interval_holds_the_truth_and_never_is_rounding(tmp_path: Path) -> None:
    """Without noise the sizes, the plates and the load cell are still uncertain."""
    result = run_in_memory(experiment(tmp_path, log(0.0, large=False)), methods=("linear",))
    one = values(result)["linear"]
    low, high = one.interval
    assert low < E < high
    exact = E * np.array([0.01, 0.005, 0.005])  # area, height, load cell
    parts = [one.parts[name] for name in ("diameter", "height", "load cell")]
    assert parts == pytest.approx(exact.tolist(), rel=0.01)
    assert high - low > 0.02 * E
    assert "± 3e" not in sentence(one)


def test_an_assumed_range_does_not_replace_that_of_the_fit(
    folders: Sequence[Path], tmp_path: Path
) -> None:
    seen = log(5e-3, large=False)
    wide = run_in_memory(experiment(tmp_path, seen, E=0.5), methods=("linear",))
    own = judged(folders[0], large=False)
    assert values(wide)["linear"].u == pytest.approx(values(own)["linear"].u)
    one, other = (checks(r, "linear")["force.max@beyond"] for r in (wide, own))
    assert one.u_input == pytest.approx(other.u_input)
    assert one.u_input < 0.01  # N; half of the force would be 0.9


def test_what_identification_and_prediction_share_cancels(
    folders: Sequence[Path], tmp_path: Path
) -> None:
    """A wider specimen has a smaller modulus and the same force."""
    seen = log(5e-3, large=False)
    ranges = {"diameter": 0.1, "height": 0.1, "load": 0.1, "friction": 0.0}
    wide = run_in_memory(experiment(tmp_path, seen, **ranges), methods=("linear",))
    own = judged(folders[0], large=False)
    assert values(wide)["linear"].u > 5 * values(own)["linear"].u
    one, other = (checks(r, "linear")["force.max@beyond"] for r in (wide, own))
    assert one.u_input == pytest.approx(other.u_input, rel=1e-6)


def test_an_input_moves_every_model_s_modulus_and_toe() -> None:
    moves = Moves({"a": 1.1}, {"a": 2e-4})
    found = moves.of((("a", 10.0, 1e-4), ("b", 5.0, 0.0)), 2.0)
    assert found[0] == ("a", pytest.approx(12.1), pytest.approx(5e-4))
    assert found[1] == ("b", 5.0, 0.0)


def test_results_carry_interval_and_terms(folders: Sequence[Path]) -> None:
    content = document(judged(folders[1], large=True), "2026-11-24T00:00:00Z")
    jsonschema.validate(json.loads(json.dumps(content)), schema())
    first = content["identified"][0]
    assert first["name"] == "material.E"
    assert first["interval"][0] < first["value"] < first["interval"][1]
    assert {"noise", "contact point", "diameter", "height", "friction"} <= set(first["parts"])
    assert first["u"] == pytest.approx(np.linalg.norm(list(first["parts"].values())))


def test_a_body_s_modulus_is_its_own_law_s(tmp_path: Path) -> None:
    """A block on rollers in a neo-Hooke law: both laws identified, each by itself."""
    size, t = (0.03, 0.03, HEIGHT), np.linspace(0.0, 6.0, 241)
    strain = 0.1 * np.clip((t - 0.5) / 5.0, 0.0, 1.0)
    force = uniaxial(strain) * size[0] * size[1] / AREA
    force = force + np.random.default_rng(5).normal(0.0, 2e-3, len(t))
    scene = Scene(
        Box(size, (2, 2, 2), "hex8"), Material(None, NU),
        (Support("xmin", (0,)), Support("ymin", (1,)), Support("zmin", (2,))),
        drives=(Drive("displacement", "zmax", "-z"),), dilatation="by_element",
    )  # fmt: skip
    settings = MeasuredBody(SeenOf(force="force", states=16, still=0.4))
    parameters = Tree("body.mcap", scene, settings)
    seen = machine_log(t, strain * HEIGHT, force, 2e-3)
    methods = {"solid": solid("neo-Hooke"), "linear": solid("linear", "linear")}
    result = run_in_memory(on_a_body(tmp_path, parameters, seen, methods, {"force": 0.1}))
    found = values(result)
    assert found["solid"].value == pytest.approx(E, rel=0.01)
    assert found["linear"].value > 1.02 * E
    # One standard uncertainty: 1 % of the load, .5 % of each size.
    assert found["solid"].parts["load"] == pytest.approx(0.0099 * E, rel=0.05)
    assert found["solid"].parts["size x"] == pytest.approx(0.005 * E, rel=0.05)
    right, wrong = (checks(result, name)["force.max@high"] for name in ("solid", "linear"))
    # 1 % of the load would be 1 % of the force, were the modulus not identified under it.
    assert wrong.u_input < 0.006 * wrong.size.measured  # at the largest load
    assert right.ratio < 1
    assert wrong.ratio > 1
