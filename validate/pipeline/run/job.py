"""Job of a run or study: data that all its cells share, loaded by a worker."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Any

from validate.engine.identity import Identity, identity_of
from validate.engine.user_code import NO_CODE, SentCode, code_hash, received, sent
from validate.errors import UsageError
from validate.estimate.filters import FILTERS
from validate.pipeline.experiment.declaration import encoded, from_json, holds_code, to_json
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.find import (
    load_file,
    loaded_from,
    module_name,
    package_name,
    sources_of,
)
from validate.pipeline.experiment.options import folder_of
from validate.plugins import Registry
from validate.register.sensing import SENSORS
from validate.scene.laws import LAWS
from validate.solve.schemes import SCHEMES, SOLVERS

# --- What a script or notebook adds to an experiment and to the registries, for workers.
#
# A worker loads the experiment from its file. What the user changed in memory, and parts that
# were added without a package, are sent with it, code included.

_REGISTRIES: Mapping[str, Registry[Any]] = {
    "laws": LAWS, "schemes": SCHEMES, "solvers": SOLVERS, "filters": FILTERS, "sensors": SENSORS,
}  # fmt: skip


def changed_fields(experiment: Experiment, base: Experiment | None) -> dict[str, Any]:
    """Return the fields that are not those of `base`, by name; all where there is none."""
    given = {f.name: getattr(experiment, f.name) for f in fields(experiment) if f.init}
    del given["path"]
    if base is None:
        return given
    return {name: v for name, v in given.items() if not _same(v, getattr(base, name))}


def user_parts(changes: Mapping[str, Any], package: str = "") -> tuple[SentCode, str]:
    """Return these fields and the parts that a script added as bytes, and their hash; empty where
    there are none. `package` is that of the experiment's file, which a worker has loaded."""
    added = {name: registry.added for name, registry in _REGISTRIES.items() if registry.added}
    if not changes and not added:
        return NO_CODE, ""
    content = (dict(changes), added)
    mark = f"{code_hash(content)} {encoded(dict(changes), '')}"
    return sent(content, package), sha256(mark.encode()).hexdigest()


def added_here(data: SentCode) -> dict[str, Any]:
    """Return the fields in the bytes of `user_parts`, and add its parts to the registries."""
    if not data:
        return {}
    changes, added = received(data)
    for name, parts in added.items():
        for part in parts:
            _REGISTRIES[name].add(part)
    found: dict[str, Any] = changes
    return found


def _same(one: Any, other: Any) -> bool:
    try:
        return one is other or bool(one == other)
    except ValueError:  # arrays
        return False


# -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Job:
    """What all cells share: the experiment's file, its hash and those of its recordings,
    values set, quick, command lines of external simulators.

    A `declaration` without code is all that a worker needs: it executes no file. The hash is then
    that of the declaration. `changes` are what a script changed of the file's experiment, and parts
    that it added, with their code, whose hash is `code`: see `user_parts`.
    """

    path: str
    sha256: str
    recordings: tuple[str, ...] = ()
    values: tuple[tuple[str, str], ...] = ()
    quick: bool = False
    simulators: tuple[str, ...] = ()
    declaration: str = ""
    changes: SentCode = NO_CODE
    code: str = ""

    def experiment(self) -> Experiment:
        """Raise `UsageError` when the file is not the one that the study began with."""
        path = Path(self.path)
        base = _loaded(path, self.sha256) if self.sha256 and not self.declaration else None
        changes = added_here(self.changes)
        if self.declaration:
            return from_json(self.declaration, path)
        if base is None:
            return Experiment(**changes).at(path)
        return replace(base, **changes) if changes else base

    def identity(self) -> Identity:
        """Of a declaration without code no module is loaded."""
        path = Path(self.path)
        files = sources_of(path) if path.is_file() else ()
        found = identity_of(files, "" if self.declaration else module_name(path))
        return {**found, "user code": self.code} if self.code else found


@lru_cache(maxsize=2)
def _loaded(path: Path, sha256: str) -> Experiment:
    """Executed once a process: the classes of an experiment's own file are then one."""
    if file_sha256(path) != sha256:
        raise UsageError(f"{path.name} has changed since the study started; start the study again")
    return load_file(path)


def job_of(
    experiment: Experiment, values: Mapping[str, str] | None = None, quick: bool = False
) -> Job:
    """Raise what loading the experiment's recordings does."""
    loaded = experiment.load(experiment.parameters, folder_of(experiment))
    hashes = tuple(r.source.sha256 for r in loaded)
    return job_on(experiment, hashes, values or {}, quick)


def job_on(
    experiment: Experiment, hashes: tuple[str, ...], values: Mapping[str, str], quick: bool
) -> Job:
    """On recordings of these hashes."""
    path, set_ = Path(str(experiment.path)), tuple(sorted(values.items()))
    text = to_json(experiment)
    if not holds_code(text):
        digest_ = hashlib.sha256(text.encode()).hexdigest()
        changes, code = user_parts({})
        return Job(str(path), digest_, hashes, set_, quick, (), text, changes, code)
    bases = loaded_from(path)
    fewest = min((changed_fields(experiment, base) for base in bases or (None,)), key=len)
    changes, code = user_parts(fewest, package_name(path) if bases else "")
    sha256 = file_sha256(path) if bases else ""
    return Job(str(path), sha256, hashes, set_, quick, changes=changes, code=code)


def file_sha256(path: Path) -> str:
    """Of an experiment's file and of those beside it that it names."""
    return hashlib.sha256(b"".join(f.read_bytes() for f in sources_of(path))).hexdigest()
