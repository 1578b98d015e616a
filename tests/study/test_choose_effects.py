"""Effects that a stored run shows, and the candidates that lack them."""

import json
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.ladder.ladder import Rival
from validate.solve.schemes import SCHEMES
from validate.solve.study_entries import StillBody
from validate.study.choose.facts import ShownEffects, effect_words, stored_effects, with_effects


def stored(folder: Path, experiment: Experiment, shown: dict[str, float]) -> None:
    """A run's results with the separations of its effects: above 2 the recording shows them."""
    effects = [
        {
            "name": name, "doc": "one for the other",
            "changes": [{"name": "force", "separation": u}, {"name": "markers", "separation": 0.1}],
            "seen_by": ["force"] if u > 2 else [],
        }
        for name, u in shown.items()
    ]  # fmt: skip
    path = folder / experiment.name / "results.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps({"effects": effects}), encoding="utf-8")


@dataclass(frozen=True)
class Candidates:
    """Of a ladder what effects read."""

    solvers: tuple[Rival, ...] = SCHEMES.candidates(StillBody(True, 1.0, 1.0, 1, 1))
    steps: tuple[float, ...] = (1.0,)


@pytest.fixture
def trial() -> Candidates:
    return Candidates()


def words(effects: ShownEffects | None, experiment: Experiment, trial: Candidates) -> list[str]:
    return ["; ".join(w) for w in effect_words(effects, experiment, trial)]  # type: ignore[arg-type]


def test_a_shown_effect_excludes_the_candidates_without_it(
    phantom: Experiment, trial: Candidates, tmp_path: Path
) -> None:
    stored(tmp_path, phantom, {"fluid": 40.0, "loop": 4.2, "plate contact": 9.0, "membrane": 0.5})
    effects = stored_effects(phantom, tmp_path)
    found = with_effects(trial, phantom, effects).solvers  # type: ignore[arg-type]
    assert {s.name: s.lacks for s in found if s.lacks} == {
        "superposition, cavity empty": "the fluid and its pressure",
        "condensed, paper's loop at 1 %": "'loop', which the recording shows",
    }
    fluid, loop, contact, rest = words(effects, phantom, trial)
    assert (
        "40 u, seen by force; required: candidates without it do not solve this scene (super"
    ) in fluid
    assert "4.2 u" in loop
    assert contact.endswith("every candidate includes it as the scene declares it")
    assert rest == (
        "effects that the recording does not show; membrane; below 2 u: not required by it"
    )


def test_what_the_recording_does_not_show_excludes_nothing(
    phantom: Experiment, trial: Candidates, tmp_path: Path
) -> None:
    stored(tmp_path, phantom, {"loop": 1.9})
    effects = stored_effects(phantom, tmp_path)
    found = with_effects(trial, phantom, effects).solvers  # type: ignore[arg-type]
    assert found == trial.solvers


def test_without_a_stored_run_the_effects_are_unknown(
    phantom: Experiment, trial: Candidates, tmp_path: Path
) -> None:
    (line,) = words(stored_effects(phantom, tmp_path), phantom, trial)
    assert "unknown: no stored run; run `validate run fluid_phantom` first" in line
    stored(tmp_path, phantom, {})
    (line,) = words(stored_effects(phantom, tmp_path), phantom, trial)
    assert "the stored run compared no effects" in line
    (tmp_path / phantom.name / "results.json").write_text("{", encoding="utf-8")
    (line,) = words(stored_effects(phantom, tmp_path), phantom, trial)
    assert "the stored run cannot be read" in line


def test_an_experiment_without_effects_has_no_line(phantom: Experiment, tmp_path: Path) -> None:
    none = replace(phantom, effects=())
    assert stored_effects(none, tmp_path) is None
    assert list(effect_words(None, none, None)) == []  # type: ignore[arg-type]
