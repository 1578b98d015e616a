"""Whether a log presses or pulls: words of many languages, signs, and else the user is asked."""

from pathlib import Path

import numpy as np
import pytest
from exports import D, F, T, rows

from validate.errors import RecordingError, UsageError
from validate.recording.motion_capture.text_rows import ASSUMED
from validate.recording.tables.columns import kind_of_test
from validate.recording.tables.testing_machine import read_instron
from validate.recording.tables.vocabulary import (
    COMPRESSION,
    TENSION,
    is_ideographic,
    kind_word,
    tells_a_stop,
    terms,
)
from validate.recording.types import Recording

BARE = "Time (s),Displacement (mm),Load (N)\n"
ASKED = "unclear whether compression or tension: .*--map test=compression or --map test=t"


def read(folder: Path, text: str, **mapping: str) -> Recording:
    (folder / "log.csv").write_text(text, encoding="utf-8")
    return read_instron(folder / "log.csv", mapping)


def sense(recording: Recording) -> tuple[str, int, int]:
    """The kind that was read and the signs of the last displacement and force."""
    d, f = (recording.signals[name].y[-1, 0] for name in ("displacement", "force"))
    return recording.record("specimen")["test"], int(np.sign(d)), int(np.sign(f))


PRESSES, PULLS = ("compression", 1, 1), ("tension", -1, -1)
# A header line in tension, one in compression, and how the time, way and force are called.
LANGUAGES = {
    "english": ("Tensile testing of gels", "Compressive tests", "Time,Stroke,Force"),
    "german": ("Protokoll des Zugversuchs", "Protokoll des Druckversuchs", "Zeit,Weg,Kraft"),
    "german column": ("Zugkraft: 10 N", "Stauchung bis: 3 mm", "Testzeit,Traverse,Kraft"),
    "french": ("Essai de traction", "Essais de compression", "Temps,Course,Charge"),
    "italian": ("Prova di trazione", "Prova a compressione", "Tempo,Corsa,Forza"),
    "spanish": ("Ensayo de tracción", "Ensayo de compresión", "Tiempo,Recorrido,Fuerza"),
    "portuguese": ("Ensaio de tração", "Ensaio de compressão", "Tempo,Deslocamento,Força"),
    "russian": ("Испытание на растяжение", "Испытания на сжатие", "Время,Перемещение,Сила"),
    "polish": ("Próba rozciągania", "Podczas ściskaniem", "Czas,Droga,Siła"),
    "czech": ("Zkouška tahem", "Zkoušky tlakem", "Čas,Dráha,Síla"),
    "hungarian": ("Szakítóvizsgálat", "Nyomóvizsgálat", "Idő,Elmozdulás,Erő"),
    "chinese": ("金属拉伸试验", "泡沫压缩试验", "时间,位移,力"),
    "japanese": ("引張試験方法", "圧縮試験方法", "時間,変位,荷重"),
    "dutch": ("Trekproef", "Drukproef", "Tijd,Position,Force"),
}


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_words_of_a_language_decide_both_ways(language: str, tmp_path: Path) -> None:
    pulls, presses, names = LANGUAGES[language]
    table = ",".join(f"{n} ({u})" for n, u in zip(names.split(","), ("s", "mm", "N"), strict=True))
    for line, wanted in ((pulls, PULLS), (presses, PRESSES)):
        recording = read(tmp_path, f"{line}\n{table}\n{rows()}")
        assert sense(recording) == wanted
        assert recording.record(ASSUMED)["test"] == f"{wanted[0]}: the header contains '{line}'"
    with pytest.raises(UsageError, match=ASKED):
        read(tmp_path, f"{table}\n{rows()}")


@pytest.mark.parametrize("kind", [COMPRESSION, TENSION])
def test_every_word_of_the_table_is_found_and_only_of_its_kind(kind: str) -> None:
    other = TENSION if kind == COMPRESSION else COMPRESSION
    for stem in terms(kind):
        text = f"x{stem}x" if is_ideographic(stem) else f"1 {stem}x"
        assert kind_word(text, kind)
        assert kind_word(text, other) is None


@pytest.mark.parametrize(
    ("names", "wanted"),
    [
        ("Time (s),Tensile extension (mm),Load (N)", PULLS),
        ("Time (s),Compressive extension (mm),Load (N)", PRESSES),
        ("Zeit (s),Weg (mm),Zugkraft (N)", PULLS),
        ("Zeit (s),Stauchung (mm),Kraft (N)", PRESSES),
    ],
)
def test_names_of_columns_decide(names: str, wanted: tuple[str, int, int], tmp_path: Path) -> None:
    recording = read(tmp_path, f"{names}\n{rows()}")
    assert sense(recording) == wanted
    assert "the column contains '" in recording.record(ASSUMED)["test"]


def with_strain(strain: float, stress: float = 0.0, d: float = 1.0, f: float = 1.0) -> str:
    table = "".join(
        f"{t:.1f},{d * x:.5f},{f * y:.5f},{strain * x / 20:.6f},{stress * y / 400:.7f}\n"
        for t, x, y in zip(T, D, F, strict=True)
    )
    return f"Time (s),Displacement (mm),Load (N),Strain (-),Stress (MPa)\n{table}"


