"""Name of a run: the experiment's name, the user's changes and a short hash.

Nothing is overwritten unseen: a run that computes something else has a folder of its own. What is
computed counts, not how it was typed: `15kPa` and `15000` are one run.
"""

import hashlib
import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from validate.catalogue import reports_of as reports_of
from validate.parameters import Parameter, changed, describe
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.find import loaded_from
from validate.pipeline.experiment.options import (
    Options,
    all_methods,
    configure,
    with_simulators,
)

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
