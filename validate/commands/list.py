"""`validate list NAME`: one experiment with all its parameters."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from validate.commands.arguments import Detail
from validate.commands.display import say, table
from validate.commands.screen import Passage, cut, rows, sentences
from validate.commands.screen import show as show_screen
from validate.parameters import Parameter, describe
from validate.pipeline.experiment.declaration import to_json
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.find import find
from validate.pipeline.experiment.options import laws_of
from validate.report.stored.json_values import members

_DEFAULT = 16  # characters of a default
_FIRST = 10  # of each list on the screen


def show(name: str, named: tuple[Path, ...], as_json: bool, detail: Detail = "screen") -> None:
    """Print parameters, methods and requirements of an experiment; "full" prints all of them."""
    experiment = find(name, Path.cwd(), named)
    if as_json:
        document = _document(experiment)
        print(json.dumps(document, ensure_ascii=False, indent=2, allow_nan=False))
    elif detail == "screen":
        cells = [[p.path, cut(_default(p), _DEFAULT), p.doc] for p in _by_weight(experiment)]
        methods = [
            [f"{k}{' (checked)' if k in experiment.accepted else ''}", m.label]
            for k, m in experiment.methods.items()
        ]
        required = [
            [a.quantity, ", ".join(a.loads) or "all", a.statistic,
             "none" if a.required is None else f"{a.required:g}", a.why]
            for a in experiment.accept
        ]  # fmt: skip
        known = [[f"{e.method}: {e.check}", e.verdict, e.why] for e in experiment.expected]
        show_screen(
            [
                sentences([f"{experiment.name}: {experiment.title}. {experiment.source}"], None),
                _block("Parameters (--set PATH=VALUE)", cells, _FIRST),
                _block("Methods", methods, 3),
                _block("Requirements, limits in SI", required, 2),
                _block("Expected verdicts", known, 1),
            ]
        )
    else:
        say(f"{experiment.name}: {experiment.title}", "bold")
        say(experiment.source)
        rows_ = [[p.path, _default(p), f"{p.doc} ({p.type})"] for p in parameters_of(experiment)]
        table("Parameters", ["path", "default", "description (type)"], rows_)
        methods = [
            [k, m.label, "checked" if k in experiment.accepted else ""]
            for k, m in experiment.methods.items()
        ]
        table("Methods", ["name", "what", ""], methods)
        required = [
            [a.quantity, ", ".join(a.loads) or "all", a.statistic,
             "none" if a.required is None else f"{a.required:g}", a.why]
            for a in experiment.accept
        ]  # fmt: skip
        table("Requirements", ["quantity", "at", "statistic", "limit (SI)", "why"], required)
        known = [[e.method, e.check, e.verdict, e.why] for e in experiment.expected]
        table("Expected verdicts", ["method", "check", "verdict", "why"], known)


def declare(name: str, named: tuple[Path, ...]) -> None:
    """Print the declaration of an experiment as JSON."""
    print(to_json(find(name, Path.cwd(), named)))


def parameters_of(experiment: Experiment) -> tuple[Parameter, ...]:
    """Every settable path of an experiment, methods included; a method's law with those choices
    alone that it can take, and what it changes of a declared scene as the scene says it."""
    laws = {f"methods.{name}.material.law": laws_of(m) for name, m in experiment.methods.items()}
    own = describe(experiment.parameters)
    by_path = {p.path: p for p in own}

    def told(p: Parameter) -> Parameter:
        if known := laws.get(p.path):
            return replace(p, type="|".join(known))
        of = None if p.doc else by_path.get(p.path.split(".", 2)[2])
        return replace(p, type=of.type, unit=of.unit, doc=of.doc) if of else p

    return (*own, *map(told, describe(experiment.methods, "methods.")))


def _document(experiment: Experiment) -> dict[str, Any]:
    return {
        "name": experiment.name,
        "title": experiment.title,
        "source": experiment.source,
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


def _block(title: str, cells: Sequence[Sequence[str]], keep: int) -> Passage:
    """The first rows of a list, a line each; the last column is cut at the screen's edge."""
    first = [[*map(str, row[:-1]), " ".join(row[-1].split())] for row in cells[:_FIRST]]
    columns = len(first[0]) if first else 0
    lines = rows([""] * columns, first, soft=columns - 1)
    return Passage(title, lines, keep, None, "more: --all", len(cells) - len(first))


def _by_weight(experiment: Experiment) -> list[Parameter]:
    """Parameters by how much they matter: identified ones, those to be given, the material, then
    in their order, those of methods last."""
    free = {path for c in experiment.calibrations for path in c.paths}

    def weight(p: Parameter) -> int:
        if p.path in free:
            return 0
        if p.missing:
            return 1
        if p.path.startswith("material."):
            return 2
        return 4 if p.path.startswith("methods.") else 3

    return sorted(parameters_of(experiment), key=weight)


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
