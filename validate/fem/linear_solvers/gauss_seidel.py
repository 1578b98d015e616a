"""Gauss-Seidel sweeps over a sparse matrix: compiled kernel, and plain loops as reference."""

from validate.arrays import Floats, Ints
from validate.fem.kernels.jit_cache import compiled


def sweeps_loops(
    indptr: Ints, indices: Ints, data: Floats, b: Floats, x: Floats, count: int
) -> None:
    """`count` forward sweeps in place over x (m,) for A x = b; A in rows, its diagonal present."""
    for _ in range(count):
        for i in range(len(b)):
            rest, pivot = b[i], 1.0
            for k in range(indptr[i], indptr[i + 1]):
                j = indices[k]
                if j == i:
                    pivot = data[k]
                else:
                    rest -= data[k] * x[j]
            x[i] = rest / pivot


sweeps = compiled(nogil=True, error_model="numpy")(sweeps_loops)
