"""Program of an external simulator: its command, its process with limits, and its version."""

import hashlib
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import distributions
from pathlib import Path

from validate.catalogue import shipped
from validate.errors import UsageError
from validate.plugins import Registry, kind_fault

# --- External simulators by name: `validate run NAME --external felupe`.


@dataclass(frozen=True)
class Simulator:
    """An external simulator: its name, what it is, the `command` that is called with a folder
    (docs/how-to/external-simulators.md), and the `programs` that the command starts."""

    name: str
    doc: str
    command: str
    programs: tuple[str, ...] = ()


_FORMER_PATH = re.compile(r"benchmarks/guests/(\w+)_guest\.")  # read for one version


def _shipped(name: str, doc: str, *programs: str) -> Simulator:
    return Simulator(name, doc, f"python benchmarks/external/{name}_simulator.py", programs)


SIMULATORS: Registry[Simulator] = Registry(
    "simulators",
    (
        _shipped("calculix", "CalculiX", "ccx"),
        _shipped("febio", "FEBio", "febio4"),
        _shipped("felupe", "FElupe"),
        _shipped("mujoco", "MuJoCo"),
        _shipped("newton", "NVIDIA Newton"),
        _shipped("sofa", "SOFA", "runSofa"),
    ),
    lambda simulator: simulator.name,
    lambda part: kind_fault(part, Simulator),
)


def simulator_of(command: str) -> Simulator | None:
    """Return the simulator of this name, or that of this command; None where there is none."""
    known = (command, _without_former_path(command))
    return next((s for s in SIMULATORS if s.name == command or s.command in known), None)


# --- The program runs in a process group with limits; its home is one folder.

_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
_CACHES = (
    "XDG_CACHE_HOME", "XDG_CONFIG_HOME", "XDG_DATA_HOME", "XDG_STATE_HOME", "MPLCONFIGDIR",
    "NUMBA_CACHE_DIR", "PYTHONPYCACHEPREFIX", "WARP_CACHE_PATH", "CUDA_CACHE_PATH",
)  # fmt: skip
_SAID, _PEAK = "said.txt", "peak.txt"
_LAST_WORDS = 2000  # bytes of what it printed that are read


@dataclass(frozen=True)
class Limits:
    """`seconds` of wall time, `memory` bytes of each of its processes, `output` bytes of all files
    in its folder."""

    seconds: float
    memory: int
    output: int


@dataclass(frozen=True)
class Ended:
    """After `seconds` s of wall time; `why` is empty where it ended well, `said` its last line,
    `memory` bytes the peak of the largest of its processes (0: it was ended before)."""

    seconds: float
    why: str
    said: str
    memory: int = 0


def words(command: str) -> tuple[str, ...]:
    """Return a command line, or the name of a simulator, as words: `python` is the one that runs
    this, and files of the current folder stand by their whole path, else those that came with the
    package.

    Raises `UsageError` for a program that is not there.
    """
    try:
        given = shlex.split(command)
    except ValueError as error:
        raise UsageError(f"command {command!r}: {error}") from None
    if not given:
        raise UsageError(
            "no command of the external simulator; give "
            "methods.NAME.command='python my_simulator.py'"
        )
    program = sys.executable if given[0] == "python" else shutil.which(given[0])
    if program is None and len(given) == 1 and (known := simulator_of(given[0])):
        return words(known.command)
    if program is None:
        raise UsageError(f"command {command!r}: not installed: there is no program '{given[0]}'")
    return str(Path(program).absolute()), *(_whole(word) for word in given[1:])


def _whole(word: str) -> str:
    for path in (Path(word), shipped().parent / word):
        if path.is_file():
            return str(path.absolute())
    now = _without_former_path(word)
    path = shipped().parent / now
    if now == word or not path.is_file():
        return word
    warnings.warn(f"{word} is called {now} now", DeprecationWarning, stacklevel=2)
    return str(path.absolute())


def _without_former_path(command: str) -> str:
    """Return a command with today's path of a shipped script."""
    return _FORMER_PATH.sub(r"benchmarks/external/\1_simulator.", command)


