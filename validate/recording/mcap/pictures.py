"""Messages of images as this package writes them, looked at without unpacking their pixels.

An inspection reads head and end: the JSON around the picture, its size in the PNG's header, and
that the PNG ends. What stands between is covered by the file's own checksums; a run, which needs
the pixels, unpacks and checks them all.
"""

import base64
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from validate.arrays import Ints
from validate.errors import RecordingError
from validate.recording.images.image import png_size
from validate.recording.mcap.schemas import MAX_MESSAGE

_HEAD = re.compile(
    rb'\{"timestamp":\{"sec":(\d{1,10}),"nsec":(\d{1,9})\},"frame_id":"([^"\\:]{0,200})","data":"'
)
_TAIL = b'","format":"png"}'
_HEADER, _END = 44, 24  # characters: signature with IHDR; what holds the last chunk
_LAST = b"\0\0\0\0IEND\xaeB`\x82"
_LAST_SECOND = 2**63 // 10**9


@dataclass(frozen=True)
class Pictures:
    """Messages that agree: stamps (n,) ns, frame, and (h, w) px of every image."""

    stamps_ns: Ints
    frame: str
    shape: tuple[int, int]


def pictures(messages: Sequence[bytes]) -> Pictures | None:
    """The messages as one batch; None where one is odd, or differs from the others."""
    found = [_looked(data) for data in messages]
    seen = {one[1:] for one in found if one is not None}
    if None in found or len(seen) != 1:
        return None
    frame, header = seen.pop()
    try:
        width, height = png_size(base64.b64decode(header))
        name = frame.decode("utf-8")
    except (RecordingError, ValueError):
        return None
    stamps = np.array([one[0] for one in found if one is not None], dtype=np.int64)
    return Pictures(stamps, name, (height, width))


def _looked(data: bytes) -> tuple[int, bytes, bytes] | None:
    """Stamp ns, frame and header of a picture that begins and ends as one."""
    head = _HEAD.match(data)
    if head is None or not data.endswith(_TAIL) or len(data) > MAX_MESSAGE:
        return None
    start, end = head.end(), len(data) - len(_TAIL)
    if (end - start) % 4 or end - start < _HEADER + _END:
        return None
    if data.find(b'"', start, end) >= 0 or not data.isascii() or b"\\" in data:
        return None
    try:
        last = base64.b64decode(data[end - _END : end], validate=True)
    except ValueError:
        return None
    sec, nsec = int(head[1]), int(head[2])
    if not last.endswith(_LAST) or sec >= _LAST_SECOND:
        return None
    return sec * 10**9 + nsec, head[3], data[start : start + _HEADER]
