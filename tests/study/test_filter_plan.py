"""What a study will run: checked before anything runs, keyed by all that makes a cell."""

import shlex
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from click.testing import CliRunner
from study_samples import experiment_file

from validate.commands import run as running
from validate.commands.arguments import pairs
from validate.commands.main import cli
from validate.engine.cell import Where
from validate.errors import UsageError
from validate.pipeline.experiment.experiment import Case, Experiment, ReportAdditions, vary
from validate.pipeline.experiment.find import load_file
from validate.pipeline.experiment.options import Options, chosen_cases
from validate.pipeline.run.job import run_name
from validate.pipeline.run.pipeline import compare
from validate.study.filters import plan as filter_plan
from validate.study.filters.cell import run_cell
from validate.study.filters.plan import Bench, FilterPlan, plan
from validate.study.filters.study import run_line, study
from validate.study.sweep import axes

# private: _keyed, _methods, _seeds: called alone, case by case.


@pytest.fixture(scope="module")
def pulled(tmp_path_factory: pytest.TempPathFactory) -> Experiment:
    return load_file(experiment_file(tmp_path_factory.mktemp("plan")))


def planned(pulled: Experiment, *sweeps: str, **options: object) -> FilterPlan:
    seeds = options.pop("seeds", 3)
    return plan(pulled, Options(**{"values": {}, **options}), axes(sweeps), seeds)  # type: ignore[arg-type]


def test_an_axis_of_one_method_multiplies_its_cells_only(pulled: Experiment) -> None:
    sweeps = ("methods.kf.Q=1e-12,1e-11,1e-10", "twin.noise=1e-11,1e-10")
    found = planned(pulled, *sweeps, methods=("kf", "plain"))
    assert [c.name for c in found.cells].count("kf") == 6
    assert [c.name for c in found.cells].count("plain") == 2
    assert [c.name for c in found.cells].count("last measurement, held") == 2
    assert found.seeds == (5, 6, 7)


def test_swept_methods_are_the_methods(pulled: Experiment) -> None:
    assert planned(pulled, "methods.kf.Q=1e-12,1e-11").methods == ("kf",)
    assert planned(pulled, "twin.noise=1e-11,1e-10").methods == ("kf", "plain")


def test_the_command_names_what_decides_and_what_speeds_are_compared_with(
    pulled: Experiment,
) -> None:
    more = replace(pulled, methods={**pulled.methods, "other": pulled.methods["kf"]})
    values = {"methods.kf.R": "1e-10", "methods.other.R": "2e-10"}
    swept = planned(more, "methods.other.Q=1e-12,1e-11", values=values)
    line = "validate run pulled --set methods.kf.R=1e-10 --set methods.other.R=2e-10 --set "
    found = run_line(swept, swept.cells[0])
    assert found == f"{line}methods.other.Q=1e-12 --methods kf,plain,other"
    found = run_line(planned(more, values=values), planned(more, values=values).cells[0])
    assert found == "validate run pulled --set methods.kf.R=1e-10 --methods kf,plain"


def test_keys_know_values_seeds_methods_and_the_file(pulled: Experiment) -> None:
    def key(*sweeps: str, **options: object) -> str:
        return planned(pulled, *sweeps, **{"methods": ("kf",), **options}).cells[0].key

    base = key("methods.kf.Q=1e-11,1e-10")
    assert base == key("methods.kf.Q=1e-11,1e-10")
    others = [
        key("methods.kf.Q=2e-11,1e-10"),
        key("methods.kf.Q=1e-11,1e-10", seeds=4),
        key("methods.kf.Q=1e-11,1e-10", values={"twin.noise": "2e-10"}),
        key("methods.kf.Q=1e-11,1e-10", values={"methods.kf.R": "2e-10"}),
    ]
    assert len({base, *others}) == 5
    assert pulled.path is not None
    pulled.path.write_text(pulled.path.read_text("utf-8") + "\n", encoding="utf-8")
    assert key("methods.kf.Q=1e-11,1e-10") != base


