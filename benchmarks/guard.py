"""Does a change of the code change a result? Stores what reports hold and compares two stores.

python benchmarks/guard.py make DIR [--quick-studies]    runs everything into DIR/run and DIR/study
python benchmarks/guard.py make DIR --quick              quick runs into DIR/run, no studies
python benchmarks/guard.py collect DIR -o FILE.json      what the reports below DIR hold
python benchmarks/guard.py compare A.json B.json [--renames FILE] [--intended FILE]
                                                         a table; exit code 1 if apart

Held are scores, checks (E, u_val, limit), published figures, effects, identified values, and the
tables of studies. Times, rates and what is ranked by them are left out: they never repeat.
Differences that guard_intended.toml lists are printed with their reason and are no failure.
"""

import csv
import json
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import click

RELATIVE, OF_SCALE = 1e-10, 1e-12
AS_LISTED = 1e-4  # relative; values of an intended change are written with a few digits
INTENDED = Path(__file__).with_name("guard_intended.toml")
_QUICK = re.compile(r"\+quick-[0-9a-f]+$")  # folder of a quick run, with a hash of its settings
_TIMED = re.compile(r"^(setup|step)(\.|$)|\brate\b|\bHz$|\bHz,|step over|speed|real-time|seconds")


@dataclass(frozen=True)
class Entry:
    """One number or word; `quantity` and `unit` say with what it shares its scale."""

    value: float | str
    quantity: str
    unit: str


@dataclass(frozen=True)
class Columns:
    """A study's table: `keys` name a row, `left_out` are times and what is chosen by them."""

    keys: tuple[str, ...]
    left_out: tuple[str, ...] = ()


Named = tuple[str, float | str | None, str, str]  # name, value, quantity, unit
_PROSE = ("why", "what", "asks for", "warning", "without_error", "failed")
_VARIANT = ("E / Pa", "nu / 1", "rho / kg/m3", "alpha / 1/s", "beta / s", "mesh", "altitude ratio")
_TRADE = {
    "cells": Columns(
        ("solver", "law", "element", "mesh", "dt_s"),
        ("setup_s", "step_p50_s", "step_p99_s", "step_max_s", "field_s", "time_s", "steps_timed",
         "memory_bytes", "front", "front_with_law"),
    ),
    "convergence": Columns(("ladder", "sizes, finest first")),
    "unscored": Columns(("solver", "element", "mesh", "step / ms")),
    "numbers": Columns(("what",)),
}  # fmt: skip
_STABILITY = {
    "cells": Columns(
        ("scheme", "E_Pa", "nu", "rho_kg_m3", "alpha_1_s", "beta_s", "mesh", "altitude_ratio",
         "dt_s"),
    ),
    "predictions": Columns(("claim",)),
    "limits": Columns(("scheme", *_VARIANT)),
    "conditions": Columns(_VARIANT),
    "drift": Columns(("scheme", "h / ms")),
    "papers": Columns(("setting", "source", "h / ms", "scheme")),
    "refused": Columns(_VARIANT),
}  # fmt: skip
_RANKING = Columns(("method", "settings"), ("step p50 / ms", "step p99 / ms", "Pareto"))
# Filters' cells are named by the method and by every swept path, which the table itself knows.
_FILTERS = {
    "cells": Columns(("method", "methods.*"), ("step_p50_s", "step_p99_s")),
    "ranking_*": _RANKING,
}
_STUDIES = {
    "tradeoff": _TRADE, "choose": _TRADE, "stability": _STABILITY, "filters": _FILTERS,
}  # fmt: skip


def collect(root: Path) -> dict[str, Entry]:
    """Every number of the reports (results.json) below a folder, by a name that says whence."""
    found: dict[str, Entry] = {}
    for path in sorted(root.rglob("results.json")):
        folder = path.parent
        if folder.name.startswith("compare-"):
            continue  # pages about runs that are read themselves
        plain = folder.with_name(folder.name.partition("+")[0])  # a quick study has its own folder
        kind = plain.name.removeprefix("study-")
        study = kind in _STUDIES
        read = _study(folder, _STUDIES[kind]) if study else _run(path)
        place = plain if study else folder.with_name(_QUICK.sub("+quick", folder.name))
        _put(found, place.relative_to(root).as_posix(), read)
    return found


