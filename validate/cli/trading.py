"""`validate study tradeoff` and `validate study choose`."""

from pathlib import Path

from validate.cli.display import console, progress, relative, table
from validate.report.numbers import MISSING, significant
from validate.study import trade_page
from validate.study.choose import Choice, choose, error_of, wanted
from validate.study.choose_exhibits import words
from validate.study.trade import Trade, trade
from validate.study.trade_scenes import trade_scene

_OK, _NOTHING_MEETS = 0, 1


def tradeoff(name: str, *, out: Path | None, quick: bool, as_json: bool) -> None:
    """Runs the trade, writes its folder and prints both fronts."""
    found = _measured(name, quick)
    page = trade_page.write_trade(found, trade_page.folder_of(found, trade_page.TRADEOFF, out))
    if _printed(page, as_json):
        return
    screen = console()
    for by, title in (("error", "Pareto front, declared law"), ("total", "with the law's share")):
        screen.print(table(title, ("solver", "element", "mesh", "error / mm", "time / us"),
                           _front(found, by)))  # fmt: skip
    for by in ("error", "total"):
        if found.front(by).dominated:
            named = "; ".join(found.front(by).dominated)
            screen.print(f"dominated ({by}): {named}", soft_wrap=True)
    screen.print(f"\n{trade_page.sentence(found)}", soft_wrap=True)
    screen.print(f"{found.seconds:.1f} s; report: {relative(page)}", soft_wrap=True)


def choosing(
    name: str, *, error: str, rate: str, declared_law: bool, out: Path | None, quick: bool,
    as_json: bool,
) -> int:  # fmt: skip
    """Runs the pilots, climbs the ladder; 0 when a method meets both, else 1."""
    want = wanted(error, rate)
    choice = choose(_measured(name, quick), want, declared_law)
    folder = trade_page.folder_of(choice.trade, trade_page.CHOOSE, out)
    page = trade_page.write_choice(choice, folder)
    if not _printed(page, as_json):
        _show(choice, page)
    return _OK if choice.pick is not None else _NOTHING_MEETS


def _measured(name: str, quick: bool) -> Trade:
    scene = trade_scene(name, quick)
    with progress(f"{name}: pilot runs") as report:
        return trade(scene, quick=quick, report=report)


def _printed(page: Path, as_json: bool) -> bool:
    if as_json:
        print((page.parent / "results.json").read_text(encoding="utf-8"))
    return as_json


def _front(found: Trade, by: str) -> list[list[str]]:
    return [
        [r.cell.solver.name, r.cell.element, str(r.cell.level),
         significant(1e3 * float(getattr(r, by))), significant(1e6 * (r.time_s or 0.0))]
        for r in found.front(by).rows
    ]  # fmt: skip


def _show(choice: Choice, page: Path) -> None:
    screen = console()
    rows = [[f.name, f.value, f.means] for f in choice.facts]
    screen.print(table("The scene's own numbers", ("what", "value", "asks for"), rows))
    rows = []
    for c in choice.ladder:
        error = None if c.best is None else error_of(c.best, choice.by)
        shown = MISSING if error is None else significant(1e3 * error)
        rows.append([c.rung, c.verdict, shown, c.evidence])
    screen.print(table("The ladder", ("rung", "verdict", "error / mm", "evidence"), rows))
    for line in (*choice.rejected, *words(choice)):
        screen.print(line, soft_wrap=True)
    screen.print(f"{choice.trade.seconds:.1f} s; report: {relative(page)}", soft_wrap=True)
