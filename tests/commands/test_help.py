"""Every help page says in a few words what a command does for its user, and its example runs."""

import re
import shlex
import shutil
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from command_line import here
from scipy.ndimage import gaussian_filter
from scipy.spatial.transform import Rotation

from validate.commands import check as checking
from validate.commands.help import SECTIONS, command_at, every_command
from validate.commands.main import cli
from validate.pipeline.ladder import default as ladder
from validate.recording.images.image import encode_png
from validate.recording.mcap.write import write_recording
from validate.recording.motion_capture.poses import pose_signals
from validate.recording.types import Recording, Signal, Source

# private: _QUICK_UNKNOWNS: replaced by a small number: a short test.

PAGES = (
    dict(every_command(cli)) | {n: command_at(cli, n) for n in ("study", "external")} | {"": cli}
)
TIP = np.array([0.108, 0.008, 0.003])
SLOW = ("study", "run", "check", "identify", "show", "compare", "history", "summary", "export",
        "report", "open", "external", "live", "data get", "body")  # fmt: skip
README = ["validate", "run", "fluid_phantom"]  # its first command, which `.ci/run` executes
# Words after those of an example: the same command, of fewer methods and seeds, or in this process.
FEWER = {"run": ("--methods", "fem,kf_reduced"),
         "study tradeoff": ("--workers", "0"), "study choose": ("--workers", "0"),
         "study stability": ("--workers", "0"), "study": ("--workers", "0"),
         "study filters": ("--methods", "kf_load", "--seeds", "2")}  # fmt: skip
FAILS = {"study coverage": 1, "identify": 1}  # ten draws decide nothing; one law is not identified


def examples(name: str) -> list[list[str]]:
    text = PAGES[name].help or ""
    return [shlex.split(line) for line in re.findall(r"^ *(validate .*)$", text, re.MULTILINE)]


def test_every_command_stands_in_one_section() -> None:
    listed = [name for names in SECTIONS.values() for name in names]
    assert sorted(listed) == sorted({*dict(every_command(cli))} - {"data get"})


