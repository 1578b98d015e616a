"""JSON form of a declared experiment, exact and without code.

An object is {"type": name of its class, ...} with the fields that are not their defaults; numbers
are in SI. What is code stays in the experiment's file: {"code": "twin.record"} says where in its
`EXPERIMENT` a function is, {"like": "parameters.settings", ...} which class an object of its own
has. A declaration without code is run from its JSON alone, and nothing of it is executed: its
classes are the library's and those of plug-ins that the user has installed (`classes`). The
settings of a kind of experiment complete its declaration (`completed`).
"""

import json
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import MISSING, fields, is_dataclass
from functools import cache, lru_cache
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from validate.errors import UsageError, ValidateError
from validate.estimate.filters import FILTERS
from validate.former_names import new_name
from validate.parameters import describe, has_path, nearest_names
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.tree import Tree, follows
from validate.pipeline.experiment.variation import ByPath, Shift, Values
from validate.register.sensing import SENSORS
from validate.scene.laws import LAWS
from validate.solve.schemes import SCHEMES, SOLVERS

#: What a declaration of such a kind holds.
DECLARED = ("name", "title", "source", "parameters", "methods", "accepted", "accept", "kind")


@cache
def kinds() -> Mapping[type, Callable[..., Experiment]]:
    """What makes an experiment, by the class of its settings; they read all formats, so that they
    are imported where one is asked for."""
    from validate.pipeline.bodies.choices import MeasuredBody
    from validate.pipeline.bodies.measured import measured_body
    from validate.pipeline.plates.compression import compression
    from validate.pipeline.plates.inclusion import InclusionTest, inclusion_test
    from validate.pipeline.plates.scene import Compression

    return MappingProxyType({
        MeasuredBody: measured_body,
        Compression: compression,
        InclusionTest: lambda *, folder, **given: inclusion_test(**given),
    })  # fmt: skip


def of_a_kind(experiment: Experiment) -> bool:
    """Return whether its scene and settings say all that is declared of it."""
    return _kind(experiment) in kinds()


def _kind(experiment: Experiment) -> type:
    """The class that says what the experiment measures."""
    return type(experiment.parameters.settings)


def completed(experiment: Experiment, path: Path) -> Experiment:
    """Return the experiment declared in that file, with what its kind adds."""
    if not isinstance(experiment.parameters, Tree):
        raise UsageError(
            f"{path}: parameters of type {type(experiment.parameters).__name__}; declare a scene: "
            "Experiment(scene=Scene(...), settings=...)"
        )
    if of_a_kind(experiment) and not experiment.complete:
        given: dict[str, Any] = {name: getattr(experiment, name) for name in DECLARED}
        make = kinds()[_kind(experiment)]
        experiment = make(**given, folder=path.resolve().parent)
    return experiment.at(path)


# --- The paths of a declaration, checked when it is read: an error names the path and the line.


def require_paths(experiment: Experiment, file: Path) -> None:
    """Raise `UsageError` for a variation, case, effect or method whose path or rule is none."""
    parameters = experiment.parameters
    for what, change in _changes(experiment):
        try:
            change(parameters)
        except ValidateError as error:
            raise UsageError(f"{file}{_line(file, what)}: {error}") from error
    for name, method in experiment.methods.items():
        # Paths that a method changes, or takes a value from ("as PATH")
        scene = method.scene if isinstance(method.scene, ByPath) else ByPath({})
        taken = (value[3:] for value in scene.values() if follows(value))
        for path in (path for path in (*scene, *taken) if not has_path(parameters, path)):
            known = {p.path for p in describe(parameters)}
            raise UsageError(
                f"{file}{_line(file, (path,))}: method '{name}' changes the unknown parameter "
                f"'{path}'; {nearest_names(path, known)}"
            )
    for name in experiment.accepted:
        if name not in experiment.methods:
            near = nearest_names(name, set(experiment.methods))
            raise UsageError(f"{file}{_line(file, (name,))}: accepted: no method '{name}'; {near}")


def _changes(experiment: Experiment) -> Iterator[tuple[tuple[str, ...], Any]]:
    """The paths of each change that is data, and the change."""
    declared = experiment.uncertainty
    for one in declared.inputs if declared else ():
        if isinstance(one.move, Shift):
            yield one.move.paths, one.by(0.0)
    cases = [case.change for case in experiment.cases]
    effects = [v.change for e in experiment.effects for v in (e.one, e.other)]
    for change in (*cases, *effects, experiment.quick):
        if isinstance(change, Values):
            yield tuple(path for path, _ in change.by_path), change


