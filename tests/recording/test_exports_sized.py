"""Tables of stress, strain and stretch: force and displacement by sizes that are said."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from validate.errors import RecordingError, UsageError, ValidateError
from validate.recording.motion_capture.text_rows import ASSUMED
from validate.recording.readers import READERS
from validate.recording.tables import blocks as repeats
from validate.recording.tables import specimens as sized
from validate.recording.tables import table as encoding
from validate.recording.tables import workbook
from validate.recording.tables.columns import Pick, Said
from validate.recording.tables.testing_machine import read_instron
from validate.recording.types import Recording

# private: _LONGEST: a limit or list of the code, which the test must meet exactly.
# private: _relative, _signed, _source: called alone, case by case.

E = np.linspace(0.0, 0.4, 41)  # engineering strain of the path
SIGMA = 100.0 * E + 30.0 * E**2  # kPa, engineering
AREA, LENGTH = 314e-6, 20e-3
SIZES = {"area": "314mm2", "length": "20mm", "measure": "engineering"}
PLAIN = "Time (s),Strain (%),Stress (kPa)\n"


def table(names: str, *columns: np.ndarray) -> str:
    rows = zip(np.arange(len(E)) / 10, *columns, strict=True)
    return names + "".join(",".join(f"{x:.12g}" for x in row) + "\n" for row in rows)


def read(folder: Path, text: str, **mapping: str) -> Recording:
    (folder / "log.csv").write_text(text, encoding="utf-8")
    return read_instron(folder / "log.csv", mapping)


def assert_pulled(recording: Recording, e: np.ndarray = E, sigma: np.ndarray = SIGMA) -> None:
    d, f = (recording.signals[k].y[:, 0] for k in ("displacement", "force"))
    assert np.allclose(d, -e * LENGTH, rtol=1e-9, atol=1e-15)
    assert np.allclose(f, -sigma * 1e3 * AREA, rtol=1e-9, atol=1e-12)
    assert recording.record("specimen")["test"] == "tension"


def test_engineering_measures_are_multiplied(tmp_path: Path) -> None:
    recording = read(tmp_path, table(PLAIN, 100 * E, SIGMA), **SIZES, test="tension")
    assert_pulled(recording)
    told = recording.record(ASSUMED)["sizes"]
    assert "displacement = engineering strain 'Strain (%)' x length 0.02 m (given)" in told
    assert "force = engineering stress 'Stress (kPa)' x area 0.000314 m2 (given)" in told
    assert float(recording.record("specimen")["area_m2"]) == pytest.approx(AREA)
    assert float(recording.record("specimen")["height_m"]) == pytest.approx(LENGTH)


def test_the_sides_of_a_strip_that_is_pulled_are_its_area(tmp_path: Path) -> None:
    """Those of a slab that is pressed may be its height: its area is asked for."""
    sides = "Width: 20 mm\nThickness: 15.7 mm\n"
    mapping = {"length": "20mm", "measure": "engineering"}
    text = sides + table(PLAIN, 100 * E, SIGMA)
    assert_pulled(read(tmp_path, text, **mapping, test="tension"))
    with pytest.raises(RecordingError, match="area=314mm2"):
        read(tmp_path, text, **mapping, test="compression")


def test_true_measures_are_turned_back(tmp_path: Path) -> None:
    """ln(1 + e), and the stress on an area that the volume leaves, are those of the same path."""
    for sign, test in ((1, "tension"), (-1, "compression")):
        s = 1 + sign * E
        true = table("Time (s),True strain (-),True stress (kPa)\n", np.log(s), sign * SIGMA * s)
        recording = read(tmp_path, true, area="314mm2", length="20mm", test=test)
        d, f = (recording.signals[k].y[:, 0] for k in ("displacement", "force"))
        assert np.allclose(d, -sign * E * LENGTH, rtol=1e-9, atol=1e-15)
        assert np.allclose(f, -sign * SIGMA * 1e3 * AREA, rtol=1e-9, atol=1e-12)
        assert "constant volume assumed" in recording.record(ASSUMED)["sizes"]


def test_compression_written_positive_is_true_compression(tmp_path: Path) -> None:
    s = 1 - E
    text = table("Time (s),Strain (-),Stress (kPa)\n", -np.log(s), SIGMA * s)
    recording = read(tmp_path, text, **{**SIZES, "measure": "true"}, test="compression")
    assert np.allclose(recording.signals["displacement"].y[:, 0], E * LENGTH, atol=1e-13)
    assert np.allclose(recording.signals["force"].y[:, 0], SIGMA * 1e3 * AREA, atol=1e-9)
    assert float(recording.record("specimen")["height_m"]) == pytest.approx(LENGTH)


def test_a_stretch_says_itself_which_way_it_goes(tmp_path: Path) -> None:
    text = table("Time (s),Stretch,Nominal stress (kPa)\n", 1 + E, SIGMA)
    recording = read(tmp_path, text, area="314mm2", length="20mm")
    assert_pulled(recording)
    assert recording.record(ASSUMED)["test"] == "tension: 'Stretch' goes above 1"
    pressed = table("Time (s),Stretch,Nominal stress (kPa)\n", 1 - E, SIGMA)
    recording = read(tmp_path, pressed, area="314mm2", length="20mm")
    assert recording.record("specimen")["test"] == "compression"
    assert np.allclose(recording.signals["displacement"].y[:, 0], E * LENGTH)
    with pytest.raises(RecordingError, match=r"tension test .* give --map test=comp"):
        read(tmp_path, pressed, area="314mm2", length="20mm", test="tension")


def test_negative_strain_is_compression(tmp_path: Path) -> None:
    text = table(PLAIN, -100 * E, -SIGMA)
    assert read(tmp_path, text, **SIZES).record("specimen")["test"] == "compression"


def test_all_that_is_missing_is_told_at_once_and_can_be_followed(tmp_path: Path) -> None:
    text = table("i,Strain,Stress (kPa)\n", E, SIGMA)
    with pytest.raises(RecordingError) as told:
        read(tmp_path, text)
    words = str(told.value)
    for advice in ("time=every:0.1s", "'strain=Strain:UNIT'", "area=314mm2", "test=tension",
                   "measure=engineering"):  # fmt: skip
        assert f"--map {advice}" in words or advice in words
    given = {**SIZES, "time": "every:0.1s", "strain": "Strain:1", "test": "tension"}
    assert_pulled(read(tmp_path, text, **given))


@pytest.mark.parametrize("left", ["area", "length", "measure", "test"])
def test_nothing_is_guessed(left: str, tmp_path: Path) -> None:
    given = {k: v for k, v in {**SIZES, "test": "tension"}.items() if k != left}
    with pytest.raises(ValidateError, match=f"--map {left}=" if left != "test" else "--map test="):
        read(tmp_path, table(PLAIN, 100 * E, SIGMA), **given)


def test_the_sizes_of_a_header_count_where_they_are_meant(tmp_path: Path) -> None:
    header = "Compression test\nDiameter: 25 mm\nHeight: 20 mm\n"
    recording = read(tmp_path, header + table(PLAIN, 100 * E, SIGMA), measure="engineering")
    assert np.allclose(recording.signals["displacement"].y[:, 0], E * LENGTH)
    area = np.pi * 0.025**2 / 4
    assert np.allclose(recording.signals["force"].y[:, 0], SIGMA * 1e3 * area)
    assert "(from the header)" in recording.record(ASSUMED)["sizes"]
    pulled = "Tensile test\nArea: 314 mm^2\nLength: 80 mm\n" + table(PLAIN, 100 * E, SIGMA)
    with pytest.raises(RecordingError, match="the gauge length of the strain"):
        read(tmp_path, pulled, measure="engineering")


def test_one_of_the_two_may_be_written(tmp_path: Path) -> None:
    names = "Time (s),Extension (mm),Stress (kPa)\n"
    text = "Tensile test\n" + table(names, 1e3 * LENGTH * E, SIGMA)
    assert_pulled(read(tmp_path, text, area="314mm2", measure="engineering"))


def test_a_true_stress_beside_a_displacement(tmp_path: Path) -> None:
    names = "Time (s),Extension (mm),True stress (kPa)\n"
    text = "Tensile test\n" + table(names, 3 + 1e3 * LENGTH * E, SIGMA * (1 + E))
    with pytest.raises(RecordingError, match=r"current area: give .*--map length=20mm"):
        read(tmp_path, text, area="314mm2")
    force = read(tmp_path, text, area="314mm2", length="20mm").signals["force"].y[:, 0]
    assert np.allclose(force, -SIGMA * 1e3 * AREA, rtol=1e-9, atol=1e-12)


def test_a_size_beside_force_and_displacement_is_the_specimens(tmp_path: Path) -> None:
    names = "Time (s),Extension (mm),Load (N),Stress (kPa)\n"
    text = table(names, 1e3 * LENGTH * E, SIGMA * 1e3 * AREA, SIGMA)
    recording = read(tmp_path, text, area="314mm2", length="20mm", test="tension")
    assert_pulled(recording)
    assert "'Stress (kPa)' is 1 x 'Load (N)'" in recording.record("provenance")["compared"]
    with pytest.raises(RecordingError, match=r"a factor of 1e-1\); .*, or the true size"):
        read(tmp_path, text, area="31.4mm2", test="tension")


def test_a_strain_cannot_be_led_into_being_a_length(tmp_path: Path) -> None:
    for names in ("Time (s),Strain (%),Load (N)\n", "Time (s),Strain,Load (N)\n"):
        label = names.split(",")[1]
        text = "Tensile test\n" + table(names, 100 * E, SIGMA)
        with pytest.raises(UsageError, match=r"this column is a strain, not a displacem"):
            read(tmp_path, text, displacement=f"{label}:mm")
    with pytest.raises(UsageError, match=r"this column is a stress, not a force"):
        read(tmp_path, table(PLAIN, E, SIGMA), force="Stress (kPa):N")
    force = 1e3 * AREA * SIGMA
    text = "Tensile test\n" + table("Time (s),Strain (%),Load (N)\n", 100 * E, force)
    assert_pulled(read(tmp_path, text, length="20mm", measure="engineering"))


@pytest.mark.parametrize(
    ("mapping", "why"),
    [
        ({"area": "314"}, "expected a size above 0 with a unit, as 314mm2"),
        ({"area": "-3mm2"}, "expected a size above 0"),
        ({"length": "20mm2"}, "'mm2' is not a unit of length"),
        ({"measure": "nominal"}, "expected one of engineering, true"),
    ],
)
def test_a_size_has_a_unit(mapping: dict[str, str], why: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=why):
        read(tmp_path, table(PLAIN, 100 * E, SIGMA), **{**SIZES, "test": "tension", **mapping})


def test_more_than_all_of_a_specimen_is_refused(tmp_path: Path) -> None:
    text = table("Time (s),Strain (mm/mm),Stress (kPa)\n", 100 * E, SIGMA)
    with pytest.raises(RecordingError, match=r"4000 % of its length; .*'strain=Strain"):
        read(tmp_path, text, **SIZES, test="compression")
    given = {**SIZES, "test": "compression", "strain": "Strain (mm/mm):%"}
    assert np.allclose(read(tmp_path, text, **given).signals["displacement"].y[:, 0], E * LENGTH)


def test_a_name_that_says_its_measure_is_not_overruled(tmp_path: Path) -> None:
    text = table("Time (s),True strain (%),Stress (kPa)\n", 100 * E, SIGMA)
    with pytest.raises(UsageError, match=r"'True strain \(%\)' names true itself"):
        read(tmp_path, text, **SIZES, test="tension")


def test_real_stretches_and_stresses(shared_data: Path) -> None:
    """Rubber of Treloar, digitised by others: no time, no size, no sense but the stretch's."""
    path = shared_data / "force/multimode/treloar_uniaxial.csv"
    with pytest.raises(RecordingError) as told:
        read_instron(path)
    for advice in ("time=every:0.1s", "length=20mm", "area=314mm2"):
        assert f"--map {advice}" in str(told.value)
    sizes = {"time": "every:1s", "length": "20mm", "area": "10mm2"}
    recording = read_instron(path, sizes)
    stretch, stress = np.loadtxt(path, delimiter=",", skiprows=1).T
    d, f = (recording.signals[k].y[:, 0] for k in ("displacement", "force"))
    assert np.allclose(d, -0.02 * (stretch - 1), rtol=1e-12, atol=0)
    assert np.allclose(f, -1e6 * stress * 10e-6, rtol=1e-12, atol=0)
    assert recording.record("specimen")["test"] == "tension"


