"""Every defect of a force-displacement table gives its own error, and what mends it."""

import contextlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from validate.errors import RecordingError, UsageError, ValidateError
from validate.recording.tables.blocks import fitted
from validate.recording.tables.columns import _same
from validate.recording.tables.testing_machine import INSTRON, read_instron
from validate.recording.types import Recording

# private: _same: columns that move alike.

T = np.arange(60) * 0.1
D = 0.3 * T  # mm
F = 7.0 * D + 2.5 * D**2  # N
HEAD = "Compression test\nDiameter: 50mm\nHeight: 30mm\n"
FULL = "Time (s),Compression (mm),Load (N),Strain [-],Stress (kPa)"
BARE = "Time (s),Displacement (mm),Load (N)"


def table(names: str, *columns: np.ndarray, head: str = "") -> str:
    rows = [",".join(repr(float(x)) for x in row) for row in zip(*columns, strict=True)]
    return head + "\n".join([names, *rows]) + "\n"


def full(names: str = FULL, head: str = HEAD, d: np.ndarray = D, f: np.ndarray = F) -> str:
    return table(names, T, d, f, -D / 30, -F / (np.pi * 0.025**2) / 1e3, head=head)


def bare(names: str = BARE, d: np.ndarray = D, f: np.ndarray = F) -> str:
    return table(names, T, d, f)


def spoiled(line: int, change: Callable[[str], str], text: str | None = None) -> str:
    """The text with one line (from 1) changed."""
    lines = (text or bare()).split("\n")
    lines[line - 1] = change(lines[line - 1])
    return "\n".join(lines)


def cell(row: str, index: int, value: str) -> str:
    cells = row.split(",")
    return ",".join([*cells[:index], value, *cells[index + 1 :]])


def load(folder: Path, text: str | bytes, **mapping: str) -> Recording:
    path = folder / "log.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_instron(path, {"test": "compression", **mapping})


RNG = np.random.default_rng(5)
NOISY = D + RNG.normal(0, 0.3, len(D))

