"""Summary of all stored runs: which predict, bias and scatter by measured quantity; its page."""

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from itertools import groupby, starmap
from pathlib import Path
from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.compare.bias import Estimated, Predicted, Statement, area_metric, statement
from validate.compare.exhibit import Chart, Exhibit, NumberTable, Series, TableCell
from validate.compare.verdict import NO_EVIDENCE
from validate.errors import RecordingError, UsageError
from validate.numbers import scale, shown_unit, significant, text, to_decimal_of, with_unit
from validate.report.export.table_file import stored_table
from validate.report.long_table import checks_of
from validate.report.stored.json_values import Json
from validate.report.stored.tables import report_folders
from validate.report.views.view_filling import Shown, chart, grouped, table, value
from validate.study.loose_page import write_loose

# --- predictions of stored runs, and why others do not count -------------------------------------

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
    """A run with its predictions, where it may count; None for what is no run: a comparison, a
    summary, a study."""
    try:
        table = stored_table(folder, part=("check", "check.*"))
        if not table.of_run:
            return None
        head, why = table.head, _unfit(table.head)
        if why:
            return Seen(folder.name, why, head["kind"])
        inputs = sorted(i["sha256"] or i["path"] for i in head["inputs"])
        changed = sorted(
            f"{c['path']}={c['value']}"
            for c in head.get("changed", [])
            if c["path"].rpartition(".")[2] not in _LOCATES
        )
        run = Seen(
            folder.name, "", head["kind"], head["created"], (head["experiment"], *inputs),
            tuple(changed), tuple(head["domain"]),
        )  # fmt: skip
        # What the first accepted method predicted, and why its other checks, and those of other
        # methods, do not count.
        method = next(m["name"] for m in head["methods"] if m.get("accepted"))
        specimen = ", ".join(sorted({d["specimen"] for d in run.domain}))
        predicted: list[Foretold] = []
        left: dict[str, int] = {}
        for check in checks_of(table.rows):
            other = check["method"] != method
            why = "from another method on the same data" if other else _no_evidence(check)
            if why:
                left[why] = left.get(why, 0) + 1
                continue
            size = check["size"]
            # Many thousand predictions share their texts.
            name, kind, unit = (sys.intern(check[k]) for k in ("name", "kind", "unit"))
            predicted.append(Foretold(
                (run.folder,), run.recorded[0], sys.intern(method), name, kind, unit, specimen,
                size["measured"], size["simulated"], size["u"], check["value"], check["u_val"],
                float(np.hypot(check["u_num"], check["u_input"])), check["u_D"],
                sys.intern(check["verdict"]), run.changed,
            ))  # fmt: skip
        return replace(run, predicted=tuple(predicted), left=left)
    except RecordingError as error:
        return Seen(folder.name, str(error))
    except (KeyError, TypeError, AttributeError) as error:
        return Seen(folder.name, f"its results cannot be read: {error!r:.60}")


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


# --- summary of all stored runs: bias and scatter of predictions by quantity ---------------------

Range = tuple[float, float] | None


@dataclass(frozen=True)
class Covered:
    """The least and the largest that the predictions of a kind reached: size in `unit`, strain 1,
    rate 1/s, side of the body m. None where no run says."""

    size: Range
    unit: str
    strain: Range
    rate: Range
    sides: Range


@dataclass(frozen=True)
class OfKind:
    """Bias and scatter of predictions of one kind of quantity.

    `stated` is None where a prediction has the wrong sign: then there is no ratio; `why` says so,
    and why an interval is missing.
    """

    kind: str
    points: tuple[Foretold, ...]
    stated: Statement | None
    covered: Covered
    why: str


@dataclass(frozen=True)
class Summary:
    """`kinds` of measured recordings, `twins` apart; the runs with why they do not count; checks
    that do not count, by reason."""

    reports: Path
    runs: tuple[Seen, ...]
    kinds: tuple[OfKind, ...]
    twins: tuple[OfKind, ...]
    left: dict[str, int]

    @property
    def taken(self) -> tuple[Seen, ...]:
        return tuple(run for run in self.runs if not run.why)


