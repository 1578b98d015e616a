"""Tracked sequences as the PLUS toolkit writes them, small."""

import zlib
from collections.abc import Collection, Mapping

import numpy as np

from validate.arrays import Floats

TURN = "0 -1 0 10 1 0 0 -2e-005 0 0 1 1e3 0 0 0 1"


def tracked(
    frames: int = 3,
    *,
    lost: tuple[int, ...] = (),
    pixels: bool = True,
    spacing: str = "0.1 0.2 1",
    compressed: bool = True,
    last: str = "LOCAL",
    comment: str = "",
) -> bytes:
    """A stylus that is INVALID in the frames `lost`, images of 5 x 4 px with their frame's number
    in the first pixel."""
    data = images(frames).tobytes() if pixels else b""
    packed = zlib.compress(data) if compressed else data
    size = f"5 4 {frames}" if pixels else f"0 0 {frames}"
    lines = [
        "ObjectType = Image", "NDims = 3", f"CompressedData = {compressed and pixels}",
        f"Comment = {comment}", f"DimSize = {size}    ", f"ElementSpacing = {spacing}",
        f"ElementType = {'MET_UCHAR' if pixels else 'MET_OTHER'}",
    ]  # fmt: skip
    for i in range(frames):
        name = f"Seq_Frame{i:04d}"
        lines += [
            f"{name}_StylusToReferenceTransform = {TURN} ",
            f"{name}_StylusToReferenceTransformStatus = {'INVALID' if i in lost else 'OK'}",
            f"{name}_Timestamp = {280.4 + 0.1 * i}",
        ]
    text = "\n".join([*lines, f"ElementDataFile = {last}"]) + "\n"
    return text.encode() + (packed if pixels and last == "LOCAL" else b"")


def images(frames: int) -> np.ndarray:
    found = np.random.default_rng(0).integers(0, 255, (frames, 4, 5)).astype(np.uint8)
    found[:, 0, 0] = np.arange(frames)
    return found


def sequence(poses: Mapping[str, Floats], rate: float, lost: Collection[int] = ()) -> bytes:
    """Transforms (n, 4, 4) mm by name, no images; INVALID, and far off, in the frames `lost`."""
    count = len(next(iter(poses.values())))
    lines = ["ObjectType = Image", "NDims = 3", f"DimSize = 0 0 {count}", "ElementType = MET_OTHER"]
    for i in range(count):
        for name, T in poses.items():
            numbers = 9.0 * T[i] * [1, 1, 1, 0] + T[i] * [0, 0, 0, 1] if i in lost else T[i]
            words = " ".join(f"{v:.9g}" for v in numbers.ravel())
            lines.append(f"Seq_Frame{i:04d}_{name}Transform = {words}")
            lines.append(
                f"Seq_Frame{i:04d}_{name}TransformStatus = {'INVALID' if i in lost else 'OK'}"
            )
        lines.append(f"Seq_Frame{i:04d}_Timestamp = {100 + i / rate:.6f}")
    return ("\n".join([*lines, "ElementDataFile = LOCAL"]) + "\n").encode()
