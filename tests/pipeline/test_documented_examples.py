"""The Python that the docstring of `validate.pipeline` shows runs as it is printed."""

from dataclasses import replace
from typing import Any

import pytest

import validate.pipeline
from validate.parameters import with_given
from validate.pipeline.experiment.experiment import Experiment


def docstring() -> str:
    return (validate.pipeline.__doc__ or "").split("\n\n", 1)[1]


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

    monkeypatch.setattr(validate.pipeline, "load", load)
    ran: dict[str, Any] = {}
    exec(compile(docstring(), "example", "exec"), ran)
    assert asked == [phantom.name]
    result = ran["result"]
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == len(result.checks) > 3
    assert lines[0].startswith("contour.rms@3mm ")
    assert {line.rsplit(" ", 1)[1] for line in lines} <= {"enough", "undecided"}
    assert {p.path: p.default for p in result.parameters}["material.E"] == 14_000.0
