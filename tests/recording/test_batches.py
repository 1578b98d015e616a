"""Messages judged together are judged as one by one, whatever stands among them."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap_samples import T0, markers_json, signal_json, write_foreign

from validate.errors import RecordingError
from validate.recording.mcap.channel_state import batch
from validate.recording.mcap.read import read_recording
from validate.recording.mcap.schemas import MARKERS, SIGNAL, decode
from validate.recording.preflight import Inspection
from validate.recording.types import Recording

COUNT = 600  # more than two batches
MS = 1_000_000


def _plain(schema: str, i: int) -> bytes:
    make = signal_json if schema == SIGNAL else markers_json
    own = {"values": [0.1 * i]} if schema == SIGNAL else {"x": [0.3 * i, None]}
    return json.dumps(make(T0 + i * MS, **own)).encode()


def _swapped(schema: str, i: int, old: str, new: str) -> bytes:
    text = _plain(schema, i).decode()
    assert old in text
    return text.replace(old, new).encode()


SIGNALS = {
    "unit": ('"N"', '"mN"'),
    "frame": ('"plate"', '"plate:2"'),
    "escaped frame": ('"plate"', '"pl\\u0061te"'),
    "sd": ("0.1}", "0.2}"),
    "negative sd": ("0.1}", "-0.1}"),
    "text sd": ("0.1}", '"0.1"}'),
    "true": ("[", "[true, "),
    "two": ("[", "[1, "),
    "none": ("[", "[null, "),
    "nan": ("[", "[NaN, "),
    "beyond": ("[", "[1e999, "),
    "beyond as a whole": ("[", f"[{'9' * 400}, "),
    "twice": ('"unit"', '"unit": "N", "unit"'),
    "twice with a colon": ('"frame": "plate"', '"frame": "a:b", "frame": "plate"'),
    "twice in the stamp": ('"nsec"', '"sec": 1600000000, "nsec"'),
    "no unit": ('"unit": "N", ', ""),
    "stamp": ('"nsec"', '"nano"'),
    "extra": ('"unit"', '"more": 1, "unit"'),
    "no stamp": ('"stamp"', '"stomp"'),
    "list": ("{", "[{"),
    "two objects": ('{"stamp"', '{}, {"stamp"'),
    "mark": ('"unit"', '"|between|": 1, "unit"'),
}
MARKED = {
    "renamed": ('"b"', '"c"'),
    "turned": ('["a", "b"]', '["b", "a"]'),
    "flat": ('"z": [4, null]', '"z": null'),
    "short": ('"z": [4, null]', '"z": [4]'),
    "name": ('"b"', "7"),
}
ODD: list[Any] = [pytest.param(SIGNAL, *swap, id=name) for name, swap in SIGNALS.items()]
ODD += [pytest.param(MARKERS, *swap, id=name) for name, swap in MARKED.items()]


@pytest.mark.parametrize("schema", [SIGNAL, MARKERS])
def test_a_batch_holds_what_each_message_holds(schema: str) -> None:
    messages = [_plain(schema, i) for i in range(20)]
    found, samples = batch(schema, messages), [decode(schema, data) for data in messages]
    assert found is not None
    assert found.stamps_ns.tolist() == [s.stamp_ns for s in samples]
    assert found.values.tobytes() == np.stack([s.values for s in samples]).tobytes()
    for one in samples:
        assert (one.frame, one.sd, one.names, one.unit) == (
            found.frame,
            found.sd,
            found.names,
            found.unit,
        )


@pytest.mark.parametrize(("schema", "old", "new"), ODD)
def test_an_odd_message_makes_no_batch(schema: str, old: str, new: str) -> None:
    messages = [_plain(schema, i) for i in range(5)]
    assert batch(schema, messages) is not None
    messages[3] = _swapped(schema, 3, old, new)
    assert batch(schema, messages) is None


def test_messages_that_are_whole_only_together_make_no_batch() -> None:
    whole = [_plain(SIGNAL, i) for i in range(3)]
    cut = len(whole[1]) - 4  # inside of its last number's text
    for pair in ([whole[1][:cut], whole[1][cut:]], [b"", whole[1] + b"," + whole[2]]):
        assert batch(SIGNAL, [whole[0], *pair]) is None
    joined = whole[0] + b',"|between|",' + whole[1]
    assert batch(SIGNAL, [joined]) is None
    assert batch(SIGNAL, [joined, whole[2]]) is None


@pytest.mark.parametrize(("schema", "old", "new"), ODD)
def test_inspection_says_what_reading_says(tmp_path: Path, schema: str, old: str, new: str) -> None:
    messages: list[tuple[str, str, int, Any]] = [
        ("/t", schema, T0 + i * MS, _plain(schema, i)) for i in range(COUNT)
    ]
    at = COUNT - 70
    messages[at] = ("/t", schema, T0 + at * MS, _swapped(schema, at, old, new))
    path = write_foreign(tmp_path / "f.mcap", messages, chunk_size=40_000)
    got, read = Inspection.of(path), _read(path)
    assert got.topics[0].count == COUNT
    if isinstance(read, str):
        assert got.defects[0] == read.removeprefix("f.mcap: ")
    else:
        assert got.defects == ()
        assert got.topics[0].clock == read.clock["/t"]


def _read(path: Path) -> Recording | str:
    try:
        return read_recording(path)
    except RecordingError as error:
        return str(error)
