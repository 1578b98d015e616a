"""Several logs of one test as one: the mean, its scatter by specimens, and what that is worth."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import openpyxl
import pytest
from machine_logs import pressed_cylinder

from validate.commands.main import run
from validate.compare.verdict import Accept
from validate.errors import RecordingError, UsageError
from validate.identify.budget import Votes, averaged, labels_of
from validate.pipeline.experiment.method import Method
from validate.pipeline.plates.compression import compression
from validate.pipeline.plates.scene import Compression
from validate.recording.mcap.read import read_recording
from validate.recording.mcap.write import write_recording
from validate.recording.merge import REPEATS, SHARE, repeats_share
from validate.recording.motion_capture.text_rows import ASSUMED
from validate.recording.tables.testing_machine import read_instron
from validate.recording.types import Recording
from validate.register.signals import SignalObservation
from validate.solve.fluid.cavities import NoFluid

T = np.arange(60) / 10
D = 0.05 * np.arange(60)  # mm
F = 7 * D + 1.25 * D**2  # N


def log(folder: Path, name: str, scale: float, header: str = "", d: np.ndarray = D) -> Recording:
    rows = "".join(f"{t:.1f},{x:.8f},{scale * f:.8f}\n" for t, x, f in zip(T, d, F, strict=True))
    text = f"Compression test\nDiameter: 25 mm\n{header}Time (s),Displacement (mm),Load (N)\n{rows}"
    (folder / f"{name}.csv").write_text(text, "utf-8")
    return read_instron(folder / f"{name}.csv")


def logs(folder: Path, *scales: float) -> list[Recording]:
    return [log(folder, f"log{i}", scale) for i, scale in enumerate(scales)]


@pytest.mark.parametrize(
    ("scales", "said", "mean", "sd"),
    [
        ((0.9, 1.0, 1.1), "one", 1.0, 0.1 / np.sqrt(3)),
        ((0.9, 1.0, 1.1), "each", 1.0, 0.1 / np.sqrt(3)),
        ((0.9, 1.1, 1.2), "A,A,B", 1.1, 0.1),  # specimens 1.0 and 1.2: sd .1414, over root 2
        ((1.0, 1.0), "one", 1.0, 0.0),
    ],
)
def test_every_specimen_has_one_vote(
    scales: tuple[float, ...], said: str, mean: float, sd: float, tmp_path: Path
) -> None:
    found = logs(tmp_path, *scales)
    recording = averaged(found, labels_of(said, found), "mean")
    d, f = (recording.signals[k].y[:, 0] for k in ("displacement", "force"))
    assert np.allclose(d, D / 1e3, atol=1e-9)
    assert np.allclose(f, mean * F, rtol=1e-6, atol=1e-4)
    assert repeats_share(recording) == pytest.approx(sd / mean, rel=1e-4, abs=1e-7)
    assert np.allclose(recording.signals["force/sd"].y[:, 0], sd * F, rtol=1e-3, atol=1e-4)
    assert recording.record(REPEATS)["logs"] == str(len(scales))


def test_the_logs_stay_beside_as_they_were_and_survive_a_file(tmp_path: Path) -> None:
    found = logs(tmp_path, 0.9, 1.1)
    write_recording(averaged(found, labels_of("each", found), "mean"), tmp_path / "mean.mcap")
    again = read_recording(tmp_path / "mean.mcap")
    for i, one in enumerate(found):
        for topic in ("displacement", "force"):
            assert np.array_equal(again.signals[f"{topic}/log{i}"].y, one.signals[topic].y)
    assert repeats_share(again) == pytest.approx(0.1, rel=1e-4)
    assert float(again.record("specimen")["diameter_m"]) == pytest.approx(0.025)
    assert "mean of 2 logs of 2 specimens to 2.95 mm" in again.record(ASSUMED)["repeats"]
    seen = SignalObservation.validating(again, "force", "N", quantity="force", trace="stage.force")
    assert seen.share == repeats_share(again)  # u_D is that of the repeats


def test_a_compression_is_judged_within_the_repeats(tmp_path: Path) -> None:
    found = logs(tmp_path, 0.9, 1.1)
    mean = averaged(found, labels_of("each", found), "mean")
    parameters = pressed_cylinder(0.025, 0.02, settings=Compression(limit=0.14))
    experiment = compression(
        "gel", "A gel", "made here", parameters, {"fem": Method("linear", NoFluid())}, ("fem",),
        (Accept("force@beyond", 1.0, "made here"),),
    )  # fmt: skip
    for recording, share in ((mean, 0.1), (found[0], 0.0)):
        seen = experiment.place(recording, parameters, None)
        (force,) = [o for o in seen.observations if o.role == "validates"]
        assert force.share == pytest.approx(share, rel=1e-4)


def test_a_folder_of_logs_is_imported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder, out = tmp_path / "logs", tmp_path / "mean.mcap"
    folder.mkdir()
    logs(folder, 0.9, 1.1)
    assert run(["import", str(folder), "-o", str(out)]) == 2
    assert "specimens are not declared; --specimens one" in " ".join(
        capsys.readouterr().err.split()
    )
    assert run(["import", str(folder), "-o", str(out), "--specimens", "each"]) == 0
    assert "10 % sd of the mean" in " ".join(capsys.readouterr().out.split())
    assert run(["inspect", str(out)]) == 0
    assert "10 % sd of the mean" in " ".join(capsys.readouterr().out.split())


def two_specimens(folder: Path) -> Path:
    table = "Time (s),Displacement (mm),Load (N)\n"
    text = "Compression test\n"
    for number, scale in ((1, 0.9), (2, 1.1)):
        cells = zip(T, D, scale * F, strict=True)
        text += f"Specimen {number}\n{table}"
        text += "".join(f"{t:.1f},{d:.8f},{f:.8f}\n" for t, d, f in cells)
    (folder / "both.csv").write_text(text, "utf-8")
    return folder / "both.csv"


def as_workbook(text: Path) -> Path:
    book = openpyxl.Workbook()
    for line in text.read_text("utf-8").splitlines():
        cells = line.split(",")
        book.active.append([float(c) if c[-1].isdigit() and len(cells) > 1 else c for c in cells])
    book.save(text.with_suffix(".xlsx"))
    return text.with_suffix(".xlsx")


@pytest.mark.parametrize(
    "written", [Path, pytest.param(as_workbook, marks=pytest.mark.slow)], ids=["text", "workbook"]
)
def test_the_specimens_of_one_file_are_repeats(
    written: Callable[[Path], Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, out = written(two_specimens(tmp_path)), tmp_path / "mean.mcap"
    assert run(["import", str(path), "-o", str(out)]) == 2
    assert "specimen=all" in capsys.readouterr().err
    given = ["--map", "specimen=all", "--specimens", "each"]
    assert run(["import", str(path), "-o", str(out), *given]) == 0
    recording = read_recording(out)
    assert repeats_share(recording) == pytest.approx(0.1, rel=1e-4)
    assert {"force/both-1", "force/both-2"} <= set(recording.signals)


def test_logs_are_counted_from_contact(tmp_path: Path) -> None:
    """One is touched 1 mm later, with 3 N on its cell: the same path, no scatter."""
    t = np.arange(90) / 10
    d = 0.05 * np.arange(90)
    found = []
    for name, gap, offset in (("a", 0.5, 0.0), ("b", 1.5, 3.0)):
        f = 10 * np.clip(d - gap, 0, None) + offset
        rows = "".join(f"{x:.1f},{y:.8f},{z:.8f}\n" for x, y, z in zip(t, d, f, strict=True))
        (tmp_path / f"{name}.csv").write_text(f"Time (s),Stroke (mm),Load (N)\n{rows}", "utf-8")
        found.append(read_instron(tmp_path / f"{name}.csv", {"test": "compression"}))
    recording = averaged(found, ("1", "1"), "mean")
    d, f = (recording.signals[k].y[:, 0] for k in ("displacement", "force"))
    assert np.allclose(f, 10 * 1e3 * d, atol=1e-6)
    assert repeats_share(recording) < 1e-6
    assert d[-1] == pytest.approx(2.95e-3, abs=1e-9)
    assert recording.record(ASSUMED)["zero of b"].startswith("contact at 1.5 mm, 3 N taken off")


def test_tension_keeps_its_sign_and_unloading_is_left_out_and_said(tmp_path: Path) -> None:
    there = np.concatenate([D, D[::-1]])
    rows = "".join(f"{i / 10},{x:.6f},{7 * x:.6f}\n" for i, x in enumerate(there))
    (tmp_path / "a.csv").write_text(f"Time (s),Extension (mm),Load (N)\n{rows}", "utf-8")
    one = read_instron(tmp_path / "a.csv", {"test": "tension"})
    recording = averaged([one, one], ("1", "1"), "mean")
    assert recording.signals["force"].y[-1, 0] == pytest.approx(-7 * D[-1], rel=1e-6)
    assert "60 rows after the largest displacement" in recording.record(ASSUMED)["zero of 1-a"]
    assert len(recording.signals["force/1-a"].t) == 120


def test_what_are_no_repeats_is_refused(tmp_path: Path) -> None:
    a, b = logs(tmp_path, 1.0, 1.1)
    with pytest.raises(UsageError, match=r"2 logs, log0, log1: their.*--specimens"):
        labels_of(None, [a, b])
    with pytest.raises(UsageError, match=r"3 labels for 2 logs.*order log0, log1"):
        labels_of("A,A,B", [a, b])
    with pytest.raises(RecordingError, match="1 logs; a mean needs at least 2"):
        averaged([a], ("1",), "mean")
    wide = log(tmp_path, "wide", 1.0, "Height: 20 mm\n")
    with pytest.raises(RecordingError, match=r"height_m of 1 of 2 logs is 0\.02"):
        averaged([a, wide], ("1", "2"), "mean")
    pulled = read_instron(tmp_path / "log1.csv", {"test": "tension"})
    with pytest.raises(RecordingError, match="of one test, these are of compression"):
        averaged([a, pulled], ("1", "2"), "mean")


def test_votes_by_hand() -> None:
    found = Votes.by_specimen([1.0, 3.0, 6.0], ["A", "A", "B"])
    assert found.means == {"A": 2.0, "B": 6.0}
    assert found.mean == 4.0
    assert found.within == pytest.approx(np.sqrt(2.0))
    assert found.sd_mean == pytest.approx(2.0)  # sd of 2 and 6 is 2.83, over root 2
    assert Votes.by_specimen([1.0], ["A"]).sd_mean is None


def test_a_damaged_share_is_refused(tmp_path: Path) -> None:
    (one,) = logs(tmp_path, 1.0)
    object.__setattr__(one, "metadata", {**one.metadata, REPEATS: {"share": "nan"}})
    with pytest.raises(RecordingError, match="share 'nan' is not a number"):
        repeats_share(one)


def test_what_no_machine_wrote_and_loadings_without_overlap_are_refused(tmp_path: Path) -> None:
    a, b = logs(tmp_path, 1.0, 1.1)
    bare = replace(b, metadata={})
    with pytest.raises(UsageError, match="log1 is not a log of a testing"):
        labels_of("one", [a, bare])
    far = [log(tmp_path, f"far{i}", 1.0, d=np.where(D > 0, D + 5.0 * i, 0.0)) for i in range(2)]
    with pytest.raises(RecordingError, match=r"share the displacements .* \d samples"):
        averaged(far, ("1", "2"), "mean")


@pytest.mark.parametrize("share", ["a tenth", "-0.1", "nan", "inf"])
def test_a_share_that_is_no_number_names_its_record(share: str, tmp_path: Path) -> None:
    (one,) = logs(tmp_path, 1.0)
    assert repeats_share(one) == 0.0
    damaged = replace(one, metadata={REPEATS: {SHARE: share}})
    with pytest.raises(
        RecordingError, match=f"log0: record '{REPEATS}': {SHARE} '{share}' is not a n"
    ):
        repeats_share(damaged)
