"""Instron exports: real files, one table in every dress, invariances."""

import csv
import hashlib
import io
import itertools
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from validate.errors import RecordingError
from validate.recording.tables.testing_machine import read_instron
from validate.recording.types import Recording

REAL = [f"EF30_0T_A{i}" for i in range(1, 6)] + ["EF50_0T_A1"]
AREA = np.pi * 0.025**2
T = np.append(np.arange(40) / 10, 3.921)  # s; the last row is off the grid
D = np.append(np.arange(40) * 0.25, 9.8125)  # mm, exact in binary
F = 7.0 * D + 1.25 * D**2 / 8 - 0.03125  # N, with a load-cell offset
SAMPLES = list(zip(T.tolist(), D.tolist(), F.tolist(), strict=True))


@dataclass(frozen=True)
class Dress:
    """How one and the same table is written."""

    separator: str = ","
    decimal: str = "."
    units: str = "round"  # round, square, slash, row, bracket row
    header: str = "colon;"  # colon;, colon, pair, quoted, none
    quote: bool = False
    encoding: str = "utf-8"
    ends: str = "\n"
    sign: float = 1.0
    trailing: str = ""
    blanks: bool = False


UNITS = ("s", "mm", "N", "-", "kPa")
NAMES = ("Time", "Compression", "Load", "Engineering Strain", "Engineering Stress")
HEADER = (("Cylinder Diameter", "50mm"), ("Cylinder Height", "30.0 mm"), ("Speed (mm/min)", "150"))


def numeral(value: float, dress: Dress) -> str:
    text = f"{value:.6f}".replace(".", dress.decimal)
    return f'"{text}"' if dress.quote else text


def head(dress: Dress) -> list[str]:
    if dress.header == "none":
        return []
    form = {
        "colon;": "{}: {};",
        "colon": "{}: {}",
        "pair": "{}" + dress.separator + "{}",
        "quoted": '"{}"' + dress.separator + '"{}"',
    }[dress.header]
    return ["sample 1", "Compression test", *(form.format(*pair) for pair in HEADER)]


def titles(dress: Dress) -> list[str]:
    form = {"round": "{} ({})", "square": "{} [{}]", "slash": "{} /{}"}.get(dress.units, "{}")
    rows = [[form.format(*pair) for pair in zip(NAMES, UNITS, strict=True)]]
    if "row" in dress.units:
        rows.append([f"({u})" if "bracket" in dress.units else u for u in UNITS])
    return [dress.separator.join(row) for row in rows]


def written(dress: Dress, t: np.ndarray = T, d: np.ndarray = D, f: np.ndarray = F) -> bytes:
    strain, stress = -d / 30.0, -f / AREA / 1e3
    table = zip(t, dress.sign * d, dress.sign * f, strain, stress, strict=True)
    rows = [dress.separator.join(numeral(x, dress) for x in row) for row in table]
    lines = head(dress) + titles(dress) + [row + dress.trailing for row in rows]
    if dress.blanks:
        lines = ["", *itertools.chain.from_iterable((line, "", "") for line in lines)]
    return dress.ends.join(lines).encode(dress.encoding)


def read(folder: Path, data: bytes, mapping: dict[str, str] | None = None) -> Recording:
    path = folder / "test.csv"
    path.write_bytes(data)
    return read_instron(path, mapping)


def assert_same(recording: Recording) -> None:
    displacement, force = recording.signals["displacement"], recording.signals["force"]
    assert (displacement.unit, force.unit) == ("m", "N")
    assert np.array_equal(displacement.t, T)
    assert np.allclose(displacement.y[:, 0], D * 1e-3, rtol=1e-15, atol=0)
    assert np.allclose(force.y[:, 0], F, rtol=0, atol=5.1e-7)  # six decimals are written


