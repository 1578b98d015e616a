"""A plan that needs no experiment: every cell waits, and logs who ran it and when."""

import os
import time
from dataclasses import dataclass
from pathlib import Path

from validate.engine.cell import Plan
from validate.errors import SceneError
from validate.pipeline.run.job import Job


@dataclass(frozen=True)
class Waiting:
    """A cell that takes `seconds`; "refuse" and "break" end otherwise."""

    key: str
    seconds: float = 0.0
    timed: bool = False
    ends: str = ""

    @property
    def label(self) -> str:
        return f"cell {self.key}"


@dataclass(frozen=True)
class Waited:
    pid: int
    seconds: float


def open_folder(job: Job) -> Path:
    return Path(job.path)


def wait(folder: Path, cell: Waiting) -> Waited:
    start = time.time()
    time.sleep(cell.seconds)
    with (folder / "runs").open("a") as out:
        out.write(f"{cell.key} {os.getpid()} {start} {time.time()}\n")
    if cell.ends == "refuse":
        raise SceneError("this cannot\n be")
    if cell.ends == "break":
        raise ZeroDivisionError("a trap")
    return Waited(os.getpid(), cell.seconds)


def waiting(folder: Path, cells: tuple[Waiting, ...]) -> Plan[Waiting, Waited]:
    return Plan(Job(str(folder), ""), cells, open_folder, wait, Waited)


@dataclass(frozen=True)
class Logged:
    """A line of the log."""

    key: str
    pid: int
    start: float
    end: float


def logged(folder: Path) -> list[Logged]:
    rows = [line.split() for line in (folder / "runs").read_text().splitlines()]
    return [Logged(key, int(pid), float(start), float(end)) for key, pid, start, end in rows]