def test_two_directions_are_asked_about(shared_data: Path) -> None:
    with pytest.raises(RecordingError, match=r"2 columns .*stress: .*--map area=314mm2"):
        read_instron(shared_data / "force/multimode/kawabata1981_biaxial.csv")


def picked(role: str, *values: float) -> Pick:
    return Pick(role, SimpleNamespace(label=role), "1", 1.0, np.array(values), None)  # type: ignore[arg-type]


def test_a_stretch_is_above_zero_and_a_true_measure_needs_its_sense() -> None:
    assert sized._relative(picked("stretch", 1.0, 1.5), "", None).tolist() == [0.0, 0.5]
    for values in ((1.0, 0.0), (1.0, sized._LONGEST + 1)):
        with pytest.raises(RecordingError, match=r"'stretch' from .* is 1 at rest"):
            sized._relative(picked("stretch", *values), "", None)
    with pytest.raises(ValidateError, match="'strain' does not show whether"):
        sized._signed(np.array([0.0, 0.1]), None, picked("strain"))


def test_a_sign_a_limit_and_a_word_that_do_not_fit_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said = {"strain": Said("e", "%", -1.0)}
    with pytest.raises(UsageError, match=r"--map strain.*--map test=compression"):
        sized._source("strain", None, said)  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="--map repeated=both"):
        repeats.without_repeats(None, Said("every", "1s", None), "both")  # type: ignore[arg-type]
    mcap = next(reader for reader in READERS if reader.name == "mcap")
    with pytest.raises(UsageError, match=r"specimen=.*: x\.mcap .* no specimens"):
        workbook.every_specimen(mcap, tmp_path / "x.mcap", {})
    (tmp_path / "a.csv").write_bytes(b"12345")
    monkeypatch.setattr(encoding, "MAX_BYTES", 4)
    with pytest.raises(RecordingError, match=r"a.csv: 5 bytes, the limit is 4"):
        encoding.whole_file(tmp_path / "a.csv")
    with pytest.raises(RecordingError, match="5 bytes, the limit for text tables is 4"):
        encoding.decode(b"12345")