def _line(file: Path, paths: tuple[str, ...]) -> str:
    """Where the file spells one of the paths first."""
    lines = file.read_text("utf-8").splitlines()
    for number, text in enumerate(lines, start=1):
        if any(f'"{path}"' in text for path in paths):
            return f", line {number}"
    return ""


# -------------------------------------------------------------------------------------------------

FORMAT = 1
_LEAVES = (str, bool, int, float, type(None))
#: Modules whose dataclasses a declaration is made of, by the names of the classes.
_MODULES = (
    "compare.effects", "compare.overall_verdict", "compare.published", "compare.verdict",
    "estimate.filters", "register.markers.quality", "register.sensing",
    "pipeline.calibration.calibration", "pipeline.experiment.tree", "pipeline.plates.scene",
    "pipeline.experiment.experiment", "pipeline.plates.inclusion",
    "pipeline.bodies.choices", "pipeline.experiment.method", "pipeline.experiment.tree",
    "pipeline.experiment.variation", "scene.contact", "scene.geometries.specification",
    "scene.geometries.hollow_block", "scene.geometries.indented_bodies", "scene.laws",
    "scene.material", "scene.material", "scene.scene", "scene.places", "scene.geometries.box",
    "scene.contact", "solve.schemes",
)  # fmt: skip
_RUNS_PROGRAMS = ("ExternalSimulator", "ExternalLetGo")  # settings with a command to run


# --- to JSON --------------------------------------------------------------------------------------


def to_json(experiment: Experiment) -> str:
    """Return the declaration; what is code is named by its place in the experiment's file."""
    document = {"format": FORMAT, "experiment": _encoded(experiment, "")}
    return json.dumps(document, indent=1, allow_nan=False)


def holds_code(declaration: str) -> bool:
    """Return whether a declaration refers to the code of the experiment's file."""

    def code(value: Any) -> bool:
        if isinstance(value, dict):
            return "code" in value or "like" in value or any(map(code, value.values()))
        return isinstance(value, list) and any(map(code, value))

    return code(json.loads(declaration))


def _encoded(value: Any, at: str) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        return {"number": str(value)}
    if isinstance(value, _LEAVES):
        return value
    if isinstance(value, tuple | list):
        return [_encoded(v, f"{at}.{i}") for i, v in enumerate(value)]
    if isinstance(value, Mapping):
        if all(isinstance(k, str) for k in value):
            return {"items": {k: _encoded(v, f"{at}.{k}") for k, v in value.items()}}
        return {"code": at.lstrip(".")}
    if isinstance(value, np.ndarray):
        return {"array": value.tolist(), "dtype": str(value.dtype)}
    if is_dataclass(value) and not isinstance(value, type):
        return _object(value, at)
    return {"code": at.lstrip(".")}


def _object(value: Any, at: str) -> dict[str, Any]:
    """The fields that differ from their defaults, and what makes the object of them."""
    kind = type(value)
    ours = classes().get(kind.__name__) is kind
    found: dict[str, Any] = {"type": kind.__name__} if ours else {"like": at.lstrip(".")}
    declared = DECLARED if isinstance(value, Experiment) and of_a_kind(value) else None
    for f in fields(value):
        own = getattr(value, f.name)
        if declared is not None and f.name not in declared:
            continue  # what the library adds
        if f.init and f.compare and not _is_default(f, own):
            found[f.name] = _encoded(own, f"{at}.{f.name}")
    return found


def _is_default(f: Any, value: Any) -> bool:
    default = f.default_factory() if f.default_factory is not MISSING else f.default
    if default is MISSING or type(default) is not type(value):
        return False
    if isinstance(value, np.ndarray):
        return bool(value.shape == default.shape and (value == default).all())
    return bool(value == default)


def classes() -> Mapping[str, type]:
    """Return the classes that a declaration may name: the package's, then those of plug-ins and
    scripts, which may add some at any time."""
    coefficients = (kind.holds for kind in LAWS.further if kind.holds is not None)
    further = (*SCHEMES.further, *SOLVERS.further, *FILTERS.further, *SENSORS.further)
    return _classes((*further, *coefficients))


@lru_cache(maxsize=2)
def _classes(further: tuple[type, ...]) -> Mapping[str, type]:
    found: dict[str, type] = {}
    for name in _MODULES:
        module = import_module(f"validate.{name}")
        own = (v for v in vars(module).values() if isinstance(v, type) and is_dataclass(v))
        found |= {kind.__name__: kind for kind in own}
    return MappingProxyType({kind.__name__: kind for kind in further} | found)


