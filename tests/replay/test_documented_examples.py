"""The Python that the documentation and the package's docstring show runs as it is printed."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import validate.replay
from validate.parameters import with_given
from validate.replay.experiment import Experiment


def readme(project_root: Path) -> str:
    page = (project_root / "docs" / "python.md").read_text("utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", page, flags=re.DOTALL)
    return str(code)


def docstring() -> str:
    return (validate.replay.__doc__ or "").split("\n\n", 1)[1]


def small(phantom: Experiment) -> Experiment:
    """The fluid phantom with two cheap methods on a coarse mesh, one of them accepted."""
    methods = {name: phantom.methods[name] for name in ("p1_fluid", "md_fluid")}
    coarse = with_given(phantom.parameters, {"body.cells": (6, 7, 10)})
    assert phantom.uncertainty is not None
    return replace(
        phantom, methods=methods, accepted=("md_fluid",), effects=(), published=(),
        parameters=coarse,
        uncertainty=replace(phantom.uncertainty, surrogate="md_fluid"),
    )  # fmt: skip


def test_readme_and_docstring_show_the_same(project_root: Path) -> None:
    shown = [
        [line for line in text.splitlines() if line] for text in (readme(project_root), docstring())
    ]
    assert shown[0] == shown[1]


@pytest.mark.slow
def test_the_example_prints_every_check(
    phantom: Experiment,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    asked: list[str] = []

    def load(name: str) -> Experiment:
        asked.append(name)
        return small(phantom)

    monkeypatch.setattr(validate.replay, "load", load)
    ran: dict[str, Any] = {}
    exec(compile(docstring(), "example", "exec"), ran)
    assert asked == [phantom.name]
    result = ran["result"]
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == len(result.checks) > 3
    assert lines[0].startswith("contour.rms@3mm ")
    assert {line.rsplit(" ", 1)[1] for line in lines} <= {"enough", "undecided"}
    assert {p.path: p.default for p in result.parameters}["material.E"] == 14_000.0
