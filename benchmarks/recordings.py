"""Inspection of long recordings of ours beside a bare reader of the same file, both checking CRCs.

python benchmarks/recordings.py [SAMPLES FRAMES IMAGES]    default 1000000 50000 5000

The files are made in a temporary folder: samples of one number and frames of 20 markers in one,
images of some 50 kB a message in another. Every reading is a process of its own, in turns; least
seconds of the wall and of the processor (hashing has a thread of its own), without imports, and
largest memory of the process, of five. "Bare" is
`NonSeekingReader` of the `mcap` package, which parses no message. Linux: `ru_maxrss` of a child
would begin at its parent's, so the peak is the kernel's VmHWM.
"""

import json
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from validate.recording.mcap.write import write_recording
from validate.recording.types import Frames, Markers, Recording, Signal, Source

TURNS = 5
SIDE = 276  # px: noise of 6 grey levels packs to some 50 kB
MARKERS = 20
_MEASURE = """
import json, sys
from pathlib import Path
from time import perf_counter, process_time
{load}
for name in reversed(sys.argv[1:]):  # a small file first, which loads what is loaded late
    path, begin, start = Path(name), perf_counter(), process_time()
    count = {count}
status = Path("/proc/self/status").read_text()
peak = int(status.split("VmHWM:")[1].split()[0]) / 1e3
print(json.dumps([perf_counter() - begin, process_time() - start, peak, count]))
"""
KINDS = {
    "bare": _MEASURE.format(
        load="from mcap.reader import NonSeekingReader",
        count="sum(1 for _ in NonSeekingReader(path.open('rb'), validate_crcs=True)"
        ".iter_messages(log_time_order=False))",
    ),
    "inspect": _MEASURE.format(
        load="from validate.recording.preflight import Inspection",
        count="Inspection.of(path).messages",
    ),
    "sha256": _MEASURE.format(
        load="import hashlib", count="len(hashlib.sha256(path.read_bytes()).digest())"
    ),
}


def long(path: Path, samples: int, frames: int) -> None:
    """A force at 1 kHz, and markers over the same time."""
    rng = np.random.default_rng(0)
    t = np.arange(samples) / 1e3
    seen = np.arange(frames) * (samples / 1e3 / frames)
    force = Signal(t, np.sin(t)[:, None] + rng.normal(0, 0.01, (samples, 1)), "N", 0.01, "plate")
    x = rng.normal(0, 0.1, (1, MARKERS, 3)) + rng.normal(0, 1e-3, (frames, MARKERS, 3))
    names = tuple(f"m{i}" for i in range(MARKERS))
    markers = Markers(seen, names, x, 1e-4, "camera")
    made = Recording("long", Source("", "", 0, ""), 10**18, {"/m": markers}, {"/f": force})
    write_recording(made, path)


def pictures(path: Path, images: int) -> None:
    """B-mode images of noise at 50 Hz."""
    rng = np.random.default_rng(0)
    grey = [rng.normal(90, 6, (SIDE, SIDE)).clip(0, 255).astype(np.uint8) for _ in range(images)]
    frames = Frames(np.arange(images) / 50, tuple(grey), (1e-4, 1e-4), np.eye(4), "probe")
    source = Source("", "", 0, "")
    write_recording(Recording("images", source, 10**18, frames={"/us": frames}), path)


def measured(path: Path, small: Path) -> dict[str, tuple[float, float, float, int]]:
    """Seconds of the wall and of the processor, MB and messages by kind."""
    found: dict[str, list[tuple[float, float, float, int]]] = {kind: [] for kind in KINDS}
    for _ in range(TURNS):
        for kind, code in KINDS.items():
            said = subprocess.run(
                [sys.executable, "-c", code, str(path), str(small)],
                check=True,
                capture_output=True,
                text=True,
            )
            found[kind].append(tuple(json.loads(said.stdout)))
    return {
        kind: (min(o[0] for o in own), min(o[1] for o in own), max(o[2] for o in own), own[0][3])
        for kind, own in found.items()
    }


def main(samples: int, frames: int, images: int) -> None:
    print("| file | MB | messages | what | wall / s | of bare | CPU / s | of bare | peak / MB |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    with TemporaryDirectory() as folder:
        files = {name: Path(folder) / f"{name}.mcap" for name in ("long", "images")}
        long(files["long"], samples, frames)
        pictures(files["images"], images)
        smalls = {name: Path(folder) / f"{name}-small.mcap" for name in files}
        long(smalls["long"], 1000, 100)
        pictures(smalls["images"], 10)
        for name, path in files.items():
            found, size = measured(path, smalls[name]), path.stat().st_size / 1e6
            wall, own = found["bare"][:2]
            for kind, (seconds, cpu, peak, _) in found.items():
                times = f"{seconds:.2f} | {seconds / wall:.2f} | {cpu:.2f} | {cpu / own:.2f}"
                row = f"{found['bare'][3]} | {kind} | {times} | {peak:.0f}"
                print(f"| {name} | {size:.0f} | {row} |", flush=True)


if __name__ == "__main__":
    main(*(map(int, sys.argv[1:4]) if len(sys.argv) > 3 else (1_000_000, 50_000, 5000)))