DEFECTS: dict[str, tuple[str | bytes, str]] = {
    "empty": (b"", "empty file"),
    "blank": (b"\n \n", "empty file"),
    "prose": ("Dear all,\nthe test, as said, went well.\n", "no table of numbers"),
    "binary": (bytes(range(256)) * 4, "binary|not a text file"),
    "picture": (b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR\x00\x00\x01", "binary"),
    "no names": ("\n".join(bare().split("\n")[1:]), "no column names"),
    "few": ("\n".join(bare().split("\n")[:9]), "8 samples; at least 10"),
    "backward": (
        spoiled(12, lambda r: cell(r, 0, "0.35")),
        r"line 12: time runs backward, 0.9 -> 0.35 s",
    ),
    "duplicate": (
        spoiled(12, lambda r: cell(r, 0, "0.9")),
        "line 12: time stands still, 0.9 -> 0.9",
    ),
    "empty cell": (spoiled(20, lambda r: cell(r, 2, "")), r"line 20, column 'Load \(N\)': ''"),
    "nan": (spoiled(20, lambda r: cell(r, 1, "NaN")), r"line 20, .*'NaN' is not a number"),
    "infinite": (spoiled(20, lambda r: cell(r, 1, "1e999")), "line 20, .*'1e999' is not a number"),
    "nan row": (spoiled(20, lambda r: "NaN,NaN,NaN"), "line 20, .*'NaN' is not a number"),
    "last row nan": (spoiled(61, lambda r: "NaN,NaN,NaN"), "line 61, .*'NaN' is not a number"),
    "emptied row": (spoiled(20, lambda r: ",,"), "line 20: an empty row"),
    "cut row": (spoiled(61, lambda r: r.rpartition(",")[0]), "line 61: 2 cells, .* 3 columns"),
    "cut number": (
        "Time (s),Displacement (mm),Load (N)"
        + "".join(f"\n{t:.3f},{d:.5f},{f:.5f}" for t, d, f in zip(T, D, F, strict=True))[:-2],
        "line 61: the file is truncated: its last number",
    ),
    "long row": (spoiled(30, lambda r: r + ",1.0"), "line 30: 4 cells"),
    "two tests": (bare() + bare(), "line 62"),
    "longer second test": (
        "\n".join(bare().split("\n")[:21]) + "\n" + bare(),
        r"2 specimens in one file: '1' \(20 rows from line 2 on.*'2' \(60 rows from line 23 on",
    ),
    "text amid": (spoiled(30, lambda r: "Pause"), "line 30: text 'Pause' between"),
    "no time": (bare("Kanal 1 (s),Displacement (mm),Load (N)"), "no time column .*time=every"),
    "no force": (bare("Time (s),Displacement (mm),Channel 3 (V)"), "no force column"),
    "no unit": (bare("Time (s),Displacement (mm),Load"), r"'Load': no unit .*force=Load:UNIT"),
    "empty unit": (bare("Time (s),Displacement (mm),Load ()"), "no unit for force"),
    "unknown unit": (
        bare("Time (s),Displacement (mm),Load (stone)"),
        "'stone' is not a unit of force",
    ),
    "mass for force": (bare("Time (s),Displacement (mm),Load (kg)"), "'kg' is not a unit of force"),
    "swapped units": (bare("Time (s),Displacement (N),Load (mm)"), "swapped"),
    "load in mm": (bare("Time (s),Displacement (mm),Load (mm)"), "'mm' is not a unit of force"),
    "two units": (bare(BARE + "\ns,mm,kN"), r"'Load \(N\)': unit 'N' in its name, 'kN' in the row"),
    "kN": (full(FULL.replace("Load (N)", "Load (kN)")), r"contradictory units \(a factor of 1e-3"),
    "stress": (full(FULL.replace("kPa", "N/mm^2")), r"contradictory units \(a factor of 1e\+3"),
    "metres": (full(FULL.replace("(mm)", "(m)")), r"contradictory units \(a factor of 1e-3"),
    "percent": (full(FULL.replace("[-]", "[%]")), r"contradictory units \(a factor of 1e-2"),
    "diameter": (full(head=HEAD.replace("50mm", "40mm")), "is 0.64 x 'Load .*sizes and columns"),
    "speed": (
        "Speed: 18 mm/min\n" + bare("Time (s),Displacement (cm),Load (N)"),
        "header declares 0.0003 m/s, the columns move at 10 times",
    ),
    "minutes": (
        "Speed: 18 mm/min\n" + bare("Time (min),Displacement (mm),Load (N)"),
        "0.01667 times",
    ),
    "one wrong load": (
        full(f=np.where(np.arange(60) == 30, 9.0, F)),
        "line 35: .*contradict each other",
    ),
    "one wrong digit": (
        full(f=F).replace(repr(float(F[40])), repr(float(F[40]) + 0.1), 1),
        "line 45: .*contradict each other by",
    ),
    "swapped": (full(d=F, f=D), "swapped columns"),
    "swapped ramp": (bare(d=F, f=D), "swapped columns or a load-controlled test"),
    "noisy displacement": (bare(d=NOISY, f=3 * T), "swapped columns or a load-controlled test"),
    "closes too far": (
        "Height: 30mm\n" + bare(d=30 * D, f=F),
        "closes 53.1 mm on a specimen 30 mm",
    ),
    "two loads": (table(BARE + ",Force 2 (N)", T, D, F, F + T), "2 different columns may be force"),
    "two sizes": (
        "Diameter: 50mm\nSample diameter: 40 mm\n" + bare(),
        "0.05, 'Sample diameter' 0.04",
    ),
    "two size units": ("Diameter (mm): 50 cm\n" + bare(), "given in cm; keep one unit"),
    "no size": ("Diameter: 0 mm\n" + bare(), "expected a size above 0"),
    "decimal signs": (bare().replace(",", ";").replace("0.3;", "0,3;", 1), "two decimal signs"),
    "thousands": (
        spoiled(40, lambda r: ";".join([*r.split(";")[:2], "1,234"]), bare().replace(",", ";")),
        "line 40: '1,234' may hold a thousands or a decimal",
    ),
}


@pytest.mark.parametrize("name", DEFECTS)
def test_each_defect_has_its_own_error(name: str, tmp_path: Path) -> None:
    text, says = DEFECTS[name]
    with pytest.raises(RecordingError, match=says) as caught:
        load(tmp_path, text)
    message = str(caught.value)
    assert message.startswith("log.csv: ")
    assert "\n" not in message


def test_the_undamaged_tables_pass(tmp_path: Path) -> None:
    for text in (full(), bare()):
        assert np.allclose(load(tmp_path, text).signals["force"].y[:, 0], F)


def test_opposite_signs_are_decided_by_the_declared_test(tmp_path: Path) -> None:
    recording = load(tmp_path, full(f=-F))
    assert np.allclose(recording.signals["force"].y[:, 0], F)
    assert recording.record("provenance")["signs flipped"] == "force"


def test_opposite_signs_are_decided_by_strain_and_stress(tmp_path: Path) -> None:
    names = "Time (s),Displacement (mm),Load (N),Strain (-),Stress (kPa)"
    recording = load(tmp_path, full(names, head="", d=-D))
    assert np.allclose(recording.signals["displacement"].y[:, 0], D / 1e3)


def si(recording: Recording, topic: str) -> np.ndarray:
    return recording.signals[topic].y[:, 0]


def test_mapping_overrides_units_signs_columns_and_time(tmp_path: Path) -> None:
    kilo = load(tmp_path, full(FULL.replace("Load (N)", "Load (kN)")), force="Load:N")
    assert np.allclose(si(kilo, "force"), F)
    assert kilo.record("provenance")["given by the user"].startswith("test=compression, force=Load")
    believed = load(tmp_path, full(FULL.replace("kPa", "N/mm^2")), force="Load:N")
    assert np.allclose(si(believed, "force"), F)
    assert "unit given by --map, not checked" in believed.record("provenance")["compared"]
    unitless = load(tmp_path, bare("Time (s),Displacement (mm),Load"), force="Load:kN")
    assert np.allclose(si(unitless, "force"), 1e3 * F)
    flipped = load(tmp_path, bare(f=-F), force="Load (N):-")
    assert np.allclose(si(flipped, "force"), F)
    both = load(tmp_path, bare(d=-D, f=-F), force="load:N:-")
    assert np.allclose(si(both, "force"), F)
    assert np.allclose(si(both, "displacement"), D / 1e3)
    numbered = load(tmp_path, bare("Time (s),Displacement (mm),Kanal 3 (N)"), force="#3")
    assert np.allclose(si(numbered, "force"), F)
    crossed = load(tmp_path, bare(d=F, f=D), force="Displacement:N", displacement="Load:mm")
    assert np.allclose(si(crossed, "force"), F)
    ticks = load(tmp_path, spoiled(12, lambda r: cell(r, 0, "0.9")), time="every:100 ms")
    assert np.allclose(ticks.signals["force"].t, T)
    assert ticks.record("provenance")["time column"] == "every 100 ms"


@pytest.mark.parametrize(
    ("mapping", "says"),
    [
        ({"force": "Loat (N)"}, r"no column 'Loat \(N\)'; did you mean 'Load \(N\)'"),
        ({"force": "#9"}, "no column '#9'"),
        ({"time": "every:0"}, "expected a step with its unit"),
        ({"time": "every:-1s"}, "expected a step with its unit"),
        ({"time": "Time (s):-"}, "time has no sign"),
    ],
)
def test_wrong_mapping_names_the_nearest(
    mapping: dict[str, str], says: str, tmp_path: Path
) -> None:
    with pytest.raises(UsageError, match=says):
        load(tmp_path, bare(), **mapping)


def test_a_wrong_key_names_the_nearest(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("Time (s),Load (N)\n")
    with pytest.raises(UsageError, match=r"--map forse=\.\.\..*'force'"):
        INSTRON.read(tmp_path / "log.csv", {"forse": "Load (N)"})


def test_a_unit_of_the_wrong_kind_is_refused_in_a_mapping_too(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="'mm' is not a unit of force"):
        load(tmp_path, bare(), force="Load:mm")


def test_a_column_name_used_twice_needs_its_number(tmp_path: Path) -> None:
    text = table("Time (s),Displacement (mm),Load (N),Load (N)", T, D, F, 2 * F)
    with pytest.raises(UsageError, match="2 columns have the name"):
        load(tmp_path, text, force="Load (N)")
    assert np.allclose(si(load(tmp_path, text, force="#4"), "force"), 2 * F)


def test_a_missing_file_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"absent\.csv.*\(No"):
        read_instron(tmp_path / "absent.csv")
    with pytest.raises(RecordingError, match="cannot be read"):
        read_instron(tmp_path)


def test_only_rows_that_end_early_are_told() -> None:
    """Whole rows leave no note; two of three that lack a sparse column are counted and filled."""
    names = (1, ["Time", "Force", "Mark"])
    whole = [(2, ["0", "1", "a"]), (3, ["1", "2", "b"])]
    assert fitted(names, whole).notes == ()
    some = fitted(names, [(2, ["0", "1", "a"]), (3, ["1", "2"]), (4, ["2", "3"])])
    assert some.notes == ("2 rows end early, first line 3",)
    assert [cells for _, cells in some.rows][1:] == [["1", "2", ""], ["2", "3", ""]]


def test_columns_are_one_where_they_move_alike_or_not_at_all() -> None:
    a = np.linspace(0.0, 2.0, 9)
    assert _same(a, 5.0 - a)
    assert _same(0 * a, 0 * a + 3.0)
    assert not _same(a, 1.01 * a)


def test_a_damaged_number_of_two_hundred_digits_overflows_nothing(tmp_path: Path) -> None:
    """Squares of it did, in the check for swapped columns."""
    (tmp_path / "log.csv").write_text(spoiled(20, lambda r: cell(r, 2, "-4.7e226")), "utf-8")
    with np.errstate(all="raise"), contextlib.suppress(ValidateError):
        read_instron(tmp_path / "log.csv", {"test": "compression"})