@pytest.mark.parametrize("name", PAGES)
def test_a_help_page_has_few_words_and_an_example(name: str) -> None:
    command = PAGES[name]
    short = command.get_short_help_str(200)
    assert 2 <= len(short.split()) <= 10 or not name, short
    assert examples(name)
    assert all(words[0] == "validate" for words in examples(name))


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(
            n,
            marks=[
                *([pytest.mark.slow] if n.startswith(SLOW) or not n else []),
                # Half of the time: studies share cells, and no other example reads them.
                *([pytest.mark.xdist_group("examples of studies")] if "study" in n else []),
                # The whole run that it checks is that of the experiment's own tests.
                *([pytest.mark.xdist_group("whole")] if n == "check" else []),
            ],
        )
        for n in PAGES
    ],
)
def test_the_example_of_a_help_page_runs(
    name: str,
    lab: Path,
    project_root: Path,
    request: pytest.FixtureRequest,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    if name == "external check":
        script = project_root / "benchmarks" / "external" / "felupe_simulator.py"
        shutil.copy(script, lab / "my_simulator.py")
    if name == "summary":  # of measured recordings, and of whole runs only
        assert here("new", "pressed", "--from", "log.mcap", cwd=lab)[0] == 0
        assert here("run", "pressed", cwd=lab)[0] in (0, 1)
    if name == "check":
        whole = request.getfixturevalue("whole")
        monkeypatch.setattr(checking, "compare", lambda found, *_, **__: whole(found.name))
    if name in ("study tradeoff", "study choose"):
        monkeypatch.setattr(ladder, "_QUICK_UNKNOWNS", 1000)
    monkeypatch.setattr("webbrowser.open", lambda address: True)  # no window on the tester's screen
    if name in ("show", "compare", "export", "history", "report", "open"):
        for experiment in ("kf_cube", "kf_cube_inertia"):
            stored(experiment, lab)
    for _, *words in (e for e in examples(name) if e != README):
        done, out, err = here(*words, *FEWER.get(name, ()), cwd=lab)
        if done == 2 and "validate data get" in err:
            pytest.skip("real data absent")
        assert done == FAILS.get(name, 0), (out, err)
        assert out


def stored(experiment: str, lab: Path) -> None:
    """A quick run of the accepted filter, in the folder of a full run."""
    place = lab / "reports" / experiment
    if not (place / "results.json").exists():
        out = lab / "quick" / experiment
        done = here("run", experiment, "--quick", "--methods", "kf_reduced", "--out", str(out))
        assert done[0] == 0
        quick = next(out.glob(f"{experiment}+quick*"))
        shutil.copytree(quick, place, dirs_exist_ok=True)


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the files that examples name."""
    folder = tmp_path_factory.mktemp("lab")
    rng = np.random.default_rng(2)
    t = np.arange(150) / 10
    d = np.clip(t - 2, 0, None) * 0.2  # mm
    rows = zip(t, d, 25 * d + rng.normal(0, 0.05, len(t)), strict=True)
    table = "\n".join(f"{a:.2f},{b:.5f},{c:.5f}" for a, b, c in rows)
    head = "Compression test\nDiameter: 25 mm\nHeight: 30 mm\nTime (s),Extension (mm),Load (N)\n"
    (folder / "log.csv").write_text(head + table + "\n", "utf-8")
    assert here("import", "log.csv", "-o", "log.mcap", cwd=folder)[0] == 0
    (folder / "frames").mkdir()
    y, x = np.mgrid[:120, :120] * 0.2e-3
    disk = np.hypot(x - 0.012, y - 0.012) < 0.008
    for i in range(4):
        noise = gaussian_filter(rng.normal(size=x.shape), 1.1)
        grey = np.clip(np.where(disk, 180, 40) + 60 * noise, 0, 255).astype(np.uint8)
        (folder / "frames" / f"frame_{i}.png").write_bytes(encode_png(grey))
    told = ("--as", "png-stack", "--m-per-px", "0.2mm", "--rate", "2")
    assert here("import", "frames", *told, "-o", "images.mcap", cwd=folder)[0] == 0
    camera = Signal(t + 0.3, np.clip(t - 2, 0, None)[:, None] * 0.2e-3, "m", 1e-6, "camera")
    write(folder / "camera.mcap", {"travel": camera})
    write(folder / "pivot.mcap", turned(rng))
    write(folder / "stylus.mcap", touched(rng))
    pv.Sphere(radius=20.0, theta_resolution=16, phi_resolution=16).save(folder / "gel.stl")
    return folder


def write(file: Path, signals: dict[str, Signal]) -> None:
    source = Source(file.stem, "", 0, "")
    write_recording(Recording(file.stem, source, 0, signals=signals), file)


def turned(rng: np.random.Generator) -> dict[str, Signal]:
    """A stylus whose tip stays while it turns."""
    t = np.arange(400) / 40
    tilt = 0.5 * np.column_stack([np.sin(t), np.cos(1.3 * t), np.sin(0.7 * t)])
    R = Rotation.from_rotvec(tilt).as_matrix()
    T = np.array([0.1, 0.2, 0.3]) - R @ TIP + 5e-5 * rng.normal(size=(400, 3))
    return pose_signals("StylusToTracker", t, R, T, "Tracker")


def touched(rng: np.random.Generator) -> dict[str, Signal]:
    """The tip rests on four places, two seconds on each."""
    stops = 0.06 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.2], [0.5, 0.4, 1]])
    legs = [np.repeat(stops[:1], 80, axis=0)]
    for a, b in pairwise(stops):
        legs += [np.linspace(a, b, 40), np.repeat(b[None], 80, axis=0)]
    tip = np.concatenate(legs)
    tip += 5e-5 * rng.normal(size=tip.shape)
    t = np.arange(len(tip)) / 40
    R = Rotation.from_rotvec(0.3 * np.column_stack([np.sin(t), np.cos(t), t / 9])).as_matrix()
    return pose_signals("StylusToTracker", t, R, tip - R @ TIP, "Tracker")