def _put(found: dict[str, Entry], place: str, read: Iterable[Named]) -> None:
    """What has no value is left out; a name that stands twice is told apart by its order."""
    for name, value, quantity, unit in read:
        if value is None or value == "":
            continue
        key, times = f"{place}: {name}", 2
        while key in found:
            key, times = f"{place}: {name} #{times}", times + 1
        found[key] = Entry(value, quantity, unit)


def _run(path: Path) -> Iterator[Named]:
    document = json.loads(path.read_text("utf-8"))
    for method in document["methods"]:
        yield from _method(method)
    yield from _figures("", document["published"])
    for i in document["identified"]:
        yield f"identified {i['name']}", i["value"], i["name"], i["unit"]
    for effect in document.get("effects", ()):
        yield from _effect(effect)


def _method(method: Mapping[str, Any]) -> Iterator[Named]:
    name = method["name"]
    for s in method["scores"]:
        if not _timed(s["name"], s["unit"]):
            yield f"{name} score {s['name']}", s["value"], _quantity(s["name"]), s["unit"]
    for c in method["checks"]:
        if not _timed(c["name"], c["unit"]):
            for part in ("value", "u_val", "limit"):
                key = f"{name} check {c['name']} {part}"
                yield key, c[part], _quantity(c["name"]), c["unit"]
    yield from _figures(f"{name} ", method["published"])


def _figures(of: str, figures: Iterable[Mapping[str, Any]]) -> Iterator[Named]:
    for p in figures:
        if not _timed(p["name"], p["unit"]):
            for part in ("ours", "theirs", "tolerance"):
                yield f"{of}published {p['name']} {part}", p[part], p["name"], p["unit"]


def _effect(effect: Mapping[str, Any]) -> Iterator[Named]:
    for c in effect["changes"]:
        name = f"effect {effect['name']} {c['name']}"
        for part, unit in (("rms", c["unit"]), ("max", c["unit"]), ("separation", "sd")):
            yield f"{name} {part}", c[part], _quantity(c["name"]), unit


def _study(folder: Path, tables: Mapping[str, Columns]) -> Iterator[Named]:
    for pattern, columns in tables.items():
        for path in sorted((folder / "tables").glob(f"{pattern}.csv")):
            yield from _table(path, columns)


def _table(path: Path, columns: Columns) -> Iterator[Named]:
    rows = _rows(path)
    head = rows[0] if rows else {}
    keys = [c for c in head if any(fnmatchcase(c, key) for key in columns.keys)]
    held = [c for c in head if c not in (*keys, *columns.left_out, *_PROSE)]
    for row in rows:
        name = ", ".join(_rounded(row[key]) for key in keys)
        for column in held:
            quantity = f"{path.stem} {column}"
            yield f"{path.stem} [{name}] {column}", _value(row[column]), quantity, ""


def _rounded(text: str) -> str:
    """A setting as part of a name: its last digits are not what is compared."""
    value = _value(text)
    return f"{value:.9g}" if isinstance(value, float) else text


def _rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def _value(text: str) -> float | str | None:
    try:
        return float(text) if text else None
    except ValueError:
        return text


def _quantity(name: str) -> str:
    """What is measured: the name before its statistic and its condition."""
    return name.split("@")[0].split(".")[0]


def _timed(name: str, unit: str) -> bool:
    return unit == "Hz" or _TIMED.search(name) is not None


def write(entries: Mapping[str, Entry], path: Path) -> None:
    """One line an entry, so that two stores can be compared by eye as well."""
    lines = [f"{json.dumps(k)}: {json.dumps([e.value, e.quantity, e.unit])}"
             for k, e in entries.items()]  # fmt: skip
    path.write_text("{\n" + ",\n".join(lines) + "\n}\n", "utf-8")


def read(path: Path) -> dict[str, Entry]:
    return {k: Entry(*parts) for k, parts in json.loads(path.read_text("utf-8")).items()}


@dataclass(frozen=True)
class Comparison:
    """Names that differ, that only the first or only the second store has; how many agree."""

    differ: tuple[str, ...]
    missing: tuple[str, ...]
    new: tuple[str, ...]
    equal: int


def quick_runs(entries: Mapping[str, Entry]) -> bool | None:
    """Return whether a store holds quick runs; None if it holds studies only."""
    runs = {name.partition(": ")[0] for name in entries}
    found = {run.endswith("+quick") for run in runs if "study-" not in run}
    return any(found) if found else None


