"""Result of a stored run: verdict, checks, table, fields, figures."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from validate.compare.row import Wanted
from validate.compare.view import View
from validate.display import Screen, listed
from validate.errors import UsageError
from validate.library.plots import Plots, ShownView, plots_of
from validate.numbers import scale, shown_unit, text, to_decimal_of, with_unit
from validate.report.export.table_file import stored_table
from validate.report.long_table import LongTable, content_of
from validate.report.stored.exhibit_rows import NOT_SHOWN
from validate.report.stored.json_values import Json
from validate.report.stored.tables import exhibit_of, stored_folder
from validate.report.views.view_filling import explained
from validate.study.stored_runs.score_comparison import read_table

if TYPE_CHECKING:
    from pandas import DataFrame
    from xarray import Dataset


@dataclass(frozen=True)
class RunCheck:
    """One check of a stored run: error E = simulation - measurement, in `unit` (SI).

    `u_val` is the standard uncertainty of the comparison, `limit` the requirement (None: there is
    none), `margin` what is left of it beyond |E| + 2 u_val, `count` the number of values compared.
    `verdict` is the answer that decides: acceptance, or validation where nothing is required.
    """

    method: str
    name: str
    value: float | None
    u_val: float | None
    unit: str
    limit: float | None
    margin: float | None
    count: int
    acceptance: str
    validation: str
    verdict: str
    why: str


@dataclass(frozen=True, repr=False)
class RunResult:
    """One stored run, as `run` and `open_run` return it.

    It holds verdict, checks and parameters; tables, fields and figures are read from `folder` when
    they are asked for. It can be pickled; the folder has to be there where it is used again. A
    method that reads raises `UsageError` where another run has replaced the folder meanwhile.
    """

    folder: Path
    content: Json = field(hash=False)

    @property
    def name(self) -> str:
        """The name of the run: that of its folder."""
        return self.folder.name

    @property
    def experiment(self) -> str:
        """The name of the experiment."""
        return str(self.content["experiment"])

    @property
    def created(self) -> str:
        """When it was stored, UTC."""
        return str(self.content["created"])

    @property
    def verdict(self) -> str:
        """The verdict over all checks, as "good enough" or "differs"."""
        return str(self.content["overall"]["verdict"])

    @property
    def sentence(self) -> str:
        """The verdict in words."""
        return str(self.content["sentence"])

    @property
    def passed(self) -> bool:
        """Whether the command would exit with 0."""
        return bool(self.content["passed"])

    @property
    def methods(self) -> tuple[str, ...]:
        """The names of the methods that were run."""
        return tuple(str(m["name"]) for m in self.content["methods"])

    @property
    def parameters(self) -> Mapping[str, Any]:
        """Every parameter by path, SI; `content["parameters"]` has unit and origin, too."""
        return {path: p["value"] for path, p in self.content["parameters"].items()}

    @property
    def checks(self) -> tuple[RunCheck, ...]:
        """Every check of the accepted methods."""
        names = RunCheck.__dataclass_fields__
        return tuple(
            RunCheck(**{name: c[name] for name in names if name != "method"}, method=m["name"])
            for m in self.content["methods"] for c in m["checks"]
        )  # fmt: skip

    @property
    def report(self) -> Path:
        """The report as a page."""
        return self.folder / "report.html"

    @property
    def plot(self) -> Plots:
        """The figures by name: `result.plot.limits()` returns a matplotlib Figure."""
        return plots_of(self.folder)

    def table(self, **labels: Wanted) -> LongTable:
        """Return the rows of the long table that fit `labels`, as `quantity="marker.*"`.

        Raises `UsageError` for an unknown column.
        """
        table = stored_table(self.folder, **labels)
        if table.head.get("created") != self.created:
            raise UsageError(
                f"{self.folder}: the run of {self.created} was replaced by one of "
                f"{table.head.get('created')}; open it with open_run"
            )
        return table

    def show(self, view: str | View) -> ShownView:
        """Return a view of the run: "checks", another that `validate show` lists, or one of yours.

        `print` and a notebook show it, or which condition leaves no row; it has `.figures()` and
        `.save(path)`. Raises `UsageError` for an unknown name.
        """
        table = self.table(part=NOT_SHOWN)
        if isinstance(view, str):
            return ShownView(exhibit_of(view, self.folder, table), table)
        return ShownView(explained(view, table), table)

    def to_pandas(self, **labels: Wanted) -> "DataFrame":
        """Return the long table as a DataFrame: one number a row, SI, with its unit and labels.

        `labels` are conditions on columns, as `part="score"`. Raises `UsageError` for an unknown
        column and where pandas is not installed.
        """
        return self.table(**labels).to_pandas()

    def to_xarray(self, method: str = "", recording: int = 1) -> "Dataset":
        """Return fields and traces of a method (default: the first accepted one) as a Dataset.

        `u` is (frame, node, axis) in m, `nodes` (node, axis) in m; each variable has its unit in
        `attrs["units"]`. `recording` counts from 1. Raises `UsageError` for an unknown method or
        recording, and where xarray is not installed.
        """
        from validate.report.export.fields import open_fields

        self.table(part=())
        accepted = [str(m["name"]) for m in self.content["methods"] if m.get("accepted")]
        return open_fields(self.folder, method or next(iter([*accepted, *self.methods])), recording)

    @property
    def _screen(self) -> Screen:
        rows = []
        for c in self.checks:
            error = with_unit(c.value, c.unit)
            if c.value is not None and c.u_val is not None:  # both to one decimal
                factor = scale(c.unit)
                half, shown = to_decimal_of(2 * c.u_val * factor, c.value * factor)
                error = f"{shown} ± {half} {shown_unit(c.unit)}".strip()
            limit = "–" if c.limit is None else text(c.limit, c.unit)
            rows.append((c.method, c.name, error, limit, c.verdict))
        below = (f"methods: {listed(self.methods)}", f"report: {self.report}")
        head = ("method", "check", "E ± 2 u_val", "limit", "verdict")
        return Screen(f"{self.name}: {self.verdict}", (self.sentence,), head, tuple(rows), below)

    def __repr__(self) -> str:
        return self._screen.text

    def _repr_html_(self) -> str:
        return self._screen.html


def open_run(path: str | Path) -> RunResult:
    """Return a stored run: a folder, as `reports/fluid_phantom`, or a name, as `validate show`.

    Raises `UsageError` where no run is stored there, and for the folder of a study.
    """
    folder = stored_folder(path).resolve()
    table = read_table(folder, "score*", "check*", "published*")
    if not table.head.get("methods"):
        raise UsageError(f"{path}: a study or a comparison, not a run; open its report.html")
    return RunResult(folder if folder.is_dir() else folder.parent, content_of(table))
