"""Commands killed at their n-th call of open, write, fsync or rename: the old or the new, whole.

    .venv/bin/python benchmarks/killed.py [COMMAND ...] [--seeded N] [--shipped]

Each command runs in a process that ends without a word at its n-th call below its folder, as by
SIGKILL: every n of a small scene, or N drawn by seed (`--shipped`: of a shipped experiment). After
each, what was there before must be whole or what was to come, and the next run must go on. Exit
code 1 where that is not so.
"""

import _pyio
import argparse
import builtins
import io
import os
import random
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
KILLED = 91  # exit code of a process that was ended at its n-th call
SMALL = """
from dataclasses import dataclass
import numpy as np
from validate.compare.verdict import Accept
from validate.parameters import quantity
from validate.recording.types import Recording, Signal, Source
from validate.register.observation import Role
from validate.pipeline.plates.scene import Compression
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.method import Method
from validate.scene.geometries.specification import Cylinder
from validate.scene.material import Material
from validate.scene.scene import Drive, Scene, Support
from validate.solve.fluid.cavities import NoFluid

EXPERIMENT = Experiment(
    name="small", title="A small cylinder", source="benchmarks/killed.py",
    recording="log.mcap",
    scene=Scene(
        body=Cylinder("30 mm", "20 mm", cells=(2, 2), element="tet10", part="quarter"),
        material=Material(None, 0.499),
        supports=(Support("lower_plate", (2,)),),
        drives=(Drive("stage", "upper_plate", "-z"),),
    ),
    settings=Compression(fit_from=0.0, fit_to=0.03, limit=0.06),
    methods={"slip": Method("linear, slipping plates", NoFluid())},
    accepted=("slip",),
    accept=(Accept("force", 0.5, "half a newton (ours)"),),
)
"""


@dataclass(frozen=True)
class Case:
    """`arguments` of the command in a folder that `prepare` makes, and the one file or folder that
    it writes there, as a pattern."""

    arguments: tuple[str, ...]
    prepare: Callable[[Path], None]
    output: str

    @property
    def place(self) -> Path:
        (found,) = sorted(Path().glob(self.output))
        return found


def forget_cells() -> None:
    """A study begins anew, its page is there."""
    for cells in Path().rglob("cells"):
        shutil.rmtree(cells)


def log(folder: Path) -> None:
    """A testing machine's export, and its recording."""
    rows = [f"{0.1 * i:.1f},{0.008 * i:.4f},{0.7 * i:.3f}" for i in range(160)]
    head = "Test,compression\nTime (s),Displacement (mm),Load (N)\n"
    (folder / "log.csv").write_text(head + "\n".join(rows) + "\n")
    command("import", "log.csv", "-o", "log.mcap")


def small(folder: Path) -> None:
    log(folder)
    (folder / "pyproject.toml").touch()
    (folder / "experiments").mkdir()
    (folder / "experiments" / "small.py").write_text(SMALL)
    (folder / "experiments" / "log.mcap").write_bytes((folder / "log.mcap").read_bytes())


def shipped(folder: Path) -> None:
    (folder / "pyproject.toml").touch()


CASES = {
    "import": Case(("import", "log.csv", "-o", "out.mcap", "--force"), log, "out.mcap"),
    "record": Case(
        ("record", "kf_cube", "-o", "out.mcap", "--force"), shipped, "out.mcap"
    ),
    "run": Case(("run", "small"), small, "reports/small"),
    "study": Case(
        ("study", "tradeoff", "small", "--quick", "--workers", "0"), small,
        "reports/small/study-tradeoff+*",
    ),
    "identify": Case(
        ("identify", "small", "--parameters", "material.E=10kPa:200kPa", "--seeds", "2",
         "--workers", "0"), small, "reports/small/study-identify+*",
    ),
}  # fmt: skip
SHIPPED = {
    "import": CASES["import"],
    "record": CASES["record"],
    "run": Case(("run", "needle_block", "--quick"), shipped, "reports/needle_block+quick*"),
    "study": Case(
        ("study", "tradeoff", "needle_block", "--quick", "--workers", "0"), shipped,
        "reports/needle_block/study-tradeoff+*",
    ),
    "identify": CASES["identify"],
}  # fmt: skip


def command(*arguments: str) -> int:
    """Runs a command in this process, unheard."""
    from validate.commands.main import run

    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
        return run(list(arguments))


