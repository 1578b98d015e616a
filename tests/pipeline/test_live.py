"""The live loop: against a clock that the test turns, over a real socket, and replayed."""

import gc
import math
import os
import socket
import struct
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner

from validate.arrays import Floats
from validate.commands.main import cli
from validate.errors import RecordingError, UsageError
from validate.pipeline import load as experiment_named
from validate.pipeline.experiment.options import Options
from validate.pipeline.live import (
    Listener,
    LiveRun,
    Prepared,
    RecordedPath,
    live,
    prepared,
    realtime,
    written,
)
from validate.pipeline.live.listener import (
    CONTACT,
    FADED,
    LIMITED,
    NO_ANSWER,
    RESYNC,
    Position,
    force_of,
    newer,
    position_bytes,
    position_of,
)
from validate.pipeline.live.live_recording import _from_rest
from validate.pipeline.run.pipeline import compare
from validate.recording.mcap.read import read_recording
from validate.recording.mcap.write import write_recording
from validate.recording.types import Recording, Signal, Source
from validate.solve.haptic.needle import NeedleStepper
from validate.solve.types import State

# private: _from_rest: the replay of a run that takes minutes.
# private: _run: replaced, to bring a case about.
# private: _socket: called alone, case by case.


@pytest.fixture(autouse=True)
def _collected() -> Iterator[None]:
    """A loop collects garbage before it starts, and has all of it looked at from then on: not what
    this process has imported, or thousands of tests."""
    gc.freeze()
    yield
    gc.freeze()


COARSE = {"body.plane": "10"}
REST = (0.0031, 0.001)


class Turned:
    """A clock that stands until it is waited for; every reading costs `cost` s. At every wait
    `device` is called with the time."""

    def __init__(self, cost: float = 0.0, device: Callable[[float], None] | None = None) -> None:
        self.now, self.cost, self.device = 0.0, cost, device

    def __call__(self) -> float:
        self.now += self.cost
        return self.now

    def wait(self, seconds: float) -> None:
        self.now += seconds
        if self.device:
            self.device(self.now)


@cache
def made() -> Prepared:
    return prepared(experiment_named("needle_pocket"), Options(COARSE), "p1_exact")


def run(path: RecordedPath, clock: Turned, seconds: float | None = None) -> LiveRun:
    return live(made().stepper, path, seconds, clock, clock.wait)


# --- packets ----------------------------------------------------------------------------------


def test_a_position_is_the_documented_struct() -> None:
    packet = position_bytes(Position(7, 123, np.array([0.5, -2.0])))
    assert packet == struct.pack("<4sIqdd", b"VLP1", 7, 123, 0.5, -2.0)
    back = position_of(packet, 2)
    assert isinstance(back, Position)
    assert (back.sequence, back.ns, back.x.tolist()) == (7, 123, [0.5, -2.0])


@pytest.mark.parametrize(
    ("data", "fault"),
    [
        (b"", "short"),
        (struct.pack("<4sIqd", b"VLP1", 1, 0, 0.0), "short"),
        (struct.pack("<4sIqddd", b"VLP1", 1, 0, 0.0, 0.0, 0.0), "long"),
        (b"x" * 65, "long"),
        (struct.pack("<4sIqdd", b"NOPE", 1, 0, 0.0, 0.0), "wrong magic"),
        (struct.pack("<4sIqdd", b"VLP1", 1, 0, math.nan, 0.0), "not finite"),
        (struct.pack("<4sIqdd", b"VLP1", 1, 0, 0.0, -math.inf), "not finite"),
    ],
)
def test_what_is_no_position_says_why(data: bytes, fault: str) -> None:
    assert position_of(data, 2) == fault


def test_sequence_numbers_begin_again() -> None:
    assert newer(1, 0)
    assert newer(0, 2**32 - 1)
    assert not newer(5, 5)
    assert not newer(2**32 - 1, 0)


# --- against the clock ------------------------------------------------------------------------