DRESSES = [
    Dress(),
    *(Dress(units=u) for u in ("square", "slash", "row", "bracket row")),
    *(Dress(header=h) for h in ("colon", "pair", "quoted", "none")),
    *(Dress(separator=s, decimal=d) for s in ";\t" for d in ".,"),
    *(Dress(separator=s, decimal=",", header=h) for s in ";\t" for h in ("pair", "quoted")),
    Dress(decimal=",", quote=True),
    Dress(quote=True, units="bracket row", header="quoted"),
    Dress(separator=";", decimal=",", quote=True, units="row", ends="\r\n", encoding="utf-8-sig"),
    *(Dress(encoding=e) for e in ("utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "latin-1")),
    *(Dress(ends=e) for e in ("\r\n", "\r")),
    Dress(sign=-1.0),
    Dress(separator=";", decimal=",", sign=-1.0, encoding="utf-16", ends="\r\n"),
    *(Dress(trailing=x) for x in (",", ",,,", ";", " ")),
    Dress(separator=";", trailing=";;"),
    Dress(blanks=True),
    Dress(blanks=True, units="row", ends="\r\n", separator="\t"),
]


@pytest.mark.parametrize("dress", DRESSES, ids=str)
def test_every_dress_gives_the_same_si_arrays(dress: Dress, tmp_path: Path) -> None:
    recording = read(tmp_path, written(dress))
    assert_same(recording)
    if dress.header != "none":
        specimen = recording.record("specimen")
        assert float(specimen["diameter_m"]) == pytest.approx(0.05, rel=1e-15)
        assert float(specimen["height_m"]) == pytest.approx(0.03, rel=1e-15)
        assert float(specimen["speed_m_per_s"]) == pytest.approx(0.0025, rel=1e-14)
        assert recording.record("header")["Cylinder Diameter"] == "50mm"


@pytest.mark.slow
@given(
    separator=st.sampled_from(",;\t"),
    decimal=st.sampled_from(".,"),
    units=st.sampled_from(["round", "square", "slash", "row", "bracket row"]),
    header=st.sampled_from(["colon;", "colon", "pair", "quoted", "none"]),
    quote=st.booleans(),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "latin-1"]),
    ends=st.sampled_from(["\n", "\r\n", "\r"]),
    sign=st.sampled_from([1.0, -1.0]),
    blanks=st.booleans(),
)
@settings(max_examples=60)
def test_dress_locale_and_sign_do_not_matter(
    tmp_path_factory: pytest.TempPathFactory, **choice: object
) -> None:
    dress = Dress(**choice)  # type: ignore[arg-type]
    if (dress.separator, dress.decimal, dress.quote) == (",", ",", False):
        return  # no format: commas would separate and be decimals at once
    assert_same(read(tmp_path_factory.mktemp("dress"), written(dress)))


@given(unit=st.sampled_from([("kN", 1e3), ("mN", 1e-3), ("N", 1.0)]), scale=st.floats(0.1, 50))
@settings(max_examples=25)
def test_force_scales_with_its_unit(
    tmp_path_factory: pytest.TempPathFactory, unit: tuple[str, float], scale: float
) -> None:
    name, factor = unit
    rows = [f"{t!r},{d!r},{scale * f / factor!r}" for t, d, f in SAMPLES]
    text = "\n".join([f"Time (s),Displacement (mm),Force ({name})", *rows])
    recording = read(tmp_path_factory.mktemp("scale"), text.encode(), {"test": "compression"})
    assert np.allclose(recording.signals["force"].y[:, 0], scale * F, rtol=1e-12, atol=1e-15)


def test_source_provenance_and_clock(tmp_path: Path) -> None:
    data = written(Dress(sign=-1.0))
    recording = read(tmp_path, data)
    provenance = recording.record("provenance")
    assert recording.source.sha256 == hashlib.sha256(data).hexdigest() == provenance["sha256"]
    assert recording.source.bytes == len(data)
    assert recording.source.integrity == "text file: integrity not provable"
    assert recording.source.path == "test.csv"
    assert provenance["signs flipped"] == "displacement, force"
    assert provenance["force column"] == "Load (N)"
    assert provenance["displacement unit"] == "mm x 0.001"
    clock = recording.clock["force"]
    assert (clock.count, clock.duplicates, clock.backward, clock.gaps) == (41, 0, 0, 0)
    assert clock.duration == pytest.approx(3.921, abs=1e-9)
    assert clock.stamp_minus_publish is None
    assert recording.t0_ns == 0


