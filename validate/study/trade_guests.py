"""Programs of others on the ladder of a trade: each run is a process of its own."""

import shlex
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from validate.replay.ladder import Rival, Trial
from validate.scene.material import LawName
from validate.solve.guests.guest import Guest
from validate.solve.guests.ran import words

GUEST = "guest "  # what their names begin with
_CARRIED = ("P1", "P2", "H8")  # elements that a job carries
_SECONDS = 120.0  # of one run, start and files included


def with_guests_beside(trial: Trial, commands: Sequence[str]) -> Trial:
    """The trial with every guest by the linear law and, where there is a pair, at large strain, by
    the ladder's longest steps. Raises `UsageError` for a command that is no program's."""
    rivals = [r for command in commands for r in _rivals(trial, command)]
    return replace(trial, solvers=(*trial.solvers, *rivals)) if rivals else trial


def _rivals(trial: Trial, command: str) -> list[Rival]:
    words(command)
    own = tuple(e for e in trial.meshes if e in _CARRIED)
    laws: tuple[LawName, ...] = ("linear", *((trial.pair.law,) if trial.pair else ()))
    return [
        Rival(
            f"{GUEST}{_called(command)}" + ("" if law == "linear" else ", large strain"),
            "guests", partial(_guest, command, trial.dynamic), law=law,
            elements=own or ("-",), shortest=trial.steps[0],
        )
        for law in laws
    ]  # fmt: skip


def _guest(command: str, moving: bool, dt: float) -> Guest:
    return Guest(command, inertia=moving, seconds=_SECONDS)


def _called(command: str) -> str:
    given = shlex.split(command)
    return Path(given[1] if len(given) > 1 else given[0]).stem
