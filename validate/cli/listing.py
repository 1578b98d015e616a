"""`validate list`."""

import json
from pathlib import Path
from typing import Any

from validate.cli.display import console, table
from validate.parameters import Parameter, describe
from validate.replay.experiment import Experiment
from validate.replay.find import experiment_files, find, load_file


def show(name: str | None, as_json: bool) -> None:
    """Prints the experiments, or one with every parameter."""
    start = Path.cwd()
    if name is None:
        found = [load_file(path) for path in experiment_files(start).values()]
        document: Any = [_summary(e) for e in found]
        if not as_json:
            rows = [[e.name, e.title, e.source, str(len(e.methods))] for e in found]
            console().print(table("Experiments", ["name", "what", "source", "methods"], rows))
    else:
        experiment = find(name, start)
        document = _summary(experiment) | _details(experiment)
        if not as_json:
            _print(experiment)
    if as_json:
        print(json.dumps(document, indent=2, allow_nan=False))


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
