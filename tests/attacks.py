"""Damage to any file: cuts, turned bits, forged numbers and texts, with fixed seeds."""

from collections.abc import Iterator

import numpy as np

TOKENS = (b"\xff\xff\xff\xff", bytes(4), b"nan", b"1e400", b"-1", b"\n", b"\t", b",", b'"',
          b"99999999", b"\x7f\xff", "é".encode())  # fmt: skip


def damaged(whole: bytes, cuts: int, flips: int) -> Iterator[bytes]:
    """Cuts over the whole length, single bits turned, and numbers and texts forged."""
    for at in np.unique(np.linspace(0, len(whole) - 1, cuts).astype(int)):
        yield whole[:at]
    rng = np.random.default_rng(7)
    for k in range(flips + flips // 2):
        data = bytearray(whole)
        if k < flips:
            bit = int(rng.integers(8 * len(data)))
            data[bit // 8] ^= 1 << bit % 8
        else:
            at, token = int(rng.integers(len(data))), TOKENS[int(rng.integers(len(TOKENS)))]
            data[at : at + len(token)] = token
        yield bytes(data)
