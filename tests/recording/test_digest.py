"""Digests: by hand for three samples, and every shipped recording against the file beside it."""

import hashlib
import json
import math
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap_samples import sample_recording

from validate.recording.mcap.read import read_recording
from validate.recording.reader import digest, to_text
from validate.recording.types import Markers, Signal

RECORDINGS = Path(__file__).parents[2] / "recordings"
SIGNAL = Signal(np.arange(3.0), np.array([[0.1], [0.2], [-0.5]]), "N", 0.0, "machine")


def test_an_array_by_hand() -> None:
    whole = replace(sample_recording(), signals={"/s": SIGNAL})
    assert digest(whole)["signals"]["/s"]["y"] == {
        "shape": [3, 1],
        "first": [0.1],
        "last": [-0.5],
        "sum": math.fsum([0.1, 0.2, -0.5]),
        "sha256": hashlib.sha256(struct.pack("<3d", 0.1, 0.2, -0.5)).hexdigest(),
    }


def test_points_not_seen_are_null_and_one_nan_is_like_another() -> None:
    x = np.array([[[1.0, 2.0]], [[np.nan, np.nan]]])
    found = [
        digest(replace(sample_recording(), markers={"/m": Markers(t, ("a",), a, 0.0, "w")}))
        for t, a in ((np.arange(2.0), x), (np.arange(2.0), -x * [[[-1.0]], [[1.0]]]))
    ]
    assert found[0]["markers"]["/m"]["x"]["last"] == [None, None]
    assert found[0]["markers"]["/m"]["x"]["sum"] == 3.0
    assert found[0] == found[1]


@pytest.mark.parametrize("kind", ["signals", "markers", "contours"])
def test_the_last_bit_of_one_time_changes_the_digest(kind: str) -> None:
    whole = sample_recording()
    topic, stream = next(iter(getattr(whole, kind).items()))
    t = stream.t.copy()
    t[-1] = np.nextafter(t[-1], np.inf)
    moved = {**getattr(whole, kind), topic: replace(stream, t=t)}
    assert digest(replace(whole, **{kind: moved})) != digest(whole)


def test_one_grey_level_changes_the_digest() -> None:
    whole = read_recording(RECORDINGS / "fluid_phantom_large.mcap")
    topic, frames = next(iter(whole.frames.items()))
    image = frames.images[1].copy()
    image[3, 5] ^= 1
    images = (frames.images[0], image, *frames.images[2:])
    other = replace(whole, frames={topic: replace(frames, images=images)})
    a, b = (digest(r)["frames"][topic]["images"] for r in (whole, other))
    assert (a["shape"], a["sha256"] == b["sha256"], abs(a["sum"] - b["sum"])) == (b["shape"], 0, 1)


def test_its_text_is_json_that_holds_it() -> None:
    found = digest(sample_recording())
    assert json.loads(to_text(found)) == found


@pytest.mark.slow
@pytest.mark.parametrize("file", sorted(RECORDINGS.glob("*.mcap")), ids=lambda file: file.stem)
def test_a_shipped_recording_reads_as_the_file_beside_it_says(file: Path) -> None:
    text = file.with_suffix(".json").read_text("utf-8")
    assert to_text(digest(read_recording(file))) == text
    assert len(text.splitlines()) < 200
    assert file.stat().st_size < 2e6


def test_there_are_shipped_recordings_and_each_has_its_file() -> None:
    made = {f.stem for f in RECORDINGS.glob("*.mcap")}
    assert len(made) >= 9
    assert {f.stem for f in RECORDINGS.glob("*.json")} == made
