"""At which size do regions pay? The touched body's rivals by unknowns, as a trade measured them."""

from collections.abc import Iterator
from itertools import groupby

from validate.compare.exhibit import Exhibit, NumberTable
from validate.study.ranking import SAME_TIME
from validate.study.trade import Trade, TradeRow

_MS = 1e3


def regions_exhibit(trade: Trade) -> Exhibit | None:
    """Rivals side by side on every mesh; None for a body without regions."""
    rows = _timed(trade)
    if not any(r.solver.rung == "regions" for r in rows):
        return None
    head = ("mesh", "unknowns", "solver", "step / ms", "median / ms", "slow steps (p99) / ms",
            "worst / ms", f"error / {trade.shown_unit}")  # fmt: skip
    shown = tuple(
        (r.level, r.unknowns, r.solver.name, _MS * r.dt, _MS * r.step.p50, _MS * r.step.p99,
         _MS * r.step.max, None if r.error is None else trade.scale * r.error)
        for r in rows if r.step
    )  # fmt: skip
    table = NumberTable(
        "regions", "Times of a step by body size, without forming displacements", head, shown
    )
    return Exhibit(
        "regions", "Body size from which regions are faster", tuple(pays(trade)), tables=(table,)
    )


def pays(trade: Trade) -> Iterator[str]:
    """What the times say, size by size; nothing for a body without regions."""
    rows = _timed(trade)
    if not any(r.solver.rung == "regions" for r in rows):
        return
    for _, mine in groupby(rows, key=lambda r: (r.element, r.level)):
        if words := _of_size(list(mine)):
            yield words
    yield (
        "Regions are slow in the steps in which far regions are also solved; a deadline must "
        "allow for them. (A busy machine lengthens the slow steps of every method.) A reduced "
        "model is valid for a linear body whose contact does not move. Regions are useful "
        "where matrices change at every step, or where another machine solves the far region."
    )


def _of_size(rows: list[TradeRow]) -> str:
    """Whole, fastest regions and reduced model of one mesh."""
    regions = _fastest(rows, "regions")
    whole, reduced = _fastest(rows, "prefactored"), _fastest(rows, "modal")
    if regions is None or whole is None or not (regions.step and whole.step):
        return ""
    faster = "faster" if SAME_TIME * regions.step.p50 < whole.step.p50 else "not faster"
    holds = "shorter" if SAME_TIME * regions.step.p99 < whole.step.p99 else "not shorter"
    words = (
        f"{rows[0].unknowns} unknowns: regions ({regions.solver.name}) are {faster} than the whole "
        f"solve in the median ({_MS * regions.step.p50:.3g} for {_MS * whole.step.p50:.3g} ms) and "
        f"{holds} in slow steps ({_MS * regions.step.p99:.3g} for {_MS * whole.step.p99:.3g} ms)"
    )
    if reduced is None or reduced.step is None:
        return f"{words}."
    return f"{words}; '{reduced.solver.name}' takes {_MS * reduced.step.p50:.3g} ms."


def _fastest(rows: list[TradeRow], rung: str) -> TradeRow | None:
    mine = [r for r in rows if r.solver.rung == rung and r.step]
    return min(mine, key=lambda r: r.step.p50 if r.step else 0.0, default=None)


def _timed(trade: Trade) -> list[TradeRow]:
    """Rows with times at the ladder's longest step, by mesh."""
    dt = trade.trial.steps[0]
    rows = [r for r in trade.rows if r.step and r.dt == dt]
    return sorted(rows, key=lambda r: (r.element, r.unknowns))
