"""`check` reuses a stored run only where all that made it is the same, byte for byte."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest
from command_line import here
from study_samples import experiment_file

from validate.checksums import sealed
from validate.engine import identity
from validate.pipeline.experiment.find import load_file
from validate.pipeline.experiment.options import Options
from validate.pipeline.run.cached_runs import rests_on
from validate.pipeline.run.pipeline import compare
from validate.recording.mcap.read import read_recording
from validate.recording.mcap.write import write_recording
from validate.report.stored.json_values import write_json
from validate.report.stored.store import document

_LOADS = re.compile(r"load=lambda p, folder: .*,\n")
_READS = 'load=lambda p, folder: (read_recording(folder.parent / "pulled.mcap"),),\n'
_IMPORT = "from validate.recording.mcap.read import read_recording\n"


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project with an experiment, its recording and a run of it."""
    folder = tmp_path_factory.mktemp("stored")
    file = experiment_file(folder)
    experiment = load_file(file)
    (recording,) = experiment.load(experiment.parameters, file.parent)
    write_recording(recording, folder / "pulled.mcap")
    text, found = _LOADS.subn(_READS, file.read_text("utf-8"))
    assert found == 1
    text = text.replace("import numpy as np\n", f"{_IMPORT}import numpy as np\n", 1)
    file.write_text(text, "utf-8")
    keep(folder)
    return folder


def keep(folder: Path) -> None:
    """Stores the run as `validate run` does, without its pictures."""
    (folder / "pyproject.toml").write_text("", "utf-8")
    experiment = load_file(folder / "experiments" / "pulled.py")
    result, by = compare(experiment, Options({})), rests_on(experiment, Options({}))
    report = folder / "reports" / "pulled"
    report.mkdir(parents=True)
    write_json(document(result, "2026-01-02T03:04:05+00:00", by), report / "results.json")


def checked(folder: Path, *options: str) -> tuple[bool, str]:
    """Whether `check` took the stored run, and what it said of it."""
    code, out, err = here("check", "pulled", "--json", *options, cwd=folder, COLUMNS="400")
    assert code == 0, err
    (found,) = json.loads(out)
    assert [c["verdict"] for c in found["checks"]] == ["fitted"]
    return found["stored"] is not None, err


def test_a_run_of_the_same_is_reused_and_said_so(stored: Path) -> None:
    taken, said = checked(stored)
    created = json.loads((stored / "reports/pulled/results.json").read_text("utf-8"))["created"]
    assert taken
    assert f"stored run of {created} (reports/pulled); --fresh repeats it" in said
    assert checked(stored, "--fresh") == (False, "")
    assert checked(stored, "--out", "elsewhere") == (False, "")


@pytest.mark.slow
def test_a_run_is_stored_with_what_it_rests_on(stored: Path) -> None:
    assert here("run", "pulled", "--out", "kept", cwd=stored)[0] == 0
    assert checked(stored, "--out", "kept")[0]


def test_it_prints_what_a_new_one_prints(stored: Path) -> None:
    old, new = here("check", "pulled", cwd=stored), here("check", "pulled", "--fresh", cwd=stored)
    assert old[:2] == new[:2]
    assert "top.max@all" in old[1]


@pytest.mark.parametrize(
    ("file", "says"),
    [
        ("experiments/pulled.py", "other files of the experiment"),
        ("pulled.mcap", "other recordings"),
    ],
)
def test_one_byte_of_a_file_makes_it_anew(stored: Path, file: str, says: str) -> None:
    path = stored / file
    before = path.read_bytes()
    changed = before + b"\n" if file.endswith(".py") else _restamped(path, stored)
    path.write_bytes(changed)
    try:
        taken, said = checked(stored)
    finally:
        path.write_bytes(before)
    assert not taken
    assert says in said
    assert checked(stored)[0]


def _restamped(path: Path, folder: Path) -> bytes:
    """The recording with one sample moved by its last bit, whole in itself."""
    recording = read_recording(path)
    signal = recording.signals["pull"]
    y = signal.y.copy()
    y[0, 0] = np.nextafter(y[0, 0], 1.0)
    signals = MappingProxyType({**recording.signals, "pull": replace(signal, y=y)})
    write_recording(replace(recording, signals=signals), folder / "moved.mcap")
    try:
        return (folder / "moved.mcap").read_bytes()
    finally:
        (folder / "moved.mcap").unlink()


def test_one_byte_of_the_code_makes_it_anew(
    stored: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, byte in (("one", "1"), ("two", "2")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "module.py").write_text(f"x = {byte}\n", "utf-8")
    hashes = []
    for name in ("one", "two"):
        monkeypatch.setattr(identity, "PACKAGE", tmp_path / name)
        identity.code_sha256.cache_clear()
        hashes.append(identity.code_sha256())
    assert hashes[0] != hashes[1]
    taken, said = checked(stored)
    identity.code_sha256.cache_clear()
    assert not taken
    assert "other code or libraries" in said


@pytest.mark.parametrize(
    ("members", "says"),
    [
        ({"quick": True}, "other parameters"),
        ({"environment": {"python": "2.7"}}, "another machine or environment"),
        ({"methods": []}, "other methods"),
        ({"parameters": {}}, "other parameters"),
        ({"made": None}, "another form"),
        ({"inputs": []}, "other recordings"),
    ],
)
def test_whatever_else_differs_makes_it_anew(
    stored: Path, tmp_path: Path, members: dict[str, object], says: str
) -> None:
    content = json.loads((stored / "reports/pulled/results.json").read_text("utf-8"))
    (tmp_path / "pulled").mkdir()
    text = json.dumps(sealed(content | members))
    (tmp_path / "pulled" / "results.json").write_text(text, "utf-8")
    taken, said = checked(stored, "--out", str(tmp_path))
    assert not taken
    assert says in said


def test_a_damaged_one_is_made_anew(stored: Path, tmp_path: Path) -> None:
    (tmp_path / "pulled").mkdir()
    (tmp_path / "pulled" / "results.json").write_text("{", "utf-8")
    assert "pulled/results.json: ignored" in checked(stored, "--out", str(tmp_path))[1]


def test_a_recording_without_a_hash_is_never_reused(tmp_path: Path) -> None:
    experiment_file(tmp_path)  # records in memory
    keep(tmp_path)
    taken, said = checked(tmp_path)
    assert not taken
    assert "a recording without a hash" in said


def test_a_folder_of_the_user_is_no_place_for_the_page_and_no_reason_to_stop(
    stored: Path, tmp_path: Path
) -> None:
    """Without --out the check goes on and says so in a line; with it nothing is checked."""
    place = stored / "reports" / "published"
    place.mkdir()
    (place / "mine.txt").write_text("", "utf-8")
    assert "no page of printed figures: " in checked(stored)[1]
    (tmp_path / "published").mkdir()
    (tmp_path / "published" / "mine.txt").write_text("", "utf-8")
    code, _, err = here("check", "pulled", "--out", str(tmp_path), cwd=stored)
    assert (code, "not replaced" in err) == (2, True)
    shutil.rmtree(place)
