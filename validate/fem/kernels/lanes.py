# mypy: disable-error-code="no-untyped-call, untyped-decorator"
"""Vector lanes: several cells at once in compiled loops, and their nodes.

`Lanes` holds 8 doubles or 16 floats and knows + - * / and minus; with it the tensor functions of
`fem.kernels.points` and the laws at a point, written for one cell, do 8 or 16 in the same time. It
comes from `load` and from the loads of nodes below. The compiler does not find these registers by
itself: it cannot rule out that arrays overlap, and gathers number by number.

Nodes are gathered from cells and scattered to them. A node has four
numbers in a row, x, y, z and a pad, or a multiple of four: read and written at once, as vectors.
Cells are packed in blocks of 16, corner by corner, and hold 8 x node.
"""

import operator
from collections.abc import Callable
from typing import Any, cast

import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, models, register_model

_BITS = 512  # of a register; a machine with less takes two or four
_INT = ir.IntType(32)


def on_lines(x: np.ndarray) -> np.ndarray:
    """Return a copy that begins with a line of the cache, so that no vector of it lies across
    two."""
    line = _BITS // 8
    room = np.empty(x.nbytes + line, np.uint8)
    start = -room.ctypes.data % line
    copy = room[start : start + x.nbytes].view(x.dtype).reshape(x.shape)
    copy[...] = x
    return copy


