"""`validate align`: two files of one test on one clock, against known offsets and drifts."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from command_line import here, refused
from scipy.ndimage import gaussian_filter1d

from validate.arrays import Floats
from validate.commands import align as aligning
from validate.errors import RecordingError, UsageError
from validate.recording.clocks.events import channel
from validate.recording.mcap.read import read_recording
from validate.recording.mcap.write import write_recording
from validate.recording.types import Frames, Markers, Recording, Signal, Source

# private: _aligned: called alone, case by case.
# private: _offset: replaced, to bring a case about.

OFFSET = 0.7318  # s by which the markers' clock is behind
_GRID = np.arange(-5.0, 65.0, 0.01)
_WALK = gaussian_filter1d(np.random.default_rng(0).normal(size=len(_GRID)), 40)
_WALK = _WALK / _WALK.std()


def motion(t: Floats) -> Floats:
    """A slow motion that never repeats itself."""
    return np.asarray(np.interp(t, _GRID, _WALK))


def recording(name: str, **streams: object) -> Recording:
    return Recording(name, Source(name, "", 0, ""), 0, **streams)  # type: ignore[arg-type]


def files(folder: Path, drift: float = 0.0, noise: float = 0.01) -> tuple[str, str]:
    """A log of 50 Hz and markers of 25 Hz of one motion, the second clock late and fast."""
    rng, t = np.random.default_rng(1), np.arange(0, 60, 0.02)
    force = Signal(t, (3 * motion(t) + noise * rng.normal(size=len(t)))[:, None], "N", 0.1, "cell")
    own = np.arange(0, 55, 0.04)
    real = own + OFFSET + drift * (own - own.mean())
    x = np.full((len(own), 2, 3), 0.5)
    x[:, 1, 2] = -0.01 * motion(real) + 1e-2 * noise * rng.normal(size=len(own))
    x[100, 1] = np.nan
    markers = Markers(own, ("base", "tip"), x, 1e-4, "lab")
    write_recording(recording("log", signals={"force": force}), folder / "log.mcap")
    write_recording(recording("seen", markers={"markers": markers}), folder / "seen.mcap")
    return str(folder / "log.mcap"), str(folder / "seen.mcap")


BY = ("--by", "force=-markers.tip.z")


@pytest.mark.usefixtures("drawn_figures")
def test_an_offset_is_found_below_a_sample_and_kept(tmp_path: Path) -> None:
    out = tmp_path / "both.mcap"
    code, said, err = here("align", *files(tmp_path), *BY, "-o", str(out))
    assert (code, err) == (0, "")
    told = " ".join(said.split())
    assert "by correlation; 1374 samples (100 %) lie within the first file's time" in told
    found = read_recording(out)
    record = found.record("clock_offset/markers")
    sd = float(record["sd"])
    assert sd < 2e-3
    assert abs(float(record["seconds"]) - OFFSET) < 4 * sd
    late = found.markers["markers"].t[0] - found.signals["force"].t[0]
    assert late == pytest.approx(float(record["seconds"]), abs=1e-6)
    assert (tmp_path / "both-aligned.png").stat().st_size > 10_000


@pytest.mark.slow
def test_a_drift_is_said_enters_the_sd_and_is_taken_out_on_demand(tmp_path: Path) -> None:
    drift, out = 4e-4, tmp_path / "both.mcap"
    given = files(tmp_path, drift)
    code, said, err = here("align", *given, *BY, "-o", str(out))
    assert code == 0
    assert "drift: +4" in said or "drift: +3.9" in said
    assert "the clocks drift by 2" in err
    assert "--drift corrects it" in err
    blunt = float(read_recording(out).record("clock_offset/markers")["sd"])
    assert blunt > drift * 55 / np.sqrt(12) * 0.9
    assert f"sd {blunt:.2g} s" in " ".join(said.split())
    code, said, err = here("align", *given, *BY, "--drift", "-o", str(out), "--force")
    assert (code, err) == (0, "")
    found = read_recording(out)
    record = found.record("clock_offset/markers")
    written = f"offset: {float(record['seconds']):+.6g} s, sd {float(record['sd']):.2g} s"
    assert written in " ".join(said.split())  # of the straightened clock, not of what it was
    assert float(found.record("clock_drift/seen")["rate"]) == pytest.approx(drift, rel=0.03)
    t = found.markers["markers"].t - found.signals["force"].t[0]
    own = np.arange(0, 55, 0.04)
    assert t == pytest.approx(own + OFFSET + drift * (own - own.mean()), abs=3e-3)
    assert float(found.record("clock_offset/markers")["sd"]) < blunt / 3


def third(folder: Path, late: float, noise: float) -> str:
    """A laser's displacement of 100 Hz of the same motion, on a third clock."""
    rng, own = np.random.default_rng(2), np.arange(0, 40, 0.01)
    y = 2e-3 * motion(own + late) + 2e-3 * noise * rng.normal(size=len(own))
    laser = Signal(own, y[:, None], "m", 1e-5, "bench")
    write_recording(recording("laser", signals={"laser": laser}), folder / "laser.mcap")
    return str(folder / "laser.mcap")