def test_strain_that_goes_negative_is_compression(tmp_path: Path) -> None:
    recording = read(tmp_path, with_strain(-1, -1))
    assert sense(recording) == PRESSES
    told = "compression: 'Strain (-)' and 'Stress (MPa)' go negative"
    assert recording.record(ASSUMED)["test"].startswith(told)
    assert sense(read(tmp_path, with_strain(-1, -1, d=-1.0))) == PRESSES


@pytest.mark.parametrize(
    "text",
    [
        BARE + rows(),
        BARE + rows(f=-F),
        BARE + rows(d=-D),
        "Time (s),Extension (mm),Load (N)\n" + rows(),
        with_strain(1, 1),
        with_strain(-1, 1),
        with_strain(1, 1, d=-1.0, f=-1.0),
        "Load cell: 1 kN tension/compression\n" + BARE + rows(),
        "Compression test\nTime (s),Tensile extension (mm),Load (N)\n" + rows(),
        "Compressed air: 6 bar\nPre-compression: 1 N\nDruck (bar): 6\n" + BARE + rows(),
    ],
    ids=range(10),
)
def test_what_says_nothing_or_both_is_asked_and_the_answer_is_taken(
    text: str, tmp_path: Path
) -> None:
    with pytest.raises(UsageError, match=ASKED):
        read(tmp_path, text)
    for kind, wanted in (("compression", PRESSES), ("tension", PULLS)):
        recording = read(tmp_path, text, test=kind)
        assert sense(recording) == wanted
        assert recording.record(ASSUMED)["test"] == f"{kind}: given by --map"


def test_both_negative_tells_nothing_and_the_answer_says_what_was_flipped(tmp_path: Path) -> None:
    text = BARE + rows(d=-D, f=-F)
    with pytest.raises(UsageError, match=ASKED):
        read(tmp_path, text)
    assert sense(read(tmp_path, text, test="tension")) == PULLS
    recording = read(tmp_path, text, test="compression")
    assert sense(recording) == PRESSES
    assumed = recording.record(ASSUMED)
    assert assumed["signs"].startswith("flipped: displacement, force, ")
    assert "'Load (N)' in N x 1" in assumed["units"]
    assert "'Displacement (mm)' in mm x 0.001" in assumed["units"]
    assert recording.record("provenance")["given by the user"] == "test=compression"


def test_a_test_in_tension_that_goes_negative_is_asked(tmp_path: Path) -> None:
    text = "Tensile test\n" + BARE + rows(d=-D, f=-F)
    with pytest.raises(RecordingError, match=r"negative in a tension test .*--map test="):
        read(tmp_path, text)
    assert sense(read(tmp_path, text, test="tension")) == PULLS
    assert sense(read(tmp_path, text, test="compression")) == PRESSES


def test_a_sign_that_is_said_makes_the_kind_immaterial(tmp_path: Path) -> None:
    assert sense(read(tmp_path, BARE + rows(), force="Load:+")) == PRESSES
    assert sense(read(tmp_path, BARE + rows(), force="Load:-")) == PULLS


def test_a_sign_that_is_said_is_believed_over_the_header(tmp_path: Path) -> None:
    text = "Tensile test\n" + BARE + rows()
    assert sense(read(tmp_path, text, force="Load:+")) == PRESSES
    with pytest.raises(UsageError, match=r"test=tension.*--map"):
        read(tmp_path, text, test="tension", force="Load:+")


def test_a_kind_that_is_neither_is_refused() -> None:
    with pytest.raises(UsageError, match="test=bending: expected"):
        kind_of_test("bending", {}, ())


@pytest.mark.parametrize(
    "line",
    [
        "Test aborted at machine limit",
        "Status: stopped by operator",
        "Versuch abgebrochen",
        "Essai interrompu",
        "Prova interrotta",
        "Proef afgebroken",
        "Provningen avbruten",
        "Ensayo interrumpido",
        "Испытание прервано",
        "试验中止",
    ],
)
def test_an_aborted_run_is_remarked(line: str, tmp_path: Path) -> None:
    for text in (f"{line}\n{BARE}{rows()}", f"{BARE}{rows()}\n{line}\n"):
        recording = read(tmp_path, text, test="compression")
        assert recording.record(ASSUMED)["run"].startswith(f"aborted, by the words '{line}'")
        assert len(recording.signals["force"].t) == len(T)


def test_words_that_no_run_was_aborted_are_no_remark(tmp_path: Path) -> None:
    for answer in ("no", "0", "false"):
        recording = read(tmp_path, f"Aborted: {answer}\n{BARE}{rows()}", test="compression")
        assert "run" not in recording.record(ASSUMED)
    assert not tells_a_stop("Test ended at 3 mm")


@pytest.mark.parametrize("name", ["Deflection (mm)", "Flexure extension (mm)", "Depth (mm)"])
def test_a_bent_or_indented_body_is_told_what_to_answer(name: str, tmp_path: Path) -> None:
    """It neither presses on a whole face nor pulls: the question alone had no true answer."""
    path = tmp_path / "log.csv"
    lines = "".join(f"{t},{d},{f}\n" for t, d, f in zip(T, D, F, strict=True))
    path.write_text(BARE.replace("Displacement (mm)", name) + lines)
    with pytest.raises(UsageError, match=ASKED + ".* give compression .* experiment = body"):
        read_instron(path, {})
