"""A disk in B-mode images: found in each, its diameter predicted by the nominal one."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from beside import beside
from numpy.typing import NDArray
from scipy.io import savemat
from scipy.ndimage import gaussian_filter
from sequences import tracked

from validate.compare.result import Result
from validate.errors import RecordingError, UsageError
from validate.pipeline import load, run_in_memory
from validate.pipeline.experiment.tree import Tree

# private: _options: replaced, to bring a case about.
# private: _read: called alone, case by case.

disk_module = beside("ultrasound_disk", "disk")

DISK = "ultrasound/disk/bmode_PWI_disk.mat"


def imaged(diameter: float, side: float, frames: int = 2) -> NDArray[np.uint8]:
    """Log-compressed speckle (h, w, frames) of a bright disk, diameter and pixel in mm."""
    rng, n = np.random.default_rng(3), int(1.4 * diameter / side)
    y, x = (np.mgrid[:n, :n] - n / 2) * side
    inside = np.hypot(x - 0.5, y + 0.3) < diameter / 2
    images = []
    for _ in range(frames):
        field = rng.normal(size=(2, n, n)) * np.where(inside, 1.0, 0.02)
        envelope = np.hypot(*(gaussian_filter(part, 2.0) for part in field))
        dB = 20 * np.log10(envelope / envelope.max() + 1e-9)
        images.append(np.clip(255 * (1 + dB / 50), 0, 255).astype(np.uint8))
    return np.stack(images, axis=-1)


def run(path: Path, **values: str) -> Result:
    return run_in_memory(load("ultrasound_disk"), {"recording": str(path), **values}, quick=True)


@pytest.mark.slow
@pytest.mark.parametrize(("diameter", "side"), [(16.0, 0.2), (7.0, 0.1)])
def test_other_disks_are_measured_by_their_own_pixels(
    tmp_path: Path, diameter: float, side: float
) -> None:
    path = tmp_path / "other.mat"
    savemat(path, {"bmode": imaged(diameter, side)})
    sets = {"image.m_per_px": f"{side}mm", "disk.diameter": f"{diameter}mm"}
    result = run(path, **sets)
    (check,) = result.checks
    assert check.count == 2
    assert abs(check.raw) < 0.04e-3 * diameter
    assert check.validation == "not distinguishable"
    assert result.title.startswith("other: a disk in 2 B-mode images")
    wrong = run(path, **{**sets, "disk.diameter": f"{1.15 * diameter}mm"})
    assert wrong.checks[0].validation == "differs"


@pytest.mark.slow
def test_an_image_without_a_disk_is_named_and_most_without_one_are_an_error(tmp_path: Path) -> None:
    path = tmp_path / "some.mat"
    images = imaged(8.0, 0.1, frames=3)
    images[..., 1] = np.random.default_rng(0).integers(0, 30, images.shape[:2])
    savemat(path, {"bmode": images})
    found = run(path, **{"disk.diameter": "8mm"})
    assert found.checks[0].count == 2
    assert any(note.startswith("1 of 3 images show no outline; image 1") for note in found.notes)
    images[..., 0] = images[..., 1]
    savemat(path, {"bmode": images})
    with pytest.raises(RecordingError, match="found in 1 of 3 images"):
        run(path)


@pytest.mark.slow
def test_bad_input_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "two.mat"
    savemat(path, {"a": imaged(8.0, 0.2, 1), "b": imaged(8.0, 0.2, 1)})
    with pytest.raises(RecordingError, match=r"2 streams of images .* image\.topic=NAME"):
        run(path)
    path.write_bytes(tracked(spacing="1 1 1"))
    with pytest.raises(UsageError, match=r"--set image\.m_per_px=0\.1mm"):
        run(path)
    with pytest.raises(UsageError, match=r"disk\.diameter = 20 m"):
        run(path, **{"disk.diameter": "20m"})


@pytest.mark.slow
def test_the_disk_of_two_centimetres(shared_data: Path) -> None:
    result = run_in_memory(load("ultrasound_disk"), {})
    (check,) = result.checks
    assert (check.count, check.verdict) == (32, "good enough")
    values = {s.name: s.value for s in result.identified}
    assert values["diameter.mean"] == pytest.approx(19.90e-3, abs=0.03e-3)
    assert values["diameter.sd"] == pytest.approx(0.095e-3, abs=0.02e-3)
    assert values["scale.factor"] == pytest.approx(1.005, abs=0.002)
    assert values["scale.confidence"] == pytest.approx(0.028, abs=0.003)


def test_images_in_which_few_disks_are_found_report_what_was_searched(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    calls = iter(range(9))

    def one_of_five(*_: object, **__: object) -> object:
        i = next(calls)
        if i != 2:
            raise RecordingError(f"no wall in call {i}")
        return SimpleNamespace()

    frames = SimpleNamespace(images=[None] * 5, m_per_px=(1e-4, 1e-4))
    recording = SimpleNamespace(name="r", frame=lambda topic: frames)
    for name, found in (
        ("data_path", lambda *_: tmp_path), ("_read", lambda *_: recording),
        ("_topic", lambda *_: "images"), ("extract_outline", one_of_five),
    ):  # fmt: skip
        monkeypatch.setattr(disk_module, name, found)
    with pytest.raises(
        RecordingError,
        match=r"1 of 5 images.*image\.bright=False",
    ):
        disk_module.load(Tree(settings=disk_module.ImagedDisk()), tmp_path)


def test_images_without_a_scale_name_the_setting_of_a_run(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def asks(*_: object) -> None:
        raise UsageError("x.mat states no unit of length")

    monkeypatch.setattr(disk_module, "recognised", lambda path: SimpleNamespace(read=asks))
    monkeypatch.setattr(disk_module, "_options", lambda *_: {})
    with pytest.raises(UsageError, match=r"--set image.m_per_px=0.1mm"):
        disk_module._read(tmp_path, None)  # type: ignore[arg-type]


@pytest.mark.parametrize("diameter", [0.0, -1.0, 1.0, float("nan")])
def test_a_disk_has_a_diameter_of_a_disk(diameter: float) -> None:
    with pytest.raises(UsageError, match=rf"disk.diameter = {diameter:g} m: .* 1 m"):
        disk_module.Disk(diameter)