@pytest.mark.parametrize(  # a clock that began after the first, or before
    "late", [pytest.param(7.25, marks=pytest.mark.slow), -3.5]
)
def test_three_files_come_onto_the_first_clock(tmp_path: Path, late: float) -> None:
    out = tmp_path / "all.mcap"
    given = (*files(tmp_path), third(tmp_path, late, 0.02), *BY, "--by", "force=laser")
    code, said, err = here("align", *given, "-o", str(out))
    assert (code, err) == (0, "")
    told = " ".join(said.split())
    assert "seen.mcap: offset: +0.73" in told
    record = read_recording(out).record("clock_offset/markers")
    assert f"seen.mcap: offset: {float(record['seconds']):+.6g} s" in told
    assert "laser.mcap: offset: " in told
    assert all(float(share.split()[0]) > 0.99 for share in told.split("correlation  ")[1:])
    found = read_recording(out)
    begin = found.signals["force"].t[0]
    for topic, stream, offset in (("markers", found.markers["markers"], OFFSET),
                                  ("laser", found.signals["laser"], late)):  # fmt: skip
        record = found.record(f"clock_offset/{topic}")
        assert abs(float(record["seconds"]) - offset) < 4 * float(record["sd"])
        assert stream.t[0] - begin == pytest.approx(float(record["seconds"]), abs=1e-6)
    names = sorted(p.name for p in tmp_path.glob("*.png"))
    assert names == ["all-laser-aligned.png", "all-seen-aligned.png"]


@pytest.mark.slow
def test_one_file_that_does_not_follow_is_named_and_nothing_is_written(tmp_path: Path) -> None:
    out = str(tmp_path / "x.mcap")
    given = (*files(tmp_path), third(tmp_path, 7.25, 30.0), *BY, "--by", "force=laser")
    code, said, why = here("align", *given, "-o", out)
    assert code == 2
    assert "seen.mcap: offset" in said
    assert "laser.mcap: stream: flat" in why
    assert "seen.mcap" not in why
    assert not Path(out).exists()
    assert "--by: 1 given for 2 further files" in refused("align", *given[:3], *BY, "-o", out)
    for odd in ("force", "=laser", "force="):
        assert f"--by {odd}: expected CHANNEL=CHANNEL" in refused(
            "align", *given[:2], "--by", odd, "-o", out
        )
    assert "1 file; give at least 2" in refused("align", given[0], *BY, "-o", out)


@pytest.mark.slow
def test_what_is_enough_is_the_users(tmp_path: Path) -> None:
    given = (*files(tmp_path, noise=0.8), *BY, "-o", str(tmp_path / "x.mcap"))
    why = refused("align", *given, "--correlation", "0.9")
    assert "at least 0.9 is needed" in why
    code, said, _ = here("align", *given)
    assert code == 0
    assert "correlation 0." in " ".join(said.split())
    pair = (files(tmp_path)[0], third(tmp_path, 35.0, 0.01), "--by", "force=laser")
    for share, code in (("0.5", 0), ("0.9", 2)):
        out = str(tmp_path / f"{share}.mcap")
        assert here("align", *pair, "--coverage", share, "-o", out)[0] == code


def test_a_flash_marks_images(tmp_path: Path) -> None:
    t = np.arange(100) / 20
    images = tuple(np.full((16, 16), 200 if x >= 2 else 20, np.uint8) for x in t)
    frames = Frames(t, images, (1e-4, 1e-4), np.eye(4), "image")
    write_recording(recording("us", frames={"images": frames}), tmp_path / "us.mcap")
    t = np.arange(0, 6, 0.01)
    lamp = Signal(t, np.where(t >= 3, 5.0, 0.0)[:, None], "V", 0.01, "lamp")
    write_recording(recording("lamp", signals={"lamp": lamp}), tmp_path / "lamp.mcap")
    out = tmp_path / "both.mcap"
    by = ("--by", "lamp=images.brightness", "--event", "step")
    pair = (str(tmp_path / "lamp.mcap"), str(tmp_path / "us.mcap"))
    code, _, _ = here("align", *pair, *by, "-o", str(out))
    assert code == 0
    for ignored in (("--drift",), ("--within", "3"), ("--correlation", "0.9")):
        why = refused("align", *pair, *by, *ignored, "-o", str(tmp_path / "x.mcap"))
        assert f"--event step: {ignored[0]} belongs to the correlation; leave it out" in why
    record = read_recording(out).record("clock_offset/images")
    assert float(record["seconds"]) == pytest.approx(1.0, abs=0.03)
    assert float(record["sd"]) == pytest.approx(0.05 / np.sqrt(12), rel=0.2)


