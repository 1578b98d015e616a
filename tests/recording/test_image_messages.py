"""Images are inspected by head and end; what is odd is looked at whole, and told as before."""

import json
import re

import numpy as np
import pytest

from validate.errors import RecordingError
from validate.recording.mcap import channel_state as seen_module
from validate.recording.mcap import schemas
from validate.recording.mcap.channel_state import _TAIL, ChannelSeen, _looked, pictures
from validate.recording.mcap.records import Channel, Schema
from validate.recording.mcap.schemas import IMAGE, decode, image_message

# private: _TAIL: the last bytes of a message.
# private: _looked: one message of a batch.
# private: _shapes: called alone, case by case.

GREY = [np.random.default_rng(i).integers(0, 255, (30, 40)).astype(np.uint8) for i in range(40)]


def messages(frame: str = "probe") -> list[bytes]:
    made = (image_message(10**9 + i, frame, image) for i, image in enumerate(GREY))
    return [json.dumps(one, separators=(",", ":")).encode() for one in made]


def seen(data: list[bytes]) -> ChannelSeen:
    found = ChannelSeen(Channel(1, 1, "/us", "json", {}), Schema(1, IMAGE, "jsonschema", b"{}"))
    found.take(data)
    return found


def test_pictures_that_are_alike_are_one_batch() -> None:
    found = pictures(messages())
    assert found is not None
    assert (found.frame, found.shape) == ("probe", (30, 40))
    assert found.stamps_ns.tolist() == [10**9 + i for i in range(40)]
    whole = seen(messages())
    assert (whole.count, whole.error) == (40, "")
    assert whole.numbers == 40 * 150  # float64 of 1200 bytes
    stamps = whole.stamps_ns()
    assert stamps is not None
    assert stamps.tolist() == found.stamps_ns.tolist()


@pytest.mark.parametrize("frame", ['a "probe"', "a:b", "Sonde \u00e4"])
def test_an_odd_frame_is_looked_at_whole(frame: str) -> None:
    assert pictures(messages(frame)) is None
    assert seen(messages(frame)).count == 40


@pytest.mark.parametrize(("change", "why"), [
    (lambda m: m.replace(b'"png"', b'"jpg"'), "image format 'jpg'"),
    (lambda m: m[:-30] + m[-22:], "field 'data' is not base64|damaged PNG"),
    (lambda m: m.replace(b"iVBORw0KGgo", b"jVBORw0KGgo"), "not a PNG"),
    (lambda m: m.replace(b"UgAAACgAAAAe", b"UgAAACkAAAAe"), "wrong CRC of the chunk"),
    (lambda m: m[:-1], "not readable JSON"),
    (lambda m: m.replace(b'"frame_id"', b'"frame"'), "field 'frame_id' is missing"),
])  # fmt: skip
def test_the_first_odd_message_is_named(change: object, why: str) -> None:
    data = messages()
    assert change(data[20]) != data[20]  # type: ignore[operator]
    data[20] = change(data[20])  # type: ignore[operator]
    assert pictures(data) is None
    found = seen(data)
    assert found.error.startswith("'/us' message 20: ")
    assert re.search(why, found.error)


def test_images_of_other_sizes_are_told() -> None:
    data = messages()
    other = image_message(2 * 10**9, "probe", np.zeros((8, 9), np.uint8))
    data[30] = json.dumps(other, separators=(",", ":")).encode()
    assert pictures(data) is None
    assert seen(data)._shapes == {(30, 40), (8, 9)}


def test_a_run_still_finds_wrong_pixels() -> None:
    """An inspection does not unpack; `decode`, which a run reads by, does."""
    data = messages()
    data[5] = data[5][:400] + (b"A" if data[5][400:401] != b"A" else b"B") + data[5][401:]
    assert pictures(data) is not None
    with pytest.raises(RecordingError, match="wrong CRC of the chunk"):
        decode(IMAGE, data[5])


def test_a_batch_whose_pictures_only_begin_alike_is_none() -> None:
    """Every picture has the same wrong header, and then the last characters are no base64."""
    wrong = [m.replace(b"UgAAACgAAAAe", b"UgAAACkAAAAe") for m in messages()]
    assert wrong[0] != messages()[0]
    assert pictures(wrong) is None
    data = messages()[0]
    end = len(data) - len(_TAIL)
    assert _looked(data) is not None
    assert _looked(data[: end - 4] + b"=AAA" + data[end:]) is None


def test_an_image_too_large_for_a_message_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(schemas, "MAX_MESSAGE", 2000)
    with pytest.raises(RecordingError, match=r"image \(30, 40\): \d+ bytes .* 2000"):
        image_message(0, "probe", GREY[0])


def test_outlines_of_two_points_are_reported_with_their_message(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(seen_module, "pose_of", lambda *_: np.eye(4))
    found = ChannelSeen(
        Channel(1, 1, "/o", "json", {}), Schema(1, schemas.CONTOUR, "jsonschema", b"{}")
    )
    ring = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    outlines = [schemas.contour_message(i, "a", ring[:n], 0.0) for i, n in enumerate((3, 2, 1))]
    found.take([json.dumps(one).encode() for one in outlines])
    assert (found.error, found.count) == ("", 3)
    with pytest.raises(RecordingError, match=r"'/o': contours: outline 1.*than 3 points"):
        found.stream(np.arange(3), {})