def test_the_path_is_walked_on_time_and_forces_are_those_of_the_stepper() -> None:
    path = made().path
    done = run(path, Turned())
    assert done.ticks == len(path.t) == len(done.t)
    assert done.missed == 0
    assert np.array_equal(done.x, path.x)
    assert done.due == pytest.approx(path.t - path.t[0])
    assert np.abs(done.F).max() > 1
    assert done.changed.sum() == 4


@pytest.mark.slow
def test_ticks_that_take_too_long_are_missed_and_none_is_left_out() -> None:
    path = RecordedPath(made().path.t[:50], made().path.x[:50])
    done = run(path, Turned(cost=0.003))
    assert len(done.t) == 50
    assert done.missed == 50
    assert done.late.max() > 40 / 512


def test_garbage_is_collected_again_afterwards() -> None:
    path = RecordedPath(made().path.t[:3], made().path.x[:3])
    run(path, Turned())
    assert gc.isenabled()
    assert gc.get_freeze_count() == 0


def test_seconds_end_it() -> None:
    assert run(made().path, Turned(), seconds=0.1).ticks == math.ceil(0.1 * 512)


# --- packets on loopback ----------------------------------------------------------------------


class Device:
    """A client on a real socket: sends at every wait of the clock and reads the answers."""

    def __init__(self, listener: Listener, packets: list[bytes]) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.settimeout(5.0)
        self.socket.connect(listener.address)
        self.packets: Iterator[bytes] = iter(packets)
        self.answers: list[tuple[int, Floats, int]] = []
        self.waiting = False

    def __call__(self, now: float) -> None:
        if self.waiting:
            self.answers.append(force_of(self.socket.recv(1024), 2))
        packet = next(self.packets, None)
        self.waiting = packet is not None
        if packet is not None:
            self.socket.send(packet)


def talk(packets: list[bytes], seconds: float, stepper: NeedleStepper | None = None
         ) -> tuple[LiveRun, Device]:  # fmt: skip
    listener = Listener(*made().reach, 512.0)
    device = Device(listener, packets)
    clock = Turned(device=device)
    try:
        return live(stepper or made().stepper, listener, seconds, clock, clock.wait), device
    finally:
        device.socket.close()
        listener.close()


def at(k: int, y: float, ns: int | None = None) -> bytes:
    when = round(k * 1e9 / 512) if ns is None else ns
    return position_bytes(Position(k, when, np.array([REST[0], y])))


def test_a_device_is_answered_with_the_force_of_its_place() -> None:
    ys = [0.003, 0.001, -0.001, -0.003, -0.004]
    done, device = talk([at(k + 1, y) for k, y in enumerate(ys)], 7 / 512)
    assert done.findings["taken"] == 5
    assert done.x[:, 1].tolist() == ys
    assert [sequence for sequence, _, _ in device.answers] == [1, 2, 3, 4, 5]
    assert np.array([force for _, force, _ in device.answers]) == pytest.approx(done.F)
    assert [flags for _, _, flags in device.answers] == [0, 0, CONTACT, CONTACT, CONTACT]
    assert done.F[-1, 1] > done.F[-2, 1] > 0


def test_bad_packets_are_counted_and_end_nothing() -> None:
    """Short, long, foreign, not finite, out of reach, old and late ones between sound ones."""
    bad = [b"", b"x" * 900, struct.pack("<4sIqdd", b"EVIL", 9, 0, 0.0, 0.0),
           struct.pack("<4sIqdd", b"VLP1", 9, 0, math.nan, 0.0), at(9, 1e300), at(1, -0.004),
           at(10, -0.004, ns=-(10**18)), at(11, -0.004, ns=-(2**63))]  # fmt: skip
    sound = [at(1, 0.003), at(2, -0.001), at(3, -0.002)]
    done, _ = talk([sound[0], sound[1], *bad, at(12, -0.002)], 12 / 512)
    wanted = {"short": 1, "long": 1, "wrong magic": 1, "not finite": 1, "out of reach": 1,
              "out of order": 1, "late": 2, "taken": 3}  # fmt: skip
    assert {k: done.findings[k] for k in wanted} == wanted
    assert done.x[:, 1].tolist() == [0.003, -0.001, -0.002]