def summary(reports: Path) -> Summary:
    """Over every run below a folder of reports. Raises `UsageError` where none counts."""
    runs = stored_runs(reports) if reports.is_dir() else ()
    measured = [r for r in runs if not r.why and r.kind == "measured"]
    twins = [r for r in runs if not r.why and r.kind == "twin"]
    if not measured and not twins:
        seen = "; ".join(f"{r.folder}: {r.why or r.kind}" for r in runs[:3])
        raise UsageError(
            f"no run below {reports} counts ({seen or '0 runs'}); `validate run silicone_beam` "
            "makes one of a measured recording"
        )
    (points, left), (made, _) = predictions(measured), predictions(twins)
    return Summary(reports, runs, _kinds(points, measured), _kinds(made, twins), left)


def area_of(point: Foretold) -> float:
    """Return the area metric of one prediction, in its unit."""
    return area_metric(point.error, point.u_simulated, point.u_measured)


def _kinds(points: Sequence[Foretold], runs: Sequence[Seen]) -> tuple[OfKind, ...]:
    """By kind, and by unit where a kind has several: newtons and an unknown unit stay apart."""
    groups = dict.fromkeys((p.kind, p.unit) for p in points)
    return tuple(
        _of_kind(kind, [p for p in points if (p.kind, p.unit) == (kind, unit)], runs)
        for kind, unit in sorted(groups)
    )


def _of_kind(kind: str, points: list[Foretold], runs: Sequence[Seen]) -> OfKind:
    turned = [p for p in points if p.simulated <= 0]
    folders = {f for p in points for f in p.folders}
    domains = [d for r in runs if r.folder in folders for d in r.domain]
    sizes = [p.measured for p in points]
    covered = Covered(
        (min(sizes), max(sizes)),
        points[0].unit,
        _range(domains, lambda d: [d["strain"]]),
        _range(domains, lambda d: [d["rate"]]),
        _range(domains, lambda d: d["sides"] or []),
    )
    if turned:
        first = turned[0]
        why = (
            f"{len(turned)} of {len(points)} predictions have the wrong sign "
            f"({first.experiment}: {first.check}): a ratio is not possible"
        )
        return OfKind(kind, tuple(points), None, covered, why)
    stated = statement(
        [Predicted(p.specimen, float(np.log(p.simulated / p.measured)), p.u / p.measured)
         for p in points]
    )  # fmt: skip
    few = "one specimen: no interval over specimens" if stated.specimens == 1 else ""
    return OfKind(kind, tuple(points), stated, covered, few)


def _range(domains: Sequence[Json], of: Callable[[Json], list[Any]]) -> Range:
    found = [float(value) for d in domains for value in of(d) if value is not None]
    return (min(found), max(found)) if found else None


_PERCENT = 100.0
_ROWS = 300  # of a table on the page
_NAMED = 28  # experiments of a chart by name
_ROOM = 1.3  # of a chart beyond its points, both ways
#: Of a row's texts: what is stated, then where it holds.
STATED = ("quantity", "bias / %", "scatter / %", "measurement / %", "predictions", "specimens")
COVERED = ("size", "strain / %", "rate / 1/s", "body / mm")
_WORDS = (
    "Bias: predicted over true, less one. Scatter: relative standard deviation of the "
    "predictions, without that of the measurements (a separate column). Unknown moduli, "
    "geometry and friction are included in it. Both with 95 % intervals over specimens "
    "(McGrattan and Toman 2011; NUREG-1824).",
    "Repeats of one specimen under one load count once. All specimens have the same weight, "
    "whatever the number of their loads. Undecided checks count. Fitted checks, quick runs "
    "and runs with warnings do not. The first accepted method of each run counts.",
    "A row is valid only for the sizes, strains, rates and bodies that it names.",
)


def write_summary(found: Summary, folder: Path) -> Path:
    """Replace `folder`; returns the path of report.html. Raises what `replace_folder` does."""
    told = (
        "summary", "Prediction errors over all stored runs", f"{len(found.taken)} stored runs",
        sentence(found),
    )  # fmt: skip
    points, all_points = _points("predictions", found.kinds)
    columns: Mapping[str, Shown] = {
        "run": "folder", "counts": lambda r: "does not count" if r.why else "counts", "why": "why",
    }  # fmt: skip
    all_runs = table("runs", "Below one folder of reports.", found.runs, columns, below="why")
    note = _more("runs", len(all_runs.rows), "first")
    runs = replace(all_runs, name="", rows=all_runs.rows[:_ROWS], note=note)
    # Twins in tables of their own.
    twins: tuple[Exhibit, ...] = ()
    if found.twins:
        words = ("Recordings made by our finer models; they are not measurements.",)
        page, data = _points("twin_predictions", found.twins)
        tables = (_table("twins", found.twins), page)
        twins = (Exhibit("twins", "Twins", words, tables, data=(data,)),)
    left = tuple(f"{_count(number, 'check')} of these runs not counted: {why}."
                 for why, number in found.left.items())  # fmt: skip
    exhibits = (
        Exhibit("statement", "Measured recordings", _WORDS, (_table("statement", found.kinds),),
                tuple(starmap(_against, enumerate(found.kinds, 1)))),
        *twins,
        Exhibit("predictions", "Predictions that count", tables=(points,), data=(all_points,)),
        Exhibit("runs", "Counted and excluded runs", left, (runs,),
                data=(all_runs,)),
    )  # fmt: skip
    return write_loose(told, exhibits, document(found, predictions=False), folder, "Summary")


