"""Predictions of stored runs: counted runs and checks, and reasons for the others.

A run counts once. Of several runs of the same recordings the one counts with the fewest changed
parameters, then the newest: other settings are no other experiment. Runs of other recordings with
the same settings are repeats: where the specimen is one, their predictions are one.
"""

import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from itertools import groupby
from pathlib import Path

import numpy as np

from validate.compare.verdict import NO_EVIDENCE
from validate.errors import RecordingError
from validate.report.export.table_file import stored_table
from validate.report.long_table import LongTable, checks_of
from validate.report.stored.json_values import Json
from validate.report.stored.tables import report_folders

# Parameters that say where recordings lie: which ones they are, their hashes say.
_LOCATES = ("recording", "recordings", "data", "logs")
_EVIDENCE = ("differs", "not distinguishable")
_ROUGH = 0.25  # relative: a measurement as uncertain as that tells no ratio


@dataclass(frozen=True, slots=True)
class Foretold:
    """A check that was measured and predicted, SI: sizes, the measured one's standard uncertainty,
    error and its uncertainties; several repeats of one specimen are one, by their means.

    Repeats share experiment, check, specimen and `changed` settings: their `key`.
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
    changed: tuple[str, ...]

    @property
    def key(self) -> tuple[str, ...]:
        return self.experiment, self.check, self.specimen, *self.changed


@dataclass(frozen=True, slots=True)
class Seen:
    """A stored run: its folder's name, and why it does not count ("": it does).

    `predicted` are its checks that count, `left` how many do not, by reason. `recorded` tells the
    recordings, `changed` the settings that are not as declared, `domain` what they covered.
    """

    folder: str
    why: str = ""
    kind: str = ""
    created: str = ""
    recorded: tuple[str, ...] = ()
    changed: tuple[str, ...] = ()
    domain: tuple[Json, ...] = ()
    predicted: tuple[Foretold, ...] = ()
    left: Mapping[str, int] = field(default_factory=dict)


def stored_runs(reports: Path) -> tuple[Seen, ...]:
    """Every run below the folder of reports, and whether it counts, by name.

    One run's checks are in memory at a time, and of each what is kept here.
    """
    # Of the same recordings one run counts
    runs = [seen for f in report_folders(reports) if (seen := _read(f)) is not None]
    found = [run for run in runs if run.why]
    fit = sorted((run for run in runs if not run.why), key=lambda run: run.recorded)
    for _, group in groupby(fit, key=lambda run: run.recorded):
        first, *others = sorted(group, key=_standing)
        instead = f"the same recordings as {first.folder}, which is used because "
        found.append(first)
        for other in others:
            fewer = len(other.changed) > len(first.changed)
            reason = "it has fewer changed settings" if fewer else "it is newer"
            found.append(replace(other, why=instead + reason, predicted=(), left={}))
    return tuple(sorted(found, key=lambda run: run.folder))


def _read(folder: Path) -> Seen | None:
    """None for what is no run: a comparison, a summary, a study."""
    try:
        table = stored_table(folder, part=("check", "check.*"))
        return _seen(folder.name, table) if table.of_run else None
    except RecordingError as error:
        return Seen(folder.name, str(error))
    except (KeyError, TypeError, AttributeError) as error:
        return Seen(folder.name, f"its results cannot be read: {error!r:.60}")


def _seen(folder: str, table: LongTable) -> Seen:
    """A run with its predictions, where it may count."""
    head, why = table.head, _unfit(table.head)
    if why:
        return Seen(folder, why, head["kind"])
    inputs = sorted(i["sha256"] or i["path"] for i in head["inputs"])
    run = Seen(
        folder, "", head["kind"], head["created"], (head["experiment"], *inputs), _changed(head),
        tuple(head["domain"]),
    )  # fmt: skip
    predicted, left = _predicted(run, table)
    return replace(run, predicted=predicted, left=left)


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


def _standing(run: Seen) -> tuple[int, list[int]]:
    """Fewest changes first, then the newest."""
    return len(run.changed), [-ord(c) for c in run.created]


def _changed(head: Json) -> tuple[str, ...]:
    return tuple(sorted(
        f"{c['path']}={c['value']}"
        for c in head.get("changed", [])
        if c["path"].rpartition(".")[2] not in _LOCATES
    ))  # fmt: skip


def predictions(runs: Iterable[Seen]) -> tuple[tuple[Foretold, ...], dict[str, int]]:
    """What the runs that count predicted, repeats as one; and how many checks do not count, by the
    reason."""
    found: list[Foretold] = []
    left: dict[str, int] = {}
    for run in runs:
        found += run.predicted
        for why, number in run.left.items():
            left[why] = left.get(why, 0) + number
    found.sort(key=lambda p: p.key)
    repeats = [list(group) for _, group in groupby(found, key=lambda p: p.key)]
    return tuple(_mean(group) for group in repeats), left


def _predicted(run: Seen, table: LongTable) -> tuple[tuple[Foretold, ...], dict[str, int]]:
    """What the first accepted method predicted, and why its other checks, and those of other
    methods, do not count."""
    method = next(m["name"] for m in table.head["methods"] if m.get("accepted"))
    found: list[Foretold] = []
    left: dict[str, int] = {}
    for check in checks_of(table.rows):
        other = check["method"] != method
        why = "from another method on the same data" if other else _no_evidence(check)
        if why:
            left[why] = left.get(why, 0) + 1
        else:
            found.append(_prediction(run, check))
    return tuple(found), left


def _no_evidence(check: Json) -> str:
    """Why a check counts for nothing here."""
    if not check["validation"]:
        return "stored by an older version, with one answer for each check; run it again"
    if check["verdict"] in NO_EVIDENCE or check["validation"] not in _EVIDENCE:
        return str(check["verdict"])
    if not check["count"]:
        return "compared nothing"
    if check["u_num"] is None:
        return "the numerical error has no bound"
    if not check["kind"] or not check["size"]:
        return "the quantity has no size to compare with (a distance, a ratio)"
    if check["size"]["u"] > _ROUGH * check["size"]["measured"]:
        return f"measured with an uncertainty above {100 * _ROUGH:g} %"
    return ""


def _prediction(run: Seen, check: Json) -> Foretold:
    size, experiment = check["size"], run.recorded[0]
    specimen = ", ".join(sorted({d["specimen"] for d in run.domain}))
    # Many thousand predictions share their texts.
    method, name, kind, unit = (sys.intern(check[k]) for k in ("method", "name", "kind", "unit"))
    return Foretold(
        (run.folder,), experiment, method, name, kind, unit, specimen,
        size["measured"], size["simulated"], size["u"], check["value"], check["u_val"],
        float(np.hypot(check["u_num"], check["u_input"])), check["u_D"],
        sys.intern(check["verdict"]), run.changed,
    )  # fmt: skip


def _mean(group: list[Foretold]) -> Foretold:
    """Repeats as one: their mean sizes and errors. Uncertainties are those of one of them, for what
    repeats share is not known; a verdict counts where all agree on it."""
    first = group[0]
    if len(group) == 1:
        return first
    names = ("measured", "simulated", "u", "error", "u_val", "u_simulated", "u_measured")
    means: Json = {n: float(np.mean([getattr(p, n) for p in group])) for n in names}
    verdicts = dict.fromkeys(p.verdict for p in group)
    folders = tuple(f for p in group for f in p.folders)
    return replace(first, folders=folders, verdict=" or ".join(verdicts), **means)
