"""View: declaration of a table, chart or sentence over rows of the long table.

View("late_error", "Error at the last markers", {"part": "score", "quantity": "marker.*",
     "statistic": "rms"}, form="lines", x="at", by="method", unit="mm")
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

from validate.compare.row import LongRow, Wanted, require_columns
from validate.errors import UsageError
from validate.parameters import nearest_names

Form = Literal["table", "lines", "points", "intervals", "heat", "sentences"]
Several = Literal["", "last", "largest"]
#: What can be read of a row, besides its columns.
DERIVED = ("name", "expanded", "label")
_COLUMNS = (*LongRow._fields, *DERIVED)


@dataclass(frozen=True)
class View:
    """Rows of the long table as a table, a chart or sentences.

    `name` is that of files and anchors. `rows` are conditions on columns, as `LongTable.where` has
    them. What `x`, `by` and `y` are depends on the form:

    - "table": `x` are the labels of a line, `by` those of a column, `y` what a cell reads;
    - "lines", "points": y over x, a line for each `by`; `x` is a column of numbers, or the name or
      role of a quantity that has a row at the same time. Of `y` "sd" is a band of ± 2 sd;
    - "heat": y as colour over `x` (columns) and `by` (rows);
    - "intervals": y ± 2 sd for each `x`, and its limit (rows `check.limit`) where it has one;
    - "sentences": `text` once for each row, its columns in braces.

    Besides the columns there are "expanded" (2 sd), "name" (quantity.statistic@condition) and
    "label" (what figures call the method). `columns` name the columns of a table (heading to
    "label:column", the label one of `by`; * stands for what both have in common); without them
    every label has one. `also` are columns behind them that hold for a whole line. `each`: one
    table or chart for every value of a column. `less`: y is the difference from the method of this
    name at the same time ("measured"). `several` says which of several rows counts in a cell of a
    table: the last or the largest.
    `unit` is the unit shown ("" the usual one). `below`: a heading whose texts stand below the row.
    """

    name: str
    title: str
    rows: Mapping[str, Wanted]
    form: Form = "table"
    x: str | tuple[str, ...] = ()
    by: str | tuple[str, ...] = ()
    y: str | tuple[str, ...] = "value"
    unit: str = ""
    caption: str = ""
    columns: Mapping[str, str] = field(default_factory=dict)
    also: tuple[str, ...] = ()
    each: str = ""
    several: Several = ""
    log: Literal["", "x", "y", "xy"] = ""
    text: str = ""
    less: str = ""
    folded: bool = False
    below: str = ""

    def __post_init__(self) -> None:
        if self.form not in get_args(Form):
            known = nearest_names(self.form, set(get_args(Form)))
            raise UsageError(f"view '{self.name}': no form '{self.form}'; {known}")
        require_columns(self.rows, LongRow._fields)
        plotted = self.form in ("lines", "points")
        labels = (*(() if plotted else texts(self.x)), *texts(self.by), *self.also, self.each)
        columns = (text.partition(":")[2] for text in self.columns.values())
        for name in (*labels, *texts(self.y), *columns):
            if name and name not in _COLUMNS:
                known = nearest_names(name, set(_COLUMNS))
                raise UsageError(f"view '{self.name}': no column '{name}'; {known}")
        if not texts(self.x) and self.form != "sentences":
            raise UsageError(f"view '{self.name}': x is missing; name a column, e.g. 'method'")

    def to_json(self) -> dict[str, Any]:
        """Every field that is not its default, as JSON has it."""
        default = View("", "", {}, "sentences")
        found = {k: v for k, v in vars(self).items() if v != getattr(default, k) or k == "form"}
        return {k: dict(v) if isinstance(v, Mapping) else v for k, v in found.items()}

    @classmethod
    def from_json(cls, found: Mapping[str, Any]) -> "View":
        """Return the view that `to_json` wrote; lists are tuples. Raises `UsageError` as `View`
        does."""
        return cls(**{k: _tuples(v) for k, v in found.items()})


def _tuples(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {k: _tuples(v) for k, v in value.items()}
    return tuple(value) if isinstance(value, list) else value


def texts(one: str | tuple[str, ...]) -> tuple[str, ...]:
    """One name, or several, as a tuple."""
    return (one,) if isinstance(one, str) else one
