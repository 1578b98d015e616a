"""Free parameters of an identification in the user's notation: `a,b` or `path=low:high`."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from validate.errors import UsageError
from validate.parameters import describe, with_values
from validate.pipeline.calibration.calibrated import open_free
from validate.pipeline.calibration.calibration import Calibrates, Calibration, Free
from validate.pipeline.experiment.experiment import Experiment

FreeOf = tuple[tuple[Free, ...], ...]  # of every calibration


def asked(
    experiment: Experiment, parameters: Any, wanted: Sequence[str] = ()
) -> tuple[Experiment, FreeOf]:
    """Return the experiment with its calibrations, and what is free of each.

    Nothing wanted: what stands open, or all that is declared where nothing does. What is not
    declared needs bounds, and is identified with the first calibration; an experiment without one
    is calibrated by its first accepted method, on all that it judges. Raises `UsageError`.
    """
    if not wanted:
        free = open_free(experiment, parameters)
        if not any(free):
            free = tuple(c.free for c in experiment.calibrations)
        if not any(free):
            raise UsageError(
                f"{experiment.name} declares no calibration; name parameters with their bounds: "
                "--parameters PATH=LOW:HIGH"
            )
        return experiment, free
    named = [_parsed(experiment, parameters, text) for text in wanted]
    twice = [f.path for i, f in enumerate(named) if f.path in [g.path for g in named[:i]]]
    if twice:
        raise UsageError(f"--parameters: {twice[0]} is given twice; give it once")
    experiment = experiment if experiment.calibrations else _on_all(experiment, tuple(named))
    # Every parameter to the calibration that declares it, the rest to the first one used
    own = [[f for f in named if f.path in c.paths] for c in experiment.calibrations]
    foreign = [f for f in named if not any(f in mine for mine in own)]
    first = next((i for i, mine in enumerate(own) if mine), 0)
    own[first] += foreign
    still = open_free(experiment, parameters)
    return experiment, tuple(
        (*mine, *(f for f in left if f.path not in {m.path for m in mine})) if mine else ()
        for mine, left in zip(own, still, strict=True)
    )


def _parsed(experiment: Experiment, parameters: Any, text: str) -> Free:
    path, sign, bounds = (part.strip() for part in text.partition("="))
    if path.startswith("methods."):
        raise UsageError(
            f"--parameters {path}: a setting of a method cannot be identified; give a parameter "
            f"of the experiment, see `validate list {experiment.name}`"
        )
    declared = {f.path: f for c in experiment.calibrations for f in c.free}
    if not sign:
        with_values(parameters, {path: "0"} if path not in declared else {})
        if path not in declared:
            known = f"declared: {', '.join(declared)}; or " if declared else ""
            raise UsageError(
                f"--parameters {path}: no bounds; {known}give them: --parameters {path}=LOW:HIGH"
            )
        return declared[path]
    low, colon, high = bounds.partition(":")
    if not (colon and low and high):
        raise UsageError(f"--parameters {text}: expected {path}=LOW:HIGH")
    ends = [_number(parameters, path, end) for end in (low, high)]
    known_free = declared.get(path)
    helps = known_free.helps if known_free else ""
    return Free(path, ends[0], ends[1], "asked for", helps)


def _number(parameters: Any, path: str, text: str) -> float:
    """In SI, as --set takes it."""
    found = {p.path: p.default for p in describe(with_values(parameters, {path: text}))}[path]
    if isinstance(found, bool) or not isinstance(found, float):
        raise UsageError(f"--parameters {path}: not a number that can be varied")
    return found


def _on_all(experiment: Experiment, free: tuple[Free, ...]) -> Experiment:
    names = tuple(
        name for a in experiment.accept
        for name in ([f"{a.quantity}@{load}" for load in a.loads] or [a.quantity])
    )  # fmt: skip
    method = next(iter(experiment.accepted), next(iter(experiment.methods)))
    if not names:
        raise UsageError(
            f"{experiment.name} has no accepted methods: declare a calibration in its file"
        )
    every = Calibration(method, free, (Calibrates(names, name="all checked quantities"),))
    return replace(experiment, calibrations=(every,))
