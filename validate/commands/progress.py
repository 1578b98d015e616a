"""Progress on standard error: current work, elapsed and remaining time.

On a terminal something moves and the seconds count, whatever is being computed. In a pipe a line
is written now and then.
"""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from time import monotonic

import click
from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.spinner import Spinner
from rich.table import Table
from rich.text import Text

from validate.commands.display import console
from validate.report.views.layout import wrapped

_QUIET = ContextVar("quiet", default=False)
_EVERY = 10.0  # s between two lines in a pipe
_BAR = 20  # characters

Clock = Callable[[], float]


class Watch:
    """Progress of a work: current step, share done, elapsed and remaining time."""

    def __init__(self, title: str, clock: Clock = monotonic) -> None:
        self.title, self._clock = title, clock
        self._start = self._at = clock()
        self._first: int | None = None  # done by others, before
        self._done, self._total, self.text = 0, 0, ""

    def report(self, done: int, total: int, text: str) -> None:
        """Units of work done and in all, and what comes next."""
        self._first = done if self._first is None else self._first
        self._done, self._total, self.text, self._at = done, total, text, self._clock()

    @property
    def share(self) -> float:
        """0 to 1."""
        return min(self._done / self._total, 1.0) if self._total else 0.0

    @property
    def elapsed(self) -> str:
        return _clocked(self._clock() - self._start)

    @property
    def left(self) -> str:
        """About how long, if the rest goes as what was done; "" where nothing tells."""
        mine = self._done - (self._first or 0)
        if mine <= 0 or self._done >= self._total:
            return ""
        whole = (self._at - self._start) * (self._total - self._done) / mine
        seconds = whole - (self._clock() - self._at)
        return f"about {_clocked(seconds)} left" if seconds >= 1 else "soon done"

    @property
    def line(self) -> str:
        """All of it, for a pipe."""
        known = [self.elapsed, *([f"{100 * self.share:.0f} %", self.left] if self.left else [])]
        return f"{self.title}: {self.text or 'starts'} ({', '.join(known)})"


def _clocked(seconds: float) -> str:
    """7 s, 1 min 10 s, 2 h 5 min."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"


@contextmanager
def quiet() -> Iterator[None]:
    """No progress is shown."""
    token = _QUIET.set(True)
    try:
        yield
    finally:
        _QUIET.reset(token)


@contextmanager
def progress(title: str) -> Iterator[Callable[[int, int, str], None]]:
    """Yield the callback of the work: done, total, text of the next step."""
    watch, screen = Watch(title), console(error=True)
    if _QUIET.get():
        yield watch.report
        return
    with _bar(watch, screen) if screen.is_terminal else _lines(watch, _EVERY):
        yield watch.report


@contextmanager
def _bar(watch: Watch, screen: Console) -> Iterator[None]:
    spinner = Spinner("dots")
    # Asked for anew eight times a second by a thread of its own: it turns while a matrix is
    # factorised.
    with Live(
        get_renderable=lambda: drawn(watch, spinner, screen.width),
        console=screen, refresh_per_second=8, transient=True, redirect_stdout=False,
        redirect_stderr=False,
    ):  # fmt: skip
        yield


def drawn(watch: Watch, spinner: Spinner, width: int) -> RenderableType:
    """Return a line with what is known of the time, and below it what is being done."""
    head = Table.grid(padding=(0, 1))
    times = f"{watch.elapsed}, {watch.left}" if watch.left else watch.elapsed
    head.add_row(spinner, watch.title, ProgressBar(1.0, watch.share, width=_BAR), times)
    below = [Text(line, "dim") for line in wrapped(f"  {watch.text}", width - 1, "  ")]
    return Group(head, *below)


@contextmanager
def _lines(watch: Watch, every: float) -> Iterator[None]:
    done = threading.Event()

    def now_and_then() -> None:
        while not done.wait(every):
            click.echo(watch.line, err=True)

    teller = threading.Thread(target=now_and_then, daemon=True)
    teller.start()
    try:
        yield
    finally:
        done.set()
        teller.join()
