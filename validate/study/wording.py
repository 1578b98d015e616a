"""How a filter study puts things into words: settings, seeds, and how honest a filter is."""

from collections.abc import Mapping, Sequence

from validate.estimate.consistency import Consistency, nis_consistency
from validate.study.outcome import CellResult
from validate.study.plan import METHODS


def consistency(result: CellResult) -> Consistency | None:
    """NIS of all seeds together; None for a method without innovations."""
    if result.nis is None or not result.nis_dof:
        return None
    return nis_consistency([result.nis], [result.nis_dof])


def named(values: Mapping[str, str] | Sequence[tuple[str, str]]) -> str:
    """Settings as read: `Q=1e-09, R=1e-09`."""
    pairs = values.items() if isinstance(values, Mapping) else values
    return ", ".join(f"{short(k)}={v}" for k, v in pairs) or "as declared"


def seeds_text(count: int) -> str:
    return "1 seed" if count == 1 else f"{count} seeds"


def short(path: str) -> str:
    """`Q` of `methods.kf.Q`, `twin.noise` as it is."""
    inner = path.split(".", 2)[2] if path.startswith(METHODS) else path
    return inner.removeprefix("settings.")