def run_program(command: Sequence[str], folder: Path, limits: Limits) -> Ended:
    """Run a command with the folder as its last argument until it ends or a limit ends it.

    Whatever of its process group is left then is ended too. The limit of memory is each process's;
    what it writes outside of the folder is not watched.
    """
    apart = (sys.executable, "-I", str(Path(__file__).with_name("limits.py")))
    # Home, temporary files and caches in the folder; one thread
    places = {name: folder / ".home" / name.lower() for name in _CACHES}
    places |= {"HOME": folder / ".home"} | dict.fromkeys(("TMPDIR", "TMP", "TEMP"), folder / ".tmp")
    for place in places.values():
        place.mkdir(parents=True, exist_ok=True)
    surroundings = {
        **os.environ,
        **dict.fromkeys(_THREADS, "1"),
        **{name: str(place) for name, place in places.items()},
        "PWD": str(folder),
    }
    start = time.monotonic()
    with (folder / _SAID).open("wb") as said:
        process = subprocess.Popen(
            [*apart, str(limits.memory), str(limits.output), _PEAK, *command, str(folder)],
            cwd=folder,
            env=surroundings,
            stdin=subprocess.DEVNULL,
            stdout=said,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
    try:
        why = _watched(process.pid, folder, limits, start)
    finally:  # before it is reaped: its number is nobody else's
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    seconds = time.monotonic() - start
    if not why:
        code = process.returncode
        if code >= 0:
            why = f"ended with code {code}" if code else ""
        elif -code == signal.SIGXFSZ:
            why = "stopped at the limit of its output"
        else:
            why = f"stopped by signal {-code} ({signal.Signals(-code).name})"
    # Its peak in bytes; 0 if the file is damaged, since the program can write it, too
    text = _last_line(folder / _PEAK)
    peak = int(text) if text.isdecimal() and len(text) < 16 else 0
    return Ended(seconds, why, _last_line(folder / _SAID), peak)


def _watched(pid: int, folder: Path, limits: Limits, start: float) -> str:
    """Waits; why it has to be ended, empty where it ended by itself."""
    pause = 0.002
    while os.waitid(os.P_PID, pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None:
        if time.monotonic() - start > limits.seconds:
            return f"over the limit of {limits.seconds:g} s, stopped"
        if size_of(folder) > limits.output:
            break
        time.sleep(pause)
        pause = min(0.1, 1.5 * pause)
    if (size := size_of(folder)) > limits.output:
        return f"{size} bytes in its folder, the limit is {limits.output}"
    return ""


def size_of(folder: Path) -> int:
    """Bytes of all files below a folder, as they are now; links are not followed."""
    total = 0
    for where, _, files in os.walk(folder, onerror=None):
        for name in files:
            try:
                total += os.lstat(Path(where) / name).st_size
            except OSError:  # gone since
                continue
    return total


def _last_line(path: Path) -> str:
    if path.is_symlink() or not path.is_file():
        return ""
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - _LAST_WORDS))
        lines = file.read(_LAST_WORDS).decode("utf-8", "replace").splitlines()
    return next((plain(line) for line in reversed(lines) if line.strip()), "")


def plain(text: str, most: int = 200) -> str:
    """One printable line of what a stranger wrote."""
    line = " ".join(text[: 4 * most].split())
    return "".join(c for c in line if c.isprintable())[:most]


# -------------------------------------------------------------------------------------------------

_MOST_FILES, _MOST_BYTES = 200, 256 * 2**20  # beside a program that are looked at


def version_of(command: str) -> str:
    """SHA-256 of a command, its program, the files that it names and those beside them, the
    programs that its simulator declares, and the packages installed for this Python; "" where that
    does not tell what runs: the command names no file, or too many lie beside it."""
    try:
        program, *others = words(command)
    except UsageError as error:  # its run is refused for this
        return str(error)
    named = [Path(word) for word in others if Path(word).is_file()]
    script = program == str(Path(sys.executable).absolute())
    if script and not named:
        return ""
    beside = {file for one in named for file in one.parent.iterdir() if file.is_file()}
    known = simulator_of(command)
    started = [shutil.which(name) for name in (known.programs if known else ())]
    files = sorted({Path(program), *beside, *(Path(name) for name in started if name)})
    if len(files) > _MOST_FILES or sum(file.stat().st_size for file in files) > _MOST_BYTES:
        return ""
    found = hashlib.sha256(" ".join((program, *others)).encode())
    for file in files:
        found.update(str(file).encode() + hashlib.sha256(file.read_bytes()).digest())
    installed = sorted(f"{d.name} {d.version}" for d in distributions()) if script else ()
    found.update(" ".join(installed).encode())
    return found.hexdigest()
