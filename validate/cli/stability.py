"""`validate study stability`."""

from pathlib import Path

from validate.cli.display import console, progress, relative, table
from validate.report.numbers import MISSING, significant
from validate.study.stability import CELLS, Stability, stability, stability_folder
from validate.study.stored_stability import sentence, write_stability


def run(
    name: str,
    *,
    workers: int | None,
    scheduler: str,
    out: Path | None,
    quick: bool,
    as_json: bool,
) -> int:
    """Runs the map, writes its folder and prints the predictions; 0 where all of them hold."""
    folder = stability_folder(name, out)
    try:
        with progress(f"{name}: study stability") as report:
            found = stability(
                name, quick=quick, out=out, workers=workers, scheduler=scheduler, report=report
            )
    except KeyboardInterrupt:
        kept = sum(1 for _ in (folder / CELLS).glob("*.json"))
        screen = console(error=True)
        screen.print(f"{kept} finished variants are kept; the same command goes on from there")
        raise
    page = write_stability(found, folder)
    if as_json:
        print((page.parent / "results.json").read_text(encoding="utf-8"))
    else:
        _show(found, page)
    return 0 if found.passed else 1


def _show(found: Stability, page: Path) -> None:
    screen = console()
    rows = [
        [p.name, MISSING if p.value is None else significant(p.value), significant(p.limit),
         str(p.count), "holds" if p.holds else "FAILS"]
        for p in found.predictions
    ]  # fmt: skip
    head = ("prediction", "worst / 1", "limit / 1", "count", "verdict")
    screen.print(table("Predictions against measured radii", head, rows))
    quick = "QUICK: fewer points; " if found.quick else ""
    screen.print(f"\n{quick}{sentence(found)}", soft_wrap=True)
    screen.print(
        f"{len(found.cells)} variants, {found.reused} of them finished before; {found.seconds:.1f} "
        f"s on {found.workers}; report: {relative(page)}",
        soft_wrap=True,
    )
