"""A material point passes the whole pipeline: a stress-stretch record, no mesh, a report."""

from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest

from validate.arrays import Floats
from validate.compare.verdict import Accept
from validate.errors import SceneError
from validate.pipeline.experiment.experiment import Experiment, Uncertainty, vary
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.options import Options
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.run.pipeline import compare
from validate.recording.types import Recording, Signal, Source
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.report.write import write_report
from validate.scene.material import Material, Prony
from validate.scene.meshless import MaterialPoint
from validate.solve.fluid.cavities import NoFluid
from validate.solve.static.stretch_test import StretchTest

MU, NU = 30e3, 0.4999
STRETCH = np.linspace(1.0, 2.0, 41)


SCENE = MaterialPoint(Material(2 * MU * (1 + NU), NU, "neo_hooke"), "uniaxial")


def recorded() -> Recording:
    """Incompressible neo-Hooke in uniaxial tension, P = mu (l - 1/l^2), with 200 Pa of noise."""
    noise = np.random.default_rng(4).normal(0, 200.0, len(STRETCH))
    stress = MU * (STRETCH - STRETCH**-2) + noise
    t = np.arange(len(STRETCH), dtype=float)
    signals = {
        "stretch": Signal(t, STRETCH[:, None], "1", 0.0, "machine"),
        "stress": Signal(t, stress[:, None], "Pa", 200.0, "machine"),
    }
    return Recording("rubber", Source("x", "", 0, "x"), 0, signals=MappingProxyType(signals))


def place(recording: Recording, tree: Tree, scene: object) -> Registered:
    stress = SignalObservation.validating(
        recording, "stress", "Pa", quantity="stress", trace="nominal_stress"
    )
    return Registered((SignalObservation.driving(recording, "stretch", "1"), stress))


POINT = Experiment(
    name="rubber",
    title="a strip pulled",
    source="this test",
    scene=SCENE,
    methods={"neo": Method("neo-Hooke", StretchTest())},
    accepted=("neo",),
    accept=(Accept("stress", 5e3, "a tenth of the largest stress"),),
    load=lambda tree, folder: (recorded(),),
    place=place,
    variations=(vary("material.E", "relative 1 %"),),
    uncertainty=Uncertainty(surrogate="neo"),
    path=Path(__file__),
)


def test_stress_against_stretch_is_predicted_without_a_mesh(tmp_path: Path) -> None:
    result = compare(POINT, Options({}))
    (check,) = result.checks
    assert (check.unit, check.count, check.verdict) == ("Pa", len(STRETCH), "good enough")
    wrong = compare(POINT, Options({"material.E": repr(2 * 33e3 * (1 + NU))}))
    assert wrong.checks[0].validation == "differs"
    page = write_report(result, tmp_path / "rubber", created="2026-01-01T00:00:00+00:00")
    assert "stress" in page.read_text("utf-8")


def held(stress: Floats, t: Floats, stretch: Floats) -> Recording:
    noise = np.random.default_rng(4).normal(0, 200.0, len(t))
    signals = {
        "stretch": Signal(t, stretch[:, None], "1", 0.0, "machine"),
        "stress": Signal(t, (stress + noise)[:, None], "Pa", 200.0, "machine"),
    }
    return Recording("held", Source("x", "", 0, "x"), 0, signals=MappingProxyType(signals))


# Incompressible uniaxial tension: P of every law by its published coefficients.
CURVES = {
    "mooney_rivlin": (
        Material.mooney_rivlin(12e3, 3e3, NU),
        2 * (STRETCH - STRETCH**-2) * (12e3 + 3e3 / STRETCH),
    ),
    "yeoh": (
        Material.yeoh(15e3, 800.0, 100.0, NU),
        2 * (STRETCH - STRETCH**-2)
        * (15e3 + 1600.0 * (I1 := STRETCH**2 + 2 / STRETCH - 3) + 300.0 * I1**2),
    ),
    "ogden": (
        Material.ogden((20e3, 500.0), (1.3, 5.0), NU),
        20e3 * (STRETCH**0.3 - STRETCH**-1.65) + 500.0 * (STRETCH**4 - STRETCH**-3.5),
    ),
}  # fmt: skip


@pytest.mark.parametrize("law", CURVES)
def test_every_law_walks_the_road(law: str) -> None:
    material, curve = CURVES[law]
    recording = held(curve, np.arange(len(STRETCH), dtype=float), STRETCH)
    made = replace(
        POINT,
        load=lambda tree, folder: (recording,),
        parameters=Tree(scene=MaterialPoint(material, "uniaxial")),
    )
    (check,) = compare(made, Options({})).checks
    assert (check.count, check.verdict) == (len(STRETCH), "good enough")


@pytest.mark.slow
def test_a_stretch_that_is_held_relaxes_on_the_road() -> None:
    """P = mu (l - 1/l^2) (1 + g exp(-t/tau)) after a jump; without the series it differs."""
    t, series = np.linspace(0.0, 3.0, 61), Prony((0.6,), (0.7,))
    stress = MU * (1.5 - 1.5**-2) * (1 + 0.6 * np.exp(-t / 0.7))
    recording = held(stress, t, np.full(len(t), 1.5))

    def made(prony: Prony) -> str:
        material = Material(2 * MU * (1 + NU), NU, "neo_hooke", prony=prony)
        experiment = replace(
            POINT,
            load=lambda tree, folder: (recording,),
            parameters=Tree(scene=MaterialPoint(material, "uniaxial")),
        )
        return compare(experiment, Options({})).checks[0].verdict

    assert made(series) == "good enough"
    assert made(Prony()) == "not good enough"


def test_a_scheme_of_meshes_is_refused_on_a_point() -> None:
    methods = {"neo": Method("linear", NoFluid())}
    with pytest.raises(SceneError, match="mesh"):
        compare(replace(POINT, methods=methods), Options({}))


def test_every_recording_of_one_material_has_its_own_mode() -> None:
    """P = mu (l - l^-2), mu (l - l^-5): the second recording is judged in its own mode."""
    t, powers = np.arange(len(STRETCH), dtype=float), {"uniaxial": -2, "equibiaxial": -5}
    curves = {mode: MU * (STRETCH - STRETCH**power) for mode, power in powers.items()}
    recordings = tuple(replace(held(y, t, STRETCH), name=mode) for mode, y in curves.items())

    def mode_of(recording: Recording, tree: Tree, changes: None) -> MaterialPoint:
        return replace(tree.scene, mode=recording.name)

    def by_mode(recording: Recording, tree: Tree, scene: MaterialPoint) -> Registered:
        assert scene.mode == recording.name
        stress = SignalObservation.validating(
            recording, "stress", "Pa", quantity=scene.mode, trace="nominal_stress"
        )
        return Registered((SignalObservation.driving(recording, "stretch", "1"), stress))

    accept = tuple(Accept(mode, 9e3, "a tenth of the stress") for mode in powers)
    both = replace(
        POINT, load=lambda tree, folder: recordings, build=mode_of, place=by_mode, accept=accept
    )
    checks = compare(both, Options({})).checks
    assert [(c.name, c.verdict) for c in checks] == [
        ("uniaxial.max@all", "good enough"), ("equibiaxial.max@all", "good enough"),
    ]  # fmt: skip