def sentence(found: Summary) -> str:
    """Return the statement over measured recordings in one sentence."""
    if not found.kinds:
        return "No stored run of a measured recording counts; twins are in a separate table."
    points = sum(len(k.points) for k in found.kinds)
    specimens = len({p.specimen for k in found.kinds for p in k.points})
    parts = "; ".join(f"{k.kind} {_short(k)}" for k in found.kinds)
    return f"{_count(points, 'prediction')} of {_count(specimens, 'specimen')}: {parts}."


def _count(number: int, what: str) -> str:
    return f"{number} {what}" + ("s" if number != 1 else "")


def _short(kind: OfKind) -> str:
    if kind.stated is None:
        return f"({kind.why})"
    s = kind.stated
    scatter = ""
    if s.scatter is not None:
        size = f"{percent(s.scatter.value)} %" if s.scatter.value else "no"
        scatter = f", {size} scatter beyond the measurements'"
    return f"{percent(s.bias.value - 1, sign=True)} %{scatter} ({s.points} of {s.specimens})"


def percent(value: float, *, sign: bool = False) -> str:
    """Return a relative value in per cent, two digits."""
    plus = "+" if sign and value > 0 else ""
    return plus + significant(_PERCENT * value, 2)


def row(kind: OfKind) -> tuple[str, ...]:
    """Return a kind of quantity as texts under `STATED` and `COVERED`."""
    s, c = kind.stated, kind.covered
    specimens = len({p.specimen for p in kind.points})
    stated = ("–", "–", "–") if s is None else (
        interval(s.bias, -1.0), "–" if s.scatter is None else interval(s.scatter), percent(s.own)
    )  # fmt: skip
    return (
        kind.kind, *stated, str(len(kind.points)), str(specimens),
        f"{spanned(c.size, c.unit)} {shown_unit(c.unit)}".strip(),
        spanned(c.strain, "1", _PERCENT), spanned(c.rate, "1"), spanned(c.sides, "m"),
    )  # fmt: skip


def interval(found: Estimated, shift: float = 0.0) -> str:
    """Return a value with its interval, in per cent."""
    signed = shift != 0
    if not signed and found.value == 0:
        most = "" if found.high is None else f" (to {percent(found.high)})"
        return f"none beyond the measurements'{most}"
    value = percent(found.value + shift, sign=signed)
    if found.low is None or found.high is None:
        return f"{value} (no interval)"
    ends = (percent(end + shift, sign=signed) for end in (found.low, found.high))
    return f"{value} ({' to '.join(ends)})"


def spanned(found: Range, unit: str, by: float = 1.0) -> str:
    """From the least to the largest, with a unit where the heading has none."""
    if found is None:
        return "–"
    low, high = (text(by * end, unit, 2) for end in found)
    return low if low == high else f"{low} to {high}"


def _table(name: str, kinds: tuple[OfKind, ...]) -> NumberTable:
    rows = tuple((*row(kind), kind.why) for kind in kinds)
    note = "" if rows else "No stored run counts."
    return NumberTable(
        name, "Grouped by measured quantity.", (*STATED, *COVERED, "why"), rows, note, below="why"
    )


_TWO_TICKS = 100.0  # ratio of an axis's ends from which two powers of ten lie on it for certain


