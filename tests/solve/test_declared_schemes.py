"""The one list of schemes: step maps and candidates come from their classes, a new one's too."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from study_samples import experiment_file

from validate.engine.cell import Where
from validate.fem.system import System
from validate.pipeline.experiment.find import find, load_file
from validate.pipeline.ladder.default import trial_of
from validate.solve.dynamic.newmark import Newmark
from validate.solve.handles import LINEAR_DYNAMICS, Handles
from validate.solve.schemes import SCHEMES, steppings, steppings_for
from validate.solve.study_entries import (
    RUNGS,
    Rates,
    Rival,
    Stepping,
    StillBody,
    StudyBody,
    SwingingBody,
    implicit_maps,
)
from validate.solve.types import Scheme, Stepper
from validate.study.choose.study import Climb, choose, wanted
from validate.study.stability.study import declared
from validate.study.tradeoff.study import again

EXPERIMENTS = Path(__file__).parents[2] / "experiments"
STEPS = (0.02, 0.01)
BODIES: tuple[StudyBody, ...] = (
    SwingingBody(STEPS, 3, 5), SwingingBody(STEPS, 3, 5, "yeoh"),
    StillBody(True, 0.02, 0.01, 5, 3), StillBody(False, 0.02, 0.01, 5, 3),
)  # fmt: skip


@dataclass(frozen=True)
class Toy:
    """Average acceleration under another name."""

    handles: ClassVar[Handles] = LINEAR_DYNAMICS

    dt: float = 0.001

    @staticmethod
    def steppings() -> tuple[Stepping, ...]:
        return (Stepping("toy", "a toy", "consistent", implicit_maps("average")),)

    @staticmethod
    def candidates(asked: StudyBody) -> tuple[Rival, ...]:
        return (Rival("a toy", "prefactored", Toy),) if isinstance(asked, SwingingBody) else ()

    def prepare(self, system: System) -> Stepper:
        return Newmark(self.dt).prepare(system)


@pytest.fixture
def toy() -> Iterator[None]:
    own = SCHEMES.own
    object.__setattr__(SCHEMES, "own", (*own, Toy))
    yield
    object.__setattr__(SCHEMES, "own", own)


def test_names_of_step_maps_stay() -> None:
    assert [s.name for s in steppings()] == [
        "newmark_average", "newmark_lumped", "backward_euler", "generalised_alpha",
        "newmark_misprinted", "explicit_consistent", "explicit_consistent_lagged",
        "explicit_lumped", "explicit_lumped_lagged", "central", "central_lagged",
        "newton_dynamics", "modal", "quasi_static",
    ]  # fmt: skip
    assert {s.name for s in steppings()} - {s.name for s in steppings_for("hex8")} == {
        "central", "central_lagged", "newton_dynamics",
    }  # fmt: skip


@pytest.mark.parametrize("asked", BODIES)
def test_candidates_are_their_scheme_and_rise_by_rung(asked: StudyBody) -> None:
    for scheme in SCHEMES:
        for one in getattr(scheme, "candidates", lambda _: ())(asked):
            assert isinstance(one.make(0.01), scheme)
    rungs = [RUNGS.index(c.rung) for c in SCHEMES.candidates(asked)]
    assert rungs == sorted(rungs)


@pytest.mark.parametrize("scheme", SCHEMES, ids=lambda s: s.__name__)
def test_a_linear_scheme_with_inertia_declares_a_step_map(scheme: type[Scheme]) -> None:
    """So that stability maps it; those that are driven by a tool or in regions march otherwise."""
    marches = scheme.handles.inertia and scheme.handles.law == ("linear",)
    if marches and "needle" not in scheme.handles.contact and scheme.__name__ != "AsyncRegions":
        assert getattr(scheme, "steppings", tuple)()


@pytest.mark.parametrize(
    "one", [s for s in steppings() if s.order],
    ids=lambda s: s.name,
)  # fmt: skip
def test_the_declared_order_is_that_of_the_map(one: Stepping) -> None:
    """Of a damped mode over a fixed time, when the step is halved."""
    w, time = 2 * np.pi, 1.0
    alpha, beta = (0.0, 0.01) if one.name == "central_lagged" else (0.5, 0.0)
    c = alpha + beta * w * w
    exact = complex(-c / 2, np.sqrt(w * w - c**2 / 4))
    errors = []
    for n in (200, 400):
        h = time / n
        values = np.linalg.eigvals(one.maps(Rates(np.array([w * h]), alpha * h, beta / h))[0])
        nearest = values[np.argmin(np.abs(values - np.exp(exact * h)))]
        errors.append(abs(nearest**n - np.exp(exact * time)))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(one.order, abs=0.1)


def test_a_new_scheme_enters_by_its_name_in_the_list(toy: None) -> None:
    assert "toy" in declared()
    assert steppings_for("tet4")[-1].name == "toy"
    trial = trial_of(find("kf_cube", EXPERIMENTS), quick=True)
    assert "a toy" in {s.name for s in trial.solvers}
    assert isinstance(next(s for s in trial.solvers if s.name == "a toy").make(0.01), Toy)


@pytest.mark.slow
def test_a_new_scheme_is_chosen_where_it_meets_error_and_rate(toy: None, tmp_path: Path) -> None:
    """`study choose` runs its candidates: as the only scheme in the list it is the choice."""
    object.__setattr__(SCHEMES, "own", (Toy,))
    pulled, here = load_file(experiment_file(tmp_path)), Where(workers=0)
    climb = Climb(pulled, quick=True, out=tmp_path, where=here)
    found = choose(
        climb, wanted("10mm", "1Hz"), True,
        lambda trade, row, dt: again(trade, row, dt, tmp_path, here),
    )  # fmt: skip
    assert {r.solver.name for r in found.trade.rows} == {"a toy"}
    assert found.pick is not None
    assert isinstance(found.pick.solver.make(0.01), Toy)
    assert found.pick.error is not None
    assert 0 < found.pick.error < 10e-3
