"""What stands beside a table of samples: sizes in a table, LabVIEW's units."""

from pathlib import Path

import pytest
from exports import assert_test, comma, read, rows

from validate.errors import RecordingError


def test_a_labview_measurement_names_its_units_by_channel(tmp_path: Path) -> None:
    """As its text files have them, here with decimal commas; X is a time where they say so."""
    head = (
        "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t,\n"
        "Multi_Headings\tNo\nX_Columns\tOne\nTime_Pref\tRelative\nDate\t2024/03/04\n"
        "***End_of_Header***\t\n\nChannels\t2\t\t\nSamples\t40\t40\t\n"
        "Y_Unit_Label\tmm\tN\t\nX_Dimension\tTime\tTime\t\nDelta_X\t0,100000\t0,100000\t\n"
        "***End_of_Header***\t\t\t\nX_Value\tVerplaatsing\tKracht\tComment\n"
    )
    recording = read(tmp_path, head + rows("\t", comma))
    assert_test(recording)
    other = head.replace("X_Dimension\tTime\tTime", "X_Dimension\tFrequency\tFrequency")
    with pytest.raises(RecordingError, match="no time column"):
        read(tmp_path, other + rows("\t", comma))


def test_sizes_in_a_table_above_the_samples_are_read(tmp_path: Path) -> None:
    """As Trapezium writes them, a row a specimen; of specimens that differ none is taken."""
    head = (
        '"試験種類","圧縮"\n\n"名前","直径","高さ"\n"単位","mm","mm"\n'
        '"1_ 1","25.0000","20.0000"\n{}\n'
        '"時間","ストローク","試験力"\n"sec","mm","N"\n'
    )
    recording = read(tmp_path, head.format("") + rows(), test=None)
    assert_test(recording)
    specimen = recording.record("specimen")
    assert (float(specimen["diameter_m"]), float(specimen["height_m"])) == (0.025, 0.02)
    two = read(tmp_path, head.format('"1_ 2","25.0000","21.0000"\n') + rows(), test=None)
    assert "height_m" not in two.record("specimen")
    assert float(two.record("specimen")["diameter_m"]) == 0.025