def test_negative_zeros_become_zeros(tmp_path: Path) -> None:
    data = written(Dress()).replace(b"\n0.000000,0.000000", b"\n0.000000,-0.000000")
    first = read(tmp_path, data).signals["displacement"].y[0, 0]
    assert first == 0
    assert not np.signbit(first)


def test_remarks_below_the_table_are_kept(tmp_path: Path) -> None:
    recording = read(tmp_path, written(Dress()) + b"\n\nOperator,AB\nEnd of test\n\x1a")
    assert_same(recording)
    header = recording.record("header")
    assert header["Operator"] == "AB"
    assert [text for key, text in header.items() if key.startswith("line")][-1] == "End of test"
    assert "\x1a" not in "".join(header.values())


def test_thousands_beside_a_decimal_sign_are_read(tmp_path: Path) -> None:
    rows = [f'{t!r};{d!r};"{1000 * f:,.3f}"' for t, d, f in SAMPLES]
    text = "\n".join(["Time (s);Displacement (mm);Force (mN)", *rows])
    recording = read(tmp_path, text.encode(), {"test": "compression"})
    assert np.allclose(recording.signals["force"].y[:, 0], F, atol=1e-6)


def test_two_columns_of_one_motion_are_one(tmp_path: Path) -> None:
    rows = [f"{t!r},{-d!r},{d!r},{f!r}" for t, d, f in SAMPLES]
    names = "Time (s),Extension (mm),Compressive extension (mm),Compressive load (N)"
    recording = read(tmp_path, "\n".join([names, *rows]).encode())
    assert_same(recording)
    assert recording.record("provenance")["displacement column"] == "Compressive extension (mm)"


def test_tension_is_negative(tmp_path: Path) -> None:
    data = written(Dress()).replace(b"Compression test", b"Tensile test")
    recording = read(tmp_path, data.replace(b"Compression (mm)", b"Extension (mm)"))
    assert np.allclose(recording.signals["force"].y[:, 0], -F, atol=1e-6)
    assert recording.record("specimen")["test"] == "tension"


@pytest.mark.parametrize("name", REAL)
def test_real_files_against_the_csv_module(name: str, shared_data: Path) -> None:
    path = shared_data / "force" / "ecoflex-compression" / f"{name}.csv"
    recording = read_instron(path)
    rows = list(csv.reader(io.StringIO(path.read_text())))[8:]
    plain = np.array([[float(x) for x in row[:3]] for row in rows])
    assert len(plain) == 1202  # counted with wc: 1210 lines, 8 of header
    assert np.array_equal(recording.signals["force"].t, plain[:, 0])
    assert np.allclose(recording.signals["displacement"].y[:, 0], plain[:, 1] / 1e3, rtol=1e-15)
    assert np.array_equal(recording.signals["force"].y[:, 0], plain[:, 2])
    specimen = {k: v for k, v in recording.record("specimen").items() if k != "test"}
    sizes = {"diameter_m": 0.05, "height_m": 0.03, "speed_m_per_s": 10e-3 / 60}  # from its header
    assert {k: float(v) for k, v in specimen.items()} == pytest.approx(sizes, rel=1e-14)
    assert recording.record("specimen")["test"] == "compression"
    assert recording.record("header")["Speed (mm/min)"] == "10"
    assert recording.record("provenance")["signs flipped"] == "none"


@pytest.mark.parametrize("name", ["README.txt", "DATA_LICENSE.md"])
def test_text_beside_the_data_is_refused(name: str, shared_data: Path) -> None:
    with pytest.raises(RecordingError, match=rf"{name}: no table of numbers in \d+ lines"):
        read_instron(shared_data / "force" / "ecoflex-compression" / name)
