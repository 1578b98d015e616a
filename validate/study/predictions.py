"""Predictions of stored runs: which runs count, which of their checks, and why the others do not.

A run counts once. Of several runs of the same recordings the one counts with the fewest changed
parameters, then the newest: other settings are no other experiment. Runs of other recordings with
the same settings are repeats: where the specimen is one, their predictions are one.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from validate.compare.verdict import NO_EVIDENCE
from validate.errors import RecordingError
from validate.report.folder import MARK
from validate.seals import read_sealed

Json = dict[str, Any]
# Parameters that say where recordings lie: which ones they are, their hashes say.
_LOCATES = ("recording", "recordings", "data", "logs")
_EVIDENCE = ("differs", "not distinguishable")
_ROUGH = 0.25  # relative: a measurement as uncertain as that tells no ratio


@dataclass(frozen=True)
class Seen:
    """A stored run: its folder's name, and why it does not count ("": it does)."""

    folder: str
    content: Json
    why: str = ""


@dataclass(frozen=True)
class Foretold:
    """A check that was measured and predicted, SI: sizes, the measured one's standard uncertainty,
    error and its uncertainties; several repeats of one specimen are one, by their means.

    `key` tells repeats: experiment, settings, check.
    """

    folders: tuple[str, ...]
    experiment: str
    method: str
    check: str
    kind: str
    unit: str
    specimen: str
    measured: float
    simulated: float
    u: float
    error: float
    u_val: float
    u_simulated: float
    u_measured: float
    verdict: str
    key: tuple[str, ...]


def stored_runs(reports: Path) -> tuple[Seen, ...]:
    """Every run below the folder of reports, and whether it counts, by name."""
    folders = sorted(f for f in reports.iterdir() if f.is_dir() and not f.name.startswith("."))
    read = [seen for f in folders if (f / MARK).is_file() and (seen := _read(f)) is not None]
    return _once(read)


def _read(folder: Path) -> Seen | None:
    """None for what is no run: a comparison, a summary, a study."""
    try:
        content = read_sealed(folder / MARK)
        if "kind" not in content or not content["methods"]:
            return None
        return Seen(folder.name, content, _unfit(content))
    except RecordingError as error:
        return Seen(folder.name, {}, str(error))
    except (KeyError, TypeError, AttributeError) as error:
        return Seen(folder.name, {}, f"its results.json cannot be read: {error!r:.60}")


def _unfit(content: Json) -> str:
    """Why a run is no evidence over experiments."""
    if content.get("quick"):
        return "a quick run"
    if content["kind"] == "same model":
        return "recording and model are the same model"
    if content.get("warnings"):
        return f"warning: {content['warnings'][0]}"
    if "--anyway" in content.get("made", {}).get("command", "").split():
        return "predicted with parameters that are not identifiable (option --anyway)"
    if "domain" not in content:
        return "stored by an older version, without sizes; run it again"
    if not any(m.get("accepted") for m in content["methods"]):
        return "it accepts no method"
    return ""


def _once(runs: Sequence[Seen]) -> tuple[Seen, ...]:
    """Of the same recordings one run counts."""
    found = [run for run in runs if run.why]
    fit = sorted((run for run in runs if not run.why), key=_recorded)
    for _, group in groupby(fit, key=_recorded):
        first, *others = sorted(group, key=_standing)
        instead = f"the same recordings as {first.folder}, which is used because "
        found.append(first)
        for other in others:
            fewer = len(_changed(other.content)) > len(_changed(first.content))
            reason = "it has fewer changed settings" if fewer else "it is newer"
            found.append(Seen(other.folder, other.content, instead + reason))
    return tuple(sorted(found, key=lambda run: run.folder))


def _recorded(run: Seen) -> tuple[str, ...]:
    inputs = run.content["inputs"]
    return (run.content["experiment"], *sorted(i["sha256"] or i["path"] for i in inputs))


def _standing(run: Seen) -> tuple[int, list[int]]:
    """Fewest changes first, then the newest."""
    return len(_changed(run.content)), [-ord(c) for c in run.content["created"]]


def _changed(content: Json) -> list[str]:
    return sorted(
        f"{c['path']}={c['value']}"
        for c in content.get("changed", [])
        if c["path"].rpartition(".")[2] not in _LOCATES
    )


def predictions(runs: Iterable[Seen]) -> tuple[tuple[Foretold, ...], dict[str, int]]:
    """What the runs that count predicted, repeats as one; and how many checks do not count, by the
    reason."""
    found: list[Foretold] = []
    left: dict[str, int] = {}
    for run in runs:
        if run.why:
            continue
        method = next(m for m in run.content["methods"] if m.get("accepted"))
        others = sum(len(m["checks"]) for m in run.content["methods"]) - len(method["checks"])
        _count(left, "from another method on the same data", others)
        for check in method["checks"]:
            if why := _no_evidence(check):
                _count(left, why, 1)
            else:
                found.append(_prediction(run, method["name"], check))
    found.sort(key=lambda p: p.key)
    repeats = [list(group) for _, group in groupby(found, key=lambda p: p.key)]
    return tuple(_mean(group) for group in repeats), left


def _count(left: dict[str, int], why: str, number: int) -> None:
    if number:
        left[why] = left.get(why, 0) + number


def _no_evidence(check: Json) -> str:
    """Why a check counts for nothing here."""
    if "validation" not in check:
        return "stored by an older version, with one answer for each check; run it again"
    if check["verdict"] in NO_EVIDENCE or check["validation"] not in _EVIDENCE:
        return str(check["verdict"])
    if not check["count"]:
        return "compared nothing"
    if check["u_num"] is None:
        return "the numerical error has no bound"
    if not check.get("kind") or not check.get("size"):
        return "the quantity has no size to compare with (a distance, a ratio)"
    if check["size"]["u"] > _ROUGH * check["size"]["measured"]:
        return f"measured with an uncertainty above {100 * _ROUGH:g} %"
    return ""


def _prediction(run: Seen, method: str, check: Json) -> Foretold:
    content, size = run.content, check["size"]
    specimen = ", ".join(sorted({d["specimen"] for d in content["domain"]}))
    experiment = str(content["experiment"])
    return Foretold(
        (run.folder,), experiment, method, check["name"], check["kind"], check["unit"], specimen,
        size["measured"], size["simulated"], size["u"], check["value"], check["u_val"],
        float(np.hypot(check["u_num"], check["u_input"])), check["u_D"], check["verdict"],
        (experiment, check["name"], specimen, *_changed(content)),
    )  # fmt: skip


def _mean(group: list[Foretold]) -> Foretold:
    """Repeats as one: their mean sizes and errors. Uncertainties are those of one of them, for what
    repeats share is not known; a verdict counts where all agree on it."""
    first = group[0]
    if len(group) == 1:
        return first
    names = ("measured", "simulated", "u", "error", "u_val", "u_simulated", "u_measured")
    means = {n: float(np.mean([getattr(p, n) for p in group])) for n in names}
    verdicts = dict.fromkeys(p.verdict for p in group)
    folders = tuple(f for p in group for f in p.folders)
    return Foretold(**vars(first) | means | {"folders": folders, "verdict": " or ".join(verdicts)})
