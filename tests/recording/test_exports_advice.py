"""Every advice that is printed can be followed, and leads to the test as it was."""

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from exports import D, F, T

from validate.errors import ValidateError
from validate.recording.tables.testing_machine import read_instron
from validate.recording.types import Recording

_ADVICE = re.compile(r"--map ('[^']+'|[^\s;,)]+)")


def refused(path: Path, mapping: Mapping[str, str]) -> str:
    """What the error says; empty where the file is read."""
    try:
        read_instron(path, mapping)
    except ValidateError as error:
        return str(error)
    return ""


def advised(words: str, fills: Mapping[str, str]) -> dict[str, str]:
    """What to say by key, the first of alternatives; `fills` is what only the user knows, by key,
    where an advice has a place for it."""
    new: dict[str, str] = {}
    for key, value in (a.strip("'").split("=", 1) for a in _ADVICE.findall(words)):
        open_ = "COLUMN" in value or "UNIT" in value
        if open_ and key in fills:
            named = value.replace("UNIT", "").replace("COLUMN", "").strip(":")
            assert fills[key].startswith(named), (value, fills[key])
            new.setdefault(key, fills[key])
        elif not open_ and key not in fills:
            new.setdefault(key, value)
    assert new, f"nothing to follow in: {words}"
    return new


def followed(path: Path, fills: Mapping[str, str], rounds: int) -> Recording:
    """What comes of doing what each error says."""
    mapping: dict[str, str] = {}
    for _ in range(rounds):
        if words := refused(path, mapping):
            mapping |= advised(words, fills)
    return read_instron(path, mapping)


def table(names: str, *columns: np.ndarray) -> str:
    rows = zip(*columns, strict=True)
    return names + "\n" + "".join(",".join(f"{x:.9g}" for x in row) + "\n" for row in rows)


S, G = D / 20, F / 314.0  # strain of 20 mm, stress MPa on 314 mm2
TWICE = np.repeat(T, 2)[: len(T)]
CASES: dict[str, tuple[str, dict[str, str], int]] = {
    "grams": (table("Time (s),Distance (mm),Force (g)", T, D, F / 9.80665e-3), {}, 2),
    "kilograms in a row": (table("Time,Distance,Force\ns,mm,kg", T, D, F / 9.80665), {}, 2),
    "no unit": (table("Time (s),Stroke (mm),Load", T, D, F), {"force": "Load:N"}, 2),
    "no name": (table("Time (s),A (mm),Load (N)", T, D, F), {"displacement": "A (mm)"}, 1),
    "no names": (
        table("i (s),A (mm),B (N)", T, D, F),
        {"time": "i (s)", "displacement": "A (mm)", "force": "B (N)"},
        1,
    ),
    "no time": (table("Stroke (mm),Load (N)", D, F), {}, 1),
    "strain and stress": (table("Strain (-),Stress (MPa)", S, G), {}, 1),
    "strain without a unit": (table("Strain,Stress (MPa)", S, G), {"strain": "Strain:1"}, 1),
    "stretch": (table("Stretch,Stress (MPa)", 1 - S, -G), {}, 1),
    "strain and force": (table("Time (s),Rek (%),Kracht (N)", T, 100 * S, F), {}, 1),
    "way and stress": (table("Time (s),Weg (mm),Spannung (MPa)", T, D, G), {}, 1),
    "a name for two things": (table("Tiempo (s),Rec (mm),Tensión (MPa)", T, D, G),
                              {"displacement": "Rec (mm)"}, 2),
    "both negative": (table("Time (s),Distance (mm),Force (N)", T, -D, -F), {}, 1),
    "two forces": (table("Time (s),Stroke (mm),Force 1 (N),Force 2 (N)", T, D, F, T + 1),
                   {"force": "Force 1 (N)"}, 2),
    "swapped": (
        table("Time (s),Load (N),Stroke (mm)", T, D, F),
        {"force": "Stroke (mm):N", "displacement": "Load (N):mm"},
        4,
    ),
    "a unit a thousand off": (
        "Diameter: 20 mm\n" + table("Time (s),Stroke (mm),Load (kN),Stress (MPa)", T, D, F,
                                    F / (100 * np.pi)),
        {"force": "Load (kN):N"}, 3,
    ),
    "rows of equal time": (table("Time (s),Stroke (mm),Load (N)", TWICE, D, F), {}, 3),
    "two specimens": (
        "Specimen 1\n" + table("Time (s),Stroke (mm),Load (N)", T, D, F)
        + "Specimen 2\n" + table("Time (s),Stroke (mm),Load (N)", T, D, 2 * F), {}, 3,
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_advice_leads_to_the_test(case: str, tmp_path: Path) -> None:
    text, fills, rounds = CASES[case]
    path = tmp_path / "log.csv"
    path.write_text(text, "utf-8")
    with pytest.raises(ValidateError):
        read_instron(path)
    recording = followed(path, fills, rounds)
    d, f = (recording.signals[k].y[:, 0] for k in ("displacement", "force"))
    assert np.allclose(d, D / 1e3, rtol=1e-6, atol=1e-9)
    assert np.allclose(f, F, rtol=1e-6, atol=1e-6)
    assert recording.record("specimen")["test"] == "compression"
    given = recording.record("provenance")["given by the user"]
    assert given != "nothing"
    assert "test=" in given or recording.record("specimen")["test"] != "not stated"
