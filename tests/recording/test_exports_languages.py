"""Exports of other laboratories: languages, encodings, units, and what machines put around."""

from pathlib import Path

import numpy as np
import pytest
from exports import D, F, T, assert_test, comma, read, rows

from validate.errors import RecordingError, UsageError
from validate.recording.tables.table import decode

PAIRS = list(zip(T, D, F, strict=True))
QUOTED = '"Zeit","Weg","Kraft"\n"(s)","(mm)","(N)"\n' + rows(form=lambda x: f'"{comma(x)}"')
GERMAN = (
    '"Prüfer";"Müller"\n"Durchmesser";"25,0";"mm"\n"Probenhöhe";"20,0";"mm"\n'
    '"Prüfgeschwindigkeit";"15";"mm/min"\nDruckversuch\n'
    '"Prüfzeit";"Standardweg";"Standardkraft"\n"s";"mm";"N"\n' + rows(";", comma)
)
POLISH = (
    "Operator;Żaneta\nŚrednica próbki [mm];25,0\nWysokość [mm];20,0\nPróba ściskania\n"
    "Czas [s];Przemieszczenie [mm];Siła [N]\n" + rows(";", comma)
)
CZECH = "Zkouška tlakem\nPrůměr;25,0 mm\nVýška;20 mm\nČas (s);Dráha (mm);Síla (kN)\n" + rows(
    ";", lambda x: f"{x:.8f}".replace(".", ","), f=F / 1e3
)
CHINESE = (
    "试样编号,A1\n试样直径(mm),25.0\n试样高度(mm),20.0\n压缩试验\n时间(s),位移(mm),变形(mm),力(N)\n"
    + "".join(f"{t:.3f},{d:.5f},0.000,{f:.7f}\n" for t, d, f in zip(T, D, F, strict=True))
)
FRENCH = (
    "Essai de compression\nDiamètre;25,0 mm\nHauteur;20 mm\n"
    "Temps (s);Déplacement (mm);Force (N)\n" + rows(";", comma)
)

SIZED = {
    "german": (GERMAN, "cp1252"),
    "german utf-16": (GERMAN, "utf-16"),
    "polish": (POLISH, "cp1250"),
    "polish utf-8": (POLISH, "utf-8"),
    "polish with mark": (POLISH, "utf-8-sig"),
    "czech": (CZECH, "cp1250"),
    "chinese": (CHINESE, "gb18030"),
    "chinese utf-16 without mark": (CHINESE, "utf-16-le"),
    "french": (FRENCH, "cp1252"),
}


@pytest.mark.parametrize("name", SIZED)
def test_language_and_encoding_do_not_matter(name: str, tmp_path: Path) -> None:
    text, encoding = SIZED[name]
    recording = read(tmp_path, text, encoding, test=None)
    assert_test(recording)
    specimen = recording.record("specimen")
    assert specimen["test"] == "compression"
    assert float(specimen["diameter_m"]) == pytest.approx(0.025)
    assert float(specimen["height_m"]) == pytest.approx(0.020)
    wanted = encoding.removesuffix("-sig")
    assert recording.record("provenance")["text"].startswith(wanted)


