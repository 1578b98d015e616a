"""The outline through the load: what each picture shows, and how it is stored."""

from dataclasses import replace
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image, ImageSequence
from report_samples import small_result

from validate.compare.exhibit import Animation
from validate.compare.result import Result
from validate.register.observation import Selection
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.report.charts.encode import gif
from validate.report.scenes.animation import moving_outline
from validate.report.scenes.loads import at_times, held, in_steps
from validate.report.sections.observations import driven, holds
from validate.report.write import write_report

pytestmark = [pytest.mark.xdist_group("two methods of the phantom"), pytest.mark.slow]
BLACK = 60  # of 255; the measured points at a load are darker, between two they are not


@pytest.fixture(scope="module")
def animation(result: Result) -> Animation:
    (made,) = moving_outline(result.methods[0])
    return made


@pytest.mark.slow
def test_between_loads_linear_in_the_stage(result: Result) -> None:
    run, seen = result.methods[0].run, result.methods[0].registered[0]
    found = in_steps(seen, run, 8)
    assert len(found) == 3 * 8 + 1
    assert [i.hold for i in found if i.hold] == list(holds(seen))
    assert all(np.array_equal(i.u, u) for i, u in zip(found[::8], run.u, strict=True))
    a, middle, b = found[8], found[12], found[16]
    assert middle.hold is None
    assert middle.drive == pytest.approx((a.drive + b.drive) / 2)
    assert middle.u == pytest.approx((a.u + b.u) / 2, abs=1e-15)


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


def test_pictures_and_times(animation: Animation) -> None:
    assert len(animation.frames) == len(animation.milliseconds) == 25
    assert animation.milliseconds[:3] == (2000, 1000, 90)
    assert [i for i, ms in enumerate(animation.milliseconds) if ms == 1000] == [1, 9, 17]
    assert len({f.shape for f in animation.frames}) == 1
    assert len({f.tobytes() for f in animation.frames}) == 25


def test_the_still_is_the_last_load_and_the_loop_starts_at_rest(animation: Animation) -> None:
    """The simulated outline (blue) is flattest in the still and roundest at rest."""
    heights = [_height(f) for f in animation.frames]
    assert heights[0] == min(heights)
    assert heights[1] == max(heights)
    assert all(a >= b - 1 for a, b in pairwise(heights[1:]))
    assert animation.still.pixels is animation.frames[0]


def _height(frame: np.ndarray) -> int:
    red, _, blue = (frame[: int(0.8 * len(frame)), :, c].astype(int) for c in range(3))
    rows = np.flatnonzero((blue - red > 100).any(axis=1))  # the legend lies below
    return int(np.ptp(rows))


def test_measured_points_fade_between_loads(animation: Animation) -> None:
    def dark(frame: np.ndarray) -> int:
        inside = frame[60 : int(0.75 * len(frame)), 120:]
        return int((inside.max(axis=2) < BLACK).sum())

    assert dark(animation.frames[9]) > 300
    assert dark(animation.frames[10]) < 20


def test_words(animation: Animation) -> None:
    assert "interpolated linearly in the drive" in animation.caption
    assert "The still image shows 9 mm." in animation.caption
    assert "mm" in animation.caption
    assert animation.alt.startswith("Animation: the measured outline points over the simulated")


def test_gif(animation: Animation) -> None:
    data = gif(animation)
    assert len(data) < 400_000
    with Image.open(BytesIO(data)) as image:
        assert image.format == "GIF"
        assert image.info["loop"] == 0
        frames = [(np.array(f.convert("RGB"), dtype=int), f.info["duration"])
                  for f in ImageSequence.Iterator(image)]  # fmt: skip
    assert [ms for _, ms in frames] == list(animation.milliseconds)
    for (shown, _), drawn in zip(frames, animation.frames, strict=True):
        assert (np.abs(shown - drawn.astype(int)).max(axis=2) < 40).mean() > 0.995


@pytest.mark.slow
def test_in_the_report(result: Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VALIDATE_NO_GL", "1")
    page = write_report(result, tmp_path / "phantom", created="2026-11-21T04:00:00Z")
    text = page.read_text(encoding="utf-8")
    assert text.count("data:image/gif;base64,") == 1
    assert '<source media="print, (prefers-reduced-motion: reduce)" srcset="data:image/webp' in text
    assert len(text.encode()) < 2_000_000
    assert (page.parent / "figures" / "outline.gif").read_bytes()[:6] == b"GIF89a"
    assert (page.parent / "replay.mcap").read_bytes()[:5] == b"\x89MCAP"


def test_nothing_to_show(result: Result) -> None:
    small = small_result()
    assert moving_outline(small.methods[0]) == ()
    one = result.methods[0]
    rest = replace(one, runs=(replace(one.run, at=one.run.at[:1], u=one.run.u[:1]),))
    assert moving_outline(rest) == ()
