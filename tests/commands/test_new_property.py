"""`validate new` on random recordings, bodies and answers: what is written is run, and runs end in
numbers or in one line."""

import math
import os
import random
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import here
from hypothesis import HealthCheck, Phase, example, given, settings
from hypothesis import strategies as st

from validate.arrays import Floats
from validate.commands.questions.answers import Question
from validate.commands.questions.new import _asked, fitting
from validate.errors import ValidateError
from validate.pipeline import run_in_memory
from validate.pipeline.bodies.choices import MeasuredBody
from validate.pipeline.experiment.declaration import from_json, to_json
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.find import load_file
from validate.recording.mcap.write import write_recording
from validate.recording.readers import read_recording
from validate.recording.types import Markers, Recording, Signal, Source
from validate.scene.geometries.box import box, grid
from validate.scene.mesh_files.mesh_file import write_mesh

# private: _asked: every question at once, without a terminal.

G = 9.80665
LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6}
PRESSURES = {"": 1.0, "Pa": 1.0, "kPa": 1e3, "MPa": 1e6}
KINDS = ("plates", "log", "markers", "gravity", "release", "force")
SHAPES = ("block", "cylinder", "box.npz", "bricks.npz")


@dataclass(frozen=True)
class Case:
    """A recording, the body in it and how its questions are answered; sides are in m, E in Pa."""

    kind: str = "log"
    shape: str = "block"
    sides: tuple[float, float, float] = (0.04, 0.03, 0.05)
    E: float = 20e3
    nu: float = 0.3
    strain: float = 0.05
    samples: int = 60
    rate: float = 20.0
    noise: float = 1e-4  # of the largest value
    header: bool = True  # the recording holds the specimen's sizes and the test
    length: str = "mm"
    pressure: str = "kPa"
    law: str = "linear"
    held: str = "zmin"
    seed: int = 1

    @property
    def size(self) -> Floats:
        a, b, h = self.sides
        return np.array((a, a if self.shape == "cylinder" else b, h))

    @property
    def area(self) -> float:
        a, b, _ = self.size
        return float(a * b * (math.pi / 4 if self.shape == "cylinder" else 1))


CASES = st.builds(
    Case,
    kind=st.sampled_from(KINDS),
    shape=st.sampled_from(SHAPES),
    sides=st.tuples(*[st.floats(0.012, 0.12)] * 3),
    E=st.floats(2e3, 2e5),
    nu=st.floats(0.0, 0.49),
    strain=st.floats(0.01, 0.3),
    samples=st.integers(5, 120),
    rate=st.floats(5.0, 200.0),
    noise=st.sampled_from([0.0, 1e-6, 1e-3, 0.05]),
    header=st.booleans(),
    length=st.sampled_from(sorted(LENGTHS)),
    pressure=st.sampled_from(sorted(PRESSURES)),
    law=st.sampled_from(["linear", "svk", "neo_hooke"]),
    held=st.sampled_from(["zmin", "z=0", "z=0~0.1mm", ""]),
    seed=st.integers(0, 10**6),
)


# --- the recording --------------------------------------------------------------------------------


def ramp(case: Case) -> tuple[Floats, Floats]:
    t = np.arange(case.samples) / case.rate
    return t, np.clip((t / t[-1] - 0.1) / 0.8, 0, 1)


def log(case: Case) -> dict[str, Signal]:
    t, share = ramp(case)
    rng = np.random.default_rng(case.seed)
    d = case.strain * case.size[2] * share
    force = case.E * case.area * d / case.size[2]
    sd = case.noise * float(force.max())
    force = force + rng.normal(0, 1, len(t)) * sd
    return {
        "displacement": Signal(t, d[:, None], "m", 0.0, "machine"),
        "force": Signal(t, force[:, None], "N", sd, "machine"),
    }


def places(case: Case) -> Floats:
    """Five markers in the body: three on the top, two lower."""
    a, b, h = case.size
    x = np.array([(0.6, 0.5, 1.0), (0.5, 0.6, 1.0), (0.4, 0.4, 1.0), (0.5, 0.5, 0.5),
                  (0.4, 0.5, 0.7)]) * (a, b, h)  # fmt: skip
    return x - (np.array((a, b, 0)) / 2 if case.shape == "cylinder" else 0.0)


