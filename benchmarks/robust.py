"""Readers under attack: the longest refusal and the most memory of each, over the same damage.

python benchmarks/robust.py [CUTS FLIPS] [NAME ...]    default 200 2000, all readers and bodies

Every reader has a process of its own: it reads its sample whole, then cut at CUTS places, with
FLIPS turned bits and half as many forged numbers, then 4 GB of zeros behind the sample's beginning
and behind nothing. A reader that decodes in a process apart gets a fortieth of it, as each call
starts Python; one that fills a surface a two-hundredth. Seconds are those of the wall; memory is
what the largest process took beyond what the whole sample took, in itself (VmHWM) or apart
(`ru_maxrss` of its children). Ends with 1 where anything else than a typed error was raised.
"""

import json
import os
import resource
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

TESTS = Path(__file__).resolve().parents[1] / "tests"
for folder in (TESTS, TESTS / "recording", TESTS / "scene"):
    sys.path.insert(0, str(folder))

import test_bodies_robust
import test_readers
import test_robust
from attacks import damaged

from validate.errors import ValidateError
from validate.recording.readers import READERS
from validate.scene.mesh_files.mesh_file import SUFFIXES as SURFACES

SPARSE = 4 * 2**30  # bytes
BODIES = tuple(f"body {name}" for name in test_bodies_robust.MAKE)
NAMES = (*(r.name for r in READERS), *BODIES)
APART = {*test_robust.APART, *(f"body {name}" for name in test_bodies_robust.APART)}


def reading(name: str, folder: Path) -> tuple[Path, Callable[[], object]]:
    """A sample's file that is attacked, and what reads it."""
    if name in BODIES:
        path = folder / name.removeprefix("body ")
        test_bodies_robust.MAKE[path.name](path)
        return path, lambda: test_bodies_robust.read(path)
    reader = next(r for r in READERS if r.name == name)
    path, options = test_readers.sample(reader, folder)
    return test_readers.files_of(path)[0], lambda: reader.read(path, options)


def attacks(path: Path, cuts: int, flips: int) -> Iterator[str]:
    """Writes one damaged file after another, and names what was done to it."""
    whole = path.read_bytes()
    for data in damaged(whole, cuts, flips):
        path.write_bytes(data)
        yield "damage"
    for begins in (whole, b""):
        path.write_bytes(begins)
        os.truncate(path, SPARSE)
        yield "4 GB of zeros"


def peaks() -> tuple[float, float]:
    """MB: the most that this process and its largest child have taken."""
    status = Path("/proc/self/status").read_text()
    own = int(status.split("VmHWM:")[1].split()[0]) / 1e3
    return own, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1e3


def one(name: str, cuts: int, flips: int) -> dict[str, object]:
    """The attacks on one reader, in this process."""
    share = 200 if name.endswith(SURFACES) else 40 if name in APART else 1
    with TemporaryDirectory() as folder:
        path, read = reading(name, Path(folder))
        begin = perf_counter()
        read()
        whole, before = perf_counter() - begin, peaks()
        count, refused, untyped, worst = 0, 0, list[str](), (0.0, "")
        for what in attacks(path, cuts // share, flips // share):
            begin = perf_counter()
            try:
                read()
            except ValidateError:
                refused += 1
            except Exception as error:
                untyped.append(f"{what}: {error!r:.80}")
            count += 1
            worst = max(worst, (perf_counter() - begin, what))
        more = [after - then for after, then in zip(peaks(), before, strict=True)]
    return {"name": name, "cases": count, "refused": refused, "untyped": untyped,
            "whole": whole, "worst": worst[0], "what": worst[1], "MB": max(more)}  # fmt: skip


def main(words: list[str]) -> int:
    if words[:1] == ["--one"]:
        print(json.dumps(one(words[1], int(words[2]), int(words[3]))))
        return 0
    cuts, flips, *names = (*map(int, words[:2]), *words[2:]) if words else (200, 2000)
    print(f"{'reader':<16}{'cases':>7}{'refused':>9}{'untyped':>9}{'whole / s':>11}"
          f"{'worst / s':>11}{'beyond / MB':>13}  at")  # fmt: skip
    wrong = 0
    for name in names or NAMES:
        done = subprocess.run([sys.executable, __file__, "--one", str(name), str(cuts), str(flips)],
                              capture_output=True, text=True)  # fmt: skip
        if done.returncode:
            print(f"{name}: ended with {done.returncode}: {done.stderr[-2000:]}")
            wrong += 1
            continue
        row = json.loads(done.stdout.splitlines()[-1])
        wrong += len(row["untyped"])
        counts = f"{row['cases']:>7}{row['refused']:>9}{len(row['untyped']):>9}"
        cost = f"{row['whole']:>11.3f}{row['worst']:>11.3f}{row['MB']:>13.1f}"
        print(f"{row['name']:<16}{counts}{cost}  {row['what']}", flush=True)
        for said in row["untyped"][:3]:
            print(f"    {said}")
    return int(wrong > 0)


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