def compared(a: Mapping[str, Entry], b: Mapping[str, Entry]) -> Comparison:
    """Two stores by name; equal is within 1e-10 relative or 1e-12 of the quantity's scale."""
    scale = _scales([*a.values(), *b.values()])
    shared = [name for name in a if name in b]
    differ = tuple(n for n in shared if _apart(a[n], b[n], scale[a[n].quantity, a[n].unit]))
    return Comparison(
        differ,
        tuple(n for n in a if n not in b),
        tuple(n for n in b if n not in a),
        len(shared) - len(differ),
    )


def _scales(entries: Iterable[Entry]) -> dict[tuple[str, str], float]:
    found: dict[tuple[str, str], float] = {}
    for e in entries:
        size = abs(e.value) if isinstance(e.value, float | int) else 0.0
        found[e.quantity, e.unit] = max(found.get((e.quantity, e.unit), 0.0), size)
    return found


def _apart(a: Entry, b: Entry, scale: float) -> bool:
    if not (isinstance(a.value, float | int) and isinstance(b.value, float | int)):
        return a.value != b.value
    allowed = max(RELATIVE * max(abs(a.value), abs(b.value)), OF_SCALE * scale)
    return not abs(a.value - b.value) <= allowed  # a NaN on one side is a difference


def renamed(entries: Mapping[str, Entry], renames: Mapping[str, str]) -> dict[str, Entry]:
    """Names in which each old part (a method, score, table) has become the new one."""
    return {_replaced(name, renames): entry for name, entry in entries.items()}


def _replaced(name: str, renames: Mapping[str, str]) -> str:
    for old, new in renames.items():
        name = name.replace(old, new)
    return name


def _read_renames(path: Path | None) -> dict[str, str]:
    """`old<TAB>new` a line, or `old new` where neither has a blank."""
    lines = path.read_text("utf-8").splitlines() if path else []
    pairs = [line.split("\t") if "\t" in line else line.split() for line in lines if line.strip()]
    if bad := [pair for pair in pairs if len(pair) != 2]:
        raise click.UsageError(f"{path}: {' '.join(bad[0])}: expected two names, old and new")
    return {old.strip(): new.strip() for old, new in pairs}


@dataclass(frozen=True)
class Intended:
    """One intended change. `name` may hold * and ?; an omitted `old` or `new` is any value."""

    name: str
    reason: str
    old: float | str | None = None
    new: float | str | None = None

    def covers(self, name: str, old: float | str, new: float | str) -> bool:
        """Return whether a difference is this change."""
        # Names of table rows hold brackets: they are no sets of characters here.
        matches = fnmatchcase(name, self.name.replace("[", "[[]"))
        return matches and _as_listed(self.old, old) and _as_listed(self.new, new)


def _as_listed(listed: float | str | None, value: float | str) -> bool:
    if listed is None or listed == value:
        return True
    if not (isinstance(listed, float | int) and isinstance(value, float | int)):
        return False
    if listed != listed or value != value:  # NaN
        return listed != listed and value != value
    return abs(value - listed) <= AS_LISTED * abs(listed)