@pytest.mark.parametrize(
    ("sweeps", "options", "said"),
    [
        (["methods.kf.q=1,2"], {}, "unknown parameter 'kf.q'; nearest: .*kf.Q"),
        (["twin.nois=1,2"], {}, "nearest: twin.noise"),
        (["methods.kf.Q=1,high"], {}, "not a number"),
        (["twin.seed=1,2"], {}, "--seeds"),
        (["methods.kf.Q=1,2"], {"methods": ("plain",)}, "not among plain"),
        ([], {"methods": ("kff",)}, "nearest: kf"),
        ([], {"seeds": 0}, "at least 1"),
        ([], {"seeds": (3, 3)}, "twice"),
    ],
)
def test_what_cannot_run_is_refused_at_once(
    pulled: Experiment, sweeps: list[str], options: dict[str, object], said: str
) -> None:
    with pytest.raises(UsageError, match=said):
        planned(pulled, *sweeps, **options)


def test_an_experiment_without_time_has_no_filters(phantom: Experiment) -> None:
    with pytest.raises(UsageError, match=r"has no filter: no method of"):
        plan(phantom, Options({}), (), 2)


def test_each_keeps_the_only_marker_of_a_filter_and_names_it(pulled: Experiment) -> None:
    alone = plan(pulled, Options({}), (), 2, ("each",))
    assert {(c.given, c.spared) for c in alone.cells} == {(("top",), ())}
    words = "These methods are given one marker only and are scored by its next sample: kf (top)."
    assert alone.single_words == words
    assert plan(pulled, Options({}), (), 2).single_words == ""
    two = replace(pulled.methods["kf"], markers=("top", "side"))
    more = replace(pulled, methods={**pulled.methods, "two": two})
    both = plan(more, Options({}), (), 2, ("each",))
    assert both.single_words == words
    assert both.cells[0].spared == ("top", "side")


def test_a_case_is_a_condition_by_its_name(pulled: Experiment) -> None:
    softer = Case("soft", "made for tests", {"twin.stiffness": 0.5})
    more = replace(pulled, cases=(softer,))
    found = plan(more, Options({}, ("kf",)), axes(["case=recorded,soft"]), 2)
    kf = [c for c in found.cells if c.name == "kf"]
    errors = [run_cell(Bench(more, found.job), c).scores["all.rmse"][0] for c in kf]
    assert errors[1] > 5 * errors[0]  # the model is twice as stiff as that truth
    with pytest.raises(UsageError, match=r"no case 'sof' of pulled; nearest: soft"):
        plan(more, Options({}, ("kf",)), axes(["case=sof"]), 2)


def test_a_declared_sweep_is_the_one_that_nobody_asks_for(
    pulled: Experiment, tmp_path: Path
) -> None:
    swept = vary("methods.kf.Q", "log 1e-12 1e-8, 2 values")
    more = replace(pulled, variations=(swept, vary("methods.none.Q", "of 1, 2")))
    found = study(more, methods=("kf",), seeds=2, out=tmp_path, where=Where(0))
    assert [a.path for a in found.plan.axes] == ["methods.kf.Q"]
    asked = study(
        more, ["methods.kf.Q=1e-9"], methods=("kf",), seeds=2, out=tmp_path, where=Where(0)
    )
    assert [a.values for a in asked.plan.axes] == [("1e-9",)]


@pytest.mark.parametrize(
    ("rule", "text"),
    [("log 1e-9 1e-5", "q=log:1e-09:1e-05:5"), ("log 1 10, 3 values", "q=log:1.0:10.0:3"),
     ("linear 0 1, 5 values", "q=lin:0.0:1.0:5"), ("of 1e-9, 1e-7", "q=1e-9,1e-7")],
)  # fmt: skip
def test_a_rule_of_settings_is_a_sweep(rule: str, text: str) -> None:
    assert vary("q", rule).text == text
    assert axes([text])


@pytest.mark.parametrize("rule", ["log 1", "log 0 1", "linear 0 1", "of", "log 1e-5 1e-9"])
def test_a_rule_that_is_no_sweep_is_refused(rule: str) -> None:
    with pytest.raises(UsageError, match=r"^q: "):
        vary("q", rule)


def with_cases(folder: Path) -> Path:
    """The file of the experiment with two cases, the second one for the solver alone."""
    path = experiment_file(folder)
    text = path.read_text("utf-8")
    head = "from validate.pipeline.experiment.experiment import Experiment, Twin"
    assert head in text
    text = text.replace(
        head,
        "from validate.pipeline.experiment.experiment import Case, Experiment, Twin",
    )
    text = text.replace("    twin=Twin(record", """    cases=(
        Case("soft", "half as stiff", {"twin.stiffness": 0.5}),
        Case("stiff", "twice as stiff", {"twin.stiffness": 2.0}, methods=("plain",)),
    ),
    twin=Twin(record""")  # fmt: skip
    path.write_text(text, "utf-8")
    return path