def markers(case: Case) -> dict[str, Markers]:
    t, share = ramp(case)
    if case.kind in ("release", "force"):
        share = np.exp(-2 * t / t[-1]) * np.cos(2 * np.pi * 4 * t / t[-1])
    x = places(case)
    u = np.array([-case.nu, -case.nu, 1.0]) * -case.strain * x
    sd = case.noise * case.strain * float(case.size[2])
    noise = np.random.default_rng(case.seed).normal(0, 1, (len(t), *x.shape)) * sd
    return {"m": Markers(t, tuple("ABCDE"), x + share[:, None, None] * u + noise, sd, "body")}


def recorded(case: Case) -> Recording:
    metadata: dict[str, Any] = {}
    signals, seen = {}, {}
    if case.kind in ("plates", "log"):
        signals = log(case)
        if case.header:
            a, b, h = map(float, case.size)
            round_ = case.shape == "cylinder"
            sides = {"diameter_m": a} if round_ else {"width_m": a, "thickness_m": b}
            sides["height_m"] = h
            metadata["specimen"] = {name: repr(side) for name, side in sides.items()}
    if case.kind not in ("plates", "log") or case.seed % 2:
        seen = markers(case)
    if case.kind == "force":
        t, share = ramp(case)
        load = case.E * case.area * case.strain * share
        signals = {"pull": Signal(t, load[:, None], "N", 0.0, "machine")}
    return Recording("random", Source("x", "", 0, "x"), 0, signals=signals, markers=seen,
                     metadata=metadata)  # fmt: skip


# --- the answers ----------------------------------------------------------------------------------


def length(value: float, case: Case) -> str:
    return f"{value / LENGTHS[case.length]:.9g}{case.length}"


def answer(case: Case, question: Question, rng: random.Random) -> str:
    """A valid answer, or the proposal."""
    key, (a, b, h) = question.key, map(float, case.size)
    known = {
        "experiment": "plates" if case.kind == "plates" else "body",
        "test": "compression", "outline.shows": "other",
        "body.diameter": length(2 * math.sqrt(case.area / math.pi), case),
        "body.height": length(h, case),
        "body.shape": "file" if "." in case.shape else case.shape,
        "body.file": "" if case.kind == "plates" else case.shape,
        "body.block": ",".join(length(v, case) for v in (a, b, h)),
        "body.cylinder": ",".join(length(v, case) for v in (a, h)),
        "body.size": length(max(a, b, h), case),
        "material.E": f"{case.E / PRESSURES[case.pressure]:.9g}{case.pressure}",
        "material.nu": f"{case.nu:.4g}", "material.rho": "1050", "law": case.law,
        "moved.by": {"plates": "displacement", "log": "displacement", "force": "pull"}.get(
            case.kind, case.kind),
        "moved.place": rng.choice(("zmax", f"z={length(h, case)}")), "moved.along": "-z",
        "moved.sideways": rng.choice(("true", "false")), "moved.markers": "A,B,C",
        "moved.held": rng.choice(("0.1N", length(case.strain * h, case))),
        "held.all": case.held, "seen.layout": "as seen",
        "motion.damping": rng.choice(("0.05", "2ms")),
        "accept.force": rng.choice(("0.1N", "100mN", "2")),
        "accept.marker": rng.choice(("0.5mm", "1e-3", "none")),
        "ranges.E": rng.choice(("2%", "0.02")), "ranges.nu": "0.01", "ranges.load": "1%",
        "ranges.rho": "0", "ranges.damping": "0.05", "indenter.shape": "none",
    }  # fmt: skip
    sure = ("held.all", "experiment")
    if not question.open and (key not in known or (key not in sure and rng.random() < 0.3)):
        return question.default
    if key in known and (not question.choices or known[key] in question.choices):
        return known[key]
    return rng.choice(question.choices)


