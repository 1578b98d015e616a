"""Hash of the code behind a cell's numbers: package, libraries, the user's files.

A worker may be another installation, or one that was changed since it started. It proves by these
hashes that it computes what the calling process would, before it runs a cell and with each
record.
"""

import hashlib
import importlib
import json
import platform
import sys
import time
from collections.abc import Iterable, Mapping
from functools import cache
from importlib.metadata import version
from pathlib import Path
from types import ModuleType
from typing import Any

from validate.errors import UsageError
from validate.plugins import plug_ins

Identity = Mapping[str, str]

PACKAGE = Path(__file__).resolve().parents[1]
_LIBRARIES = ("numpy", "scipy", "numba")
_RESTS_ON = (*_LIBRARIES, "scikit-fem", "filterpy", "opencv-python-headless")
_INSTALLED = ("site-packages", "dist-packages")
_SHORT = 12  # characters of a hash that a person compares
_LOADED = time.time()


class OtherCodeError(UsageError):
    """A worker whose code is not that of the calling process."""


@cache
def code_sha256() -> str:
    """Of this package's sources and the libraries' versions: what a stored result rests on."""
    found = hashlib.sha256()
    for path in sorted(PACKAGE.rglob("*.py")):
        found.update(path.relative_to(PACKAGE).as_posix().encode())
        found.update(path.read_bytes())
    found.update(platform.python_version().encode())
    found.update(" ".join(f"{name} {version(name)}" for name in _RESTS_ON).encode())
    return found.hexdigest()


@cache
def installation() -> Identity:
    """Return hash of the package, versions of Python and the numerical libraries as loaded, and
    the plug-ins with theirs."""
    versions = {name: str(importlib.import_module(name).__version__) for name in _LIBRARIES}
    added = "; ".join(map(str, plug_ins()))
    python = platform.python_version()
    return {"validate": code_sha256(), "python": python, "plug-ins": added, **versions}


def proven_installation() -> Identity:
    """Return a worker's installation; its hash is "changed since it started" where a source file is
    newer than the process, which may have loaded an older one."""
    now = time.time()
    times = (path.stat().st_mtime for path in PACKAGE.rglob("*.py"))
    changed = any(_LOADED < t <= now for t in times)
    return {**installation(), "validate": "changed since it started"} if changed else installation()


def identity_of(files: Iterable[Path], module: str) -> Identity:
    """Return the installation with the hashes of the files of an experiment and of the user's own
    modules that the loaded module of that name refers to."""
    modules: dict[str, Path] = {}
    left = [sys.modules.get(module)]
    while left:
        one = left.pop()
        file = getattr(one, "__file__", None)
        if one is None or file is None or one.__name__ in modules or not _is_users(Path(file)):
            continue
        modules[one.__name__] = Path(file)
        left += [_home(value) for value in vars(one).values()]
    return {
        **installation(),
        "experiment": _hash((file.name, file) for file in files),
        "modules": _hash(sorted(modules.items())),
    }


def digest(identity: Identity) -> str:
    """Return one hash of an identity, for a record."""
    return hashlib.sha256(json.dumps(dict(identity), sort_keys=True).encode()).hexdigest()[:32]


def require_same(here: Identity, there: Identity, who: str) -> None:
    """Raise `OtherCodeError` naming what differs between this process's identity and a worker's."""
    odd = [name for name in here if here[name] != there.get(name, "not known")]
    if odd:
        parts = "; ".join(
            f"{name} {here[name][:_SHORT]}, there {there.get(name, 'not known')[:24]}"
            for name in odd
        )
        raise OtherCodeError(
            f"{who} is refused: its code differs from that of the caller ({parts})"
        )


def _hash(files: Any) -> str:
    found = hashlib.sha256()
    for name, path in files:
        found.update(name.encode() + b"\0" + path.read_bytes())
    return found.hexdigest()


def _home(value: Any) -> ModuleType | None:
    if isinstance(value, ModuleType):
        return value
    name = getattr(value, "__module__", None)
    return sys.modules.get(name) if isinstance(name, str) else None


@cache
def _is_users(file: Path) -> bool:
    """Whether a module is neither of this package, of Python nor installed."""
    ours = (PACKAGE, Path(sys.prefix), Path(sys.base_prefix))
    return not any(file.is_relative_to(place) for place in ours) and not any(
        part in _INSTALLED for part in file.parts
    )