def encoded(part: Any, at: str) -> str:
    """As JSON what stands at that path of an experiment, with other numbers; see `decoded`."""
    return json.dumps(_encoded(part, at), allow_nan=False)


# --- from JSON ------------------------------------------------------------------------------------


def from_json(text: str, path: Path, declared: Experiment | None = None) -> Experiment:
    """Return the experiment of a declaration; code is that of `declared`, where it is given.

    Recordings and meshes are found from the folder of `path`. Raises `UsageError` that names the
    path in the declaration for what is no declaration, and for code where there is no `declared`.
    """
    try:
        document = json.loads(text)
    except ValueError as error:
        raise UsageError(f"{path.name}: no JSON ({error})"[:200]) from None
    whole = document.get("experiment") if isinstance(document, dict) else None
    if not isinstance(whole, dict) or document.get("format") != FORMAT:
        raise UsageError(
            f"{path.name}: no declaration of format {FORMAT}; `validate list NAME --declaration` "
            "writes one"
        )
    reader = _Reader(path.name, declared)
    experiment = reader.read(whole, "")
    if not isinstance(experiment, Experiment):
        raise UsageError(f"{path.name}: type '{whole.get('type')}': expected Experiment")
    return completed(experiment, path)


def decoded(text: str, at: str, declared: Experiment) -> Any:
    """What was `encoded`; classes and code that are the experiment's own are those `declared`."""
    return _Reader(declared.name, declared).read(json.loads(text), at)


class _Reader:
    def __init__(self, file: str, declared: Experiment | None) -> None:
        self._file, self._declared = file, declared

    def read(self, value: Any, at: str) -> Any:
        if isinstance(value, list):
            return tuple(self.read(v, f"{at}.{i}") for i, v in enumerate(value))
        if not isinstance(value, dict):
            return value
        kinds: dict[str, Callable[[dict[str, Any], str], Any]] = {
            "type": self._object, "like": self._own, "items": self._items, "code": self._code,
            "array": lambda v, _: np.array(v["array"], dtype=v["dtype"]),
            "number": lambda v, _: float(v["number"]),
        }  # fmt: skip
        key = next((k for k in kinds if k in value), None)
        if key is None:
            raise self._wrong(at, f"{sorted(value)[:4]}: expected one of {', '.join(kinds)}")
        return kinds[key](value, at)

    def _items(self, value: dict[str, Any], at: str) -> Mapping[str, Any]:
        items = value["items"]
        return MappingProxyType({k: self.read(v, f"{at}.{k}") for k, v in items.items()})

    def _object(self, value: dict[str, Any], at: str) -> Any:
        name = str(value["type"])
        kind = classes().get(name) or classes().get(new_name(name))
        if kind is None:
            raise self._wrong(at, f"type '{name}' is no part of a declaration")
        if self._declared is None and kind.__name__ in _RUNS_PROGRAMS:
            raise self._wrong(at, f"'{kind.__name__}' runs a program; a JSON file may not")
        return self._of(kind, {k: v for k, v in value.items() if k != "type"}, at)

    def _own(self, value: dict[str, Any], at: str) -> Any:
        """An object of a class of the experiment's own."""
        kind = type(self._code({"code": value["like"]}, at))
        return self._of(kind, {k: v for k, v in value.items() if k != "like"}, at)

    def _of(self, kind: type, given: dict[str, Any], at: str) -> Any:
        known = {f.name for f in fields(kind) if f.init}
        if odd := sorted(set(given) - known):
            raise self._wrong(at, f"'{odd[0]}' is no field of {kind.__name__}")
        read = {k: self.read(v, f"{at}.{k}") for k, v in given.items()}
        try:
            return kind(**read)
        except (ValidateError, TypeError) as error:
            raise self._wrong(at, str(error)) from None

    def _code(self, value: dict[str, Any], at: str) -> Any:
        if self._declared is None:
            raise self._wrong(
                at, "is code, which a JSON file does not hold; run the experiment's own file"
            )
        found: Any = self._declared
        for name in str(value["code"]).split("."):
            if isinstance(found, Mapping):
                found = found[name]
            elif isinstance(found, tuple):
                found = found[int(name)]
            else:
                found = getattr(found, name)
        return found

    def _wrong(self, at: str, why: str) -> UsageError:
        return UsageError(f"{self._file}: {at.lstrip('.') or 'experiment'}: {why}")
