"""Studies from a script: the cells and the folder of the command."""

import json
import pickle
from pathlib import Path

import numpy as np
import pytest
from command_line import here

import validate
from validate.errors import UsageError
from validate.library.study_result import StudyResult

pytestmark = pytest.mark.xdist_group("library")
Q = "methods.kf.settings.Q=1e-12,1e-10"


def test_a_study_is_the_one_of_the_command(pulled: Path, reports: Path) -> None:
    found = validate.study("filters", pulled, quick=True, sweep=[Q], seeds=[3, 7], out=reports)
    command = ("study", "filters", str(pulled), "--quick", "--sweep", Q, "--seeds", "3,7")
    code, out, _ = here(*command, "--out", str(reports), "--json")
    assert code == 0
    document = json.loads(out)
    ours, theirs = dict(found.found), dict(document["study"])
    assert theirs.pop("reused") == 4  # the function computed them
    assert (ours.pop("reused"), ours.pop("seconds") > 0, theirs.pop("seconds") > 0) == (
        0,
        True,
        True,
    )
    assert ours == theirs
    assert found.sentence == document["sentence"]
    assert found.content["made"]["command"] == document["made"]["command"].replace(" --json", "")
    frame = found.to_pandas()
    assert len(frame) == len(found.cells()) - 1 > 1
    errors, score = found.to_xarray(), str(frame.columns[3])
    assert list(errors.sizes) == ["method", Q.partition("=")[0]]
    # every cell where its columns say, nothing elsewhere
    for row in frame.dropna(subset=list(errors.dims)).to_dict("records"):
        at = errors[score].sel({d: row[d] for d in errors.dims})
        assert np.array_equal(at, row[score], equal_nan=True)
    assert int(errors[score].notnull().sum()) == int(frame[score].notna().sum())
    with pytest.raises(UsageError, match="'methd'"):
        found.to_xarray("methd")
    with pytest.raises(UsageError, match="not told apart by method"):
        found.to_xarray("method")
    assert pickle.loads(pickle.dumps(found)) == found
    assert len(repr(found).splitlines()) <= 24
    assert list(found.plot)
    with pytest.raises(UsageError, match="a study or a comparison, not a run"):
        validate.open_run(found.folder)


def test_what_a_study_does_not_take_is_refused(pulled: Path) -> None:
    with pytest.raises(UsageError, match="unknown study 'filter'; nearest: filters"):
        validate.study("filter", pulled)  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="study 'stability' has no option 'seeds'"):
        validate.study("stability", pulled, seeds=3)
    with pytest.raises(UsageError, match="give error"):
        validate.study("choose", pulled, error="1mm")


def test_columns_of_one_value_are_no_dimension_and_a_million_combinations_are_the_most(
    tmp_path: Path,
) -> None:
    pytest.importorskip("xarray")
    (tmp_path / "tables").mkdir()
    study = StudyResult(tmp_path, {})

    def cells(lines: list[str]) -> None:
        (tmp_path / "tables" / "cells.csv").write_text("\n".join(lines) + "\n")

    cells(["scheme,mesh,dt_s,error_m", *(f"newmark,4,{dt},{dt**2}" for dt in (1.0, 2.0))])
    assert study.to_xarray().sizes == {"dt_s": 2}
    cells(["a,b,error_m", *(f"{i},{i},0.5" for i in range(1001))])
    with pytest.raises(UsageError, match="1002001 combinations"):
        study.to_xarray("a", "b")
