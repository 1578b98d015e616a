"""What is written returns bit for bit, and others can read it."""

import hashlib
import json
import struct
from collections import Counter
from dataclasses import replace
from pathlib import Path

import hypothesis.extra.numpy as hnp
import jsonschema
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap_samples import ABSENT, T0, same_values, sample_recording, text_at, walk

from validate.errors import RecordingError
from validate.recording.mcap.read import read_recording
from validate.recording.mcap.schemas import SCHEMAS
from validate.recording.mcap.write import write_recording
from validate.recording.types import Contours, Frames, Markers, Recording, Signal


def test_round_trip_is_exact(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    write_recording(sample_recording(), path)
    got = read_recording(path)
    assert same_values(got, sample_recording())
    assert got.source.integrity == "verified"
    assert got.source.path == "a.mcap"
    assert got.source.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert got.source.bytes == path.stat().st_size
    assert got.clock["/markers"].rate_hz == pytest.approx(100.0, rel=1e-12)
    assert got.clock["/markers"].stamp_minus_publish == got.clock["/markers"].publish_minus_log == 0


def test_same_values_sees_one_bit() -> None:
    whole = sample_recording()
    y = whole.signals["/force"].y.copy()
    y[2, 1] = np.nextafter(y[2, 1], 1)
    assert not same_values(
        whole, replace(whole, signals={"/force": replace(whole.signals["/force"], y=y)})
    )


@pytest.mark.slow
def test_two_writes_are_byte_equal_and_times_of_many_chunks_return(tmp_path: Path) -> None:
    t = np.arange(12_000) * 33_333_333 / 1e9
    y = np.random.default_rng(1).normal(size=(len(t), 2))
    whole = Recording("long", ABSENT, T0, signals={"/s": Signal(t, y, "kPa", 0.0, "w")})
    one, two = tmp_path / "one.mcap", tmp_path / "two.mcap"
    write_recording(whole, one)
    write_recording(whole, two)
    assert one.read_bytes() == two.read_bytes()
    assert sum(opcode == 0x08 for opcode, _ in walk(one.read_bytes())) > 1  # chunk indexes
    assert same_values(read_recording(one), whole)


def test_samples_of_one_instant_keep_their_order(tmp_path: Path) -> None:
    y = np.arange(600.0).reshape(-1, 1)
    t = np.repeat([0.0, 0.1, 0.2], 200)
    streams = {f"/{k}": Signal(t, y + k, "N", 0.0, "w") for k in range(3)}
    whole = Recording("a", ABSENT, T0, signals=streams)
    write_recording(whole, tmp_path / "a.mcap")
    got = read_recording(tmp_path / "a.mcap")
    assert same_values(got, whole)
    assert got.clock["/1"].duplicates == 597


def test_zero_of_time_is_the_earliest_sample(tmp_path: Path) -> None:
    signal = Signal(np.array([0.5, 0.75]), np.ones((2, 1)), "N", 0.0, "w")
    write_recording(Recording("late", ABSENT, T0, signals={"/s": signal}), tmp_path / "a.mcap")
    got = read_recording(tmp_path / "a.mcap")
    assert got.t0_ns == T0 + 500_000_000
    assert got.signals["/s"].t.tolist() == [0.0, 0.25]


def test_independent_reader_finds_every_message(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    write_recording(sample_recording(), path)
    schemas: dict[int, str] = {}
    channels: dict[int, tuple[str, int]] = {}
    counts: Counter[str] = Counter()
    forces, stamps = [], []
    for opcode, content in walk(path.read_bytes()):
        if opcode == 0x03:
            schemas[struct.unpack_from("<H", content)[0]] = text_at(content, 2)[0]
        elif opcode == 0x04:
            number, schema = struct.unpack_from("<HH", content)
            channels[number] = text_at(content, 4)[0], schema
        elif opcode == 0x05:
            number, _, log, publish = struct.unpack_from("<HIQQ", content)
            topic, schema = channels[number]
            message = json.loads(content[22:])
            jsonschema.validate(message, dict(SCHEMAS[schemas[schema]]))
            stamp = message.get("stamp") or message["timestamp"]
            assert log == publish == stamp["sec"] * 10**9 + stamp["nsec"]
            stamps.append(log)
            counts[topic] += 1
            if topic == "/force":
                forces.append(message["values"])
    assert counts == {
        "/markers": 5,
        "/markers/foxglove": 5,
        "/plane": 4,
        "/plane/foxglove": 4,
        "/force": 7,
        "/outline": 2,
    }
    assert forces == sample_recording().signals["/force"].y.tolist()
    assert stamps == sorted(stamps)
    assert b"NaN" not in path.read_bytes()


def test_the_mcap_package_reads_it_in_order_of_time(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    write_recording(sample_recording(), path)
    with path.open("rb") as stream:
        found = [m.log_time for _, _, m in make_reader(stream, validate_crcs=True).iter_messages()]
    assert found == sorted(found)
    assert len(found) == 27


def test_mirror_holds_the_points_that_were_seen(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    write_recording(sample_recording(), path)
    bodies = [c[22:] for opcode, c in walk(path.read_bytes()) if opcode == 0x05]
    poses = [m["poses"] for m in map(json.loads, bodies) if "poses" in m]
    assert [len(p) for p in poses if len(p) != 1] == [3, 2, 3, 2, 3]
    flat = [p for p in poses if len(p) == 1]
    assert [p[0]["position"]["z"] for p in flat] == [0.0] * 4
    assert poses[0][1]["orientation"] == {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}


def test_a_failed_write_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(b"old")

    def full(self: object, *_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("validate.recording.mcap.write.Writer.add_message", full)
    with pytest.raises(RecordingError, match=r"a\.mcap: cannot be written .No space"):
        write_recording(sample_recording(), path)
    assert [p.name for p in tmp_path.iterdir()] == ["a.mcap"]
    assert path.read_bytes() == b"old"


def test_a_folder_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"cannot be written \(No such file"):
        write_recording(sample_recording(), tmp_path / "absent" / "a.mcap")


_T = np.array([0.0, 1.0])
_SIGNAL = Signal(_T, np.ones((2, 1)), "N", 0.0, "w")
_MARKERS = Markers(_T, ("a",), np.zeros((2, 1, 3)), 0.0, "w")
_CONTOURS = Contours(_T, (np.eye(3, 2), np.eye(3, 2)), 0.0, np.eye(4), "w")
_FRAMES = Frames(_T, (np.zeros((2, 2), np.uint8),) * 2, (1e-4, 1e-4), np.eye(4), "w")


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        (
            {"frames": {"/f": _FRAMES}, "metadata": {"calibration//f": {}}},
            r"metadata names \['calibration//f'\] are reserved",
        ),
        ({}, "no streams to write"),
        ({"markers": {"/m": _MARKERS}, "signals": {"/m": _SIGNAL}}, r"topics used twice: \['/m'\]"),
        (
            {"markers": {"/m": _MARKERS}, "signals": {"/m/foxglove": _SIGNAL}},
            r"topics used twice: \['/m/foxglove'\]; rename",
        ),
        (
            {"contours": {"/c": _CONTOURS}, "metadata": {"pose//c": {"a": "b"}}},
            r"metadata names \['pose//c'\] are reserved",
        ),
        ({"signals": {"/s": _SIGNAL}, "metadata": {"validate.recording": {}}}, "are reserved"),
        ({"signals": {"/s": _SIGNAL}, "metadata": {"m": {"a": 1}}}, "has values that are not text"),
        (
            {"signals": {"/s": _SIGNAL}, "metadata": {"m": {"a": "\ud800"}}},
            "text that is not UTF-8",
        ),
        (
            {"signals": {"/s": _SIGNAL}, "t0_ns": 2**63 - 10},
            "ns are outside 0 .. 9223372036854775807",
        ),
        ({"signals": {"/s": _SIGNAL}, "t0_ns": -1}, "times -1 .. 999999999 ns are outside"),
        ({"signals": {"/s": replace(_SIGNAL, t=np.array([0.0, 1e300]))}}, "are outside 0"),
    ],
)
def test_what_cannot_be_written_is_refused(tmp_path: Path, parts: dict, message: str) -> None:
    with pytest.raises(RecordingError, match=message):
        write_recording(
            Recording(**({"name": "r", "source": ABSENT, "t0_ns": T0} | parts)), tmp_path / "a.mcap"
        )
    assert list(tmp_path.iterdir()) == []


_NUMBERS = st.floats(allow_nan=False, allow_infinity=False, width=64)
_TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=6)
_SIDES = st.floats(1e-300, 1e300)
_SPREADS = st.floats(0, 1e300)


@st.composite
def _times(draw: st.DrawFn) -> np.ndarray:
    ns = draw(st.lists(st.integers(0, 20 * 86_400 * 10**9), min_size=1, max_size=5))
    return np.sort(np.array(ns, dtype=np.int64)) / 1e9


@st.composite
def _recordings(draw: st.DrawFn) -> Recording:
    t, tm, tc = draw(_times()), draw(_times()), draw(_times())
    shape = (len(tm), draw(st.integers(1, 3)), draw(st.sampled_from([2, 3])))
    names = draw(st.lists(_TEXTS, min_size=shape[1], max_size=shape[1], unique=True))
    maybe = st.one_of(_NUMBERS, st.just(float("nan")))
    outlines = [
        draw(hnp.arrays(np.float64, (draw(st.integers(3, 5)), 2), elements=_NUMBERS)) for _ in tc
    ]
    each = st.none() | hnp.arrays(np.float64, (len(tc), 2), elements=st.floats(0, 1))
    y = draw(hnp.arrays(np.float64, (len(t), draw(st.integers(0, 3))), elements=_NUMBERS))
    x = draw(hnp.arrays(np.float64, shape, elements=maybe))
    pose = draw(hnp.arrays(np.float64, (4, 4), elements=_NUMBERS))
    unit, frame, name = draw(_TEXTS.filter(bool)), draw(_TEXTS), draw(_TEXTS)
    tf = draw(_times())
    pixels = draw(hnp.arrays(np.uint8, (len(tf), draw(st.integers(1, 4)), 3)))
    sides = draw(st.tuples(_SIDES, _SIDES))
    start = min(t[0], tm[0], tc[0], tf[0])
    return Recording(
        name=name,
        source=ABSENT,
        t0_ns=draw(st.integers(0, 2**62)),
        markers={"m": Markers(_from(tm, start), tuple(names), x, draw(_SPREADS), frame)},
        signals={"s": Signal(_from(t, start), y, unit, draw(_SPREADS), frame)},
        contours={
            "c": Contours(
                _from(tc, start), tuple(outlines), draw(_SPREADS), pose, frame, each=draw(each)
            )
        },
        frames={"f": Frames(_from(tf, start), tuple(pixels), sides, pose, frame)},
        metadata=draw(
            st.dictionaries(_TEXTS, st.dictionaries(_TEXTS, _TEXTS, max_size=2), max_size=2)
        ),
    )


def _from(t: np.ndarray, start: float) -> np.ndarray:
    return (np.rint(t * 1e9) - np.rint(start * 1e9)) / 1e9


@settings(
    max_examples=30,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(whole=_recordings())
def test_any_small_recording_returns(tmp_path: Path, whole: Recording) -> None:
    write_recording(whole, tmp_path / "any.mcap")
    assert same_values(read_recording(tmp_path / "any.mcap"), whole)
