"""Machine, versions, command and input files behind a result, without user, host or path."""

import contextlib
import hashlib
import os
import platform
import shlex
import subprocess
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path, PurePosixPath, PureWindowsPath

from validate.engine.identity import PACKAGE, code_sha256

_PACKAGES = (
    ("validate", "validate-tissue"),
    ("numpy", "numpy"),
    ("scipy", "scipy"),
    ("numba", "numba"),
    ("skfem", "scikit-fem"),
    ("filterpy", "filterpy"),
    ("opencv", "opencv-python-headless"),
    ("pyvista", "pyvista"),
    ("vtk", "vtk"),
    ("matplotlib", "matplotlib"),
    ("mcap", "mcap"),
)
_THREADS = (
    "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS",
)  # fmt: skip


def environment() -> dict[str, str]:
    """Versions, platform, processor, memory and thread settings by name."""
    found = {"python": platform.python_version()}
    found |= {name: _version(distribution) for name, distribution in _PACKAGES}
    found["platform"] = f"{platform.system()} {platform.release()} {platform.machine()}"
    try:
        found["os"] = platform.freedesktop_os_release().get("PRETTY_NAME", "unknown")
    except OSError:
        found["os"] = f"{platform.system()} {platform.version()}"
    models: list[str] = []
    with contextlib.suppress(OSError):
        lines = Path("/proc/cpuinfo").read_text("utf-8").splitlines()
        pairs = (line.partition(":") for line in lines)
        models = [name.strip() for key, _, name in pairs if key.strip() == "model name"]
    found["cpu"] = models[0] if models else platform.processor() or "unknown"
    found["cpu_count"] = str(os.cpu_count() or "unknown")
    found["memory"] = "unknown"
    with contextlib.suppress(AttributeError, ValueError, OSError):  # not every system says it
        size = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
        found["memory"] = f"{size / 2**30:.1f} GiB"
    found |= {name: os.environ.get(name, "unset") for name in _THREADS}
    return found


def _version(distribution: str) -> str:
    try:
        return version(distribution)
    except PackageNotFoundError:
        return "not installed"


def file_name(text: str) -> str:
    """Return the last part of a path of either system: reports name files, not places."""
    return PureWindowsPath(PurePosixPath(text).name).name if text else text


def without_folder(value: object) -> object:
    """`value`, or its file name when it is the text of an absolute path."""
    if isinstance(value, str) and (
        PurePosixPath(value).is_absolute() or PureWindowsPath(value).is_absolute()
    ):
        return file_name(value)
    return value


# --- provenance of a run: its command, the commit of its code, and its input files ---------------

_PATIENCE = 10.0  # s that git may take: a run is worth more than its commit's name
_LEFT_OUT = "…/"  # of an absolute path in a command: reports name files, not places


@dataclass(frozen=True)
class Commit:
    """The commit that files were taken from; `dirty`: they are not as it has them."""

    sha: str
    dirty: bool

    def __str__(self) -> str:
        return f"{self.sha[:10]}, with changes" if self.dirty else self.sha[:10]


@dataclass(frozen=True)
class UsedFile:
    """A file that a run read beside its recordings: `role` is experiment, mesh, layout (of
    markers), case: the recording of another truth, or calibrates: one that only calibrates."""

    role: str
    path: str
    sha256: str
    bytes: int


@dataclass(frozen=True)
class Made:
    """Command ("" from Python), commit of this package's clone and, where that is another one, of
    the experiment's (None: no clone, or git does not say), hash of code and libraries, files,
    plug-ins that it used (package and version)."""

    command: str = ""
    commit: Commit | None = None
    project: Commit | None = None
    code_sha256: str = ""
    files: tuple[UsedFile, ...] = ()
    plug_ins: tuple[str, ...] = ()


def made(
    arguments: Sequence[str] = (), sources: Sequence[Path] = (), meshes: Iterable[Path] = ()
) -> Made:
    """`arguments` of the command line, `sources` the experiment's file and its helpers, `meshes`
    with layouts of markers."""
    command = shlex.join(["validate", *map(_told, arguments)]) if arguments else ""
    ours, theirs = commit_of([PACKAGE]), commit_of(sources)
    same = theirs is None or (ours is not None and theirs.sha == ours.sha and not theirs.dirty)
    layouts = (".fcsv", ".json")
    roles = [("experiment", path) for path in sources]
    roles += [("layout" if p.suffix.lower() in layouts else "mesh", p) for p in meshes]
    files = []
    for role, path in roles:
        with path.open("rb") as stream:
            sha256 = hashlib.file_digest(stream, "sha256").hexdigest()
        files.append(UsedFile(role, file_name(str(path)), sha256, path.stat().st_size))
    return Made(command, ours, None if same else theirs, code_sha256(), tuple(files))


def _told(argument: str) -> str:
    """An argument without the folders of an absolute path, alone or behind its `=`."""
    before, equals, after = argument.partition("=")
    key, sign, value = (before, equals, after) if equals else ("", "", argument)
    short = str(without_folder(value))
    return argument if short == value else f"{key}{sign}{_LEFT_OUT}{short}"


def commit_of(paths: Sequence[Path]) -> Commit | None:
    """Return the commit of files or folders that lie in one clone; None where git tracks the first
    not."""
    if not paths:
        return None
    folder = paths[0] if paths[0].is_dir() else paths[0].parent
    names = [str(p.resolve()) for p in paths]
    tracked = _git(folder, "ls-files", "--error-unmatch", "--", names[0])
    sha = _git(folder, "rev-parse", "HEAD") if tracked else None
    changes = _git(folder, "status", "--porcelain", "--", *names) if sha else None
    return None if sha is None or changes is None else Commit(sha.strip(), bool(changes.strip()))


def _git(folder: Path, *arguments: str) -> str | None:
    """What git says; None where there is none, or it fails."""
    around = {k: v for k, v in os.environ.items() if not k.startswith("GIT_")}
    try:
        done = subprocess.run(
            ["git", "-C", str(folder), *arguments],
            capture_output=True, text=True, timeout=_PATIENCE, check=True, encoding="utf-8",
            errors="replace", env={**around, "GIT_OPTIONAL_LOCKS": "0"},
        )  # fmt: skip
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout
