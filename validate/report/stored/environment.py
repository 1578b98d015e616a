"""Machine and versions behind a result, without user, host or path."""

import contextlib
import os
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path, PurePosixPath, PureWindowsPath

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
    found["os"] = _system()
    found["cpu"] = _processor()
    found["cpu_count"] = str(os.cpu_count() or "unknown")
    found["memory"] = _memory()
    found |= {name: os.environ.get(name, "unset") for name in _THREADS}
    return found


def _system() -> str:
    with contextlib.suppress(OSError):
        return platform.freedesktop_os_release().get("PRETTY_NAME", "unknown")
    return f"{platform.system()} {platform.version()}"


def _processor() -> str:
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text("utf-8").splitlines():
            key, _, name = line.partition(":")
            if key.strip() == "model name":
                return name.strip()
    return platform.processor() or "unknown"


def _memory() -> str:
    """All of the machine's, which not every system says."""
    try:
        size = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return "unknown"
    return f"{size / 2**30:.1f} GiB"


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
