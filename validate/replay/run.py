"""One entry for every kind of experiment."""

from validate.compare.result import Result
from validate.replay.options import AnyExperiment, Options, Report
from validate.replay.road import compare_at_holds
from validate.replay.track import track
from validate.replay.tracking import Tracking


def compare(experiment: AnyExperiment, options: Options, report: Report | None = None) -> Result:
    """Runs an experiment and judges it. Raises children of `ValidateError` for bad input."""
    if isinstance(experiment, Tracking):
        return track(experiment, options, report)
    return compare_at_holds(experiment, options, report)