def interview(case: Case, folder: Path, name: str) -> dict[str, str]:
    """Every question answered; nothing that a source holds is open."""
    recording, rng = read_recording(folder / name), random.Random(case.seed)
    asks = partial(_asked, fitting(recording), recording, folder / "experiments")
    found: dict[str, str] = {}
    while pending := [q for q in asks(found) if q.key not in found]:
        question = pending[0]
        held = held_by_a_source(case)
        assert not (question.open and question.key in held), f"{question.key} is known: {held}"
        found[question.key] = question.checked(answer(case, question, rng))
        assert len(found) < 80
    return found


def held_by_a_source(case: Case) -> set[str]:
    """Keys of questions whose answers the recording or the mesh file holds."""
    keys = set()
    if case.kind in ("plates", "log") and case.header:
        keys |= {"body.height", "body.block", "body.cylinder", "body.diameter"}
    if "." in case.shape:
        keys |= {"body.unit", "body.block", "body.cylinder"}
    return keys


# --- the run --------------------------------------------------------------------------------------


def one_line(error: str) -> None:
    """A message of one line, long enough for what is wrong and what to do."""
    text = error.strip()
    assert "\n" not in text
    assert "Traceback" not in text
    assert "nan" not in text.lower().replace("name", "").split()
    assert len(text) > 30
    assert ":" in text or ";" in text, text


def ran(mine: Experiment, case: Case) -> None:
    values = {"body.cells": "2,2"}
    settings = getattr(mine.parameters, "settings", None)
    if isinstance(settings, MeasuredBody):
        values, body = {"seen.states": "8"}, mine.parameters.scene.body
        values |= {} if "." in case.shape else {"body.cells": ",".join("2" * len(body.cells))}
        if settings.motion.how == "dynamic":
            values["motion.length"] = f"{min(10, case.samples - 1) / case.rate:.6g}"
    try:
        result = run_in_memory(mine, values, methods=(list(mine.methods)[-1],), quick=True)
    except ValidateError as error:
        one_line(str(error))
        return
    scores = [s for m in result.methods for s in m.scores]
    assert all(np.isfinite(s.value) for s in scores), [s for s in scores if s.value != s.value]
    assert scores


def holds(case: Case, folder: Path) -> None:
    write_recording(recorded(case), folder / "r.mcap")
    made = {"box.npz": box, "bricks.npz": grid}.get(case.shape)
    if made is not None:
        write_mesh(made(tuple(map(float, case.size)), (2, 2, 2)), folder / case.shape)
    try:
        found = interview(case, folder, "r.mcap")
    except ValidateError as error:
        one_line(str(error))
        return
    text = "".join(f"{key} = '{value}'\n" for key, value in found.items())
    (folder / "a.toml").write_text(text, "utf-8")
    code, out, err = here("new", "mine", "--from", "r.mcap", "--answers", "a.toml", "--force")
    if code:
        assert (code, out) == (2, ""), err
        one_line(err)
        return
    file = folder / "experiments" / "mine.py"
    assert len(file.read_text("utf-8").splitlines()) <= 60
    mine = load_file(file)
    written = to_json(mine)
    assert to_json(from_json(written, file)) == written
    ran(mine, case)


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    before = Path.cwd()
    os.chdir(tmp_path)
    yield tmp_path
    os.chdir(before)


COMMON: dict[str, Any] = {
    "derandomize": True, "deadline": None, "database": None,
    "phases": (Phase.explicit, Phase.generate),  # a failing case is small as it is
    "suppress_health_check": [HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
}  # fmt: skip


@settings(max_examples=1, **COMMON)
@given(case=CASES)
@example(case=Case())
@example(case=Case("gravity", "bricks.npz", held=""))  # not held: roots of rounding errors
@example(
    case=Case("plates", "cylinder", law="svk")
)  # its JSON named the class of its scenes as code
@example(case=Case("plates", "cylinder", noise=0.0, samples=23))  # a parabola through two places
def test_random_recordings_end_in_numbers_or_in_one_line(folder: Path, case: Case) -> None:
    holds(case, folder)


@pytest.mark.slow
@pytest.mark.timeout(600)
@settings(max_examples=15, **COMMON)
@given(case=CASES)
def test_more_random_recordings(folder: Path, case: Case) -> None:
    holds(case, folder)
