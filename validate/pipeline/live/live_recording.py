"""Recording of a real-time loop, which `validate run` replays to the same numbers."""

from dataclasses import replace

import numpy as np

from validate.arrays import Floats
from validate.compare.verdict import Accept
from validate.errors import ComparisonError
from validate.parameters import describe
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.live.clock import LiveRun
from validate.pipeline.live.preparation import Prepared
from validate.recording.types import Recording, Signal, Source

LIVE = "live"  # the metadata record of it
_AXES = "xyz"
_FRAME = "block"
_TINY = 1e-12  # N: what was given is known to rounding


def written(done: LiveRun, made: Prepared, start_ns: int) -> Recording:
    """Signals `tip.*` m and `given.*` N of the answered ticks, `tick.late`, `tick.work` s of all.

    The path begins where the needle rests, so that a replay begins as the loop did.
    """
    t, x, F = _from_rest(done, np.array(made.stepper.tool.tip))
    signals = {}
    for c, a in enumerate(_AXES[: x.shape[1]]):
        signals[f"tip.{a}"] = Signal(t, x[:, [c]], "m", 0.0, _FRAME)
        signals[f"given.{a}"] = Signal(t, F[:, [c]], "N", _TINY, _FRAME)
    offset = max(0.0, -float(t[0]))
    for name, y in (("tick.late", done.late), ("tick.work", done.work)):
        if len(y):
            signals[name] = Signal(np.round(done.due, 9), y[:, None], "s", 0.0, _FRAME)
    signals = {k: Signal(s.t + offset, s.y, s.unit, s.sd, s.frame) for k, s in signals.items()}
    name = f"{made.experiment.name} live"
    counts = {k: str(v) for k, v in sorted(done.findings.items())}
    loop = {
        "experiment": made.experiment.name, "method": made.method, "source": done.kind,
        "rate_hz": repr(done.rate), "ticks": str(done.ticks), "missed": str(done.missed), **counts,
    }  # fmt: skip
    return Recording(
        name, Source(name, "", 0, "made in memory"), start_ns, signals=signals,
        metadata={
            "provenance": {"kind": "twin", "law": "the model that ran live"}, LIVE: loop,
            "live_parameters": {p.path: str(p.default) for p in describe(made.parameters)},
        },
    )  # fmt: skip


def _from_rest(done: LiveRun, rest: Floats) -> tuple[Floats, Floats, Floats]:
    if len(done.x) and np.array_equal(done.x[0], rest):
        return np.round(done.t, 9), done.x, done.F
    before = (done.t[0] if len(done.t) else 0.0) - 1 / done.rate
    none = np.zeros((1, len(rest)))
    t = np.concatenate([[before], done.t])
    return np.round(t, 9), np.vstack([rest[None], done.x]), np.vstack([none, done.F])


# --- An experiment whose recording is a live loop's: the same method must give the same force.

_SAME = 1e-9  # N: a replay of a live loop is the same to rounding


def as_given(experiment: Experiment, recording: Recording) -> Experiment | None:
    """Return the experiment with the loop's force compared with its own method only; None for a
    recording that is no live loop's.

    Raises `ComparisonError` for an experiment without a twin, which every live loop's has.
    """
    if LIVE not in recording.metadata:
        return None
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
