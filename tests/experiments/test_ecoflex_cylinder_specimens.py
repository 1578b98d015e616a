"""Several specimens: repeats have one vote, one is left out and predicted from the others."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from beside import experiment

from experiments.ecoflex_cylinder.cylinder import model_scene, place, size
from experiments.ecoflex_cylinder.modulus import identified
from experiments.ecoflex_cylinder.published import follows
from experiments.ecoflex_cylinder.specimens import (
    apart_notes,
    left_out,
    named,
    specimen_of,
    split,
    summarised,
)
from validate.errors import RecordingError, UsageError
from validate.identify.budget import Votes
from validate.identify.modulus import ModulusFit
from validate.parameters import with_values
from validate.pipeline.experiment.experiment import Identified
from validate.recording.types import Recording, Signal, Source
from validate.register.observation import Selection
from validate.register.signals import SignalObservation
from validate.solve.types import Outcome, Run, Trace

HEIGHT, AREA = 0.03, np.pi * 0.05**2 / 4
SHIPPED = experiment("ecoflex_cylinder")
SMALL = with_values(
    SHIPPED.parameters,
    {"body.diameter": "50mm", "body.height": "30mm", "body.cells": "2,2", "limit_svk": "0.11",
     "limit_neo_hooke": "0.12"},
)  # fmt: skip
RANGES = SMALL.settings.ranges


def log(name: str, E: float, header: bool = True) -> Recording:
    """A cylinder whose apparent modulus is E, with a file's name and a first line."""
    t = np.arange(150) / 10
    d = np.linspace(0, 0.13 * HEIGHT, len(t))
    force = E * AREA * d / HEIGHT
    line = f"{name[:-1]}_sample_{name[-1]}"
    return Recording(
        name, Source(f"{name}.csv", "", 0, "x"), 0,
        signals={"displacement": Signal(t, d[:, None], "m", 0.0, "machine"),
                 "force": Signal(t, force[:, None], "N", 0.0, "machine")},
        metadata={"header": {"line 1": line}} if header else {},
    )  # fmt: skip


LOGS = [log("EF30_0T_A1", 100e3), log("EF30_0T_A2", 102e3), log("EF30_0T_A3", 104e3),
        log("EF30_0T_B1", 111e3), log("EF30_0T_C1", 90e3), log("EF30_0T_C2", 94e3)]  # fmt: skip


def test_header_and_file_name_say_material_and_specimen() -> None:
    assert named(log("EF50_0T_B2", 1e5)) == ("EF50_0T", "B")
    assert named(log("EF50_0T_B2", 1e5, header=False)) == ("EF50_0T", "B")
    assert specimen_of(log("EF50_10T_C1", 1e5)) == "EF50_10T_C"
    assert named(log("unknown", 1e5, header=False)) == ("unknown", "")


def test_repeats_of_one_specimen_have_one_vote() -> None:
    """By hand: specimens 102, 111 and 92 kPa."""
    every = [specimen_of(r) for r in LOGS]
    found = Votes.by_specimen([100.0, 102, 104, 111, 90, 94], every)
    assert list(found.means.values()) == [102, 111, 92]
    assert found.mean == pytest.approx(305 / 3)
    assert found.between == pytest.approx(np.std([102, 111, 92], ddof=1))
    assert found.within == pytest.approx(np.sqrt((8 + 8) / 3))
    fits = [ModulusFit.of(r, size(SMALL)) for r in LOGS]
    mean = summarised(fits, every)
    assert mean.mean == pytest.approx(305e3 / 3, rel=1e-6)
    assert mean.sd_mean == pytest.approx(found.between * 1e3 / np.sqrt(3), rel=1e-6)


def test_each_specimen_is_predicted_from_the_others() -> None:
    scores = {s.name: s.value for s in left_out([100, 102, 104, 111, 90, 94],
                                                [specimen_of(r) for r in LOGS])}  # fmt: skip
    assert scores["left_out.EF30_0T_B"] == pytest.approx(97 / 111 - 1)
    assert scores["left_out.EF30_0T_C"] == pytest.approx(106.5 / 92 - 1)
    assert left_out([1.0, 2.0], ["A", "A"]) == ()


