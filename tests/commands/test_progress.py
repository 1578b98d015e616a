"""What runs and how long it takes: counted by a clock that the test turns."""

import threading
from collections.abc import Iterator
from types import SimpleNamespace

import pytest
from rich.console import Console
from rich.spinner import Spinner

from validate.commands import progress as module
from validate.commands.progress import Watch, drawn, progress
from validate.pipeline.run.runs import Pace


class Clock:
    now = 0.0

    def __call__(self) -> float:
        return self.now


def test_the_time_left_follows_what_was_done_and_counts_down() -> None:
    clock = Clock()
    watch = Watch("run", clock)
    assert watch.line == "run: starts (0 s)"
    watch.report(2, 10, "two were there before")
    assert watch.left == ""  # nothing was timed yet
    clock.now = 20.0
    watch.report(4, 10, "kf, 300 unknowns, step 5 of 90")
    assert watch.left == "about 1 min 0 s left"  # six more of 10 s each
    clock.now = 45.0
    assert watch.line == (
        "run: kf, 300 unknowns, step 5 of 90 (45 s, 40 %, about 35 s left)"
    )  # fmt: skip
    clock.now = 4000.0
    assert (watch.elapsed, watch.left) == ("1 h 6 min", "soon done")
    watch.report(10, 10, "report")
    assert (watch.share, watch.left) == (1.0, "")


def test_the_bar_says_the_same_and_keeps_to_the_width() -> None:
    watch = Watch("run", Clock())
    watch.report(1, 2, "a method with a long name, 12345 unknowns, step 5 of 90")
    screen = Console(width=40, record=True, file=None, quiet=False, force_terminal=False)
    with screen.capture() as shown:
        screen.print(drawn(watch, Spinner("dots"), 40))
    lines = shown.get().splitlines()
    assert max(map(len, lines)) <= 40
    assert " ".join(" ".join(lines[1:]).split()) == watch.text


@pytest.fixture
def ticks(monkeypatch: pytest.MonkeyPatch) -> Iterator[threading.Semaphore]:
    """A pipe's seconds pass when the test says so."""
    allowed = threading.Semaphore(0)

    class Event(threading.Event):
        def wait(self, timeout: float | None = None) -> bool:
            assert timeout == 10.0
            allowed.acquire()
            return self.is_set()

    monkeypatch.setattr(module, "threading", SimpleNamespace(Event=Event, Thread=threading.Thread))
    yield allowed
    allowed.release(9)


def test_a_pipe_gets_a_line_each_ten_seconds_and_only_on_standard_error(
    ticks: threading.Semaphore, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    said = threading.Semaphore(0)
    echo = module.click.echo

    def told(text: str, *, err: bool) -> None:
        echo(text, err=err)
        said.release()

    monkeypatch.setattr(module.click, "echo", told)
    with progress("run") as report:
        for step in range(50):
            report(step, 50, f"step {step}")
        ticks.release()
        said.acquire(timeout=60)
        ticks.release()  # for the end
    out, err = capsys.readouterr()
    assert out == ""
    assert [line.split(" (")[0] for line in err.splitlines()][:1] == ["run: step 49"]
    assert len(err.splitlines()) <= 2


def test_what_is_left_of_a_road_follows_the_methods_and_their_meshes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clock = Clock()
    monkeypatch.setattr("validate.pipeline.run.runs.perf_counter", clock)
    pace = Pace(since=0.0)
    pace.expect("plain", "p1")
    pace.expect("finer", "p1", cells=8.0, steps=2.0)
    pace.expect("other", "p2")
    assert pace.progress == (0, 1)
    clock.now = 10.0
    pace.took("plain", 4.0)
    pace.took("unexpected", 100.0)
    left = 4.0 * (8**1.3 * 2 + 1)  # p2 as p1, of which alone there is a time
    assert pace.progress == (10_000, round(10_000 + 1e3 * left))
    pace.took("other", 1.0)
    pace.took("finer", 1.0)
    assert pace.progress == (10_000, 10_000)
