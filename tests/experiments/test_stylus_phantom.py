"""A stylus on landmarks: the pose is fitted, each landmark is predicted from the others."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from beside import beside, experiment
from sequences import sequence

from validate.arrays import Floats, rms
from validate.errors import RecordingError, RegistrationError, UsageError, ValidateError
from validate.parameters import with_values
from validate.pipeline import run_in_memory
from validate.pipeline.experiment.options import Options
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.run.pipeline import compare
from validate.register.markers.transform import Similarity
from validate.register.tools.landmarks import Digitised

# private: _by_plus, _landmarks: called alone, case by case.

phantom_module, plus = beside("stylus_phantom", "phantom"), beside("stylus_phantom", "plus")
shown = beside("stylus_phantom", "exhibits")
digitised, load, stated = phantom_module.digitised, phantom_module.load, phantom_module.stated
apart, mean_error = shown.apart, shown.mean_error
TREE: Tree = experiment("stylus_phantom").parameters

DEVICES = "markers/stylus/PlusDeviceSet_fCal_Sim_RecordPhantomLandmarks.xml"
TIP = np.array([108.565, 7.77385, 2.5389])  # mm
TURN = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
SHIFT = np.array([20.0, -40.0, 25.0])  # mm


def landmarks(path: Path) -> Floats:
    text = path.read_text().partition("<Landmarks>")[2].partition("</Landmarks>")[0]
    places = [part.partition('"')[0] for part in text.split('Position="')[1:]]
    return np.array([[float(word) for word in place.split()] for place in places])


def dwelling(places: Floats, noise: float, rate: float = 20.0, seed: int = 0) -> bytes:
    """A stylus held upright for 3 s on each of the places (n, 3) mm of the reference's frame."""
    x = np.repeat(places, int(3 * rate), axis=0)
    way = np.linspace(places[:-1], places[1:], int(rate))[1:-1]  # a second between two places
    for i in range(len(places) - 1, 0, -1):
        x = np.insert(x, int(3 * rate) * i, way[:, i - 1], axis=0)
    x = x + np.random.default_rng(seed).normal(0, noise, x.shape)
    T = np.tile(np.eye(4), (len(x), 1, 1))
    T[:, :3, 3] = x - TIP
    return sequence({"StylusToReference": T}, rate, lost=range(5, len(x), 37))


def made(folder: Path, shared: Path, order: list[int], noise: float = 0.1) -> Tree:
    """Landmarks in that order, parked before, between and after."""
    places = landmarks(shared / DEVICES) @ TURN.T + SHIFT
    parked = np.array([[-30.0, 200.0, 5.0], [150.0, 60.0, 90.0]])
    half = len(order) // 2
    path = np.vstack([parked[:1], places[order[:half]], parked[1:], places[order[half:]], parked])
    file = folder / "other.igs.mha"
    file.write_bytes(dwelling(path, noise))
    values = {"recording": str(file), "landmarks": str(shared / DEVICES)}
    return with_values(TREE, values)


def found(p: Tree) -> Digitised:
    (recording,) = load(p, Path("experiments"))
    values = {path: repr(value) for path, value in stated(recording).items()}
    return digitised(recording, with_values(p, values).settings)


@pytest.mark.parametrize(
    ("order", "noise"),
    [([*range(8)], 0.02), ([*range(8)], 1.0), ([5, 2, 7, 0, 1, 6, 3, 4], 1.0), ([6, 1, 3, 4], 0.1)],
)
def test_landmarks_are_found_in_any_order_between_places_where_it_was_parked(
    tmp_path: Path, shared_data: Path, order: list[int], noise: float
) -> None:
    got = found(made(tmp_path, shared_data, order, noise))
    assert len(got.dwells) == len(order) + 4
    assert sorted(got.match.known.tolist()) == sorted(order)
    truth = Similarity(TURN, 1e-3 * SHIFT)
    off = apart(got.pose, truth, got.body.mean(axis=0))
    assert off.centre < 0.4e-3 * max(noise, 0.1)
    assert off.angle < 1.0 * max(noise, 0.05)
    expected = float(np.sqrt(3)) * rms(got.expected)
    assert 0.4 < rms(got.left_out) / expected < 2.0