@pytest.mark.parametrize(
    "jump",
    ["stamp far ahead", "number far ahead", "clock set back", "device restarted", "two at once"],
)
def test_the_loop_takes_a_clock_that_jumped_anew(jump: str) -> None:
    """One packet, or a clock, must not end it: it resynchronises, and gives no force until then."""

    def sent(sequence: int, tick: float, y: float = -0.003, ns: int | None = None) -> bytes:
        when = round(tick * 1e9 / 512) if ns is None else ns
        return position_bytes(Position(sequence, when, np.array([REST[0], y])))

    first = [sent(1000 + k, k, y) for k, y in enumerate((0.003, -0.001, -0.003, -0.003))]
    odd = {
        "stamp far ahead": [sent(1005, 5, ns=2**62)],
        "number far ahead": [sent(2**31, 5)],
        "two at once": [sent(2**31, 5, ns=2**62)],
    }.get(jump, [])
    back = 51.2 if jump == "clock set back" else 0  # ticks: 100 ms
    start, n = 0 if jump == "device restarted" else 1010, RESYNC + 30

    def later(k: int) -> bytes:
        return sent(start + k, k + 5 - back)

    given: list[float] = []

    class Heard(Listener):
        def give(self, force: Floats, flags: int) -> None:
            given.append(float(np.linalg.norm(force)))
            super().give(force, flags)

    listener = Heard(*made().reach, 512.0)
    packets = iter([*first, *odd, *(later(k) for k in range(n))])
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as device:

        def send(now: float) -> None:
            if (packet := next(packets, None)) is not None:
                device.sendto(packet, listener.address)

        clock = Turned(device=send)
        done = live(made().stepper, listener, (n + 7) / 512, clock, clock.wait)
    listener.close()
    refused = done.findings.get("late", 0) + done.findings.get("out of order", 0)
    assert (done.findings["resynchronised"], refused) == (1, RESYNC - 1)
    assert done.findings["taken"] == len(first) + len(odd) + n - refused
    assert given[-1] > 1
    assert given[len(first) + len(odd) + RESYNC - 3] == 0.0  # passive until then


def test_without_packets_the_force_is_held_fades_and_is_nothing() -> None:
    ticks = 80
    listener = Listener(*made().reach, 512.0)
    given: list[tuple[Floats, int]] = []
    keep = listener.give
    listener.give = lambda F, flags: (given.append((F, flags)), keep(F, flags))[0]  # type: ignore[assignment, func-returns-value, method-assign]
    device = Device(listener, [at(1, 0.003), at(2, -0.003), at(3, -0.005)])
    clock = Turned(device=device)
    done = live(made().stepper, listener, ticks / 512, clock, clock.wait)
    device.socket.close()
    listener.close()
    sizes = [float(np.linalg.norm(F)) for F, _ in given]
    last = max(sizes)
    assert last > 1
    first = sizes.index(last)
    assert sizes[first + 9] == last  # 17.6 ms
    assert 0 < sizes[first + 30] < last
    assert sizes[first + 55 :] == [0.0] * (len(sizes) - first - 55)
    assert given[-1][1] & FADED
    assert done.findings["ticks without a new place"] == ticks - 3


@pytest.mark.slow
def test_no_force_beyond_the_limit_goes_out() -> None:
    strict = prepared(
        experiment_named("needle_pocket"), Options({**COARSE, "hand.limit": "5"}), "p1_exact"
    ).stepper
    ys = [0.003, *np.linspace(0.001, -0.049, 30)]
    done, device = talk([at(k + 1, float(y)) for k, y in enumerate(ys)], 33 / 512, strict)
    sizes = [float(np.linalg.norm(force)) for _, force, _ in device.answers]
    assert len(sizes) == 31
    assert max(sizes) == pytest.approx(5.0)
    assert done.findings["force limited"] == sum(
        bool(flags & LIMITED) for _, _, flags in device.answers
    )


class Fails(NeedleStepper):
    """Has no answer where the tip is deeper than 4 mm."""

    def step(self, state: State, inputs: Floats) -> State:
        made = super().step(state, inputs)
        deep = self.tool.tip[1] + inputs[1] < -0.004
        return replace(made, failure=("not_converged", "as asked")) if deep else made