def _against(number: int, kind: OfKind) -> Chart:
    """Predicted over measured sizes, with the bands of both."""
    stated, unit = kind.stated, shown_unit(kind.covered.unit) or "1"
    drawn = [p for p in kind.points if p.simulated > 0]
    names = dict.fromkeys(p.experiment for p in drawn)
    others = dict.fromkeys(list(names)[_NAMED:], f"{len(names) - _NAMED} other experiments")
    by_name = grouped(drawn, lambda p: others.get(p.experiment, p.experiment))
    ends = scale(kind.covered.unit) * np.array([(p.measured, p.simulated) for p in drawn])
    x = np.array([ends.min() / _ROOM, ends.max() * _ROOM]) if drawn else np.array([1.0, 10.0])
    series = [*_band("measured = predicted", x, 1.0, stated.own if stated else 0.0)]
    if stated is not None:
        spread = stated.scatter.value if stated.scatter else 0.0
        series += _band("bias of the models", x, stated.bias.value, spread)
    chart_ = chart(
        f"against_{number}", f"{kind.kind}: predicted against measured",
        (f"measured / {unit}", "measured"), (f"predicted / {unit}", "simulated"),
        points=by_name, log="xy" if x[1] >= _TWO_TICKS * x[0] else "",
        caption="All counted checks. Bands: two standard deviations of the measurements, and of "
        "the models' scatter.",
    )  # fmt: skip
    return replace(chart_, series=(*series, *chart_.series))


def _band(label: str, x: Floats, by: float, sd: float) -> Iterator[Series]:
    """The line y = by x, within two relative standard deviations."""
    if sd:
        low, high = (by * x * np.exp(sign * 2 * sd) for sign in (-1, 1))
        yield Series(f"{label}, ± 2 sd", x, low, "band", high)
    yield Series(label, x, by * x)


def _points(name: str, kinds: tuple[OfKind, ...]) -> tuple[NumberTable, NumberTable]:
    """Predictions for the page, those with the largest errors, and all of them for the files."""
    points = [p for k in kinds for p in k.points]
    largest = set(sorted(points, key=lambda p: -abs(p.error) / p.measured)[:_ROWS])
    words = (
        "Sizes are along the measured direction; E, u_val and verdict are those of the check. "
        "Area: between the distributions of prediction and measurement, in the unit of E."
    )
    note = _more(name, len(points), "largest")
    columns: Mapping[str, Shown] = {
        "experiment": "experiment", "check": "check", "specimen": "specimen",
        "measured": _with_unit("measured"), "predicted": _with_unit("simulated"),
        "ratio / 1": lambda p: p.simulated / p.measured, "E": _rounded("error"),
        "u_val": _rounded("u_val"), "area": _with_unit(area_of), "verdict": "verdict",
        "runs": lambda p: ", ".join(p.folders),
    }  # fmt: skip
    page = table("", words, (p for p in points if p in largest), columns, note, below="runs")
    return page, table(name, words, points, {**columns, "unit": "unit"})


def _with_unit(of: Shown) -> Shown:
    """Each number with the unit of its prediction."""
    return lambda p: TableCell(value(p, of), p.unit, with_unit(value(p, of), p.unit))


def _rounded(of: Shown) -> Shown:
    """Each number with its unit, to the decimal of two digits of u_val."""

    def shown(p: Any) -> TableCell:
        number, by = value(p, of), scale(p.unit)
        words = f"{to_decimal_of(by * p.u_val, by * number)[1]} {shown_unit(p.unit)}"
        return TableCell(number, p.unit, words.strip())

    return shown


def _more(name: str, count: int, which: str) -> str:
    """The sentence below a table that shows a part, or nothing."""
    if not count:
        return "None."
    return f"The {which} {_ROWS} of {count}: tables/{name}.csv has all." if count > _ROWS else ""


def document(found: Summary, *, predictions: bool = True) -> dict[str, Any]:
    """One JSON document, SI; without predictions for a folder whose tables/ hold them."""
    return {
        "reports": found.reports.name,
        "sentence": sentence(found),
        "measured": [_stated(k, predictions) for k in found.kinds],
        "twins": [_stated(k, predictions) for k in found.twins],
        "runs": [{"folder": r.folder, "counts": not r.why, "why": r.why} for r in found.runs],
        "checks_left_out": found.left,
    }


def _stated(kind: OfKind, predictions: bool) -> dict[str, Any]:
    stated = {
        "kind": kind.kind, "unit": kind.covered.unit, "why": kind.why,
        "statement": None if kind.stated is None else asdict(kind.stated),
        "covered": asdict(kind.covered),
    }  # fmt: skip
    return stated | ({"predictions": [_members(p) for p in kind.points]} if predictions else {})


def _members(p: Foretold) -> dict[str, Any]:
    names = (f.name for f in fields(p) if f.name != "changed")
    return {name: getattr(p, name) for name in names} | {"area": area_of(p)}
