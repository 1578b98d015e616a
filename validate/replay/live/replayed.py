"""An experiment whose recording is a live loop's: the same method must give the same force."""

from dataclasses import replace

from validate.compare.verdict import Accept
from validate.errors import ComparisonError
from validate.recording.types import Recording
from validate.replay.experiment import Experiment
from validate.replay.live.written import LIVE

_SAME = 1e-9  # N: a replay of a live loop is the same to rounding


def as_given(experiment: Experiment, recording: Recording) -> Experiment:
    """The live loop's own force is held against the method that gave it, and nothing else is.

    Raises `ComparisonError` for an experiment without a twin, which every live loop's has.
    """
    if experiment.twin is None:
        raise ComparisonError(
            f"experiment '{experiment.name}' has no twin, which replaying a loop needs"
        )
    method = recording.record(LIVE)["method"]
    names = sorted(name for name in recording.signals if name.startswith("given."))
    accept = tuple(Accept(name, _SAME, "rounding: the same method, replayed") for name in names)
    return replace(
        experiment, accept=accept, accepted=(method,), uncertainty=None, cases=(),
        twin=replace(experiment.twin, remake=(), kind="same model"),
    )  # fmt: skip
