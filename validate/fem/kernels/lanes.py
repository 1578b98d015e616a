# mypy: disable-error-code="no-untyped-call, untyped-decorator"
"""Vector lanes: a number type for compiled loops that holds several cells at once.

`Lanes` holds 8 doubles or 16 floats and knows + - * / and minus; with it the tensor functions of
`fem.kernels.tensors` and the laws at a point, written for one cell, do 8 or 16 in the same time. It
comes from `load` and from `fem.kernels.nodes_in_lanes`. The compiler does not find these registers
by itself: it cannot rule out that arrays overlap, and gathers number by number.
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