def test_a_model_without_an_answer_gives_no_force() -> None:
    """Counted, zero newtons, and the model goes on from where it last had an answer."""
    whole = made().stepper
    assert isinstance(whole, NeedleStepper)
    lost = Fails(whole.settings, whole.small, whole.tool, whole.surface)
    ys = [0.003, -0.001, -0.003, -0.005, -0.006, -0.0035]
    done, device = talk([at(k + 1, y) for k, y in enumerate(ys)], 8 / 512, lost)
    sizes = [float(np.linalg.norm(force)) for _, force, _ in device.answers]
    assert sizes[2] > 1
    assert sizes[3:5] == [0.0, 0.0]
    assert sizes[5] > sizes[2]
    assert [bool(flags & NO_ANSWER) for _, _, flags in device.answers] == [
        False, False, False, True, True, False
    ]  # fmt: skip
    assert done.findings["no answer of the model"] == 2
    assert done.x[:, 1].tolist() == [0.003, -0.001, -0.003, -0.0035]


def test_another_sender_is_not_heard_while_one_is() -> None:
    listener = Listener(*made().reach, 512.0)
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as two,
    ):
        for k, device in ((1, one), (2, two)):
            device.sendto(at(k, 0.003), listener.address)
        listener.place(0, 0.0)
        assert dict(listener.findings) == {"taken": 1, "another sender": 1}
        two.sendto(at(1, 0.002), listener.address)
        found = listener.place(1, 2.0)
        assert found is not None
        assert found[1] == 0.002
    listener.close()


def test_it_listens_on_loopback_alone_and_only_when_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    listener = Listener(*made().reach, 512.0)
    assert listener.address[0] == "127.0.0.1"
    with pytest.raises(UsageError, match="choose another port"):
        Listener(*made().reach, 512.0, listener.address[1])
    listener.close()

    def refused(*_: object) -> None:
        raise AssertionError("a socket was opened")

    path = RecordedPath(made().path.t[:3], made().path.x[:3])
    monkeypatch.setattr(socket, "socket", refused)
    assert run(path, Turned()).kind == "path"


# --- what it did, replayed --------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("source", ["path", "udp"])
def test_what_it_did_replays_to_the_same_numbers(source: str, tmp_path: Path) -> None:
    if source == "path":
        done = run(made().path, Turned())
    else:
        ys = 0.003 - 0.007 * np.sin(np.pi * np.arange(40) / 39)
        done, _ = talk([at(k + 1, float(y)) for k, y in enumerate(ys)], 45 / 512)
    file = tmp_path / "live.mcap"
    write_recording(written(done, made(), 10**18), file)
    again = read_recording(file)
    assert again.record("live")["method"] == "p1_exact"
    result = compare(
        experiment_named("needle_pocket"),
        Options({**COARSE, "recording": str(file)}, ("p1_exact",)),
    )
    (method,) = result.methods
    traces = method.runs[0].traces
    force = np.column_stack([traces["needle.force.x"].y, traces["needle.force.y"].y])
    assert np.abs(done.F).max() > 1
    assert np.array_equal(force[-len(done.F) :], done.F)
    assert result.kind == "same model"
    assert result.passed


@pytest.mark.slow
def test_the_command_runs_against_the_real_clock(tmp_path: Path) -> None:
    file = tmp_path / "live.mcap"
    given = ["live", "needle_pocket", "--set", "body.plane=10", "--method", "p1_exact",
             "--seconds", "0.3", "-o", str(file), "--json"]  # fmt: skip
    result = CliRunner().invoke(cli, given, standalone_mode=False)
    assert result.exception is None
    assert '"ticks": 154' in result.stdout
    assert len(read_recording(file).signals["tick.work"].t) == 154
    assert "validate run needle_pocket --set body.plane=10 --set recording=" in result.stdout


def test_an_experiment_without_a_needle_is_refused() -> None:
    with pytest.raises(UsageError, match="has no needle"):
        prepared(experiment_named("fluid_block"), Options({}), "p1_exact")


