"""Where files of data sets are looked for, and what is said where they are not."""

from hashlib import sha256
from pathlib import Path

import pytest

from validate.datasets import home
from validate.datasets.home import DataFile, DataSet, data_path, data_set_of, data_sets, whole
from validate.errors import RecordingError, UsageError

FOLDER, FILE = "markers/silicone-beam", "beam_gravity_V2_b.c3d"


@pytest.fixture(autouse=True)
def _nowhere(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv(home.SHARED, raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


def put(path: Path, content: bytes = b"x") -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
    return path


def test_what_is_registered_is_what_lies_in_the_folder(shared_data: Path) -> None:
    """More of the same kinds may lie there."""
    here = [s for s in data_sets() if (shared_data / s.folder).is_dir()]
    assert len(here) == len(data_sets())
    broken = [
        f"{s.folder}/{f.name}"
        for s in here
        for f in s.files
        if not whole(shared_data / s.folder / f.name, f)
    ]
    assert broken == []


def test_a_set_has_all_that_is_needed_to_bring_and_to_cite_it() -> None:
    for theirs in data_sets():
        assert theirs.title
        assert theirs.citation
        assert theirs.licence
        assert len(theirs.commit) >= 7
        assert theirs.brought or theirs.made, theirs.name
        assert all(f.source for f in theirs.files) or theirs.made, theirs.name
    assert len({s.name for s in data_sets()}) == len(data_sets())
    beam = data_set_of("silicone_beam")
    assert beam is data_set_of("markers/silicone-beam/")
    assert beam.address(next(f for f in beam.files if f.name == FILE)) == (
        f"https://raw.githubusercontent.com/srl-ethz/diffPD_sim2real/{beam.commit}"
        f"/python/realbeam_experiments/Measurement_data/{FILE}"
    )
    with pytest.raises(UsageError, match=r"'silicon-bean'; nearest: silicone-beam"):
        data_set_of("silicon-bean")


def test_what_is_absent_names_the_command(tmp_path: Path) -> None:
    with pytest.raises(RecordingError) as caught:
        data_path(FOLDER, FILE, tmp_path / "p" / "experiments")
    assert str(caught.value) == (
        f"{FOLDER}/{FILE} is missing: `validate data get silicone-beam` downloads it "
        "(srl-ethz/diffPD_sim2real 825e7b7, MIT); or pass --set recording=FILE, or set "
        "VALIDATE_SHARED_DATA to a folder that holds it"
    )
    with pytest.raises(RecordingError, match=r"--set landmarks=FILE"):
        data_path(FOLDER, FILE, tmp_path / "p" / "experiments", by="landmarks")
    with pytest.raises(RecordingError, match="`validate data get rubber-strip`"):
        data_path("markers/rubber-strip", "points3d_mm.npz", tmp_path / "p" / "experiments")
    with pytest.raises(RecordingError, match=r"get skin-pads`.*--set data=FOLDER"):
        data_path("force/skin-pads", None, tmp_path / "p" / "experiments")


def test_the_named_folder_goes_first_then_the_neighbour(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    experiments = tmp_path / "project" / "experiments"
    near = put(tmp_path / "shared" / "data" / FOLDER / FILE)
    assert data_path(FOLDER, FILE, experiments) == near
    assert data_path(FOLDER, None, experiments) == near.parent
    monkeypatch.setenv(home.SHARED, str(tmp_path / "elsewhere"))
    with pytest.raises(RecordingError):
        data_path(FOLDER, FILE, experiments)
    there = put(tmp_path / "elsewhere" / FOLDER / FILE)
    assert data_path(FOLDER, FILE, experiments) == there


def test_an_empty_folder_is_none(tmp_path: Path) -> None:
    (tmp_path / "shared" / "data" / FOLDER).mkdir(parents=True)
    with pytest.raises(RecordingError):
        data_path(FOLDER, None, tmp_path / "project" / "experiments")


def test_the_cache_counts_only_whole(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    rows = [(FILE, b"measured"), ("LICENSE", b"free")]
    files = tuple(DataFile(n, n, sha256(b).hexdigest(), len(b)) for n, b in rows)
    beam = DataSet("silicone-beam", FOLDER, "t", "a/b", "0" * 40, "MIT", "c", files)
    monkeypatch.setattr(home, "data_set_of", lambda _: beam)
    monkeypatch.setenv(home.SHARED, str(tmp_path / "without"))
    path = put(home.cache_folder() / FOLDER / FILE, b"measured")
    assert data_path(FOLDER, FILE, tmp_path / "p" / "experiments") == path
    with pytest.raises(RecordingError):
        data_path(FOLDER, None, tmp_path / "p" / "experiments")
    put(path.parent / "LICENSE", b"free")
    assert data_path(FOLDER, None, tmp_path / "p" / "experiments") == path.parent
    put(path, b"Measured")
    with pytest.raises(RecordingError):
        data_path(FOLDER, FILE, tmp_path / "p" / "experiments")


def test_a_file_of_ones_own_is_taken_or_refused(tmp_path: Path) -> None:
    own = put(tmp_path / "own.c3d")
    assert data_path(FOLDER, FILE, tmp_path, str(own)) == own
    assert data_path(FOLDER, None, tmp_path, str(tmp_path)) == tmp_path
    with pytest.raises(RecordingError, match=r"^no file .*nowhere\.c3d$"):
        data_path(FOLDER, FILE, tmp_path, str(tmp_path / "nowhere.c3d"))
    with pytest.raises(RecordingError, match=r"^no folder .*own\.c3d$"):
        data_path(FOLDER, None, tmp_path, str(own))


def test_another_file_of_the_set_is_found_by_its_bare_name(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    beside, here = tmp_path / "p" / "experiments", tmp_path / "here"
    other = put(tmp_path / "shared" / "data" / FOLDER / "other.c3d")
    assert data_path(FOLDER, FILE, beside, "other.c3d") == other
    here.mkdir()
    monkeypatch.chdir(here)
    put(here / "other.c3d")
    assert data_path(FOLDER, FILE, beside, "other.c3d") == Path("other.c3d")
    with pytest.raises(RecordingError, match=r"^no file none\.c3d$"):
        data_path(FOLDER, FILE, beside, "none.c3d")
