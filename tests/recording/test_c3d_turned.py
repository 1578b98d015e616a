"""C3D in the byte order of SGI, written here number by number, against an independent reader."""

import struct
from pathlib import Path

import c3d
import numpy as np
import pytest

from validate.errors import RecordingError
from validate.recording.motion_capture.c3d import read_c3d

pytestmark = pytest.mark.usefixtures("decoded_here")

SCALE, RATE, SGI, INTEL = 0.05, 60.0, 86, 84
GAIN, OFFSET = 0.25, 100  # of the analog channel


def block(raw: bytes) -> bytes:
    return raw.ljust(-(-len(raw) // 512) * 512, b"\0")


class Section:
    """A parameter section of the C3D user guide, in an order of bytes."""

    def __init__(self, order: str) -> None:
        self.order, self.raw = order, b""

    def group(self, number: int, name: str) -> None:
        self.raw += struct.pack("bb", len(name), -number) + name.encode()
        self.raw += struct.pack(f"{self.order}h", 3) + b"\0"

    def parameter(
        self, number: int, name: str, kind: int, shape: tuple[int, ...], data: bytes
    ) -> None:
        body = struct.pack("bB", kind, len(shape)) + bytes(shape) + data + b"\0"
        self.raw += struct.pack("bb", len(name), number) + name.encode()
        self.raw += struct.pack(f"{self.order}h", 2 + len(body)) + body

    def words(self, number: int, name: str, words: list[str]) -> None:
        longest = max(map(len, words))
        text = "".join(w.ljust(longest) for w in words).encode()
        self.parameter(number, name, -1, (longest, len(words)), text)

    def whole(self, number: int, name: str, *values: int) -> None:
        self.parameter(
            number, name, 2, (len(values),), struct.pack(f"{self.order}{len(values)}h", *values)
        )

    def real(self, number: int, name: str, *values: float) -> None:
        self.parameter(
            number, name, 4, (len(values),), struct.pack(f"{self.order}{len(values)}f", *values)
        )


def made(path: Path, order: str, floats: bool) -> np.ndarray:
    """Three frames of two points, the second not seen in the second frame, and one channel of two
    samples a frame; returns the points (3, 2, 3) mm."""
    s = Section(order)
    scale = -SCALE if floats else SCALE
    s.group(1, "POINT")
    s.whole(1, "USED", 2)
    s.real(1, "SCALE", scale)
    s.real(1, "RATE", RATE)
    s.whole(1, "FRAMES", 3)
    s.words(1, "LABELS", ["TIP", "HEEL"])
    s.words(1, "DESCRIPTIONS", ["-", "-"])
    s.words(1, "UNITS", ["mm"])
    s.whole(1, "DATA_START", 4)
    s.group(2, "ANALOG")
    s.whole(2, "USED", 1)
    s.words(2, "LABELS", ["LOAD"])
    s.words(2, "DESCRIPTIONS", ["-"])
    s.words(2, "UNITS", ["N"])
    s.real(2, "SCALE", GAIN)
    s.real(2, "GEN_SCALE", 1.0)
    s.whole(2, "OFFSET", OFFSET)
    s.real(2, "RATE", 2 * RATE)
    head = struct.pack(f"{order}BBHHHHHfHHf", 2, 80, 2, 2, 1, 3, 10, scale, 4, 2, RATE)
    section = bytes([1, 80, 2, SGI if order == ">" else INTEL]) + s.raw + b"\0\0"
    whole = np.arange(18).reshape(3, 2, 3) * 7 - 40
    data = b""
    for k in range(3):
        for p in range(2):
            seen = (k, p) != (1, 1)
            place = (whole[k, p] * SCALE if floats else whole[k, p]) if seen else np.zeros(3)
            word = 0 if seen else -1
            data += struct.pack(f"{order}4f" if floats else f"{order}4h",
                                *(place if floats else place.astype(int)), word)  # fmt: skip
        load = [OFFSET + 10 * k, OFFSET + 10 * k + 5]
        data += struct.pack(f"{order}2f" if floats else f"{order}2h", *load)
    path.write_bytes(block(head) + block(section).ljust(1024, b"\0") + data.ljust(512, b"\0"))
    x = whole * SCALE
    x[1, 1] = np.nan
    return x


@pytest.mark.parametrize("floats", [True, False])
@pytest.mark.parametrize("order", ["<", ">"])
def test_both_orders_are_one_trial(order: str, floats: bool, tmp_path: Path) -> None:
    path = tmp_path / "x.c3d"
    x = made(path, order, floats)
    with path.open("rb") as file:
        frames = list(c3d.Reader(file).read_frames())
    theirs = np.array([points[:, :3] for _, points, _ in frames])
    seen = np.isfinite(x)
    assert theirs[seen] == pytest.approx(x[seen], rel=1e-6)
    got = read_c3d(path, {})
    markers = got.marker("markers")
    assert markers.names == ("TIP", "HEEL")
    assert np.array_equal(np.isfinite(markers.x), seen)
    assert 1e3 * markers.x[seen] == pytest.approx(x[seen], rel=1e-6)
    assert markers.t == pytest.approx(np.arange(3) / RATE)
    load = got.signal("analog/LOAD", "N")
    assert load.y.ravel() == pytest.approx(GAIN * np.array([0, 5, 10, 15, 20, 25]))
    assert load.t == pytest.approx(np.arange(6) / (2 * RATE))
    channel = np.array([analog.ravel() for *_, analog in frames]).ravel()
    assert channel == pytest.approx(load.y.ravel())


def test_one_that_is_cut_is_a_line(tmp_path: Path) -> None:
    path = tmp_path / "x.c3d"
    made(path, ">", True)
    whole = path.read_bytes()
    for size in range(8, len(whole) - 400, 37):
        path.write_bytes(whole[:size])
        with pytest.raises(RecordingError):
            read_c3d(path, {})