def test_the_last_specimen_is_left_out_unless_another_is_named() -> None:
    assert split(LOGS, None).judged == "EF30_0T_C"
    assert split(LOGS, "B").calibrating == ("EF30_0T_A", "EF30_0T_C")
    assert split(LOGS, "EF30_0T_A").judged == "EF30_0T_A"
    alone = split(LOGS[:3], None)
    assert (alone.judged, alone.calibrating, alone.apart) == ("EF30_0T_A", ("EF30_0T_A",), False)
    with pytest.raises(
        UsageError,
        match=r"judged = D.*EF30_0T_A, EF30_0T_B",
    ):
        split(LOGS, "D")
    with pytest.raises(RecordingError, match="logs of 2 materials"):
        split([*LOGS, log("EF50_0T_A1", 2e5)], None)


@pytest.fixture(scope="module")
def found() -> Mapping[str, Identified]:
    own = SHIPPED.methods["neo_bonded"]
    few = replace(own, scene={**own.scene, "body.cells": (2, 2)})
    coarse = {**SHIPPED.methods, "neo_bonded": few}
    sets = {"three": LOGS, "two": LOGS[:4], "one": LOGS[:1]}
    return {name: identified(logs, SMALL, coarse) for name, logs in sets.items()}


def test_the_judged_specimen_does_not_calibrate(found: Mapping[str, Identified]) -> None:
    three = found["three"]
    E = {s.name: s.value for s in three.scores}["modulus.E"]
    assert pytest.approx((102e3 + 111e3) / 2, rel=1e-6) == E
    assert three.calibrated == ()
    p = three.parameters.settings
    assert p.judged == "EF30_0T_C"
    scatter = np.std([102, 111], ddof=1) / 106.5
    assert p.ranges.specimen == pytest.approx(scatter, rel=1e-6)
    assert p.ranges.modulus == pytest.approx(scatter / np.sqrt(2), rel=1e-6)
    assert "EF30_0T_C, which was left out" in three.notes[0]


def test_scatter_that_the_logs_do_not_show_is_the_declared_one(
    found: Mapping[str, Identified],
) -> None:
    """One specimen that calibrates says nothing of how specimens differ."""
    for name in ("two", "one"):
        assert found[name].parameters.settings.ranges.specimen == RANGES.specimen
        assert "is unknown" in found[name].notes[1]
    assert "extrapolates in strain the same logs" in found["one"].notes[0]
    assert found["one"].calibrated == ("force@5pct",)
    assert found["two"].calibrated == ()


def test_scatter_between_specimens_is_in_u_D_of_the_judged_one_alone(
    found: Mapping[str, Identified],
) -> None:
    tree = found["three"].parameters
    scene = model_scene(tree, SHIPPED.methods["slip"], E=1e5)
    judged, other = place(LOGS[4], tree, scene), place(LOGS[0], tree, scene)
    (force,), (calibrating,) = (s.of(SignalObservation) for s in (judged, other))
    assert (force.role, force.share) == ("validates", tree.settings.ranges.specimen)
    assert (calibrating.role, calibrating.share) == ("calibrates", 0.0)
    assert {s.label for s in judged.selections}.isdisjoint(s.label for s in other.selections)


def test_a_prediction_of_another_specimen_is_judged_where_it_was_fitted_too() -> None:
    shipped = SHIPPED
    assert follows(shipped, LOGS, SMALL).accept[0].loads == ("5pct", "10pct")
    assert follows(shipped, LOGS[:3], SMALL).accept[0].loads == ("10pct",)
    assert shipped.accepted == ("slip",)
    assert shipped.specimen is not None
    assert shipped.specimen(LOGS[3]) == "EF30_0T_B"


def test_notes_tell_one_log_from_several() -> None:
    own = Votes.by_specimen([1.0], ["A"])
    assert apart_notes(split(LOGS[:1], None), own, 0.043)[0].startswith("All 1 log is of one")


def test_what_specimens_share_is_systematic_in_proportion_to_the_force() -> None:
    """By hand: 4 % of the rms of 3 and 4 N; noise alone averages out."""
    t, y = np.array([0.0, 1.0]), np.array([[3.0], [4.0]])
    run = Run("m", t, np.array([1]), np.zeros((1, 0, 3)), {"f": Trace(y[:, 0] + 1, "N")},
              Outcome("finished", 2), 0.0, None)  # fmt: skip
    force = SignalObservation("force", "validates", t, y, "N", 0.02, "force", "f", share=0.04)
    (found,) = force.deviations(run, Selection("all", t))
    assert found.systematic == pytest.approx(0.04 * np.sqrt(12.5))
    assert (found.sd, found.values.tolist()) == (0.02, [[1.0], [1.0]])