@pytest.mark.slow
def test_what_does_not_tell_an_offset_is_one_line(tmp_path: Path) -> None:
    log, seen = files(tmp_path)
    out = str(tmp_path / "x.mcap")
    assert "no channel 'forse'; there are force" in refused(
        "align", log, seen, "--by", "forse=markers.tip.z", "-o", out
    )
    assert "is given twice" in refused("align", log, log, *BY, "-o", out)
    assert "correlate by" in refused("align", log, seen, "--by", "force=markers.tip.z", "-o", out)
    assert "flat" in refused("align", log, seen, "--by", "force=markers.base.z", "-o", out)
    t = np.arange(0, 30, 0.02)
    for name, topic in (("a", "one"), ("b", "two")):
        wave = Signal(t, np.sin(2 * np.pi * t)[:, None], "N", 0.1, "cell")
        write_recording(recording(name, signals={topic: wave}), tmp_path / f"{name}.mcap")
    pair = (str(tmp_path / "a.mcap"), str(tmp_path / "b.mcap"))
    assert "ambiguous" in refused("align", *pair, "--by", "one=two", "-o", out)
    assert not Path(out).exists()


def test_channels_are_named(tmp_path: Path) -> None:
    t = np.arange(3.0)
    pressure = Signal(t, np.array([[1.0, 2], [3, 4], [5, 7]]), "Pa", 0.0, "cell")
    images = tuple(np.full((4, 4), v, np.uint8) for v in (1, 3, 0))
    frames = Frames(t, images, (1e-4, 1e-4), np.eye(4), "image")
    held = recording("r", signals={"p": pressure}, frames={"im": frames})
    assert channel(held, "p.1").y[:, 0] == pytest.approx([2, 4, 7])
    assert channel(held, "-p.0").y[:, 0] == pytest.approx([-1, -3, -5])
    assert channel(held, "im.brightness").y[:, 0] == pytest.approx([1, 3, 0])
    assert channel(held, "im.change").y[:, 0] == pytest.approx([2, 3])
    assert channel(held, "im.change").t == pytest.approx([0.5, 1.5])
    for wrong in ("p", "p.2", "im.colour", "q"):
        with pytest.raises(UsageError, match=rf"no channel '{wrong}'; there are p.0"):
            channel(held, wrong)


def test_every_further_file_has_its_channels_and_a_reason(tmp_path: Path) -> None:
    log, seen = files(tmp_path)
    out = tmp_path / "out.mcap"
    line = refused("align", log, "--by", "force=force", "-o", str(out))
    assert "align: 1 file; give at least 2" in line
    line = refused("align", log, seen, *BY, *BY, "-o", str(out))
    assert "--by: 2 given for 1 further files; give one for each" in line
    line = refused("align", log, seen, "--by", "force=", "-o", str(out))
    assert "--by force=: expected CHANNEL=CHANNEL, a channel of the first" in line
    line = refused("align", log, seen, *BY, "--correlation", "0.9999999", "-o", str(out))
    assert "the streams correlate by 1.00 at most" in line
    assert not out.exists()


def test_a_drift_that_half_a_recording_cannot_determine_is_reported(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def unknown(*_: object) -> None:
        raise RecordingError("7 samples meet the reference, 10 are needed")

    offset = SimpleNamespace(seconds=0.0, sd=0.1, method="correlation", count=9, coverage=1.0)
    monkeypatch.setattr(aligning, "drift_of", unknown)
    monkeypatch.setattr(aligning, "_offset", lambda *_: offset)
    monkeypatch.setattr(aligning, "correlation_at", lambda *_: 0.9)
    pair = SimpleNamespace(file=Path("b.mcap"), reference=None, stream=None)
    how = SimpleNamespace(event=None, straighten=True)
    assert aligning._aligned(pair, how, several=True) == (pair, offset, None)  # type: ignore[arg-type]
    said = " ".join(capsys.readouterr().out.split())
    assert said.startswith(
        "b.mcap: drift: not known: half of the recording is not enough (7 samples meet the "
        "reference, 10 are needed) b.mcap: offset"
    )
