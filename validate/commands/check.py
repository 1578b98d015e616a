"""`validate check`: published figures and declared verdicts against current results."""

import json
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from validate.commands.arguments import Detail, complain
from validate.commands.display import print_views, relative, say, shown
from validate.commands.progress import progress
from validate.commands.run import each
from validate.commands.run_screen import figures_line
from validate.commands.screen import Passage, check_passages, rows, sentences, show
from validate.compare.result import KINDS, Result
from validate.engine.execution import CELLS
from validate.engine.pool import Pool
from validate.errors import UsageError, ValidateError
from validate.library.single_run import by_cells
from validate.pipeline.bodies.first_modes import assumed_density, first_frequencies
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.options import Options
from validate.pipeline.experiment.origins import opened
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.run.cached_runs import stored_run
from validate.pipeline.run.cells import InStore
from validate.pipeline.run.job import reports_of, run_folder
from validate.pipeline.run.pipeline import compare
from validate.report.long_table import long_table
from validate.report.sections.motion_words import motion_lines
from validate.report.stored.folder import try_results
from validate.report.stored.json_values import members
from validate.report.stored.store import check_members, figure_members, overall_members
from validate.scene.scene import Scene
from validate.study.stored_runs.published_page import FOLDER, write_published

Json = dict[str, Any]


def check(
    names: tuple[str, ...],
    *,
    named: tuple[Path, ...],
    pool: Pool,
    out: Path | None,
    fresh: bool,
    as_json: bool,
    detail: Detail = "screen",
) -> int:
    """Check every figure and verdict of matching stored runs, else of new ones, which leave no
    report, and write the page of printed figures; `fresh`: nothing that is stored is used. 0 when
    no figure moved and every verdict is the declared one."""
    found: list[Json] = []
    figures: list[Json] = []
    home, reports = reports_of(None, out), None
    try:
        try_results(home / FOLDER, ())
        reports = home
    except UsageError as error:
        if out:
            raise
        complain(f"no page of printed figures: {error}")

    def one(experiment: Experiment) -> bool:
        content, why = None, ""
        if not fresh:  # the stored run, where it would be made again from the same
            folder = run_folder(experiment, Options({}), out)
            content, why = stored_run(experiment, folder)
        if content is not None:
            run = f"stored run of {content['created']} ({relative(folder)})"
            say(f"{experiment.name}: {run}; --fresh repeats it", error=True)
        else:
            if why:
                say(f"{experiment.name}: run again: {why}", error=True)
            with (
                TemporaryDirectory(prefix="validate-") as empty,
                progress(f"check {experiment.name}") as report,
            ):
                own = reports_of(experiment.path, out) / experiment.name
                store = own if (own / CELLS).is_dir() and not fresh else Path(empty)
                by = InStore(experiment, Options({}), store, pool)
                place = out if store == own else Path(empty)
                identify = by_cells(experiment, Options({}), place, report, pool)
                content = _content(compare(experiment, Options({}), report, identify, by))
        motion = described(experiment)
        held = _document(content, declared=bool(experiment.published))
        found.append({**held, "motion": motion})
        # What the page of printed figures shows of an experiment
        now = datetime.now(UTC).isoformat(timespec="seconds")
        figures.append({
            "experiment": experiment.name, "title": experiment.title, "source": content["source"],
            "checked": content["created"] or now, "holds": held["holds"],
            "published": content["published"],
        })  # fmt: skip
        if not as_json:
            _show(content, found[-1], detail)
        return bool(found[-1]["holds"])

    def failed(name: str, why: str) -> None:
        found.append({"experiment": name, "holds": False, "error": why})

    code = each(names, named, one, failed)
    page = write_published(reports, figures) if reports else None
    if page and not as_json:
        say(f"printed figures: {relative(page)}")
    if as_json:
        print(json.dumps(found, ensure_ascii=False, indent=1, allow_nan=False))
    return code


def _content(result: Result) -> Json:
    """What of results.json is shown here."""
    return {
        "experiment": result.name,
        "created": None,
        "kind": result.kind,
        "source": result.source,
        "passed": result.passed,
        "expected": [members(e) for e in result.expected],
        "moved": [members(m) for m in result.moved] if result.expected else [],
        "overall": overall_members(result.overall),
        "published": [figure_members(p) for p in result.published],
        "methods": [
            {"name": m.name, "checks": [check_members(c) for c in m.checks]} for m in result.methods
        ],
    }