def emitted(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that writes its code itself, called like any other in compiled loops."""
    return cast(Callable[..., Any], intrinsic(function))


class Lanes(types.Type):
    """8 doubles (`of` float64) or 16 floats (float32)."""

    def __init__(self, of: types.Float) -> None:
        self.of, self.count = of, _BITS // of.bitwidth
        super().__init__(name=f"lanes({of}, {self.count})")


def vector(of: types.Float, count: int) -> ir.Type:
    return ir.VectorType(ir.DoubleType() if of.bitwidth == 64 else ir.FloatType(), count)


@register_model(Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, dmm: Any, fe_type: Lanes) -> None:
        super().__init__(dmm, fe_type, vector(fe_type.of, fe_type.count))


def _spread(context: Any, builder: Any, value: Any, typ: Any, to: Lanes) -> Any:
    """A number in all lanes; lanes as they are."""
    if isinstance(typ, Lanes):
        return value
    nothing = ir.Constant(vector(to.of, to.count), ir.Undefined)
    first = builder.insert_element(
        nothing, context.cast(builder, value, typ, to.of), ir.Constant(_INT, 0)
    )
    return shuffled(builder, first, first, [0] * to.count)


def shuffled(builder: Any, x: Any, y: Any, picks: list[int]) -> Any:
    """Return the entries `picks` of x and y side by side."""
    return builder.shuffle_vector(x, y, ir.Constant(ir.VectorType(_INT, len(picks)), picks))


def _arithmetic(symbol: Any, instruction: str) -> None:
    """Lets `symbol` join lanes with lanes, and lanes with numbers on either side."""

    @infer_global(symbol)
    class Typed(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            found = [a for a in args if isinstance(a, Lanes)]
            known = all(isinstance(a, (Lanes, types.Number)) for a in args)
            return signature(found[0], *args) if found and known else None

    def lowered(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        to = sig.return_type
        values = [_spread(context, builder, v, t, to) for v, t in zip(args, sig.args, strict=True)]
        return getattr(builder, instruction)(*values)

    for pair in ((Lanes, Lanes), (Lanes, types.Number), (types.Number, Lanes)):
        lower_builtin(symbol, *pair)(lowered)


for _symbol, _instruction in (
    (operator.add, "fadd"), (operator.iadd, "fadd"), (operator.sub, "fsub"),
    (operator.isub, "fsub"), (operator.mul, "fmul"), (operator.truediv, "fdiv"),
):  # fmt: skip
    _arithmetic(_symbol, _instruction)


@infer_global(operator.neg)
class _Negated(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        return signature(args[0], args[0]) if isinstance(args[0], Lanes) else None


@lower_builtin(operator.neg, Lanes)
def _negated(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return builder.fneg(args[0])


def place(context: Any, builder: Any, typ: Any, array: Any, index: Any, count: int) -> Any:
    """Pointer to `count` numbers of a contiguous array from its flat `index` on."""
    proxy = cast(Callable[..., Any], cgutils.create_struct_proxy)
    data = proxy(typ)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [index]), vector(typ.dtype, count).as_pointer())


@emitted
def load(typing: Any, array: Any, index: Any) -> Any:
    """Return the lanes of a contiguous array from its flat `index` on."""
    to = Lanes(array.dtype)

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        start = place(context, builder, sig.args[0], args[0], args[1], to.count)
        return builder.load(start, align=to.of.bitwidth // 8)

    return to(array, index), code


@emitted
def lanes_of(typing: Any, array: Any) -> Any:
    """How many lanes an array's numbers have."""
    count = Lanes(array.dtype).count

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return context.get_constant(types.intp, count)

    return types.intp(array), code


def _as_vectors(typ: Any) -> tuple[types.Float, int]:
    return (typ.of, typ.count) if isinstance(typ, Lanes) else (typ, 1)


@emitted
def rough_inverse_cube_root(typing: Any, x: Any) -> Any:
    """x^(-1/3) of a number or of lanes, 3 % off, from the bits of x as float32."""
    if not isinstance(x, (Lanes, types.Float)):
        return None
    of, count = _as_vectors(x)

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        short, whole = vector(types.float32, count), ir.VectorType(_INT, count)
        value = builder.bitcast(args[0], vector(of, count))
        wide = of.bitwidth == 64
        bits = builder.bitcast(builder.fptrunc(value, short) if wide else value, whole)
        third = builder.sdiv(bits, ir.Constant(whole, [3] * count))
        guess = builder.sub(ir.Constant(whole, [_CUBE_ROOT] * count), third)
        found = builder.bitcast(guess, short)
        found = builder.fpext(found, vector(of, count)) if wide else found
        return builder.bitcast(found, context.get_value_type(x))

    return x(x), code


_CUBE_ROOT = 0x54A2FA8C


@emitted
def where_positive(typing: Any, x: Any, y: Any) -> Any:
    """y where x > 0, else NaN; numbers or lanes."""
    if x != y:
        return None
    of, count = _as_vectors(x)

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        kind = vector(of, count)
        value, found = (builder.bitcast(a, kind) for a in args)
        lost, zero = ir.Constant(kind, [float("nan")] * count), ir.Constant(kind, [0.0] * count)
        chosen = builder.select(builder.fcmp_ordered(">", value, zero), found, lost)
        return builder.bitcast(chosen, context.get_value_type(x))

    return x(x, y), code


BLOCK = 16  # cells side by side
FOUR = 4  # numbers of a node that are moved at once


def _each_four(count: int, picks: tuple[int, int, int, int]) -> list[int]:
    """Picks (0-3 of the first, 4-7 of the second vector) in every four of `count` numbers."""
    return [p % 4 + 4 * g + p // 4 * count for g in range(count // 4) for p in picks]


def _even(builder: Any, x: Any, y: Any) -> Any:
    return shuffled(builder, x, y, _each_four(x.type.count, (0, 4, 2, 6)))


def _odd(builder: Any, x: Any, y: Any) -> Any:
    return shuffled(builder, x, y, _each_four(x.type.count, (1, 5, 3, 7)))


def _turned(builder: Any, rows: list[Any]) -> list[Any]:
    """Four vectors, the 4 x 4 numbers of every four of their lanes transposed: its own inverse."""
    pairs = [pick(builder, rows[i], rows[i + 1]) for pick in (_even, _odd) for i in (0, 2)]
    first, last = (_each_four(rows[0].type.count, p) for p in ((0, 1, 4, 5), (2, 3, 6, 7)))
    return [
        shuffled(builder, pairs[i], pairs[i + 1], part) for part in (first, last) for i in (0, 2)
    ]


def _joined(builder: Any, parts: list[Any]) -> Any:
    """Vectors of one length side by side."""
    if len(parts) == 1:
        return parts[0]
    half = len(parts) // 2
    low, high = _joined(builder, parts[:half]), _joined(builder, parts[half:])
    return shuffled(builder, low, high, list(range(2 * low.type.count)))


def _of_lanes(builder: Any, rows: list[Any]) -> list[Any]:
    """What every lane has of one, four or six rows, as a vector each; six with two pads."""
    if len(rows) == 6:
        return _sixes(builder, rows)
    if len(rows) == 4:
        rows = _turned(builder, rows)
    size = len(rows)
    return [
        shuffled(builder, row, row, list(range(begin, begin + size)))
        for lane in range(rows[0].type.count)
        for row, begin in [(rows[lane % size], lane // size * size)]
    ]


def _sixes(builder: Any, rows: list[Any]) -> list[Any]:
    fours = _turned(builder, rows[:4])
    twos = [pick(builder, rows[4], rows[5]) for pick in (_even, _odd)]
    count, found = rows[0].type.count, []
    for lane in range(count):
        begin, last = lane // 4 * 4, lane // 2 * 2 + count
        picks = [*range(begin, begin + 4), last, last + 1, last, last + 1]
        found.append(shuffled(builder, fours[lane % 4], twos[lane % 2], picks))
    return found


_proxy = cast(Callable[..., Any], cgutils.create_struct_proxy)
_unpacked = cast(Callable[..., list[Any]], cgutils.unpack_tuple)


class _Corners:
    """The nodes of the cells in the lanes, in code that is being made: from `nodes`, flat, and
    `cells` from a flat index on."""

    def __init__(self, context: Any, builder: Any, sig: Any, args: Any) -> None:
        self.builder = builder
        self.typ, self.index = sig.args[0], args[2]
        self.data, self.cells = (
            _proxy(sig.args[i])(context, builder, args[i]).data for i in (0, 1)
        )
        self.align = int(self.typ.dtype.bitwidth // 8)

    def at(self, corner: int, lane: int, size: int = FOUR, wide: int = FOUR, k: int = 0) -> Any:
        """Pointer to `size` of the `wide` numbers of a lane's node, from the k-th on.

        8 x node is counted in eighths of a node's bytes, which spares a multiplication.
        """
        builder, step = self.builder, ir.Constant(self.index.type, corner * BLOCK + lane)
        node = builder.load(builder.gep(self.cells, [builder.add(self.index, step)]))
        start, eighth = builder.zext(node, ir.IntType(64)), wide * self.align // 8
        unit = eighth & -eighth  # the power of two in it
        if unit < eighth:
            start = builder.mul(start, ir.Constant(start.type, eighth // unit))
        numbers = builder.bitcast(self.data, ir.IntType(8 * unit).as_pointer())
        kind = vector(self.typ.dtype, 1).element.as_pointer()
        first = builder.bitcast(builder.gep(numbers, [start]), kind)
        first = builder.gep(first, [ir.Constant(start.type, k)]) if k else first
        return builder.bitcast(first, vector(self.typ.dtype, size).as_pointer())

    def row(self, corner: int, lane: int) -> Any:
        return self.builder.load(self.at(corner, lane), align=self.align)

    def add(self, where: Any, numbers: Any, less: bool = False) -> None:
        old = self.builder.load(where, align=self.align)
        join = self.builder.fsub if less else self.builder.fadd
        self.builder.store(join(old, numbers), where, align=self.align)


@emitted
def edges(typing: Any, nodes: Any, cells: Any, index: Any) -> Any:
    """u_a - u_0 as 3 x 3 (component, a - 1), a = 1-3, of the cells from the flat `index` on."""
    to = Lanes(nodes.dtype)

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        of, found = _Corners(context, builder, sig, args), []
        origins = [of.row(0, k) for k in range(to.count)]
        for corner in (1, 2, 3):
            ways = [builder.fsub(of.row(corner, k), origins[k]) for k in range(to.count)]
            found.append(_turned(builder, [_joined(builder, ways[k::4]) for k in range(4)]))
        flat = [found[a][i] for i in range(3) for a in range(3)]
        return context.make_tuple(builder, sig.return_type, flat)

    return types.UniTuple(to, 9)(nodes, cells, index), code


@emitted
def add_forces_of(typing: Any, nodes: Any, cells: Any, index: Any, f: Any) -> Any:
    """Add the forces f, 3 x 3 (component, a - 1) of nodes 1-3, and minus their sum at node 0.

    What the pads are left with is of no use.
    """

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        of, flat = _Corners(context, builder, sig, args), _unpacked(builder, args[3], 9)
        three = [_of_lanes(builder, [flat[a], *flat[3 + a :: 3], flat[6 + a]]) for a in range(3)]
        for lane, (x, y, z) in enumerate(zip(*three, strict=True)):
            of.add(of.at(0, lane), builder.fadd(builder.fadd(x, y), z), less=True)
            for corner, four in enumerate((x, y, z)):
                of.add(of.at(corner + 1, lane), four)
        return context.get_dummy_value()

    return types.none(nodes, cells, index, f), code


@emitted
def add_numbers_of(typing: Any, nodes: Any, cells: Any, index: Any, numbers: Any) -> Any:
    """Add m = 6 or 9 numbers at each corner, `numbers` four tuples of m lanes, to the first m of a
    node's 8 or 12."""
    m = numbers.dtype.count
    parts = {6: [(0, 6)], 9: [(0, 4), (4, 4), (8, 1)]}[m]

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        of, wide = _Corners(context, builder, sig, args), -(-m // FOUR) * FOUR
        for corner, each in enumerate(_unpacked(builder, args[3], 4)):
            values = _unpacked(builder, each, m)
            for k, size in parts:
                for lane, row in enumerate(_of_lanes(builder, values[k : k + size])):
                    of.add(of.at(corner, lane, row.type.count, wide, k), row)
        return context.get_dummy_value()

    return types.none(nodes, cells, index, numbers), code
