"""The ranges of shipped experiments: each says where it comes from, and moves what it names."""

from importlib.resources import files
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from validate.compare.residual import Residual
from validate.compare.verdict import Accept
from validate.errors import ComparisonError
from validate.parameters import with_given
from validate.pipeline.checks.checks import joint_inputs
from validate.pipeline.experiment.experiment import Input, Variant
from validate.pipeline.experiment.find import find
from validate.pipeline.plates.inclusion import (
    InclusionRanges,
    plates_of_share,
    rubbed,
    rubbing_share,
)


@pytest.mark.parametrize("name", ["fluid_phantom", "ekf_cone", "ecoflex_cylinder"])
def test_every_range_has_a_source_or_says_assumed(name: str) -> None:
    declared = find(name, Path(__file__)).uncertainty
    assert declared is not None
    assert {i.name: i.source for i in declared.inputs if i.source.startswith("assumed")}


def test_a_range_without_a_source_is_refused() -> None:
    with pytest.raises(ComparisonError, match="'modulus' has no source; cite what"):
        Input("modulus", rubbed, "E", " ")


PHANTOM = find("fluid_phantom", Path(__file__)).parameters


def test_plates_rub_by_the_models_own_share() -> None:
    """One standard uncertainty from slipping is the stiffness that friction is identified by, not a
    share of the response of bonded plates, which is 1.4 to 2.3 times less."""
    k = 4 * 15_200 / 0.060 * 0.03 / 0.97
    (plates,) = rubbed(PHANTOM, 1.0).scene.foundations
    assert (plates.contact, plates.stiffness) == ("partial", pytest.approx(k))
    assert rubbed(PHANTOM, -1.0) == rubbed(PHANTOM, 1.0)


def test_bonded_and_partial_plates_are_uncertain_too() -> None:
    path, (contact, friction) = "foundations.plates.", plates_of_share(0.5, 15_200, 0.060)
    half = {f"{path}contact": contact, f"{path}stiffness": friction}
    for own, more in (({f"{path}contact": "bonded"}, 0.97), (half, 0.53)):
        (plates,) = rubbed(with_given(PHANTOM, own), 1.0).scene.foundations
        assert rubbing_share("partial", plates.stiffness, 15_200, 0.060) == pytest.approx(more)


def test_the_default_ranges_are_those_that_a_new_experiment_states() -> None:
    """Also the friction, three hundredths of the share."""
    template = (
        files("validate.commands.questions").joinpath("new_inclusion.py.txt").read_text("utf-8")
    )
    assert "ranges=InclusionRanges(E=0.05, nu=0.005, friction=0.03)," in template
    assert InclusionRanges() == InclusionRanges(E=0.05, nu=0.005, friction=0.03)
    (plates,) = rubbed(PHANTOM, 1.0).scene.foundations
    assert rubbing_share("partial", plates.stiffness, 15_200, 0.060) == pytest.approx(0.03)


def test_an_inputs_standard_uncertainty_is_its_own_range() -> None:
    """Modulus and nu up by their ranges, whatever else stays."""
    declared = find("ekf_cone", Path(__file__))
    cone, gel = declared.parameters, PHANTOM
    by = {i.name: i for i in declared.uncertainty.inputs}  # type: ignore[union-attr]
    moved = by["modulus"].by(2.0)(cone).scene.material
    assert pytest.approx(1.04 * cone.scene.material.E) == moved.E
    by = {i.name: i for i in find("fluid_phantom", Path(__file__)).uncertainty.inputs}  # type: ignore[union-attr]
    assert pytest.approx(1.1 * gel.scene.material.E) == by["modulus"].by(2.0)(gel).scene.material.E
    nu = by["Poisson ratio"].by(2.0)(gel).scene.material.nu
    assert nu == pytest.approx(gel.scene.material.nu + 0.01)


def test_first_order_is_one_standard_uncertainty_of_each_input() -> None:
    """A linear model: 3 and -4 N make 5 N, which draws of both at once show too."""
    inputs = (
        Input("a", lambda p, z: (p[0] + 3 * z, p[1]), "first", "assumed"),
        Input("b", lambda p, z: (p[0], p[1] - 4 * z), "second", "assumed"),
    )

    def varied(variant: Variant) -> SimpleNamespace:
        force = np.array([[2.0 + sum(variant.change((0.0, 0.0)))]])
        seen = Residual("force", "3mm", force, 0.0, 0.0, "N", "force")
        return SimpleNamespace(residuals={seen.name: seen})

    declared = SimpleNamespace(surrogate="m", inputs=inputs, draws=12)
    experiment = SimpleNamespace(
        name="x", uncertainty=declared, accept=(Accept("force", 1.0, "assumed"),)
    )
    runs = SimpleNamespace(experiment=experiment, kind="measured", quick=False, varied=varied)
    (found,) = joint_inputs(runs)  # type: ignore[arg-type]
    assert found.first_order == pytest.approx(5.0, rel=1e-12)
    assert found.sampled == pytest.approx(5.0, rel=0.05)
