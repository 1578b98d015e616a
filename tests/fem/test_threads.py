"""How many threads a step takes: rules over numbers, nothing is timed here."""

from pathlib import Path

import pytest

from validate.fem.kernels import threads
from validate.fem.kernels.threads import Team, ThreadChoice, candidates, chosen, idle_of, pilot

# private: _BETWEEN_S: replaced by a small number: a short test.
# private: _LOADAVG: a file of the system, replaced by one of the test.
# private: _running: called alone, case by case.

US = 1e-6


def test_the_fastest_is_taken_if_it_is_clearly_faster() -> None:
    slow, fast, little = [9 * US, 8 * US, 10 * US], [5 * US, 4 * US, 6 * US], [8.5 * US, 7.5 * US]
    assert chosen(2, {1: slow, 2: fast}).threads == 2
    assert chosen(2, {1: slow, 2: little}).threads == 1
    assert chosen(2, {1: fast, 2: slow}).threads == 1
    assert chosen(4, {1: slow, 2: [6 * US, 6 * US], 4: fast}).threads == 4
    assert chosen(4, {1: slow, 2: fast, 4: [6 * US, 6 * US]}).threads == 2


def test_one_lucky_step_convinces_nobody() -> None:
    """Median and minimum must both say so: either alone is what a busy machine does."""
    assert chosen(2, {1: [10 * US] * 9, 2: [1 * US] + [40 * US] * 8}).threads == 1
    assert chosen(2, {1: [3 * US] + [10 * US] * 8, 2: [4 * US] * 9}).threads == 1


def test_the_choice_says_what_was_measured() -> None:
    found = chosen(2, {1: [820 * US] * 3, 2: [430 * US] * 3})
    assert found.words == "threads: 2 of 2, pilot 1: 820 us, 2: 430 us"
    assert chosen(2, {}).words == "threads: 1 of 2; no other core is idle"


def test_other_processes_leave_fewer_cores() -> None:
    """This one is among those that run, and in the load."""
    assert idle_of(2, running=1, load=0.9) == 2
    assert idle_of(2, running=2, load=0.9) == 1
    assert idle_of(2, running=1, load=2.0) == 1
    assert idle_of(2, running=9, load=7.0) == 1
    assert idle_of(8, running=3, load=1.0) == 6
    assert idle_of(2, running=1, load=0.0) == 2


def test_no_more_threads_are_tried_than_cores_idle() -> None:
    assert candidates(2, 1) == ()
    assert candidates(1, 8) == ()
    assert candidates(2, 8) == (1, 2)
    assert candidates(6, 8) == (1, 2, 4, 6)
    assert candidates(8, 3) == (1, 2, 3)


def test_a_busy_machine_runs_no_pilot() -> None:
    def step(threads: int) -> None:
        raise AssertionError("a step was run")

    assert pilot(step, 2, idle=1) == ThreadChoice(1, 2, {})


def test_numbers_of_threads_take_turns() -> None:
    ran: list[int] = []
    found = pilot(ran.append, 2, idle=2)
    assert ran[:2] == [1, 2]  # what is compiled there is not timed
    assert ran[2:] == [1, 2] * (len(ran) // 2 - 1)
    assert set(found.seconds) == {1, 2}


def test_a_team_falls_back_on_one_where_its_steps_take_longer_than_one_did() -> None:
    team = Team(ThreadChoice(2, 2, {1: 100 * US, 2: 60 * US}))
    for seconds in [400 * US] * 5 + [60 * US] * 20:
        team.saw(seconds)
    assert team.threads == 2  # a few late steps are not a busy machine
    for _ in range(6):
        team.saw(400 * US)
    assert team.threads == 1
    assert team.said.endswith("; then 1, as 2 took 400 us, because the machine became busy")
    team.saw(10 * US)
    assert team.threads == 1


def test_what_runs_is_read_from_the_system(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "loadavg"
    file.write_text("0.10 0.20 0.30 3/150 4242\n", encoding="ascii")
    monkeypatch.setattr(threads, "_LOADAVG", file)
    monkeypatch.setattr(threads, "_BETWEEN_S", 0.0)
    assert threads._running() == 3
    file.write_text("nonsense", encoding="ascii")
    assert threads._running() == 1
    monkeypatch.setattr(threads, "_LOADAVG", tmp_path / "none")
    assert threads._running() == 1