@pytest.mark.skipif(not hasattr(os, "sched_setscheduler"), reason="no such scheduling here")
def test_real_time_is_asked_for_and_given_back(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []
    before = os.sched_getscheduler(0)
    monkeypatch.setattr(os, "sched_setscheduler", lambda _, policy, __: asked.append(policy))
    with realtime(wanted=False):
        pass
    assert asked == []
    with pytest.raises(ZeroDivisionError), realtime(wanted=True):
        raise ZeroDivisionError
    assert asked == [os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, before]

    def refused(*_: object) -> None:
        raise PermissionError("not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refused)
    with pytest.raises(UsageError, match="--realtime: not permitted"), realtime(wanted=True):
        pass


class Refusing:
    """A socket whose other end has gone: it reports so once, and takes nothing more."""

    def __init__(self, packet: bytes) -> None:
        self.answers: list[object] = [ConnectionResetError("gone"), packet]

    def recvfrom(self, size: int) -> tuple[bytes, tuple[str, int]]:
        if not self.answers:
            raise BlockingIOError
        answer = self.answers.pop(0)
        if isinstance(answer, Exception):
            raise answer
        return answer, ("127.0.0.1", 9)  # type: ignore[return-value]

    def sendto(self, data: bytes, peer: tuple[str, int]) -> None:
        raise ConnectionRefusedError("gone")


def test_a_device_that_has_gone_is_counted_and_ends_nothing() -> None:
    listener = Listener(*made().reach, 512.0)
    own, listener._socket = listener._socket, Refusing(at(1, -0.001))  # type: ignore[assignment]
    try:
        place = listener.place(0, 0.0)
        listener.give(np.zeros(2), 0)
    finally:
        listener._socket = own
        listener.close()
    assert place is not None
    assert place.tolist() == [REST[0], -0.001]
    counts = {name: n for name, n in listener.findings.items() if n}
    assert counts == {"unreachable": 1, "taken": 1, "unsent": 1}


def test_an_interruption_ends_the_loop_and_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object) -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr("validate.pipeline.live.clock._run", interrupted)
    done = run(made().path, Turned())
    assert done.findings["interrupted"] == 1
    assert len(done.t) == 0


def test_a_tip_recorded_at_different_times_is_refused() -> None:
    def signal(t: Floats) -> Signal:
        return Signal(t, np.zeros((len(t), 1)), "m", 0.0, "lab")

    t = np.arange(3.0)
    recording = Recording(
        "r", Source("r", "", 0, ""), 0, signals={"tip.x": signal(t), "tip.y": signal(t + 1)}
    )
    with pytest.raises(RecordingError, match=r"r: tip.x.*tip.y have \[3, 3\] samples"):
        RecordedPath.of(recording, 2)
    with pytest.raises(RecordingError, match=r"tip.x, tip.y.*'tip'"):
        RecordedPath.of(replace(recording, signals={"a": signal(t)}), 2)
    known = replace(signal(t), sd=2e-4)
    path = RecordedPath.of(replace(recording, signals={"tip.x": signal(t), "tip.y": known}), 2)
    assert (path.x.shape, path.sd) == ((3, 2), 2e-4)
    with pytest.raises(RecordingError, match=r"has 2 coordinates, the body has 3; set it"):
        RecordedPath.of(recording, 3, "set it")
    with pytest.raises(RecordingError, match=r"no signal 'tip\.y'"):
        RecordedPath.of(replace(recording, signals={"tip.x": known, "tip.z": known}), 2)


def test_a_path_that_does_not_begin_at_rest_has_rest_a_tick_before() -> None:
    rest, x, F = np.zeros(2), np.array([[1.0, 0.0], [2.0, 0.0]]), np.ones((2, 2))
    done = SimpleNamespace(x=x, t=np.array([0.5, 0.6]), F=F, rate=10.0)
    t, places, forces = _from_rest(done, rest)  # type: ignore[arg-type]
    assert t.tolist() == [0.4, 0.5, 0.6]
    assert places.tolist() == [[0, 0], [1, 0], [2, 0]]
    assert forces.tolist() == [[0, 0], [1, 1], [1, 1]]
    done.x = x - x[0]
    assert _from_rest(done, rest)[0].tolist() == [0.5, 0.6]  # type: ignore[arg-type]
