"""One test of a soft cylinder, to be written in the manner of many testing machines."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from validate.recording.tables.testing_machine import read_instron
from validate.recording.types import Recording

T = np.arange(40) / 10  # s
D = np.arange(40) * 0.025  # mm
F = 7 * D + 1.25 * D**2 - 0.03125  # N


def dot(x: float) -> str:
    return f"{x:.5f}"


def comma(x: float) -> str:
    return dot(x).replace(".", ",")


def rows(
    separator: str = ",", form: Callable[[float], str] = dot, d: np.ndarray = D, f: np.ndarray = F
) -> str:
    return "".join(separator.join(map(form, r)) + "\n" for r in zip(T, d, f, strict=True))


def read(
    folder: Path,
    text: str,
    encoding: str = "utf-8",
    test: str | None = "compression",
    **mapping: str,
) -> Recording:
    """Said to be a compression test, which most of these tables do not tell themselves."""
    path = folder / "log.csv"
    path.write_bytes(text.encode(encoding))
    return read_instron(path, {**({"test": test} if test else {}), **mapping})


def assert_test(recording: Recording, d_mm: np.ndarray = D, f: np.ndarray = F) -> None:
    displacement, force = recording.signals["displacement"], recording.signals["force"]
    assert np.allclose(displacement.t, T[: len(d_mm)], atol=1e-9)
    assert np.allclose(displacement.y[:, 0], d_mm / 1e3, rtol=0, atol=1e-8)
    assert np.allclose(force.y[:, 0], f, rtol=0, atol=2e-2 if abs(f).max() > 1e3 else 6e-3)
