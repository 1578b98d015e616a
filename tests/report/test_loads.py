"""Displacements at loads and at times between them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from validate.compare.result import Result
from validate.register.observation import Selection
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.report.scenes.body_scene import at_times, held
from validate.report.sections.observations import driven, holds

pytestmark = [pytest.mark.xdist_group("two methods of the phantom"), pytest.mark.slow]


def test_at_a_time_the_stage_of_that_time_counts(result: Result) -> None:
    run, seen = result.methods[0].run, result.methods[0].registered[0]
    times = np.array([0.0, 8.0, 13.5, 99.0])  # before, while moving, at a load, after
    found = at_times(seen, run, times)
    assert [i.t for i in found] == [3.5, 8.0, 13.5, 23.5, 33.5]
    rest, first = (h.drive for h in holds(seen)[:2])
    share = (float(driven(seen, 8.0)) - rest) / (first - rest)
    assert 0.1 < share < 0.9
    assert found[1].u == pytest.approx((1 - share) * run.u[0] + share * run.u[1], abs=1e-15)


def test_never_beyond_what_was_computed(result: Result) -> None:
    """A drive that overshoots between two loads is not extrapolated."""
    run, seen = result.methods[0].run, result.methods[0].registered[0]
    (stage,) = seen.drives
    over = replace(stage, y=np.where(np.abs(stage.t - 8.0)[:, None] < 1, 0.02, stage.y))
    others = tuple(o for o in seen.observations if o is not stage)
    (_, instant, *_) = at_times(replace(seen, observations=(over, *others)), run, np.array([8.0]))
    assert instant.u == pytest.approx(run.u[1], abs=1e-15)


def test_between_two_loads_at_one_place_of_the_drive_the_first_holds() -> None:
    """What moves there is no share of the drive: nothing is interpolated."""
    t = np.arange(3.0)
    stage = SignalObservation("stage", "drives", t, np.array([[0.0], [1.0], [1.0]]), "m", 0.0)
    at = tuple(Selection(f"{k}s", t[k : k + 1], "") for k in (1, 2))
    run = SimpleNamespace(u=np.array([[[3.0, 0.0]], [[5.0, 0.0]]]))
    found = at_times(Registered((stage,), at, None), run, np.array([1.5]))  # type: ignore[arg-type]
    assert [float(i.u[0, 0]) for i in found] == [3.0, 3.0, 5.0]


def test_a_run_that_ended_early_shows_what_it_has(result: Result) -> None:
    run, seen = result.methods[0].run, result.methods[0].registered[0]
    short = replace(run, at=run.at[:2], u=run.u[:2])
    assert [i.t for i in held(seen, short)] == [3.5, 13.5]
