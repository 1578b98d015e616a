"""Job of a run or study: data that all its cells share, loaded by a worker; a run's name."""

import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Any

from validate.catalogue import reports_of as reports_of
from validate.engine.identity import Identity, identity_of
from validate.engine.user_code import NO_CODE, SentCode, code_hash, received, sent
from validate.errors import UsageError
from validate.estimate.filters import FILTERS
from validate.parameters import Parameter, changed, describe
from validate.pipeline.experiment.declaration import encoded, from_json, holds_code, to_json
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.find import (
    load_file,
    loaded_from,
    module_name,
    package_name,
    sources_of,
)
from validate.pipeline.experiment.options import (
    Options,
    all_methods,
    configure,
    folder_of,
    with_simulators,
)
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


# --- name of a run: the experiment's name, the user's changes and a short hash -------------------

_LONGEST = 60  # characters of what differs in a folder's name
_DIGITS = 6  # of the hash


def run_folder(experiment: Experiment, options: Options, out: Path | None) -> Path:
    """Where a run's report goes: below `out`, else below the reports/ of the project.

    Raises `UsageError` for unknown methods, paths and values.
    """
    return reports_of(experiment.path, out) / run_name(experiment, options)


def study_folder(experiment: Experiment, kind: str, out: Path | None) -> Path:
    """`out`/<name>/study-<kind>, by default in the reports/ of the experiment's clone."""
    return reports_of(experiment.path, out) / experiment.name / f"study-{kind}"


def run_name(experiment: Experiment, options: Options) -> str:
    """`NAME` of the run as declared, else as in `NAME+quick+material.E-3fa2c1`."""
    return experiment.name + tag(*differences(experiment, options))


def differences(experiment: Experiment, options: Options) -> tuple[list[str], list[Any]]:
    """Return the user's changes: in words, and as content with every value. Those of a script, to
    what the experiment's file declares, are among them.

    Raises `UsageError` for unknown methods, paths and values.
    """
    loaded = loaded_from(experiment.path) if experiment.path else ()
    file = with_simulators(loaded[0], options.simulators) if loaded else experiment
    declared = _settable(file, Options({}, (), options.quick))
    differing = sorted((c.path, c.value) for c in changed(declared, _settable(experiment, options)))
    methods = sorted(set(options.methods))
    if methods == sorted(experiment.methods):
        methods = []
    case = [f"case_{options.case}"] * bool(options.case)
    words = ["quick"] * options.quick + case + ["methods"] * bool(methods)
    simulators = sorted(options.simulators)
    added = sorted({*experiment.methods} - {*file.methods})
    if added and not methods:
        words.append("methods")
    other = {name: getattr(experiment, name) for name in ("accept", "accepted")
             if getattr(experiment, name) != getattr(file, name)}  # fmt: skip
    content = [options.quick, methods, differing, *simulators, *case, *added, *other.items()]
    return [*words, *other, *(p for p, _ in differing), *["external"] * bool(simulators)], content


def _settable(experiment: Experiment, options: Options) -> tuple[Parameter, ...]:
    parameters, _ = configure(experiment, options)
    return describe(parameters) + describe(all_methods(experiment, options), "methods.")


def tag(words: Sequence[str], content: Any) -> str:
    """What differs, in words that a folder may be called by, and a hash of `content`; "" without
    words."""
    if not words:
        return ""
    plain = [re.sub(r"[^\w.]+", "_", word) for word in words]
    fit = max(1, sum(len("+".join(plain[: i + 1])) <= _LONGEST for i in range(len(plain))))
    more = [f"{len(plain) - fit}_more"] if fit < len(plain) else []
    text = json.dumps(content, default=str)
    mark = hashlib.sha256(text.encode()).hexdigest()[:_DIGITS]
    return f"+{'+'.join([*plain[:fit], *more])}-{mark}"
