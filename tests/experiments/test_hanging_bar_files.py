"""Files of solutions that the hanging bar is compared with."""

from pathlib import Path

import numpy as np
import pytest

from experiments.hanging_bar.reference_solutions import drop_of, read_arrays
from validate.errors import RecordingError

SHAPES = {"rest_q": (None, 3), "final_q": (None, 3)}


def test_the_drop_is_read_from_two_arrays(tmp_path: Path) -> None:
    rest = np.arange(12.0).reshape(4, 3)
    final = rest - np.array([0, 0, 0.04]) * np.arange(4)[:, None]
    np.savez(tmp_path / "solved.npz", rest_q=rest, final_q=final)
    assert drop_of(read_arrays(tmp_path / "solved.npz", SHAPES)) == pytest.approx(0.12)


@pytest.mark.parametrize(
    ("final", "said"),
    [
        (None, r"no numbers \['final_q'\]; it has \['rest_q'\]"),
        (np.array([["a", "b", "c"]]), r"no numbers \['final_q'\]"),
        (np.zeros((4, 2)), "final_q: shape"),
        (np.full((4, 3), np.nan), "final_q: 12 of 12 values not finite"),
    ],
)
def test_other_arrays_are_refused(tmp_path: Path, final: np.ndarray | None, said: str) -> None:
    arrays = {"rest_q": np.zeros((4, 3))} | ({} if final is None else {"final_q": final})
    np.savez(tmp_path / "solved.npz", **arrays)
    with pytest.raises(RecordingError, match=said):
        read_arrays(tmp_path / "solved.npz", SHAPES)
