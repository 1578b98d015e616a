"""`--set` with units, as a user types them: taken, refused in one line, or asked about."""

from pathlib import Path

import pytest
from command_line import here, refused

from validate.commands import record as making
from validate.errors import RecordingError
from validate.library import single_run, studies
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.find import find
from validate.pipeline.experiment.options import Options, configure


@pytest.mark.parametrize(
    ("setting", "says"),
    [
        ("material.E=15mm", "material.E=15mm: expected Pa"),
        ("body.inclusion.radius=8kPa", "body.inclusion.radius=8kPa: expected m"),
        ("positions=3,6,9mm", "each with its unit"),
        ("material.nu=0.4kPa", "without unit"),
        ("methods.p1_loop.tolerance=1kg", "tolerance=1kg: expected a number without unit"),
    ],
)
def test_a_wrong_dimension_is_one_line_with_the_unit_that_is_expected(
    setting: str, says: str
) -> None:
    assert says in refused("run", "fluid_phantom", "--set", setting)


def test_units_reach_parameters_and_lists(phantom: Experiment, project_root: Path) -> None:
    given = {"material.E": "15kPa", "body.inclusion.radius": "8mm", "positions": "3mm,6mm,9mm"}
    parameters = configure(phantom, Options(given))[0]
    scene = parameters.scene
    assert (scene.material.E, scene.body.inclusion.radius) == (15000.0, 0.008)
    assert parameters.settings.positions == phantom.parameters.settings.positions
    block = find("kf_cube", project_root)
    parameters, methods = configure(block, Options({"clock.dt": "1ms", "methods.fem.dt": "1ms"}))
    assert (parameters.settings.clock.dt, methods["fem"].settings.dt) == (0.001, 0.001)


def test_a_modulus_a_thousand_off_is_asked_about_wherever_it_is_set(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def stop(*_: object, **__: object) -> None:
        raise RecordingError("stopped here")

    monkeypatch.setattr(single_run, "compare", stop)
    monkeypatch.setattr(studies, "study", stop)
    monkeypatch.setattr(making, "progress", stop)
    for command in (["run"], ["study", "filters"], ["record", "-o", str(tmp_path / "x.mcap")]):
        code, _, err = here(*command, "fluid_phantom", "--set", "material.E=15.2")
        asked, stopped = err.splitlines()
        assert (code, stopped) == (2, "validate: stopped here")
        assert "15.2 Pa is outside 100 to 1e+09 Pa (default 15200.0)" in asked
        assert asked.endswith("a factor 1000? material.E=15.2kPa")