def read_intended(path: Path) -> tuple[Intended, ...]:
    """Read the tables [[intended]]; raises `UsageError` for other keys or no reason."""
    try:
        document = tomllib.loads(path.read_text("utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise click.UsageError(f"{path}: {error}; correct the file or pass --intended FILE") from (
            error
        )
    tables = document.pop("intended", [])
    if document or not (isinstance(tables, list) and all(isinstance(t, dict) for t in tables)):
        raise click.UsageError(f"{path}: {', '.join(document)}: use tables [[intended]] only")
    return tuple(_intended(path, number, t) for number, t in enumerate(tables, start=1))


def _intended(path: Path, number: int, table: Mapping[str, Any]) -> Intended:
    where = f"{path}: entry {number}"
    if other := sorted(set(table) - {f.name for f in fields(Intended)}):
        raise click.UsageError(f"{where}: {', '.join(other)}: use name, old, new and reason")
    for key in ("name", "reason"):
        if not (isinstance(table.get(key), str) and table[key].strip()):
            raise click.UsageError(f"{where}: {key} = {table.get(key)!r}: write a text")
    for key in ("old", "new"):
        if not isinstance(table.get(key, ""), float | int | str):
            raise click.UsageError(f"{where}: {key} = {table[key]!r}: write a number or a text")
    return Intended(**table)


_STUDY_RUNS = (
    *(("stability", name) for name in ("needle_block", "bending_rod", "kf_cube")),
    *((kind, name) for name in ("fluid_phantom", "bending_rod", "kf_cube_inertia")
      for kind in ("tradeoff", "choose")),
    ("filters", "kf_cube"),
)  # fmt: skip
_OPTIONS = {
    "choose": ("--error", "1mm", "--rate", "1000Hz", "--declared-law"),
    "filters": (
        "--methods", "fem,kf_printed,kf_load,load_scale,kf_reduced",
        "--sweep", "methods.kf_load.settings.Q=log:1e-12:1e-6:3", "--seeds", "3",
    ),
}  # fmt: skip


def commands(out: Path, *, quick_studies: bool, quick: bool = False) -> Iterator[list[str]]:
    """Arguments of `validate` that make every report the guard holds; `quick`: runs only."""
    if quick:
        yield ["run", "--all", "--quick", "--out", str(out / "run")]
        return
    yield ["run", "--all", "--out", str(out / "run")]
    shorter = ["--quick"] if quick_studies else []
    for kind, name in _STUDY_RUNS:
        options = [*_OPTIONS.get(kind, ()), *shorter, "--out", str(out / "study")]
        yield ["study", kind, name, *options]


@click.group(help=__doc__.splitlines()[0] if __doc__ else "")
def main() -> None:
    pass


_FILE = click.Path(path_type=Path)


@main.command()
@click.argument("out", type=_FILE)
@click.option("--quick-studies", is_flag=True, help="Studies in their quick form.")
@click.option("--quick", is_flag=True, help="Experiments in their quick form, and no studies.")
def make(out: Path, quick_studies: bool, quick: bool) -> None:
    """Runs the experiments and the studies; exit 2 where a command could not run."""
    if quick and quick_studies:
        raise click.UsageError("--quick makes no studies: leave out --quick or --quick-studies")
    failed = []
    for arguments in commands(out, quick_studies=quick_studies, quick=quick):
        click.echo("validate " + " ".join(arguments), err=True)
        # 1 is a verdict (a check that failed, a choice that nothing meets), not a failure to run.
        if subprocess.run([sys.executable, "-m", "validate", *arguments]).returncode > 1:
            failed.append(arguments)
    if failed:
        raise click.UsageError(f"{len(failed)} commands did not run: {failed}")


@main.command("collect")
@click.argument("folder", type=_FILE)
@click.option("-o", "out", required=True, type=_FILE)
def collect_(folder: Path, out: Path) -> None:
    """Stores what the reports below FOLDER hold."""
    entries = collect(folder)
    if not entries:
        raise click.UsageError(f"no report below {folder}")
    write(entries, out)
    click.echo(f"{len(entries)} entries in {out}")


@main.command("compare")
@click.argument("first", type=_FILE)
@click.argument("second", type=_FILE)
@click.option("--renames", type=_FILE, help="Old and new name a line, for what moved on purpose.")
@click.option("--intended", type=_FILE, default=INTENDED, help="Changes made on purpose (TOML).")
def compare_(first: Path, second: Path, renames: Path | None, intended: Path) -> None:
    """Prints what differs, what is missing and what is new; exit 1 on the first two."""
    a, b, listed = (
        renamed(read(first), _read_renames(renames)),
        read(second),
        read_intended(intended),
    )
    if None not in (kinds := (quick_runs(a), quick_runs(b))) and kinds[0] != kinds[1]:
        short = first if kinds[0] else second
        raise click.UsageError(
            f"{short} holds quick runs, the other file does not: use --quick for both or none"
        )
    result = compared(a, b)
    known = {n: i for n in result.differ for i in listed if i.covers(n, a[n].value, b[n].value)}
    unexpected = [name for name in result.differ if name not in known]
    for name, change in known.items():
        click.echo(f"intended {name}: {a[name].value} | {b[name].value} ({change.reason})")
    for change in listed:
        if change not in known.values():
            click.echo(f"listed, not seen {change.name} ({change.reason})")
    for name in unexpected:
        click.echo(f"differs  {name}: {a[name].value} | {b[name].value}")
    for name in result.missing:
        click.echo(f"missing  {name}: {a[name].value}")
    for name in result.new:
        click.echo(f"new      {name}: {b[name].value}")
    click.echo(f"{result.equal} equal, {len(unexpected)} differ, {len(result.missing)} missing, "
               f"{len(result.new)} new, {len(known)} intended")  # fmt: skip
    sys.exit(bool(unexpected or result.missing))


if __name__ == "__main__":
    main()
