"""Compiled steps of central difference on lumped masses (paper 003, eq 18)."""

from validate.arrays import Floats, Ints
from validate.fem.kernels.explicit import (
    MODULES,
    Cells,
    add_forces,
    add_forces_in_parts,
    add_late_forces,
)
from validate.fem.kernels.jit_cache import compiled
from validate.fem.kernels.tensors import FAST, inlined

Springs = tuple[Cells, Cells, Floats]


@inlined
def pull(springs: Springs, u: Floats, r: Floats) -> None:
    """r = K u of springs, rows of a csr matrix; zero without any."""
    starts, columns, values = springs
    for i in range(r.size):
        r[i] = 0.0
    if values.size > 0:
        for i in range(r.size):
            for k in range(starts[i], starts[i + 1]):
                r[i] += values[k] * u[columns[k]]


@inlined
def _moved(u: Floats, d: Floats, r: Floats, keep: Floats, gain: Floats) -> None:
    for i in range(u.size):
        d[i] = keep[i] * d[i] - gain[i] * r[i]
        u[i] += d[i]


@inlined
def _moved_damped(
    u: Floats, d: Floats, r: Floats, old: Floats, keep: Floats, gain: Floats, lag: float
) -> float:
    """The same with damping; returns what it took, J."""
    taken = 0.0
    for i in range(u.size):
        drag = lag * (r[i] - old[i])
        new = keep[i] * d[i] - gain[i] * (r[i] + drag)
        if gain[i] > 0:
            way = (new + d[i]) / 2
            taken += (1 - keep[i]) / gain[i] * way * way + drag * way
        d[i], old[i] = new, r[i]
        u[i] += new
    return taken


@inlined
def _rates(rows: Floats, keep: Floats, gain: Floats, lag: float, dt: float) -> float:
    """v and a at u (paper 003, eqs 13-14), which know the next increment; sum of d^2."""
    u, d, r, old, v, a = rows[0], rows[1], rows[2], rows[3], rows[4], rows[5]
    total = 0.0
    for i in range(u.size):
        drag = r[i] if lag == 0.0 else r[i] + lag * (r[i] - old[i])
        new = keep[i] * d[i] - gain[i] * drag
        v[i], a[i] = (new + d[i]) / (2 * dt), (new - d[i]) / (dt * dt)
        total += d[i] * d[i] + u[i] * 0.0
    return total


@inlined
def _inputs(begin: Floats, end: Floats, share: float, to: Floats) -> None:
    """Inputs (k + l,) a share of the way."""
    for c in range(to.size):
        to[c] = begin[c] + share * (end[c] - begin[c])


@inlined
def _input(columns: Floats, j: int, inputs: Floats, first: int) -> float:
    """Row j of `columns` (., k) times the inputs from `first` on."""
    total = 0.0
    for c in range(columns.shape[1]):
        total += columns[j, c] * inputs[first + c]
    return total


@compiled(*MODULES, nogil=True, fastmath=FAST, error_model="numpy")
def advance(
    law: int,
    geometry: Floats,
    cells: Cells,
    springs: Springs,
    rows: Floats,
    keep: Floats,
    gain: Floats,
    lag: float,
    dt: float,
    held: Ints,
    moves: Floats,
    loaded: Ints,
    loads: Floats,
    begin: Floats,
    end: Floats,
    substeps: int,
    w: Floats,
    memory: Floats | None,
    series: Floats | None,
) -> tuple[float, float, float]:
    """`substeps` steps of central difference (paper 003, eq 18) in increments d = u - u_before.

    d' = keep d - gain (r + lag (r - old) - f), u' = u + d', with keep = (1 - b)/(1 + b), gain =
    (dt^2/m)/(1 + b), b = alpha dt/2, lag = beta/dt; zeros where held. `rows` (6, N) are u, d, the
    forces r at u and `old` before it, v and a: overwritten, the last two from nothing. `held`
    unknowns move by `moves` (held, k) times the first inputs, `loaded` ones take `loads`
    (loaded, l) times the others; inputs go linearly from `begin` to `end` (k + l,). Returns the
    work J of loads and prescribed motion and what damping took, up to half a step before the last
    time, and the sum of d^2, not finite where any unknown is not. `w` is a workspace or the
    parts of `add_forces_in_parts`. `memory` and `series` are those of `add_late_forces`.
    """
    u, d, r, old, v, a = rows[0], rows[1], rows[2], rows[3], rows[4], rows[5]
    k = moves.shape[1]
    work, taken = 0.0, 0.0
    damped = lag > 0 or bool((keep[gain > 0] < 1).any())
    old_inputs, inputs = begin.copy(), begin.copy()
    for s in range(substeps):
        _inputs(begin, end, s / substeps, old_inputs)
        _inputs(begin, end, (s + 1) / substeps, inputs)
        for j in range(loaded.size):
            i = loaded[j]
            work += _input(loads, j, old_inputs, k) * d[i] / 2
            v[i], a[i] = d[i], lag * (r[i] - old[i])
        for j in range(held.size):
            work += r[held[j]] * d[held[j]] / 2
        if damped:
            taken += _moved_damped(u, d, r, old, keep, gain, lag)
        else:
            _moved(u, d, r, keep, gain)
        for j in range(loaded.size):
            i, f = loaded[j], _input(loads, j, old_inputs, k)
            way, drag = (v[i] + d[i]) / 2, (1 - keep[i]) / gain[i]
            d[i] += gain[i] * f
            u[i] += gain[i] * f
            work += f * d[i] / 2
            if damped:  # what it took was reckoned without the load
                more = gain[i] * f / 2
                taken += drag * more * (2 * way + more) + a[i] * more
        for j in range(held.size):
            i = held[j]
            d[i] = _input(moves, j, inputs, 0) - u[i]
            u[i] += d[i]
            work += r[i] * d[i] / 2
        pull(springs, u, r)
        # What follows is known to the compiler: each kind of body has its own code alone.
        if memory is not None and series is not None:
            add_late_forces(law, geometry, cells, u, r, memory, series)
        elif w.ndim == 2:
            add_forces_in_parts(law, geometry, cells, u, r, w)
        else:
            add_forces(law, geometry, cells, u, r, w)
    size = _rates(rows, keep, gain, lag, dt)
    for j in range(loaded.size):
        i, more = loaded[j], gain[loaded[j]] * _input(loads, j, inputs, k)
        v[i] += more / (2 * dt)
        a[i] += more / (dt * dt)
    for j in range(held.size):
        v[held[j]], a[held[j]] = d[held[j]] / dt, 0.0
    return work, taken, size
