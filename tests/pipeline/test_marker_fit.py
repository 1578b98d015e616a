"""One card says how markers are fitted, in every experiment that registers them."""

from pathlib import Path

import pytest

from validate.pipeline.experiment.find import find
from validate.pipeline.experiment.options import Options, configure, folder_of
from validate.register.markers.markers import MarkerObservation
from validate.register.markers.quality import MarkerFit


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["kf_cube", "ekf_cube", "ekf_liver", "ekf_cone", "needle_block", "fluid_phantom"]
)
def test_excluded_markers_leave_the_fit_and_stay_in_the_comparison(name: str) -> None:
    experiment = find(name, Path(__file__))
    given, _ = configure(experiment, Options({}))
    assert isinstance(getattr(given, "settings", given).registration, MarkerFit)
    (recording, *_) = experiment.load(given, folder_of(experiment))
    marker = next(iter(recording.markers.values())).names[-1]
    options = Options({"registration.exclude": marker, "registration.robust": "true"})
    parameters, methods = configure(experiment, options)
    scene = experiment.build(recording, parameters, next(iter(methods.values())).scene)
    (seen, *_) = experiment.place(recording, parameters, scene).of(MarkerObservation)
    assert seen.registration.excluded == (marker,)
    assert marker not in seen.registration.names
    if name != "ekf_cone":  # whose quarter holds only the markers within it
        assert marker in seen.names
