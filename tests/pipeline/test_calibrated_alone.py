"""Laws that are calibrated each by itself: one that cannot be identified is a row, not the end."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest

from validate.compare.verdict import Accept
from validate.errors import ComparisonError
from validate.parameters import quantity
from validate.pipeline.calibration.calibrated import here, identified
from validate.pipeline.calibration.calibration import Calibrates, Calibration, Free
from validate.pipeline.experiment.experiment import Experiment, Uncertainty
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.options import Options
from validate.pipeline.experiment.tree import Built, Tree
from validate.pipeline.run.pipeline import compare
from validate.recording.types import Recording, Signal, Source
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.scene.material import Material
from validate.scene.meshless import MaterialPoint
from validate.solve.static.stretch_test import StretchTest

MU, NU = 30e3, 0.4999
POWERS = {"uniaxial": -2, "equibiaxial": -5}


@dataclass(frozen=True)
class Moduli:
    neo: float | None = quantity(None, "Pa", "modulus of neo-Hooke; none: identified")
    svk: float | None = quantity(None, "Pa", "modulus of the other; none: identified")


def pulled(mode: str, most: float) -> Recording:
    """Incompressible neo-Hooke in tension, with 100 Pa of noise."""
    l = np.linspace(1.02, most, 12)
    t = np.arange(len(l), dtype=float)
    P = MU * (l - l ** POWERS[mode]) + np.random.default_rng(3).normal(0, 100.0, len(l))
    signals = {
        "stretch": Signal(t, l[:, None], "1", 0.0, "machine"),
        "stress": Signal(t, P[:, None], "Pa", 100.0, "machine"),
    }
    return Recording(mode, Source("x", "", 0, "x"), 0, signals=MappingProxyType(signals))


def build(recording: Recording, tree: Tree, changes: Mapping[str, Any]) -> MaterialPoint:
    """Each recording is of its own mode."""
    return replace(Built()(recording, tree, changes), mode=recording.name)  # type: ignore[type-var]


def place(recording: Recording, tree: Tree, scene: MaterialPoint) -> Registered:
    stress = SignalObservation.validating(
        recording, "stress", "Pa", quantity=scene.mode, trace="nominal_stress"
    )
    return Registered((SignalObservation.driving(recording, "stretch", "1"), stress), timed=False)


def calibration(method: str, low: float) -> Calibration:
    free = (Free(method, low, 1e3 * low, "assumed", "another mode"),)
    return Calibration(method, free, (Calibrates(("uniaxial",)),))


def laws(uniaxial: float, equibiaxial: float) -> Experiment:
    most = {"uniaxial": uniaxial, "equibiaxial": equibiaxial}
    return Experiment(
        name="laws",
        title="a strip pulled",
        source="this test",
        scene=MaterialPoint(Material(None, NU, "neo_hooke")),  # type: ignore[arg-type]
        settings=Moduli(),
        methods={
            "neo": Method("neo-Hooke", StretchTest(), {"material.E": "as neo"}),
            "svk": Method(
                "St. Venant-Kirchhoff",
                StretchTest(),
                {"material.law": "svk", "material.E": "as svk"},
            ),
        },
        accepted=("neo",),
        accept=(Accept("equibiaxial", 5e3, "ours"),),
        load=lambda tree, folder: tuple(pulled(mode, m) for mode, m in most.items()),
        build=build,
        place=place,
        calibrations=(calibration("svk", 1e3), calibration("neo", 1e3)),
        uncertainty=Uncertainty(surrogate="neo"),
        path=Path(__file__),
    )


def test_a_law_without_a_state_is_refused_and_the_others_go_on() -> None:
    result = compare(laws(2.0, 1.5), Options({}))
    assert {m.name: m.run.outcome.state for m in result.methods} == {
        "neo": "finished", "svk": "refused",
    }  # fmt: skip
    refused = next(m for m in result.methods if m.name == "svk")
    assert "no lateral stretch gives zero stress" in refused.run.outcome.why
    assert [(c.name, c.verdict) for c in result.checks] == [("equibiaxial.max@all", "good enough")]
    (modulus,) = (s for s in result.identified if s.name == "neo")
    assert modulus.value == pytest.approx(2 * MU * (1 + NU), rel=0.01)


def test_what_a_law_cannot_predict_does_not_keep_it_from_being_identified() -> None:
    """Of two recordings only the first calibrates: at 1.6 both ways the law has no state."""
    result = compare(laws(1.1, 1.6), Options({}))
    assert {s.name for s in result.identified} >= {"neo", "svk"}
    refused = next(m for m in result.methods if m.name == "svk")
    assert [r.finished for r in refused.runs] == [True, False]


@pytest.mark.slow
def test_a_parameter_that_is_not_identifiable_refuses_its_own_law() -> None:
    narrow = replace(
        laws(1.2, 1.2), calibrations=(calibration("svk", 1e6), calibration("neo", 1e3))
    )
    refused = next(m for m in compare(narrow, Options({})).methods if m.name == "svk")
    assert "svk is not identifiable" in refused.run.outcome.why
    assert "another mode would identify it" in refused.run.outcome.why
    anyway = compare(narrow, Options({}, anyway=True))
    assert all(m.run.finished for m in anyway.methods)


def test_only_the_laws_that_are_run_are_identified_and_none_left_is_an_error() -> None:
    alone = compare(laws(2.0, 1.5), Options({}, methods=("neo",)))
    assert {s.name for s in alone.identified} == {"neo"}
    none = replace(laws(2.0, 1.5), calibrations=(calibration("svk", 1e6), calibration("neo", 1e6)))
    with pytest.raises(ComparisonError, match="neo is not identifiable"):
        compare(none, Options({}))


@pytest.mark.slow
def test_what_is_shared_is_identified_whichever_law_is_run_and_ends_all() -> None:
    first, second = laws(1.2, 1.2).calibrations
    made = replace(laws(1.2, 1.2), calibrations=(replace(first, shared=True), second))
    both = compare(made, Options({}, methods=("neo",)))
    assert {s.name for s in both.identified} == {"svk", "neo"}
    lost = replace(made, calibrations=(replace(calibration("svk", 1e6), shared=True), second))
    with pytest.raises(ComparisonError, match="svk is not identifiable"):
        compare(lost, Options({}))


def test_an_identification_alone_tells_who_has_no_answer_and_goes_on() -> None:
    made = laws(2.0, 1.5)
    free = tuple(c.free for c in made.calibrations)
    recordings = made.load(made.parameters, Path())
    done, failed = identified(made, made.parameters, made.methods, recordings, here, free)
    assert [one.problem.calibration.method for one in done] == ["neo"]
    assert "no lateral stretch gives zero stress" in failed["svk"]
    with pytest.raises(ComparisonError, match="no lateral stretch"):
        identified(made, made.parameters, made.methods, recordings, here, (free[0], ()))
