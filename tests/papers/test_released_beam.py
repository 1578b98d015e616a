"""The silicone beam: measured rest positions predicted, whatever frame they were seen in."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from validate.errors import RecordingError, UsageError
from validate.papers.released_beam.beam import (
    LAYOUT,
    HungMass,
    ReleasedBeam,
    rest_to_rest,
)
from validate.recording.clocks import clock_of
from validate.recording.types import Markers, Recording, Source
from validate.replay.experiment import Experiment
from validate.replay.find import load_file
from validate.replay.options import Options
from validate.replay.road import compare

BEAM = "markers/silicone-beam/beam_{}.c3d"
T = 0.01 * np.arange(300)


@pytest.fixture(scope="module")
def beam(project_root: Path) -> Experiment:
    return load_file(project_root / "experiments" / "silicone_beam.py")


def swung(x: np.ndarray) -> Recording:
    markers = Markers(T, tuple(LAYOUT), x, 0.0, "capture")
    ns = np.rint(1e9 * T).astype(np.int64)
    clock = {"markers": clock_of("markers", None, ns, ns)}
    return Recording("swing", Source("x", "", 0, "made"), 0, {"markers": markers}, clock=clock)


def released(at: float = 1.0, drop: float = 0.007) -> np.ndarray:
    """Tips that fall and ring down; noise of 10 um."""
    layout = np.array([list(v) for v in LAYOUT.values()])
    late = np.maximum(T - at, 0.0)
    fall = drop * (1 - np.cos(2 * np.pi * 8 * late) * np.exp(-8 * late))
    x = layout + 1e-5 * np.random.default_rng(1).normal(size=(len(T), 6, 3))
    x[:, :3, 2] -= fall[:, None]
    return x


def test_rest_is_taken_before_the_release_and_at_the_end() -> None:
    x = rest_to_rest(swung(released())).marker("markers").x
    assert x.shape == (2, 6, 3)
    assert x[1, :3, 2] - x[0, :3, 2] == pytest.approx(-0.007, abs=2e-5)
    assert np.abs(x[1, 3:] - x[0, 3:]).max() < 2e-5


def test_what_is_no_release_is_refused() -> None:
    with pytest.raises(RecordingError, match=r"no marker at the tip moves by 0\.5 mm"):
        rest_to_rest(swung(released(drop=0.0)))
    with pytest.raises(RecordingError, match=r"0\.15 s of rest before it is let go"):
        rest_to_rest(swung(released(at=0.05)))
    with pytest.raises(RecordingError, match=r"wander by \d\.\d\d mm at the end"):
        rest_to_rest(swung(released(at=2.5)))
    x = released()
    x[-100:, 1] = np.nan
    with pytest.raises(RecordingError, match=r"'Tip - 2' is seen at 0 of \d+ samples at the end"):
        rest_to_rest(swung(x))
    other = swung(released())
    markers = replace(other.markers["markers"], names=("a", *tuple(LAYOUT)[1:]))
    with pytest.raises(RecordingError, match="no marker"):
        rest_to_rest(replace(other, markers={"markers": markers}))
    with pytest.raises(UsageError, match="52 g are"):
        HungMass(52.0)


def errors(beam: Experiment, path: Path, *values: str) -> dict[str, float]:
    """Mean error mm of linear hexahedra with a pressure."""
    given = {"recording": str(path), **dict(v.split("=") for v in values)}
    quick = replace(beam, accepted=(), accept=(), uncertainty=None)
    result = compare(quick, Options(given, ("mixed_coarse",)))
    residuals = result.methods[0].residuals
    return {k: float(1e3 * r.values.mean()) for k, r in residuals.items()}  # mm


def test_where_the_beam_comes_to_rest_is_predicted(beam: Experiment, shared_data: Path) -> None:
    """Nothing is fitted. Linear hexahedra of 12 x 3 x 3 sag some .2 mm less than converged."""
    own = errors(beam, shared_data / BEAM.format("gravity_V2_b"))
    assert abs(own["tip.vertical@settled"]) < 0.5
    assert abs(own["tip.axial@settled"]) < 0.3
    loaded = errors(beam, shared_data / BEAM.format("load52_V2_a"), "load.mass=0.052")
    assert abs(loaded["tip.vertical@settled"]) < 1.0
    assert abs(loaded["tip.axial@settled"]) < 0.6
    bare = errors(beam, shared_data / BEAM.format("load52_V2_a"))
    assert bare["tip.vertical@settled"] > 9  # the mass is not forgotten
    rivlin = ("load.mass=0.052", "methods.mixed_coarse.law=mooney_rivlin", "material.C01=10000")
    other = errors(beam, shared_data / BEAM.format("load52_V2_a"), *rivlin)
    moved = abs(other["tip.vertical@settled"] - loaded["tip.vertical@settled"])
    assert 0.001 < moved < 0.5  # a law's own coefficient is reached


@pytest.mark.slow
def test_its_verdict_is_on_a_measurement(beam: Experiment, shared_data: Path) -> None:
    result = compare(beam, Options({}))
    assert result.kind == "measured"
    assert result.passed
    assert {c.verdict for c in result.methods[0].checks} == {"agrees"}
    assert result.methods[0].checks[0].count == 3
    assert ReleasedBeam().load.mass == 0
