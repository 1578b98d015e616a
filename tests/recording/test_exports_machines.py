"""Files as testing machines write them, in many languages and encodings: one test from all."""

from pathlib import Path

import numpy as np
import pytest
from exports import D, F, T, assert_test

from validate.errors import UsageError
from validate.recording.motion_capture.text_rows import LEFT_OUT
from validate.recording.tables.testing_machine import read_instron

S, G = 5 * D, 2.5 * F  # strain % of 20 mm, stress kPa on 400 mm2
SIZES = {"area": "400mm2", "length": "20mm", "measure": "engineering"}
MASS = 9.80665e-3  # N, the weight of a gram


def rows(separator: str, *columns: np.ndarray, decimal: str = ".", quote: str = "") -> str:
    return "".join(
        separator.join(f"{quote}{x:.8f}{quote}".replace(".", decimal) for x in row) + "\n"
        for row in zip(*columns, strict=True)
    )


def semicolons(*columns: np.ndarray) -> str:
    return rows(";", *columns, decimal=",")


WRITTEN = {
    "bluehill": (
        'Results Table 1\n,"Maximum Load [N]","Strain at Maximum load [%]"\n1,12.3,30.1\n\n'
        '"Time","Displacement","Force","Compressive strain (Displacement)","Compressive stress"\n'
        '"(s)","(mm)","(N)","(%)","(kPa)"\n' + rows(",", T, D, F, S, G, quote='"'), "utf-8"),
    "bluehill, german": (
        '"Zeit";"Erweiterung";"Last"\n"(s)";"(mm)";"(N)"\n' + semicolons(T, D, F), "utf-8-sig"),
    "bluehill, french": (
        '"Temps";"Extension";"Charge";"Contrainte en compression"\n"(s)";"(mm)";"(N)";"(kPa)"\n'
        + semicolons(T, D, F, G), "cp1252"),
    "testxpert": (
        "Druckversuch\nPrüfzeit\tStandardweg\tStandardkraft\tNominaldehnung\ns\tmm\tN\t%\n"
        + rows("\t", T, D, F, S, decimal=","), "utf-16"),
    "testxpert, dutch": (
        "Testtijd (s);Verplaatsing (mm);Kracht (N)\n" + semicolons(T, D, F), "cp1252"),
    "testsuite": (
        "MTS TestSuite\nTest Run Name:\tR1\n\nTime\tCrosshead\tLoad\tStrain 1\n"
        "(s)\t(mm)\t(N)\t(mm/mm)\n" + rows("\t", T, D, F, S / 100), "utf-8"),
    "testsuite, swedish": (
        "Tid (s);Förlängning (mm);Kraft (N)\n" + semicolons(T, D, F), "latin-1"),
    "danish": ("Tid (s);Forlængelse (mm);Kraft (N)\n" + semicolons(T, D, F), "latin-1"),
    "trapezium": (
        "Key Word,,,\nProduct Name,gel,,\nTest Mode,Single,,\nTest Type,Compression,,\n"
        "Speed,1mm/min,,\nNo of Batches:,1,,\n\n\"1 _ 1\",,,\nTime,Force,Stroke,\nsec,N,mm,\n"
        + rows(",", T, F, D).replace("\n", ",\n"), "utf-8"),
    "trapezium, japanese": (
        '"名前","1 _ 1",""\n"時間","試験力","ストローク"\n"sec","N","mm"\n' + rows(",", T, F, D),
        "cp932"),
    "ta.xt": ("Force\tDistance\tTime\n(N)\t(mm)\t(s)\n" + rows("\t", F, D, T), "utf-8"),
    "ta.xt, both negative": (
        "Force (N),Distance (mm),Time (sec)\n" + rows(",", -F, -D, T), "utf-8"),
    "mark-10": (
        "Reading,Load [N],Travel [mm],Time [sec.]\n" + rows(",", 10 * T, F, D, T), "utf-8"),
    "mark-10, pounds": (
        "Reading,Load [lbF],Travel [in],Time [sec]\n"
        + rows(",", 10 * T, F / 4.4482216152605, D / 25.4, T), "utf-8"),
    "nexygen, french": (
        "Date d'essai;21/01/2020\nTemps (s);Extension machine (mm);Charge (N)\n"
        + semicolons(T, D, F), "cp1252"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRITTEN)
def test_a_machine_gives_the_same_numbers(name: str, tmp_path: Path) -> None:
    text, encoding = WRITTEN[name]
    (tmp_path / "log.csv").write_bytes(text.replace("\n", "\r\n").encode(encoding))
    assert_test(read_instron(tmp_path / "log.csv", {"test": "compression"}))


DERIVED = {
    "testxpert": ('"Prüfzeit";"Dehnung";"Standardkraft"\n"s";"%";"N"\n', S, F, "cp1252"),
    "french": ("Temps (s);Déformation (%);Contrainte (kPa)\n", S, G, "latin-1"),
    "french, elongation": ("Temps (s);Allongement (%);Force (N)\n", S, F, "latin-1"),
    "spanish": ("Tiempo (s);Deformación unitaria (%);Esfuerzo (kPa)\n", S, G, "latin-1"),
    "italian": ("Tempo (s);Deformazione (%);Sforzo (kPa)\n", S, G, "utf-16"),
    "portuguese": ("Tempo (s);Extensão (%);Tensão (kPa)\n", S, G, "latin-1"),
    "dutch": ("Tijd;Rek;Spanning\ns;%;kPa\n", S, G, "cp1252"),
    "swedish": ("Tid (s);Töjning (%);Spänning (kPa)\n", S, G, "latin-1"),
    "polish": ("Czas [s];Odkształcenie [%];Naprężenie [kPa]\n", S, G, "cp1250"),
    "chinese": ("时间(s);应变(%);应力(kPa)\n", S, G, "gb18030"),
}


@pytest.mark.parametrize("name", DERIVED)
def test_strain_and_stress_have_names_in_languages(name: str, tmp_path: Path) -> None:
    names, strain, other, encoding = DERIVED[name]
    (tmp_path / "log.csv").write_bytes((names + semicolons(T, strain, other)).encode(encoding))
    assert_test(read_instron(tmp_path / "log.csv", {"test": "compression", **SIZES}))


TIMES = (
    "Time Zeit Temps Tiempo Tempo Czas Čas Idő Tijd Tid Время 时间 時間 시간 Zaman Süre Aika Timp"
)


@pytest.mark.parametrize("word", TIMES.split())
def test_time_is_a_word_of_many_languages(word: str, tmp_path: Path) -> None:
    text = f"{word} (s);Stroke (mm);Load (N);Stress (V)\n" + semicolons(T, D, F, T)
    (tmp_path / "log.csv").write_text(text, "utf-8")
    recording = read_instron(tmp_path / "log.csv", {"test": "compression"})
    assert_test(recording)
    assert "'V' is not a unit of stress" in recording.record("provenance")[LEFT_OUT]


def test_one_column_is_never_two_things(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("Time (s);Load (N);Stroke (mm)\n" + semicolons(T, D, F))
    with pytest.raises(UsageError, match=r"'Stroke \(mm\)'.*both"):
        read_instron(tmp_path / "log.csv", {"test": "compression", "force": "Stroke (mm):N"})
