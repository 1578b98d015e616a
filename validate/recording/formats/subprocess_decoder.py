"""Decoding of third-party files in a subprocess.

A library in C that crashes on a damaged file, hangs, ends the interpreter or takes all memory then
costs one line. What it found comes back as plain arrays, read without pickle. The process is
isolated: nothing that lies beside the file, or in the current folder, is imported.
"""

import json
import resource
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.child_process import clean_environment, python_module
from validate.errors import RecordingError, UsageError, ValidateError
from validate.files import members
from validate.installation import install_command

Arrays = Mapping[str, NDArray[Any]]

_HOME = "validate.recording.formats"
_SAID, _MISSING = 3, 4  # exit codes of the process: a known error, a library that is not installed
_MEMORY, _TIMES = 2**30, 40  # bytes beyond so many times the file's
_SECONDS, _RATE = 1, 2**18  # s of the processor once it is loaded, and bytes a second beside
_LOADING, _SHARED = 20, 5  # s of the wall, and times the processor's on a busy machine
_OURS = "="  # before every name: savez has arguments called file and allow_pickle


def decoded(
    decoder: str,
    path: Path,
    given: Mapping[str, float] | None = None,
    seconds: int = _SECONDS,
    extra: str = "",
) -> dict[str, NDArray[Any]]:
    """What `arrays(path, **given)` of the module `decoder` gives, one beside this file or named in
    full, within `seconds` s of the processor and four more for each MB.

    Libraries that the module names in LIBRARIES are loaded before that time begins, and before
    memory is limited to its MEMORY bytes beyond them and the file's, where it names that.

    Raises `UsageError` with what to install where a library (of the `extra`) is absent, else
    `RecordingError` naming the file: what the decoder said, or how its process ended.
    """
    with tempfile.TemporaryDirectory(prefix="validate-") as folder:
        out = Path(folder) / "arrays.npz"
        done = _ended(decoder, path, out, given or {}, seconds)
        line = " ".join(done.stdout.decode("utf-8", "replace").split())[:300]
        if done.returncode == _MISSING:
            raise UsageError(f"{path.name}: {line}; {install_command(extra)}")
        if done.returncode == _SAID:
            raise RecordingError(f"{path.name}: {line}")
        if done.returncode == -signal.SIGPROF:
            raise RecordingError(f"{path.name}: {_late(_allowed(path, seconds), path)}")
        if done.returncode or not out.is_file():
            how = f"signal {-done.returncode}" if done.returncode < 0 else f"code {done.returncode}"
            raise RecordingError(
                f"{path.name}: its reader ended with {how}: the file is damaged, or not of the "
                f"type that its name claims"
            )
        with np.load(out, allow_pickle=False) as found:
            return {name.removeprefix(_OURS): found[name] for name in found.files}


def _bytes(path: Path) -> int:
    """Of a file, or of all files of a folder."""
    files = members(path) if path.is_dir() else (path,)
    return sum(file.stat().st_size for file in files if file.is_file())


def _allowed(path: Path, least: int) -> float:
    return least + _bytes(path) / _RATE


def _late(seconds: float, path: Path) -> str:
    size = _bytes(path)
    return f"its reader was stopped after {seconds:.0f} s for {size} bytes; the file may be damaged"


def _ended(
    decoder: str, path: Path, out: Path, given: Mapping[str, float], least: int
) -> subprocess.CompletedProcess[bytes]:
    seconds = _allowed(path, least)
    limits = _MEMORY + _TIMES * _bytes(path), seconds
    wall = _LOADING + _SHARED * seconds
    try:
        return subprocess.run(
            python_module(
                f"{_HOME}.subprocess_decoder",
                decoder,
                str(path.absolute()),
                str(out),
                json.dumps(limits),
                json.dumps(dict(given)),
            ),
            cwd=out.parent,
            env=clean_environment(out.parent),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            timeout=wall,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise RecordingError(f"{path.name}: {_late(wall, path)}") from None


def _decode(decoder: str, path: Path, out: Path, limits: str, given: str) -> int:
    limit, seconds = json.loads(limits)
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    try:
        module = import_module(decoder if "." in decoder else f"{_HOME}.{decoder}")
        for name in getattr(module, "LIBRARIES", ()):
            import_module(name)
        # A module that names its MEMORY may take that, and what its file may need, beyond what is
        # taken now, where the kernel tells.
        more, taken = getattr(module, "MEMORY", None), Path("/proc/self/statm")
        if more is not None and taken.is_file():
            pages = int(taken.read_text().split()[0])
            more += _TIMES * _bytes(path)
            limit = min(limit, pages * resource.getpagesize() + more)
            resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
        signal.setitimer(signal.ITIMER_PROF, seconds)  # its signal ends what is in C, too
        arrays: Arrays = module.arrays(path, **json.loads(given))
    except ImportError as missing:
        print(f"the library '{missing.name}' that reads this format is not installed")
        return _MISSING
    except MemoryError:
        print(
            f"its reader needs more than {limit / 2**20:.0f} MB: the file is damaged or too large"
        )
        return _SAID
    except ValidateError as error:
        print(error)
        return _SAID
    except Exception as error:  # whatever a library raises on damage is damage
        print(f"damaged ({' '.join(str(error).split())[:200] or type(error).__name__})")
        return _SAID
    signal.setitimer(signal.ITIMER_PROF, 0)
    np.savez(out, allow_pickle=False, **{f"{_OURS}{name}": a for name, a in arrays.items()})
    return 0


if __name__ == "__main__":
    decoder, path, out, limits, given = sys.argv[1:]
    raise SystemExit(_decode(decoder, Path(path), Path(out), limits, given))
