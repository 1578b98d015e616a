"""Sequences that SimpleITK writes and reads, in a process of its own: its SWIG and ezc3d's cannot
share one. `write FOLDER` and `read FILE OUT.npz`."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np

TURN = "0 -1 0 10 1 0 0 -2 0 0 1 1000 0 0 0 1"
PIXELS = np.random.default_rng(0).integers(0, 256, (3, 4, 5)).astype(np.uint8)
OFFSET = {"int16": -100}


def call(*words: object) -> None:
    subprocess.run([sys.executable, __file__, *map(str, words)], check=True)


def name(ending: str, depth: str = "uint8", deep: int = 0, compressed: bool = True) -> str:
    return f"{depth}-{deep}-{'zlib' if compressed else 'raw'}.{ending}"


def write_all(folder: Path) -> None:
    for packed in (False, True):
        for ending in ("mha", "mhd", "seq.nrrd"):
            for deep in (0, 1, 2):
                write(folder, ending, "uint8", deep, packed)
            for depth in ("uint16", "int16", "float32"):
                write(folder, ending, depth, 0, packed)


def write(folder: Path, ending: str, depth: str, deep: int, compressed: bool) -> None:
    """Three images of 5 x 4 px of 0.1 x 0.2 mm, the last INVALID, a probe that is lost in the
    second; `deep` > 0 writes four dimensions."""
    import SimpleITK

    pixels = PIXELS.astype(depth) + np.dtype(depth).type(OFFSET.get(depth, 0))
    stack = np.repeat(pixels[:, None], deep, axis=1) if deep else pixels
    image = SimpleITK.GetImageFromArray(stack, isVector=False)
    image.SetSpacing((0.1, 0.2, 1.0, 1.0)[: image.GetDimension()])
    for i in range(3):
        own = f"Seq_Frame{i:04d}_"
        image.SetMetaData(f"{own}Timestamp", str(5 + 0.1 * i))
        image.SetMetaData(f"{own}ProbeToTrackerTransform", TURN)
        image.SetMetaData(f"{own}ProbeToTrackerTransformStatus", "INVALID" if i == 1 else "OK")
        image.SetMetaData(f"{own}ImageStatus", "INVALID" if i == 2 else "OK")
    SimpleITK.WriteImage(image, str(folder / name(ending, depth, deep, compressed)), compressed)


def read(path: Path, out: Path) -> None:
    """`pixels` (n, h, w) and `texts`, JSON of the header; nothing for a file that ITK refuses."""
    import SimpleITK

    try:
        image = SimpleITK.ReadImage(str(path))
    except RuntimeError:
        return
    pixels = SimpleITK.GetArrayViewFromImage(image)
    if image.GetNumberOfComponentsPerPixel() > 1:  # an axis of the kind `list`
        pixels = np.moveaxis(pixels, -1, 0)
    texts = {key: image.GetMetaData(key).strip() for key in image.GetMetaDataKeys()}
    plain = pixels.reshape(-1, *pixels.shape[-2:])
    np.savez(out, pixels=plain, texts=np.array(json.dumps(texts)))


if __name__ == "__main__":
    what, *paths = sys.argv[1:]
    {"write": write_all, "read": read}[what](*map(Path, paths))