def test_the_best_command_of_a_case_runs_that_case(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its report has the score of the study's first seed, on that case and on no other one."""
    more = load_file(with_cases(tmp_path))
    found = study(
        more, ["case=stiff,recorded", "methods.kf.Q=1e-11,1e-9"], seeds=1,
        out=tmp_path / "reports", where=Where(workers=0),
    )  # fmt: skip
    stiff, recorded = found.best
    assert "--case stiff " in stiff.line
    assert "--case recorded " in recorded.line
    for best, cases in ((stiff, ["@stiff"]), (recorded, [])):
        scores = compare(more, options_of(best.line, monkeypatch)).methods[0].scores
        run = {s.name: s.value for s in scores if s.name.startswith("top.rmse")}
        assert list(run) == ["top.rmse", *(f"top.rmse{c}" for c in cases)]
        assert run[f"top.rmse{''.join(cases)}"] == pytest.approx(
            best.ranked.result.scores["top.rmse"][0], rel=1e-6
        )


def options_of(line: str, monkeypatch: pytest.MonkeyPatch) -> Options:
    """What the command line hands to a run."""
    given: dict[str, Any] = {}
    monkeypatch.setattr(running, "run", lambda names, **options: given.update(options) or 0)
    CliRunner().invoke(cli, shlex.split(line)[1:], standalone_mode=False)
    methods = tuple(given["methods"].split(","))
    return Options(pairs(given["values"], "--set"), methods, case=given["case"])


def test_a_run_of_one_case_has_a_folder_of_its_name(tmp_path: Path) -> None:
    more = load_file(with_cases(tmp_path))
    names = {c: run_name(more, Options({}, case=c)) for c in ("", "soft", "recorded")}
    assert names[""] == "pulled"
    assert names["soft"].startswith("pulled+case_soft-")
    assert len(set(names.values())) == 3
    assert [c.name for c in chosen_cases(more, Options({}))] == ["soft", "stiff"]
    needs_all = replace(
        more, exhibits=lambda p, cases, tell: ReportAdditions(numbers=dict(cases["soft"]))
    )
    assert compare(needs_all, Options({}, case="stiff")).methods  # its figures are left out
    with pytest.raises(UsageError, match="no case 'sof' of pulled; nearest: soft"):
        compare(more, Options({}, case="sof"))


def test_seeds_need_a_parameter_and_stand_once() -> None:
    assert filter_plan._seeds(1, None, "") == (0,)
    with pytest.raises(UsageError, match=r"2 seeds.*twin.seed"):
        filter_plan._seeds(2, None, "")
    with pytest.raises(UsageError, match="--seeds 0: at least 1"):
        filter_plan._seeds(0, None, "twin.seed")
    with pytest.raises(UsageError, match="a seed is given twice, but each seed"):
        filter_plan._seeds((3, 3), None, "twin.seed")


def test_a_combination_that_settings_refuse_has_a_key_of_its_refusal(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    keyed: list[object] = []

    def refuse(*_: object) -> None:
        raise UsageError("dt = 0: above 0")

    monkeypatch.setattr(filter_plan, "set_up", refuse)
    monkeypatch.setattr(filter_plan, "key_of", lambda job, bare, made: keyed.append(made) or "k")
    monkeypatch.setattr(filter_plan, "replace", lambda bare, key: key)
    bare = SimpleNamespace(seeds=(1,))
    assert filter_plan._keyed(None, None, bare) == "k"  # type: ignore[arg-type]
    assert keyed == ["dt = 0: above 0"]


def test_a_method_that_is_only_timed_has_no_error() -> None:
    methods = {"whole": SimpleNamespace(steps=None), "timed": SimpleNamespace(steps=20)}
    experiment = SimpleNamespace(methods=methods, repeats=True)
    with pytest.raises(UsageError, match="'timed' runs 20 steps"):
        filter_plan._methods(experiment, ("timed",), ())  # type: ignore[arg-type]
    with pytest.raises(UsageError, match=r"unknown method 'hole'; .*whole"):
        filter_plan._methods(experiment, ("hole",), ())  # type: ignore[arg-type]
