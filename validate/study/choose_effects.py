"""Effects that a recording shows, as the stored run of an experiment found them.

`validate run` sets every declared effect against the noise of the recording. A choice reads its
results: to compute them anew would cost a whole run.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from validate.compare.effects import TELLS_APART
from validate.replay.experiment import EffectSpec, Experiment
from validate.replay.ladder import Rival, Trial
from validate.replay.named_run import reports_of


@dataclass(frozen=True)
class ShownEffect:
    """An effect that the recording shows: by which quantities, with the largest separation."""

    name: str
    doc: str
    seen_by: tuple[str, ...]
    separation: float


@dataclass(frozen=True)
class ShownEffects:
    """Effects of a stored run; `unknown` says why there are none to read."""

    shown: tuple[ShownEffect, ...] = ()
    not_shown: tuple[str, ...] = ()
    unknown: str = ""


def stored_effects(experiment: Experiment, out: Path | None) -> ShownEffects | None:
    """Read from the experiment's own run in `out`; None where it declares no effects."""
    if not experiment.effects:
        return None
    path = reports_of(experiment.path, out) / experiment.name / "results.json"
    try:
        stored = json.loads(path.read_text(encoding="utf-8"))["effects"]
        effects = [_shown(e) for e in stored]
        shown = tuple(e for e in effects if e.seen_by)
    except FileNotFoundError:
        return ShownEffects(unknown="no stored run")
    except (OSError, ValueError, KeyError, TypeError):
        return ShownEffects(unknown="the stored run cannot be read")
    if not effects:
        return ShownEffects(unknown="the stored run compared no effects")
    return ShownEffects(shown, tuple(e.name for e in effects if not e.seen_by))


def _shown(effect: dict[str, Any]) -> ShownEffect:
    seen_by = tuple(effect["seen_by"])
    by = [float(c["separation"]) for c in effect["changes"] if c["name"] in seen_by]
    return ShownEffect(effect["name"], effect["doc"], seen_by, max(by, default=0.0))


def with_effects(trial: Trial, experiment: Experiment, effects: ShownEffects | None) -> Trial:
    """The ladder whose candidates are marked where they lack an effect that the recording shows."""
    shown = {e.name for e in effects.shown} if effects else set()
    specs = [s for s in experiment.effects if s.name in shown]
    return replace(
        trial, solvers=tuple(_marked(r, trial, experiment, specs) for r in trial.solvers)
    )


def _marked(rival: Rival, trial: Trial, experiment: Experiment, specs: list[EffectSpec]) -> Rival:
    lacking = [s for s in specs if lacks(rival, trial, experiment, s)]
    if rival.lacks or not lacking:
        return rival
    return replace(
        rival, lacks=", ".join(f"'{s.name}', which the recording shows" for s in lacking)
    )


def lacks(rival: Rival, trial: Trial, experiment: Experiment, effect: EffectSpec) -> bool:
    """Whether a candidate is the scheme of the effect's other method, without the effect.

    Effects between two variants of one scheme are parts of the scene, which every candidate has. A
    scheme of an accepted method lacks nothing.
    """
    kinds = {name: type(method.settings) for name, method in experiment.methods.items()}
    kept = {kinds[effect.one.method], *(kinds[name] for name in experiment.accepted)}
    other = kinds[effect.other.method]
    return other not in kept and type(rival.make(trial.steps[0])) is other


def effect_words(
    effects: ShownEffects | None, experiment: Experiment, trial: Trial
) -> Iterator[tuple[str, str, str]]:
    """Name, value and meaning of every effect, for the table of the scene's own numbers."""
    if effects is None:
        return
    if effects.unknown:
        first = (
            f"run `validate run {experiment.name}` first; until then effects exclude no candidate"
        )
        yield "effects in the recording", f"unknown: {effects.unknown}", first
        return
    specs = {s.name: s for s in experiment.effects}
    for e in effects.shown:
        value = f"{e.doc}: {e.separation:.3g} u, seen by {', '.join(e.seen_by)}"
        without = [
            r.name for r in trial.solvers
            if e.name in specs and lacks(r, trial, experiment, specs[e.name])
        ]  # fmt: skip
        means = "required: every candidate includes it as the scene declares it"
        if without:
            means = (
                f"required: candidates without it do not solve this scene ({'; '.join(without)})"
            )
        yield f"effect: {e.name}", value, means
    if effects.not_shown:
        names = ", ".join(effects.not_shown)
        yield (
            "effects that the recording does not show",
            names,
            (f"below {TELLS_APART:g} u: not required by it"),
        )
