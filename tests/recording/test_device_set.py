"""Configurations of PLUS: transforms in metres, landmarks by name, nothing declared in the XML."""

from pathlib import Path

import pytest

from validate.errors import RecordingError
from validate.recording.formats.device_set import read_device_set

MATRIX = "1 0 0 210 0 1 0 -1.5e-003 0 0 1 0 0 0 0 1"
TEXT = f"""<PlusConfiguration><!-- a note -->
<Transform From="StylusTip" To="Stylus" Matrix="{MATRIX}" Error="0.5"/>
<Transform From="A" To="B" Matrix="{MATRIX}"/>
<Geometry><Landmarks><Landmark Name="#1" Position="104.3 5 -20"/></Landmarks></Geometry>
</PlusConfiguration>"""


def test_lengths_are_metres(tmp_path: Path) -> None:
    path = tmp_path / "set.xml"
    path.write_text(TEXT)
    got = read_device_set(path)
    tip = got.transform("StylusTip", "Stylus")
    assert tip.matrix[:3, 3].tolist() == pytest.approx([0.21, -1.5e-6, 0])
    assert (tip.error, got.transform("A", "B").error) == (pytest.approx(5e-4), None)
    assert got.landmarks["#1"].tolist() == pytest.approx([0.1043, 0.005, -0.02])
    with pytest.raises(RecordingError, match="no transform from A to C"):
        got.transform("A", "C")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "0 bytes"),
        (TEXT.replace("</Geometry>", ""), "not XML, or damaged"),
        ('<!DOCTYPE a [<!ENTITY b "c">]>' + TEXT, "without DTD declarations"),
        (TEXT.replace("210", "x"), "not 16 finite numbers"),
        (TEXT.replace("104.3 5", "104.3"), "not 3 finite numbers"),
        (TEXT.replace('"0.5"', '"nan"'), "not 1 finite numbers"),
    ],
    ids=["empty", "cut", "entities", "matrix", "position", "error"],
)
def test_damage_is_one_line(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "set.xml"
    path.write_text(text)
    with pytest.raises(RecordingError, match=said) as raised:
        read_device_set(path)
    assert "\n" not in str(raised.value)
