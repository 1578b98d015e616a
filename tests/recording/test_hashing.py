"""The hash of a file is that of its bytes in order, however they come."""

import hashlib

import numpy as np
import pytest

from validate.recording.mcap.hashing import Hashing


@pytest.mark.parametrize("sizes", [(), (0,), (5,), (9, 2**20, 9, 3 * 2**20, 1), (2**19,) * 9])
def test_it_is_that_of_the_bytes_in_order(sizes: tuple[int, ...]) -> None:
    rng = np.random.default_rng(len(sizes))
    parts = [rng.bytes(size) for size in sizes]
    hashing = Hashing()
    for part in parts:
        hashing.update(part)
    assert hashing.hexdigest() == hashlib.sha256(b"".join(parts)).hexdigest()
