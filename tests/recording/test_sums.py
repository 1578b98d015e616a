"""The sums of a file are those of its bytes in order, however they come."""

import hashlib
import zlib

import numpy as np
import pytest

from validate.recording.mcap.integrity import Sums


@pytest.mark.parametrize("sizes", [(), (0,), (5,), (9, 2**20, 9, 3 * 2**20, 1), (2**19,) * 9])
def test_they_are_those_of_the_bytes_in_order(sizes: tuple[int, ...]) -> None:
    rng = np.random.default_rng(len(sizes))
    parts = [rng.bytes(size) for size in sizes]
    sums = Sums()
    for k, part in enumerate(parts):
        sums.update(part)
        if k % 3 == 0:
            assert sums.crc() == zlib.crc32(b"".join(parts[: k + 1]))
    assert sums.crc() == zlib.crc32(b"".join(parts))
    assert sums.hexdigest() == hashlib.sha256(b"".join(parts)).hexdigest()


@pytest.mark.parametrize("size", [3, 2**21])
def test_the_crc_counts_from_a_restart(size: int) -> None:
    rng = np.random.default_rng(size)
    before, after = rng.bytes(size), rng.bytes(size)
    sums = Sums()
    sums.update(before)
    sums.restart()
    sums.update(after)
    assert sums.crc() == zlib.crc32(after)
    assert sums.hexdigest() == hashlib.sha256(before + after).hexdigest()
