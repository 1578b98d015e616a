"""Mean and worst tick of asynchronous regions, of the whole prefactored solve and of a Krylov model
at 343, 729 and 2197 nodes of a cube (paper 004), in one run, one thread.

python benchmarks/regions.py [TICKS]    TICKS per solver (default 400)
"""

import os
import sys

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy loads its BLAS
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from experiments.async_block import sizes
from validate.pipeline import load
from validate.solve.regions.scheme import AsyncRegions

CUBES = ((3, 6), (3, 8), (3, 12))  # 343, 729 and 2197 nodes
HZ = 2.5  # of the push


def main(ticks: int) -> None:
    t = 1e-3 * np.arange(1, ticks + 1, dtype=np.float64)
    depth = 5e-3 * np.sin(2 * np.pi * HZ * t)
    block = load("async_block")
    near = AsyncRegions(layers=(4,), rates=(50.0,), overlap=2)
    print(" | ".join(sizes.HEADS))
    for row in sizes.size_rows(block.parameters, CUBES, near, depth, 4, lambda _: None):
        print(" | ".join(f"{x:.3g}" if isinstance(x, float) else str(x) for x in row))


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 400)
