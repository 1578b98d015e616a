"""From a user's files to a report, as README.md and docs/how-to/log-and-images.md print it."""

import contextlib
import io
import json
import re
import shlex
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from validate.commands.main import run
from validate.recording.images.image import encode_png
from validate.recording.mcap.read import read_recording
from validate.recording.merge import merge
from validate.recording.types import Recording, Signal, Source


def commands(project_root: Path) -> list[list[str]]:
    section = (project_root / "docs" / "how-to" / "log-and-images.md").read_text("utf-8")
    return [shlex.split(line) for line in printed(section, "console").strip().splitlines()]


def printed(section: str, language: str) -> str:
    return re.findall(rf"```{language}\n(.*?)```", section, flags=re.DOTALL)[0]


@pytest.fixture
def own_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A CSV of a cylinder of 15 kPa and a folder of 100 small images, 10 a second."""
    rng = np.random.default_rng(2)
    t = np.arange(150) / 10
    d = t * 0.2  # mm
    force = 15e3 * np.pi * 0.025**2 / 4 * d / 1e3 / 0.03 + rng.normal(0, 0.005, len(t))
    table = "\n".join(f"{a:.2f},{b:.5f},{c:.5f}" for a, b, c in zip(t, d, force, strict=True))
    head = "Compression test\nDiameter: 25 mm\nHeight: 30 mm\nTime (s),Extension (mm),Load (N)\n"
    (tmp_path / "log.csv").write_text(head + table + "\n", "utf-8")
    (tmp_path / "images").mkdir()
    for i in range(100):
        image = rng.integers(0, 255, (24, 32)).astype(np.uint8)
        (tmp_path / "images" / f"frame_{i:03}.png").write_bytes(encode_png(image))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def pressed_in_images(folder: Path, project_root: Path) -> None:
    """The cylinder between slipping plates, bright in 28 images of 0.2 mm, 2 a second; answers."""
    rng, side = np.random.default_rng(2), 0.2e-3
    y, x = np.mgrid[:190, :180] * side
    for old in (folder / "images").iterdir():
        old.unlink()
    for i in range(28):
        closed = (0.25 + i / 2) * 0.2e-3
        half = 0.0125 * (1 + 0.499 * closed / 0.03)
        body = (abs(x - 0.018) < half) & (y < 0.034) & (y > 0.004 + closed)
        strength = np.where(body, 1.0, 0.03)  # of scatterers, which the beam blurs
        parts = (gaussian_filter(strength * rng.normal(size=x.shape), 1.1) for _ in range(2))
        envelope = np.hypot(*parts)
        grey = np.clip(200 + 100 * np.log10(envelope / envelope.mean() + 1e-3), 0, 255)
        (folder / "images" / f"frame_{i:03}.png").write_bytes(encode_png(grey.astype(np.uint8)))
    section = (project_root / "docs" / "how-to" / "log-and-images.md").read_text("utf-8")
    (folder / "answers.toml").write_text(printed(section, "toml"), "utf-8")


def called(arguments: list[str]) -> tuple[int, str, str]:
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = run(arguments)
    return code, out.getvalue(), err.getvalue()


def told(report: Path) -> Any:
    return json.loads((report / "results.json").read_text("utf-8"))


@pytest.mark.slow
def test_the_tour_of_the_readme_runs_word_by_word(
    tmp_path: Path, project_root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Commands and what the last one prints; times and rates are this machine's."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    shutil.copy(project_root / "docs" / "example_log.csv", tmp_path / "log.csv")
    tour = (project_root / "README.md").read_text("utf-8").split("## Five minutes")[1]
    for line in printed(tour, "console").strip().splitlines():
        program, *arguments = shlex.split(line)
        code, out, err = called(arguments)
        assert (program, code) == ("validate", 0), (arguments, out, err)
    timing = re.compile(r"[\d.]+ (s wall time|[µm]?s$|k?Hz) *|(?<=rate) +", flags=re.MULTILINE)
    assert [timing.sub("", line) for line in out.splitlines()] == [
        timing.sub("", line) for line in printed(tour, "text").splitlines()
    ]


@pytest.mark.slow
@pytest.mark.usefixtures("drawn_figures")
def test_a_log_with_images_runs_as_printed(own_files: Path, project_root: Path) -> None:
    pressed_in_images(own_files, project_root)
    outputs = {}
    for program, *arguments in commands(project_root):
        assert program == "validate"
        code, out, err = called(arguments)
        assert code == 0, (arguments, out, err)
        outputs[arguments[0]] = out
    assert "clock_offset/images" in outputs["inspect"]
    assert "seconds 0.25, sd 0.01" in outputs["inspect"]
    assert outputs["run"].startswith("my_gel: good enough; ")
    report = own_files / "reports" / "my_gel"
    assert (report / "report.html").stat().st_size > 10_000
    assert (report / "figures" / "outline_images.png").stat().st_size > 50_000
    (method,) = [m for m in told(report)["methods"] if m["name"] == "slip"]
    judged = [c for c in method["checks"] if c["name"].startswith("contour.rms@")]
    assert [c["count"] for c in judged] == [120] * 4
    assert all(0 < c["u_val"] < 0.2e-3 and c["verdict"] != "undecided" for c in judged)
    astray = ["--set", "outline.origin=-17mm,0mm,34mm", "--methods", "slip"]  # 1 mm off
    code, out, _ = called(["run", "my_gel", *astray])
    moved = next(report.parent.glob("my_gel+*"))
    answers = [c["validation"] for m in told(moved)["methods"] for c in m["checks"]]
    assert (code, answers.count("differs")) == (1, 4), out
    bonded = next(m for m in told(report)["methods"] if m["name"] == "bonded")
    assert {s["name"] for s in bonded["scores"]} >= {c["name"] for c in judged}
    recording = read_recording(own_files / "test.mcap")
    assert set(recording.signals) == {"displacement", "force"}
    assert recording.frames["images"].m_per_px == (2e-4, 2e-4)
    assert recording.frames["images"].t[0] == pytest.approx(0.25)
    assert {"provenance/log", "provenance/images", "merged"} <= set(recording.metadata)
    assert "count" in recording.record("clock_offset/images")


def test_merge_refuses_equal_topics_and_one_file(own_files: Path) -> None:
    assert called(["import", "log.csv", "--as", "instron", "-o", "a.mcap"])[0] == 0
    code, _, err = called(["merge", "a.mcap", "a.mcap", "-o", "b.mcap"])
    assert (code, "['displacement', 'force'] occur in several" in err) == (2, True)
    code, _, err = called(["merge", "a.mcap", "-o", "b.mcap"])
    assert (code, "1 recordings to merge; give at least 2" in err) == (2, True)
    assert not (own_files / "b.mcap").exists()


def test_a_stack_needs_scale_and_rate_and_a_shift_is_checked(own_files: Path) -> None:
    stack = ["import", "images", "--as", "png-stack", "-o", "i.mcap"]
    code, _, err = called(stack)
    assert (code, "--m-per-px and --rate" in err) == (2, True)
    assert called([*stack, "--m-per-px", "1e-4", "--rate", "10", "--topic", "us"])[0] == 0
    assert called(["import", "log.csv", "--as", "instron", "-o", "a.mcap"])[0] == 0
    both = ["merge", "a.mcap", "i.mcap", "-o", "b.mcap", "--shift"]
    assert "expected SECONDS" in called([*both, "us=soon"])[2]
    assert "0 of 100 samples (0 %) meet" in called([*both, "us=60"])[2]
    assert "no other stream" in called([*both, "images=1"])[2]
    assert "are assumed to share one clock" in called(both[:-1])[2]
    assert "are assumed to share one clock" not in called([*both, "us=0"])[2]
    code, _, err = called(["import", "log.csv", "--as", "png-stack", "-o", "x.mcap",
                           "--m-per-px", "1", "--rate", "1"])  # fmt: skip
    assert (code, "not a folder of PNG images" in err) == (2, True)


def test_merged_streams_keep_their_moments_and_differing_records() -> None:
    def part(topic: str, t0_ns: int, temperature: str) -> Recording:
        signal = Signal(np.arange(3.0), np.zeros((3, 1)), "N", 0.0, "machine")
        metadata = {"room": {"temperature": temperature}, "same": {"a": "b"}}
        source = Source(f"{topic}.mcap", "00", 1, "verified")
        return Recording(topic, source, t0_ns, signals={topic: signal}, metadata=metadata)

    merged = merge([part("a", 5_000_000_000, "20"), part("b", 3_500_000_000, "21")], "both")
    assert merged.t0_ns == 3_500_000_000
    assert merged.signals["a"].t.tolist() == [1.5, 2.5, 3.5]
    assert merged.signals["b"].t.tolist() == [0.0, 1.0, 2.0]
    assert merged.record("room/a")["temperature"] == "20"
    assert merged.record("room/b")["temperature"] == "21"
    assert dict(merged.record("same")) == {"a": "b"}
    assert merged.record("merged")["2"].startswith("b: b; b.mcap sha256 00")
