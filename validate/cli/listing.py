"""`validate list NAME`: one experiment with every parameter."""

import json
from pathlib import Path
from typing import Any

from validate.cli.display import console, table
from validate.parameters import Parameter, describe
from validate.replay.experiment import Experiment
from validate.replay.find import find


def show(name: str, named: tuple[Path, ...], as_json: bool) -> None:
    """Prints parameters, methods and accepted limits of an experiment."""
    experiment = find(name, Path.cwd(), named)
    if as_json:
        document = _summary(experiment) | _details(experiment)
        print(json.dumps(document, indent=2, allow_nan=False))
    else:
        _print(experiment)


def parameters_of(experiment: Experiment) -> tuple[Parameter, ...]:
    """Every settable path of an experiment, methods included."""
    return describe(experiment.parameters) + describe(experiment.methods, "methods.")


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
            {"quantity": a.quantity, "limit": a.limit, "source": a.source}
            for a in experiment.accept
        ],
        "seed": experiment.seed,
        "same_model": experiment.same_model,
    }


def _print(experiment: Experiment) -> None:
    out = console()
    out.print(f"[bold]{experiment.name}[/]: {experiment.title}\n{experiment.source}\n")
    rows = [
        [p.path, p.type, "none" if p.default is None else str(p.default), p.unit, p.doc]
        for p in parameters_of(experiment)
    ]
    out.print(table("Parameters", ["path", "type", "default", "unit", "what it is"], rows))
    methods = [
        [k, m.label, "accepted" if k in experiment.accepted else ""]
        for k, m in experiment.methods.items()
    ]
    out.print(table("\nMethods", ["name", "what", ""], methods))
    accepted = [[a.quantity, f"{a.limit:g}", a.source] for a in experiment.accept]
    out.print(table("\nAccepted when", ["quantity", "limit (SI)", "source"], accepted))
