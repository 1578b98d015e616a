"""Tracked sequences as the PLUS toolkit writes them, small."""

import zlib

import numpy as np

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
