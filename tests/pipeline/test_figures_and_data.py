"""A printed figure belongs to the data and settings it was printed for."""

from dataclasses import replace

import pytest
from tiny import TINY

from validate.compare.published import Figure
from validate.compare.result import Result
from validate.pipeline.experiment.experiment import ReportAdditions
from validate.pipeline.experiment.options import Options
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.run.method_run import Cases
from validate.pipeline.run.pipeline import compare

FIGURE = Figure("frames", "told:frames", 3.0, 0.0, "1", "reproduced", "", "here", 3.0, 0.0)


def tiny(frames: float, **settings: str) -> Result:
    def told(tree: Tree, cases: Cases, progress: object) -> ReportAdditions:
        return ReportAdditions((), {"frames": frames})

    experiment = replace(TINY, exhibits=told, published=(FIGURE,), cases=())
    return compare(experiment, Options(settings))


@pytest.mark.slow
def test_run_fails_and_says_so_where_our_value_moved() -> None:
    assert tiny(3.0).passed
    moved = tiny(4.0)
    assert moved.fallen
    assert [p.verdict for p in moved.published] == ["moved"]
    assert moved.sentence.endswith("1 of 1 printed figures do not hold (frames).")


def test_other_settings_are_not_compared_with_a_printed_figure() -> None:
    (figure,) = (other := tiny(4.0, **{"material.E": "10001", "methods.kf.modes": "4"})).published
    assert (figure.verdict, figure.ours) == ("other data", None)
    assert "not compared with material.E = 10001.0, methods.kf.modes = 4" in figure.why
    assert other.sentence.endswith("1 of 1 printed figures belong to other data: not compared.")
    (same,) = tiny(3.0, **{"material.E": "10000"}).published
    assert same.verdict == "reproduced"