@contextmanager
def counting(root: Path, end: int) -> Iterator[list[int]]:
    """Counts calls below `root`, and ends the process at the call of that number (0: never).

    Python's own files of `_pyio` are used, whose every call is one of `os`.
    """
    calls, known = [0], set()
    real = {name: getattr(os, name) for name in ("open", "write", "fsync", "rename", "replace")}

    def count() -> None:
        calls[0] += 1
        if calls[0] == end:
            os._exit(KILLED)

    def below(path: object) -> bool:
        return not isinstance(path, int) and str(root) in str(Path(os.fsdecode(path)).absolute())

    def opened(path, flags, *rest, **more):  # type: ignore[no-untyped-def]
        writes = flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT) and below(path)
        if writes:
            count()
        descriptor = real["open"](path, flags, *rest, **more)
        known.add(descriptor) if writes else known.discard(descriptor)
        return descriptor

    def write(descriptor, data):  # type: ignore[no-untyped-def]
        if descriptor in known:
            count()
        return real["write"](descriptor, data)

    def sync(descriptor):  # type: ignore[no-untyped-def]
        count()
        return real["fsync"](descriptor)

    def moved(name):  # type: ignore[no-untyped-def]
        def call(one, other, **more):  # type: ignore[no-untyped-def]
            if below(one):
                count()
            return real[name](one, other, **more)

        return call

    from validate.report.stored import folder

    exchange = folder.exchange

    def exchanged(one: Path, other: Path) -> bool:
        count()
        done = exchange(one, other)
        count()
        return done

    plain = builtins.open
    os.open, os.write, os.fsync = opened, write, sync
    os.rename, os.replace = moved("rename"), moved("replace")
    builtins.open = io.open = _pyio.open  # type: ignore[assignment]
    folder.exchange = exchanged
    try:
        yield calls
    finally:
        for name, function in real.items():
            setattr(os, name, function)
        builtins.open = io.open = plain
        folder.exchange = exchange


def files(place: Path) -> dict[str, bytes]:
    """Content by name of a file or folder."""
    if place.is_file():
        return {"": place.read_bytes()}
    return {
        str(p.relative_to(place)): p.read_bytes() for p in sorted(place.rglob("*")) if p.is_file()
    }


def left(folder: Path) -> list[str]:
    hidden = (p for p in folder.rglob(".*") if p.is_file() or any(p.iterdir()))
    return sorted(p.name for p in hidden if not p.name.endswith(".lock"))


def fault(case: Case, old: dict[str, bytes]) -> str:
    """Why the output is neither the old nor a whole new one; empty where it is one of them."""
    from validate.checksums import read_sealed
    from validate.errors import ValidateError
    from validate.recording.mcap.read import read_recording

    place = case.place
    now = files(place)
    if {k: v for k, v in now.items() if not k.startswith("cells")} == {
        k: v for k, v in old.items() if not k.startswith("cells")
    }:
        return ""
    try:
        if place.is_dir():
            read_sealed(place / "results.json")
            assert (place / "report.html").read_text().rstrip().endswith("</html>")
            assert {k for k in now if "cells/" not in k} == {k for k in old if "cells/" not in k}
        else:
            read_recording(place)
    except (ValidateError, AssertionError, OSError) as error:
        return f"{type(error).__name__} {error}"
    return ""


def attempt(case: Case, end: int) -> int:
    """The command in a process of its own, ended at a call; how it ended."""
    pid = os.fork()
    if pid == 0:
        code = 1
        try:
            with counting(Path.cwd(), end):
                code = command(*case.arguments)
        finally:
            os._exit(code)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


def calls_of(case: Case) -> int:
    forget_cells()
    with counting(Path.cwd(), 0) as calls:
        command(*case.arguments)
    return calls[0]


def tried(name: str, case: Case, seeded: int, say: Callable[[str], None]) -> int:
    """How many kills left something else than the old or the new, or stopped the next run."""
    with tempfile.TemporaryDirectory() as place:
        os.chdir(place)
        case.prepare(Path(place))
        good = command(*case.arguments)
        total = calls_of(case)
        ends = range(1, total + 1)
        chosen = sorted(random.Random(name).sample(ends, min(seeded, total))) if seeded else ends
        wrong = 0
        for end in chosen:
            forget_cells()
            old = files(case.place)
            code = attempt(case, end)
            why = fault(case, old)
            again = command(*case.arguments)
            rest = left(Path(place))
            if code not in (KILLED, good) or why or again != good or rest:
                wrong += 1
                say(f"  {name} at call {end}: ended {code}; {why}; then {again}, left {rest[:3]}")
        say(f"{name}: {len(chosen)} of {total} calls, {wrong} wrong")
        os.chdir(ROOT)
    return wrong


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("commands", nargs="*", choices=[[], *CASES], metavar="COMMAND")
    parser.add_argument("--seeded", type=int, default=0)
    parser.add_argument("--shipped", action="store_true")
    given = parser.parse_args()
    os.environ["VALIDATE_NO_GL"] = "1"
    cases = SHIPPED if given.shipped else CASES
    names = given.commands or list(cases)
    wrong = [tried(n, cases[n], given.seeded, lambda t: print(t, flush=True)) for n in names]
    return 1 if sum(wrong) else 0


if __name__ == "__main__":
    raise SystemExit(main())