def _document(content: Json, *, declared: bool) -> Json:
    """Return the document of one experiment.

    It holds where verdicts are the declared ones (none declared: the run passed) and figures stand;
    an experiment that declares figures must have held some.
    """
    held_some = any(not p["other"] for p in content["published"]) or not declared
    checks = [{"method": m["name"], **c} for m in content["methods"] for c in m["checks"]]
    as_declared = not content["moved"] if content["expected"] else bool(content["passed"])
    fallen = any(p["fault"] for p in content["published"])
    return {
        "experiment": content["experiment"],
        "holds": bool(checks) and as_declared and held_some and not fallen,
        "expected": content["expected"],
        "moved": content["moved"],
        "stored": content["created"],
        "published": content["published"],
        "checks": checks,
    }


def _show(content: Json, document: Json, detail: Detail = "screen") -> None:
    """The answer first: what no longer stands, then how many figures have which verdict."""
    results = [p for p in content["published"] if p["result"]]
    fallen = [p for p in content["published"] if p["fault"]]
    moved, overall = content["moved"], content["overall"]
    parts = [f"the verdict is {overall['verdict']}"]
    parts += [f"verdicts changed: {len(moved)}"] if moved else []
    parts += [f"printed figures that no longer hold: {len(fallen)}"] if fallen else []
    holds = "holds" if document["holds"] else "does not hold"
    warnings = [f"{m['method']}: {m['check']} is {m['found']}; expected: "
                f"{m['expected'] or 'not declared'}" for m in moved]  # fmt: skip
    known = [f"expected: {e['check']} of {e['method']} is {e['verdict']}, because of {e['why']}"
             for e in content["expected"]]  # fmt: skip
    checks = document["checks"]
    figures = sorted(results, key=lambda p: (not p["fault"], _CLAIMS.index(p["claim"])))
    cells = [[p["name"], shown(p["ours"], p["unit"]), shown(p["theirs"], p["unit"]), p["verdict"]]
             for p in figures]  # fmt: skip
    full = detail == "full"
    show(
        (
            sentences([f"{content['experiment']}: {holds}; {', '.join(parts)}."], None),
            sentences(f"warning: {w}" for w in warnings),
            sentences(known, keep=1, most=4),
            sentences((f"{p['name']}: {p['fault']}" for p in fallen), keep=2, most=6),
            *([] if full else check_passages(checks)),
            Passage("Printed figures: ours, theirs", () if full or not cells else rows(
                [""] * 4, cells), 3, 8),
            figures_line(results),
            sentences(document["motion"], keep=1, most=3),
        ),
        detail,
    )  # fmt: skip
    if full:
        say(f"{KINDS[content['kind']]}; {content['source']}")
        print_views(long_table(content, content["experiment"]), "checks", "published", "settings")


_CLAIMS = ("not reproduced", "not reproducible as printed", "reproduced", "not comparable")


def described(experiment: Experiment) -> tuple[str, ...]:
    """Return a line for each stream of the first recording that moves, and one of the first modes.

    Empty where the recording cannot be read, or nothing of it moves in time.
    """
    try:
        found = opened(experiment, experiment.parameters)
    except ValidateError:
        return ()
    lines = motion_lines(found.recordings[0]) if found.recordings else ()
    p = found.parameters
    unknown = isinstance(p, Tree) and isinstance(p.scene, Scene) and p.scene.material.E is None
    if not lines or unknown:
        return lines
    # Modes of the first model; none of a body that nothing holds
    model = next(iter(experiment.methods.values())).scene
    try:
        scene = experiment.build(found.recordings[0], p, model)
        modes = first_frequencies(scene) if isinstance(scene, Scene) else ()
    except (ValidateError, np.linalg.LinAlgError):
        modes = ()
    if not modes:
        return lines
    words = ", ".join(f"{f:.3g}" for f in modes)
    assumed = assumed_density(p)
    return (*lines, f"first modes of the body: {words} Hz{assumed and f' ({assumed})'}")
