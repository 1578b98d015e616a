"""Lists of landmarks by other versions of 3D Slicer."""

from pathlib import Path

import pytest

from validate.errors import RecordingError
from validate.recording.formats import slicer
from validate.recording.formats.slicer import read_markups
from validate.recording.readers import recognised

# private: _LARGEST: replaced by a small number: a short test.


def test_a_list_of_slicer_3_is_in_ras(tmp_path: Path) -> None:
    path = tmp_path / "x.fcsv"
    path.write_text("# Fiducial List file x.fcsv\n# columns = label,x,y,z,sel,vis\nL-1,1,2,3,1,1\n")
    got = recognised(path).read(path, {}).marker("landmarks")
    assert (got.names, got.frame, got.x.tolist()) == (("L-1",), "RAS", [[[0.001, 0.002, 0.003]]])


def test_a_unit_for_each_axis_of_a_list_is_one(tmp_path: Path) -> None:
    path = tmp_path / "x.mrk.json"
    points = '[{"label": "A", "position": [1, 2, 3]}]'
    text = '{"@schema": "markups-schema", "markups": [{"coordinateUnits": ["cm", "cm", "%s"], '
    path.write_text(text % "cm" + f'"controlPoints": {points}}}]}}')
    assert read_markups(path, {}).marker("landmarks").x.tolist() == [[[0.01, 0.02, 0.03]]]
    path.write_text(text % "mm" + f'"controlPoints": {points}}}]}}')
    with pytest.raises(RecordingError, match=r"\['cm', 'mm'\].*separate"):
        read_markups(path, {})


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('{"markups": []}', "its 'markups' is not a list of lists"),
        ('{"markups": [3]}', "its 'markups' is not a list of lists"),
        ('{"markups": [{"controlPoints": [7]}]}', "a control point that is not an object; damaged"),
    ],
)
def test_damaged_markups_are_refused(text: str, says: str, tmp_path: Path) -> None:
    (tmp_path / "x.mrk.json").write_text(text)
    with pytest.raises(RecordingError, match=says):
        read_markups(tmp_path / "x.mrk.json", {})


def test_markups_beyond_the_limit_are_not_parsed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(slicer, "_LARGEST", 10)
    (tmp_path / "x.mrk.json").write_text('{"markups": []}')
    with pytest.raises(RecordingError, match="15 bytes, the limit is 10"):
        read_markups(tmp_path / "x.mrk.json", {})
