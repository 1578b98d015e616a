"""`--set methods.NAME.FIELD=VALUE` reaches every method's own settings in every experiment."""

from collections.abc import Iterator
from dataclasses import is_dataclass
from pathlib import Path
from typing import Any

import pytest

from validate.catalogue import experiment_files, name_of
from validate.errors import UsageError
from validate.parameters import Parameter, describe
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.find import load_file
from validate.pipeline.experiment.options import Options, configure

FILES = sorted(experiment_files(Path(__file__).resolve().parents[2]).values(), key=name_of)
PARTS = ("settings", "scene")


@pytest.fixture(scope="module", params=FILES, ids=name_of)
def experiment(request: pytest.FixtureRequest) -> Experiment:
    return load_file(request.param)


def other(parameter: Parameter) -> str | None:
    """Another value that its field takes, as text; None for texts and lists, which name things."""
    if "|" in parameter.type and "float" not in parameter.type and "int" not in parameter.type:
        choices = [c for c in parameter.type.split("|") if c != str(parameter.default)]
        return choices[0] if choices else None
    if "float" in parameter.type:
        return repr(0.9 * parameter.default) if parameter.default else "0.5"
    if parameter.type == "int":
        return str(parameter.default + 1)
    return None


def changes(experiment: Experiment) -> Iterator[tuple[str, str, str, str]]:
    """Method, its part, path within it and a new text: one number or choice of every part."""
    for name, method in experiment.methods.items():
        for part in PARTS:
            value = getattr(method, part)
            fields = describe(value) if is_dataclass(value) else ()
            usable = [(p.path, other(p)) for p in fields if "tuple" not in p.type]
            numbers = [(path, text) for path, text in usable if text is not None]
            for path, text in numbers[:1]:
                yield name, part, path, text


def found(experiment: Experiment, values: dict[str, str]) -> dict[str, Any]:
    return configure(experiment, Options(values))[1]


def value_at(method: Any, part: str, path: str) -> Any:
    value = getattr(method, part)
    for name in path.split("."):
        value = getattr(value if hasattr(value, name) else value.inner, name)
    return value


#: A rigid body and a material point alone have settings of their own to none.
WITHOUT = {"multimode", "rubber_strip", "stylus_phantom", "ultrasound_disk"}


def test_which_experiments_have_methods_without_settings() -> None:
    assert len(FILES) > 15
    assert {name_of(f) for f in FILES if not list(changes(load_file(f)))} == WITHOUT


def test_a_field_is_set_by_its_short_path_and_by_the_whole_one(experiment: Experiment) -> None:
    tried = list(changes(experiment))
    assert bool(tried) == (experiment.name not in WITHOUT)
    for name, part, path, text in tried:
        whole = found(experiment, {f"methods.{name}.{part}.{path}": text})
        short = found(experiment, {f"methods.{name}.{path}": text})
        assert short == whole
        assert str(value_at(short[name], part, path)) == text
        assert value_at(short[name], part, path) != value_at(experiment.methods[name], part, path)
        others = {n: m for n, m in short.items() if n != name}
        assert others == {n: m for n, m in experiment.methods.items() if n != name}


def test_every_listed_path_can_be_set_to_what_it_is(experiment: Experiment) -> None:
    """What `validate list NAME` shows is what `--set` takes, and its own value changes nothing."""
    listed = describe(experiment.methods, "methods.")
    assert len(listed) > 4 * len(experiment.methods)
    for p in listed:
        if p.default is None or (isinstance(p.default, list | str) and not p.default):
            continue
        text = ",".join(map(str, p.default)) if isinstance(p.default, list) else str(p.default)
        assert found(experiment, {p.path: text}) == dict(experiment.methods), p.path


def test_an_unknown_field_names_the_nearest(experiment: Experiment) -> None:
    if experiment.name in WITHOUT:
        name, path = next(iter(experiment.methods)), "stride"
    else:
        name, _, path, _ = next(changes(experiment))
    with pytest.raises(UsageError, match=rf"unknown parameter '{name}\.{path}x'; nearest: "):
        found(experiment, {f"methods.{name}.{path}x": "1"})
