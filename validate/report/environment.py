"""The machine and the versions that made a result: no user, no host, no path."""

import os
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import PurePosixPath, PureWindowsPath

_PACKAGES = (
    ("validate", "validate-tissue"),
    ("numpy", "numpy"),
    ("scipy", "scipy"),
    ("skfem", "scikit-fem"),
    ("pyvista", "pyvista"),
    ("vtk", "vtk"),
    ("matplotlib", "matplotlib"),
    ("mcap", "mcap"),
)
_THREADS = (
    "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS",
)  # fmt: skip


def environment() -> dict[str, str]:
    """Versions, platform, processors and thread settings by name."""
    found = {"python": platform.python_version()}
    found |= {name: _version(distribution) for name, distribution in _PACKAGES}
    found["platform"] = f"{platform.system()} {platform.release()} {platform.machine()}"
    found["cpu_count"] = str(os.cpu_count() or "unknown")
    found |= {name: os.environ.get(name, "unset") for name in _THREADS}
    return found


def _version(distribution: str) -> str:
    try:
        return version(distribution)
    except PackageNotFoundError:
        return "not installed"


def file_name(text: str) -> str:
    """The last part of a path of either system: reports name files, not places."""
    return PureWindowsPath(PurePosixPath(text).name).name if text else text


def without_folder(value: object) -> object:
    """`value`, or its file name when it is the text of an absolute path."""
    if isinstance(value, str) and (
        PurePosixPath(value).is_absolute() or PureWindowsPath(value).is_absolute()
    ):
        return file_name(value)
    return value