PLAIN = {
    "quoted decimals": (QUOTED, "utf-8"),
    "spanish": ("Tiempo (s);Desplazamiento (mm);Fuerza (N)\n" + rows(";", comma), "cp1252"),
    "italian": ("Tempo;Spostamento;Forza\n[s];[mm];[N]\n" + rows(";", comma), "utf-16"),
    "portuguese": ("Tempo (s);Deformação (mm);Força (N)\n" + rows(";", comma), "cp1252"),
    "russian": ("Время (с);Перемещение (мм);Нагрузка (Н)\n" + rows(";", comma), "cp1251"),
    "japanese": ("時間(sec),ストローク(mm),試験力(N)\n" + rows(), "cp932"),
    "chinese units": ("时间（秒）,位移（毫米）,载荷（牛）\n" + rows(), "gb18030"),
    "hungarian": ("Idő (s);Elmozdulás (mm);Erő (N)\n" + rows(";", comma), "cp1250"),
    "bluehill raw": ('"Time","Extension","Load"\n"(s)","(mm)","(N)"\n' + rows(), "utf-8"),
    "trapezium": ('"Name","1 _ 1",""\nTime,Stroke,Force\n"sec","mm","N"\n' + rows(), "utf-8"),
    "spaces": ("Time (s)   Extension (mm)   Load (N)\n" + rows("   "), "utf-8"),
    "testsuite": (
        "MTS793|MPT|ENU|1|0|/|.|:|1|0|0|A\n\nData Header:\tTime:\t3.0\tSec\n\n"
        "Time\tAxial Displacement\tAxial Force\nSec\tmm\tN\n" + rows("\t"),
        "utf-8",
    ),
    "nexygen": (
        "Test Date,21/01/2020\nTime (s),Machine Extension (mm),Load (N),Extension from Preload (mm)"
        "\n" + "".join(f"{t:.1f},{d:.5f},{f:.5f},{d + 1:.5f}\n" for t, d, f in PAIRS),
        "utf-8",
    ),
    "unit row with another unit": (
        "Time;Extension;Load;Temperature\ns;mm;N;°C\n"
        + "".join(f"{t:.1f};{d:.5f};{f:.5f};22\n" for t, d, f in zip(T, D, F, strict=True)),
        "cp1252",
    ),
    "unit row with a label": (
        "Channel;Time;Extension;Load\nUnit;s;mm;N\n"
        + "".join(f";{t:.1f};{d:.5f};{f:.5f}\n" for t, d, f in zip(T, D, F, strict=True)),
        "utf-8",
    ),
    "numbered rows": (
        ",Time (s),Extension (mm),Load (N)\n"
        + "".join(f"{i},{t:.1f},{d:.5f},{f:.5f}\n" for i, (t, d, f) in enumerate(PAIRS)),
        "utf-8",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", PLAIN)
def test_every_machine_gives_the_same_numbers(name: str, tmp_path: Path) -> None:
    assert_test(read(tmp_path, *PLAIN[name]))


@pytest.mark.parametrize(
    ("names", "length", "force"),
    [
        ("Time (sec),Extension (in),Load (lbf)", 25.4, 4.4482216152605),
        ("Time,Crosshead,Load\nsec,in,lb", 25.4, 4.4482216152605),
        ("Time (s),Stroke (mm),Force (kgf)", 1.0, 9.80665),
        ("TIME (SEC),STROKE (MM),LOAD (KN)", 1.0, 1e3),
    ],
)
def test_pounds_inches_and_capitals(
    names: str, length: float, force: float, tmp_path: Path
) -> None:
    recording = read(tmp_path, names + "\n" + rows())
    assert np.allclose(recording.signals["displacement"].y[:, 0], D * length / 1e3, atol=1e-9)
    assert np.allclose(recording.signals["force"].y[:, 0], F * force, atol=6e-6 * force)


def test_kilograms_are_refused_with_what_to_pass(tmp_path: Path) -> None:
    text = "Time (s),Extension (mm),Load (kg)\n" + rows()
    with pytest.raises(RecordingError, match="write kgf"):
        read(tmp_path, text)
    assert_test(read(tmp_path, text, force="Load:kgf"), f=F * 9.80665)


def test_bluehill_universal_header_with_units_in_cells(tmp_path: Path) -> None:
    head = "Specimen properties : Geometry,,Circular\nDimension : Diameter,,25.0,mm\n"
    recording = read(tmp_path, head + "Time,Displacement,Force\n(s),(mm),(N)\n" + rows())
    assert_test(recording)
    assert float(recording.record("specimen")["diameter_m"]) == pytest.approx(0.025)


def test_a_table_of_results_is_no_test_and_is_told(tmp_path: Path) -> None:
    results = (
        "Results Table 1\n,Maximum Load (N),Extension at Maximum Load (mm),Time at break (s)\n"
        "1,25.3,12.2,3\n2,26,12,3\nMean,25.6,12.1,3\n\nRaw Data\n"
    )
    recording = read(tmp_path, results + "Time,Extension,Load\n(s),(mm),(N)\n" + rows())
    assert_test(recording)
    assert "tables not used: " in recording.record("provenance")["besides"]


def test_the_unit_decides_between_length_and_strain(tmp_path: Path) -> None:
    table = "".join(
        f"{t:.1f};{d / 20 * 100:.6f};{d:.5f};{f:.5f}\n" for t, d, f in zip(T, D, F, strict=True)
    )
    names = "Zeit [s];Verformung [%];Traverse [mm];Kraft [N]\n"
    assert_test(read(tmp_path, names + table))


def test_a_doubtful_thousand_is_refused_or_said(tmp_path: Path) -> None:
    lines = [f"{t:.1f};{d:.5f};{f:.5f}" for t, d, f in zip(T, D, F, strict=True)]
    text = "Time (s);Extension (mm);Load (N)\n" + "\n".join([*lines, "4.0;1;1,234"]) + "\n"
    with pytest.raises(RecordingError, match="'1,234' may"):
        read(tmp_path, text)
    assert read(tmp_path, text, decimal=".").signals["force"].y[-1, 0] == 1234.0
    with pytest.raises(UsageError, match="decimal=x"):
        read(tmp_path, text, decimal="x")


def test_what_decided_the_encoding_is_told() -> None:
    assert decode("Siła (N);Prędkość\n".encode("cp1250")).why == "by its words Prędkość, Siła"
    assert decode("力(N)\n".encode("gb18030")).encoding == "gb18030"
    assert decode("N/mm² µm\n".encode("cp1252")).text == "N/mm² µm\n"
    doubtful = decode("Łódź\n".encode("cp1250"))
    assert (doubtful.encoding, "cp1250 would fit" in doubtful.why) == ("cp1252", True)
    assert decode("Łódź\n".encode("cp1250"), "cp1250").text == "Łódź\n"
    with pytest.raises(UsageError, match="unknown encoding"):
        decode(b"abc", "klingon")


@pytest.mark.parametrize("still", ["displacement", "force"])
def test_a_signal_that_does_not_move_takes_the_others_sign(still: str, tmp_path: Path) -> None:
    d, f = (D * (still != "displacement"), F * (still != "force"))
    names = "Time (s),Extension (mm),Load (N)\n"
    for sign in (1, -1):
        assert_test(read(tmp_path, names + rows(d=sign * d, f=sign * f)), d, f)


def test_quotes_may_follow_a_blank(tmp_path: Path) -> None:
    names = '"Time (s)", "Extension (mm)", "Load (N)"\n'
    assert_test(read(tmp_path, names + rows(", ", lambda x: f'"{comma(x)}"')))


@pytest.mark.parametrize(
    ("head", "test"),
    [
        ("Ensayo de tracción\nTiempo (s);Alargamiento (mm);Fuerza (N)\n", "tension"),
        ("Zugversuch\nZeit;Längenänderung;Zugkraft\ns;mm;N\n", "tension"),
        ("Çekme testi\nZaman;Uzama;Kuvvet\ns;mm;N\n", "tension"),
        ("Sıkıştırma testi\nZaman;Deplasman;Yük\ns;mm;N\n", "compression"),
        ("Vetokoe\nAika;Venymä;Voima\ns;mm;N\n", "tension"),
        ("Puristuskoe\nAika;Siirtymä;Voima\ns;mm;N\n", "compression"),
        ("인장 시험\n시간;변위;하중\ns;mm;N\n", "tension"),
        ("Tension\nTime;Actuator;Load\ns;mm;N\n", "tension"),
    ],
)
def test_the_words_of_a_language_name_columns_and_kind(
    head: str, test: str, tmp_path: Path
) -> None:
    recording = read(tmp_path, head + rows(";"), test=None)
    way = -1 if test == "tension" else 1
    assert recording.record("specimen")["test"] == test
    assert np.allclose(recording.signals["displacement"].y[:, 0], way * D * 1e-3)
    assert np.allclose(recording.signals["force"].y[:, 0], way * F, atol=1e-5)


def test_a_column_that_no_word_names_is_offered_before_a_strain(tmp_path: Path) -> None:
    """Who followed the advice to say a length took the strain instead of the way beside it."""
    text = "Tension\nTime (s),Koloumb (mm),Load (N),Strain (%)\n" + "".join(
        f"{t:.1f},{d:.5f},{f:.5f},{5 * d:.5f}\n" for t, d, f in PAIRS
    )
    with pytest.raises(RecordingError) as raised:
        read(tmp_path, text, test=None)
    said = "(if 'Koloumb (mm)' is the displacement, give --map 'displacement=Koloumb (mm)' alone)"
    assert said in str(raised.value)
    recording = read(tmp_path, text, test=None, displacement="Koloumb (mm)")
    assert np.allclose(recording.signals["displacement"].y[:, 0], -D * 1e-3)


@pytest.mark.parametrize(("way", "diameter", "height"), [
    ("Distanza", "Diametro", "Altezza"), ("Distancia", "Diámetro", "Altura"),
    ("Afstand", "Diameter", "Hoogte"), ("Eindringtiefe", "Durchmesser", "Höhe"),
    ("压入深度", "直径", "高度"), ("クロスヘッド", "直径", "高さ"),
    ("Flèche", "Diamètre", "Hauteur"),
])  # fmt: skip
def test_depths_and_distances_are_displacements(
    way: str, diameter: str, height: str, tmp_path: Path
) -> None:
    """As of indenters, texture analysers and bending tests."""
    text = f"{diameter};25,0 mm\n{height};20 mm\nt (s);{way} (mm);F (N)\n" + rows(";", comma)
    recording = read(tmp_path, text)
    assert_test(recording)
    specimen = recording.record("specimen")
    assert (float(specimen["diameter_m"]), float(specimen["height_m"])) == (0.025, 0.02)