def test_a_landmark_touched_twice_counts_once(tmp_path: Path, shared_data: Path) -> None:
    got = found(made(tmp_path, shared_data, [0, 1, 2, 3, 2, 4, 5, 6, 7]))
    assert (len(got.dwells), sorted(got.match.known.tolist())) == (13, list(range(8)))


def test_the_eight_landmarks_of_the_data_set(shared_data: Path) -> None:
    """The transform is that of a second program, which detects landmarks as PLUS does."""
    got = found(TREE)
    assert (len(got.dwells), got.match.known.tolist()) == (10, list(range(8)))
    assert mean_error(got) == pytest.approx(0.173e-3, abs=2e-6)
    assert rms(got.left_out) == pytest.approx(0.250e-3, abs=2e-6)
    R = np.array([[-0.0052, 0.0012, -1.0], [-0.0134, 0.9999, 0.0012], [0.9999, 0.0134, -0.0052]])
    U, _, Vt = np.linalg.svd(R)
    plus = Similarity(U @ Vt, 1e-3 * np.array([22.7605, -39.6863, 25.6534]))
    off = apart(got.pose, plus, got.body.mean(axis=0))
    assert off.angle < 0.1
    assert off.origin < 0.3e-3


@pytest.mark.slow
def test_the_road_fits_the_pose_and_judges_what_was_left_out(shared_data: Path) -> None:
    result = compare(experiment("stylus_phantom"), Options({}))
    (check,) = result.checks
    assert (check.verdict, check.count) == ("good enough", 8)
    assert check.raw == pytest.approx(0.250e-3, abs=2e-6)
    assert "fitted: the pose of the body on 8 landmarks" in result.sentence
    assert [p.verdict for p in result.published] == [
        "reproduced", "not comparable", "not comparable",
    ]  # fmt: skip
    values = {s.name: s.value for s in result.identified}
    assert values["plus.error"] == pytest.approx(0.195e-3, abs=1e-6)  # printed: 0.198
    assert values["plus.angle"] < 0.1
    assert values["plus.origin"] < 0.3e-3
    assert any("belongs to another recording" in note for note in result.notes)


@pytest.mark.slow
def test_a_wrong_landmark_differs(tmp_path: Path, shared_data: Path) -> None:
    text = (shared_data / DEVICES).read_text()
    devices = tmp_path / "devices.xml"
    devices.write_text(text.replace('Name="#3" Position="104.3 45.0 0.0"',
                                    'Name="#3" Position="104.3 45.0 3.0"'))  # fmt: skip
    result = run_in_memory(experiment("stylus_phantom"), {"landmarks": str(devices)})
    assert result.checks[0].validation == "differs"
    assert not [p for p in result.published if p.verdict == "reproduced"]


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"tools.stylus": "Pointer"}, "no transform from StylusTip to Pointer"),
        ({"tools.tracker": "Table"}, "no signal"),
        ({"dwell.least": "60s"}, "never rests"),
        ({"dwell.match": "0.01mm"}, "of 8 landmarks lie among"),
        ({"landmarks": "README.md"}, "XML"),
    ],
)
def test_bad_input_is_one_line(shared_data: Path, values: dict[str, str], said: str) -> None:
    with pytest.raises((RecordingError, RegistrationError, UsageError), match=said) as raised:
        run_in_memory(experiment("stylus_phantom"), values)
    assert isinstance(raised.value, ValidateError)
    assert "\n" not in str(raised.value)


def test_landmarks_that_are_not_declared_or_not_found_are_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with pytest.raises(RecordingError, match=r"d.xml: no landmarks"):
        phantom_module._landmarks("d.xml", {})
    t = np.arange(100) / 20
    moving = np.linspace([0.0, 0, 0], [1.0, 0, 0], 100)
    known = np.eye(3)
    with pytest.raises(RegistrationError, match="0 of 3 landmarks"):
        plus.by_plus(t, moving, moving, known)
    monkeypatch.setattr(shown, "shaft_of", lambda *_: moving)
    mine = SimpleNamespace(t=t, x=moving, known=known)
    said = shown._by_plus(None, None, mine)  # type: ignore[arg-type]
    assert said == (
        "The detection of PLUS is not compared with ours: 0 of 3 landmarks by the detection "
        "of PLUS."
    )
