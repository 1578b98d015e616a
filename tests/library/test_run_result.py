"""A run as an object: the numbers of the command's own files, one screen, pickles, figures."""

import inspect
import json
import pickle
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from command_line import here

import validate
from validate.compare.view import View
from validate.display import COLUMNS, LINES
from validate.errors import UsageError
from validate.estimate.kalman.kf_fem import KfFem
from validate.library import load
from validate.library.run_result import RunResult
from validate.pipeline import run_in_memory
from validate.pipeline.experiment.method import Method
from validate.pipeline.run.runs import ExperimentRuns
from validate.recording.types import Markers, Recording, Signal, Source
from validate.report import VIEWS
from validate.report.stored.store import document
from validate.study.stored_runs.overview import write_overview

# private: _added: plug-ins of the test are taken out again.

pytestmark = pytest.mark.xdist_group("library")


class _Requests(HTMLParser):
    """Everything in a page that a browser would fetch."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found += [f"{tag} {k}" for k, _ in attrs if k in ("src", "href", "srcset", "style")]
        self.found += [tag] if tag in ("script", "link", "iframe", "style") else []


def one_screen(text: str) -> bool:
    lines = text.splitlines()
    return len(lines) <= LINES and max(map(len, lines)) <= COLUMNS


def test_a_run_says_what_results_json_says(ran: RunResult, pulled: Path) -> None:
    stored = json.loads((ran.folder / "results.json").read_text("utf-8"))
    (kf,) = (m for m in stored["methods"] if m["name"] == "kf")
    (check,) = kf["checks"]
    (own,) = ran.checks
    assert (own.method, own.name, own.value, own.u_val) == (
        "kf", check["name"], check["value"], check["u_val"],
    )  # fmt: skip
    assert (own.limit, own.unit, own.verdict) == (1e-3, "m", check["verdict"])
    assert ran.verdict == stored["overall"]["verdict"]
    assert ran.methods == ("kf", "plain")
    assert ran.parameters["material.E"] == 10_000.0
    assert stored["made"]["command"] == "validate run '…/pulled.py' --quick --out '…/reports'"
    assert validate.open_run(ran.folder) == ran == validate.open_run(str(ran.folder))


def test_the_command_finds_the_report_of_the_function_unchanged(
    ran: RunResult, pulled: Path, reports: Path
) -> None:
    """One implementation: what one computed and wrote the other takes."""
    code, out, _ = here("run", str(pulled), "--quick", "--out", str(reports))
    assert code == 0
    assert f"the report of {ran.created} is unchanged" in " ".join(out.split())


def test_the_numbers_are_those_of_a_comparison_in_memory(ran: RunResult, pulled: Path) -> None:
    result = run_in_memory(load(pulled), quick=True)
    (check,) = result.checks
    assert ran.checks[0].value == pytest.approx(check.value, rel=1e-12)
    assert ran.content["sentence"] == document(result, "")["sentence"]


def test_a_table_and_fields_have_units(ran: RunResult) -> None:
    frame = ran.to_pandas(part="check")
    assert list(frame["value"]) == [ran.checks[0].value]
    assert list(frame["unit"]) == ["m"]
    assert len(ran.to_pandas()) == len(ran.table().rows) > 100
    fields = ran.to_xarray("plain")
    assert fields.u.dims == ("frame", "node", "axis")
    assert fields.u.attrs["units"] == "m"
    assert fields.u.shape == (40, 27, 3)
    assert ran.to_xarray().attrs["method"] == "kf"  # the accepted one
    with pytest.raises(UsageError, match="nearest: plain"):
        ran.to_xarray("plan")


def test_everything_fits_on_one_screen(ran: RunResult, softer: RunResult, pulled: Path) -> None:
    result = run_in_memory(load(pulled), quick=True)
    run = result.methods[0].runs[0]
    for thing in (
        ran, validate.compare(ran, softer), ran.plot, load("kf_cube"), load("kf_cube").parameters,
        result, result.methods[0], run, run.traces, result.methods[0].scene,
        *result.recordings, *result.recordings[0].streams.values(),
    ):  # fmt: skip
        if thing is not run.traces:
            assert one_screen(repr(thing)), type(thing)
    assert repr(ran).startswith("pulled+quick")
    assert "0.028 ± 0.025 mm" in repr(ran)


def test_pages_ask_for_nothing(ran: RunResult, softer: RunResult) -> None:
    for page in (
        ran._repr_html_(), validate.compare(ran, softer)._repr_html_(),
        load("kf_cube")._repr_html_(), load("kf_cube").parameters._repr_html_(),
    ):  # fmt: skip
        requests = _Requests()
        requests.feed(page)
        assert requests.found == []
        assert len(page) < 10_000
    hostile = replace(ran, content={**ran.content, "sentence": "<script>x</script>"})
    assert "<script>" not in hostile._repr_html_()


def test_pickles_come_back_equal(ran: RunResult, softer: RunResult, pulled: Path) -> None:
    again = pickle.loads(pickle.dumps(ran))
    assert again == ran
    assert again.to_pandas(part="check").equals(ran.to_pandas(part="check"))
    both = validate.compare(ran, softer)
    assert pickle.loads(pickle.dumps(both)) == both
    recording = run_in_memory(load(pulled), quick=True).recordings[0]
    copy = pickle.loads(pickle.dumps(recording))
    assert copy.metadata == recording.metadata
    for topic, stream in recording.markers.items():
        assert np.array_equal(copy.markers[topic].x, stream.x, equal_nan=True)
        assert not copy.markers[topic].x.flags.writeable


def test_figures_by_name(ran: RunResult) -> None:
    figure = ran.plot.limits()
    assert [label.get_text() for label in figure.axes[0].get_yticklabels()] == [
        "filter: top.max@all"
    ]
    assert figure._repr_png_().startswith(b"\x89PNG")
    assert "limits" in dir(ran.plot)
    assert {"displacement_top", "error_top"} <= set(ran.plot)
    assert ran.plot.error_top().axes[0].lines
    with pytest.raises(AttributeError, match="no figure 'limit'; nearest: limits"):
        _ = ran.plot.limit


def test_a_comparison_has_figures_and_tables_by_name(ran: RunResult, softer: RunResult) -> None:
    both = validate.compare(ran, softer)
    assert list(both.plot) == ["pair_1", "changes_1", "parameters"]
    assert both.plot.changes_1().axes
    assert "10000 Pa" in repr(both.plot.parameters())
    assert "top.max" in both.plot.pair_1()._repr_html_()


def test_a_recording_has_figures_by_topic() -> None:
    """Signals over time in the shown unit; of markers how far each moved since it was seen."""
    t = np.arange(3.0)
    x = np.zeros((3, 2, 3))
    x[:, 0, 2], x[:, 1, 0] = 1e-3 * t, (np.nan, 5e-3, 7e-3)
    recording = Recording(
        "two", Source("a.mcap", "", 0, "made here"), 0,
        markers={"tracker/skin": Markers(t, ("a", "b"), x, 1e-4, "world")},
        signals={"force": Signal(t, 2 * t[:, None], "N", 0.1, "machine")},
    )  # fmt: skip
    assert list(recording.plot) == ["force", "tracker_skin"]
    moved, pulled = (recording.plot.tracker_skin().axes[0], recording.plot.force().axes[0])
    lines = {line.get_label(): line.get_xydata() for line in moved.lines}
    assert lines["a"].tolist() == [[0, 0], [1, 1], [2, 2]]
    assert lines["b"].tolist() == pytest.approx(np.array([[1, 0], [2, 2]]))
    assert pulled.lines[0].get_ydata().tolist() == [0, 2, 4]
    assert (moved.get_xlabel(), pulled.get_ylabel()) == ("time / s", "force / N")
    assert moved.get_ylabel().endswith(" / mm")
    with pytest.raises(AttributeError, match="nearest: force"):
        _ = recording.plot.forces


def test_runs_compared_by_the_function_and_by_the_command(
    ran: RunResult, softer: RunResult
) -> None:
    both = validate.compare(ran, str(softer.folder), scores=["top.rms*"], sort="stored")
    code, out, _ = here("compare", str(ran.folder), str(softer.folder), "--json",
                        "--score", "top.rms*", "--sort", "stored")  # fmt: skip
    assert code == 0
    document = json.loads(out)
    assert [list(r.values) for r in both.scores.rows] == [s["values"] for s in document["scores"]]
    assert both.parameters == {"material.E": ("10000 Pa", "8000 Pa")}
    frame = both.to_pandas()
    assert list(frame.columns) == ["method", "score", "unit", ran.name, softer.name]
    assert np.array_equal(frame[ran.name], [r.values[0] for r in both.scores.rows])
    with pytest.raises(UsageError, match="1 run to compare"):
        validate.compare(ran)


def test_a_run_that_was_replaced_says_so(ran: RunResult) -> None:
    old = replace(ran, content={**ran.content, "created": "2020-01-01T00:00:00+00:00"})
    with pytest.raises(UsageError, match=r"the run of 2020-01-01\S+ was replaced"):
        old.to_pandas()
    with pytest.raises(UsageError, match="was replaced"):
        old.to_xarray()


def test_what_is_no_run_is_refused(tmp_path: Path, ran: RunResult) -> None:
    with pytest.raises(UsageError, match="no stored run at"):
        validate.open_run(tmp_path)
    overview = write_overview(ran.folder.parent).parent
    with pytest.raises(UsageError, match="not a run"):
        validate.open_run(overview)


def test_words_of_another_kind_are_refused_before_a_run() -> None:
    with pytest.raises(UsageError, match="list of names"):
        validate.run("kf_cube", methods="fem")
    with pytest.raises(UsageError, match="values by path"):
        validate.run("kf_cube", set="E=3")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Method("f", 7), "found 7"),
        (lambda: Method("f", KfFem), r"found the class KfFem; give KfFem\(\)"),
        (lambda: Method("f", KfFem(0.01)), "the filter KfFem is given no markers"),
        (lambda: Method("f", KfFem(0.01), markers=("tap",)), "'f' is a filter: marker 'tap'"),
        (None, r"pulled accepts none of its methods.*accepted=\(.kf.,\)"),
    ],
)
def test_what_cannot_be_run_is_refused_before_anything_is_solved(
    pulled: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    make: Callable[[], Method] | None, says: str,
) -> None:  # fmt: skip
    def solved(*_: object, **__: object) -> None:
        raise AssertionError("it was to be refused first")

    monkeypatch.setattr(ExperimentRuns, "start", solved)
    experiment = load(pulled)

    def run() -> None:
        more = {"f": make()} if make else {}
        changed = replace(experiment, methods={**experiment.methods, **more})
        validate.run(changed if make else replace(changed, accepted=()), quick=True, out=tmp_path)

    with pytest.raises(UsageError, match=says):
        run()


def test_a_run_without_an_accepted_method_warns_before_it_solves(
    pulled: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def solved(*_: object, **__: object) -> None:
        raise UsageError("solved")

    monkeypatch.setattr(ExperimentRuns, "start", solved)
    with pytest.raises(UsageError, match="solved"):
        validate.run(pulled, methods=["plain"], quick=True, out=tmp_path)
    assert "none of the chosen methods is accepted" in caplog.text
    assert "add one of kf" in caplog.text


def test_a_view_of_others_that_cannot_be_filled_costs_a_warning(
    ran: RunResult, request: pytest.FixtureRequest, caplog: pytest.LogCaptureFixture
) -> None:
    before = list(ran.plot)
    request.addfinalizer(VIEWS._added.clear)
    VIEWS.add(View("mine", "Mine", {"part": "score"}, form="points", x="condition", by="label"))
    assert list(validate.open_run(ran.folder).plot) == before
    assert "'mine' (views) is not asked further" in caplog.text


def test_streams_below_another_stream_have_nodes_of_their_own() -> None:
    t = np.arange(3.0), np.arange(5.0)
    source = Source("a.mcap", "", 0, "made here")
    signals = {name: Signal(at, np.zeros((len(at), 1)), "N", 0.1, "machine")
               for name, at in zip(("force", "force/raw/x"), t, strict=True)}  # fmt: skip
    recording = Recording("two", source, 0, signals=signals)
    rows = recording.to_pandas()
    assert rows.groupby("stream").time.max().to_dict() == {"force": 2.0, "force/raw/x": 4.0}
    assert set(rows.unit) == {"N"}
    tree = recording.to_xarray()
    assert {name: len(tree[name].time) for name in tree.children} == {"force": 3, "force.raw.x": 5}


def test_import_is_light_and_functions_are_also_packages() -> None:
    code = (
        "import sys, validate; n = {m for m in sys.modules if m.startswith('validate')}; "
        "assert n == {'validate', 'validate.former_names'}, n; "
        "import validate.compare.verdict as verdict; "
        "assert validate.compare.verdict is verdict and callable(validate.compare); "
        "assert 'validate.library' not in sys.modules"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    from validate.library.comparison import compare

    assert inspect.signature(validate.compare) == inspect.signature(compare)
    assert {"run", "study", "compare"} <= set(dir(validate))
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = validate.nothing


def test_a_view_is_text_a_page_part_figures_and_a_file(ran: RunResult, tmp_path: Path) -> None:
    checks = ran.show("checks")
    assert "top.max@all" in repr(checks)
    assert checks._repr_html_().count("<table") == 1
    assert "<html" not in checks._repr_html_()
    assert checks.figures() == []
    (figure,) = ran.show("limits").figures()
    assert figure.axes
    rows = {"part": "score", "quantity": "top", "statistic": "max"}
    mine = View("mine", "Mine", rows, x="label", by="quantity", several="largest", unit="mm")
    ran.show(mine).save(tmp_path / "mine.csv")
    head, first, *_ = (tmp_path / "mine.csv").read_text().splitlines()
    assert head == "method,top / mm"
    largest = ran.table(part="score", quantity="top", statistic="max", method="kf").rows
    assert float(first.split(",")[1]) == pytest.approx(1e3 * max(r.value for r in largest))
    with pytest.raises(UsageError, match="no view 'chekcs'; nearest: checks"):
        ran.show("chekcs")
