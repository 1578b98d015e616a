"""`validate list NAME`: one experiment with every parameter."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

from validate.cli.display import say, table
from validate.parameters import Parameter, describe
from validate.replay.experiment import Experiment
from validate.replay.find import find
from validate.replay.law_solver import laws_of
from validate.report.plain import members


def show(name: str, named: tuple[Path, ...], as_json: bool) -> None:
    """Prints parameters, methods and accepted limits of an experiment."""
    experiment = find(name, Path.cwd(), named)
    if as_json:
        document = _summary(experiment) | _details(experiment)
        print(json.dumps(document, indent=2, allow_nan=False))
    else:
        _print(experiment)


def parameters_of(experiment: Experiment) -> tuple[Parameter, ...]:
    """Every settable path of an experiment, methods included; a method's law with those choices
    alone that it can take."""
    laws = {f"methods.{name}.law": laws_of(m) for name, m in experiment.methods.items()}
    methods = (
        replace(p, type="|".join(known)) if (known := laws.get(p.path)) else p
        for p in describe(experiment.methods, "methods.")
    )
    return (*describe(experiment.parameters), *methods)


def _summary(experiment: Experiment) -> dict[str, Any]:
    return {"name": experiment.name, "title": experiment.title, "source": experiment.source}


def _details(experiment: Experiment) -> dict[str, Any]:
    return {
        "parameters": [
            {"path": p.path, "type": p.type, "unit": p.unit, "default": p.default, "doc": p.doc}
            for p in parameters_of(experiment)
        ],
        "methods": [{"name": k, "label": m.label} for k, m in experiment.methods.items()],
        "accepted": list(experiment.accepted),
        "accept": [
            {
                "quantity": a.quantity,
                "limit": a.required,
                "statistic": a.statistic,
                "loads": list(a.loads),
                "why": a.why,
            }
            for a in experiment.accept
        ],
        "expected": [members(e) for e in experiment.expected],
        "seed": experiment.seed,
        "kind": experiment.declared_kind,
    }


def _print(experiment: Experiment) -> None:
    say(f"{experiment.name}: {experiment.title}", "bold")
    say(experiment.source)
    rows = [[p.path, _default(p), f"{p.doc} ({p.type})"] for p in parameters_of(experiment)]
    table("Parameters", ["path", "default", "what it is (type)"], rows)
    methods = [
        [k, m.label, "accepted" if k in experiment.accepted else ""]
        for k, m in experiment.methods.items()
    ]
    table("Methods", ["name", "what", ""], methods)
    required = [
        [a.quantity, ", ".join(a.loads) or "all", a.statistic,
         "none" if a.required is None else f"{a.required:g}", a.why]
        for a in experiment.accept
    ]  # fmt: skip
    table("Requirements", ["quantity", "at", "of many", "limit (SI)", "why"], required)
    known = [[e.method, e.check, e.verdict, e.why] for e in experiment.expected]
    table("Expected verdicts", ["method", "check", "verdict", "why"], known)


def _default(parameter: Parameter) -> str:
    """As `--set` takes it."""
    value, unit = parameter.default, parameter.unit
    if value is None or value in ("", []):
        return "none"
    text = ",".join(map(_plain, value)) if isinstance(value, list) else _plain(value)
    return text if unit == "1" else f"{text} {unit}"


def _plain(value: Any) -> str:
    """15200, not 15200.0."""
    return f"{value:.10g}" if isinstance(value, float) else str(value)
