"""Transfer of a user's code from a script or notebook to workers, and its hash.

Classes and functions of `__main__`, of a cell and of plain modules cannot be imported by a worker,
so they are sent with their code. The hash is of the code, of what it refers to and of values that
it encloses: a cell that was edited is not the same computation.
"""

import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import MISSING, fields, is_dataclass
from functools import partial
from hashlib import sha256
from pathlib import Path
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

from validate.engine.execution import fingerprint
from validate.engine.identity import PACKAGE

_OURS = PACKAGE.name
_PYTHON = sys.stdlib_module_names - {"__main__"}
_LEAVES = (str, bytes, int, float, ModuleType, np.ndarray, type(None))
_NO_CODE = ("__dict__", "__weakref__", "__doc__", "__module__", "__dataclass_fields__",
            "__annotations__", "__firstlineno__", "__static_attributes__",
            "__abstractmethods__", "_abc_impl")  # fmt: skip


def code_hash(value: Any) -> str:
    """Return one hash of all user code that a value contains or refers to, "" where there is none.

    Equal in another process for equal code.
    """
    parts = sorted(set(_parts(value, {})))
    return sha256("\0".join(parts).encode()).hexdigest() if parts else ""


class SentCode(bytes):
    """Code on its way to a worker. Its text says nothing: two processes make other bytes of the
    same code, so that in the key of a cell its hash stands for it."""

    def __repr__(self) -> str:
        return "code"


NO_CODE = SentCode()


def sent(value: Any, known: str = "") -> SentCode:
    """Return a value as bytes, with the user code that it refers to; that of the package `known`
    stays out, which the receiver has loaded."""
    import cloudpickle  # Dask's; only where user code is sent

    with _by_value(value, known):
        return SentCode(cloudpickle.dumps(value))


def received(data: bytes) -> Any:
    """Return what `sent` was given. It is of the calling process: a job, never a file."""
    import cloudpickle

    return cloudpickle.loads(data)


@contextmanager
def _by_value(value: Any, known: str) -> Iterator[None]:
    """Plain modules of the user are sent with what refers to them."""
    import cloudpickle

    seen: dict[int, Any] = {}
    for _ in _parts(value, seen):
        pass
    names = {getattr(thing, "__module__", "") for thing in seen.values()}
    modules = [m for name, m in list(sys.modules.items()) if name in names and _is_users(name)
               and name.partition(".")[0] not in ("__main__", known)]  # fmt: skip
    for module in modules:
        cloudpickle.register_pickle_by_value(module)
    try:
        yield
    finally:
        for module in modules:
            cloudpickle.unregister_pickle_by_value(module)


def _is_users(name: str | None) -> bool:
    """Whether a module is neither of this package, of Python nor installed."""
    if not name or name.partition(".")[0] in (_OURS, *_PYTHON):
        return False
    module = sys.modules.get(name)
    file = getattr(module, "__file__", None)
    return file is None or not {"site-packages", "dist-packages"} & {*Path(file).parts}


def _parts(value: Any, seen: dict[int, Any]) -> Iterator[str]:
    """Texts that say all of the user code below a value, each once."""
    if id(value) in seen or isinstance(value, _LEAVES):
        return
    seen[id(value)] = value
    if isinstance(value, MethodType):
        yield from _parts(value.__func__, seen)
        yield from _parts(value.__self__, seen)
    elif isinstance(value, FunctionType):
        yield from _function(value, seen)
    elif isinstance(value, type):
        yield from _class(value, seen)
    elif isinstance(value, partial):
        for inner in (value.func, value.args, value.keywords):
            yield from _parts(inner, seen)
    elif isinstance(value, Mapping):
        for inner in value.values():
            yield from _parts(inner, seen)
    elif isinstance(value, tuple | list | set | frozenset):
        for inner in value:
            yield from _parts(inner, seen)
    elif is_dataclass(value):
        yield from _parts(type(value), seen)
        for f in fields(value):
            yield from _parts(getattr(value, f.name), seen)
    elif _is_users(type(value).__module__):
        yield from _parts(type(value), seen)
        yield from _parts(vars(value) if hasattr(value, "__dict__") else None, seen)


def _function(value: FunctionType, seen: dict[int, Any]) -> Iterator[str]:
    if not _is_users(value.__module__):
        return
    code, names = value.__code__, set(_names(value.__code__))
    used = {n: value.__globals__[n] for n in sorted(names) if n in value.__globals__}
    enclosed = [_content(cell) for cell in value.__closure__ or ()]
    given = [*(value.__defaults__ or ()), *(value.__kwdefaults__ or {}).values()]
    plain = [(n, _plain(v)) for n, v in used.items()]
    values = [_plain(v) for v in (*enclosed, *given)]
    yield f"{value.__qualname__}: {_text(code)}; {plain}; {values}"
    for inner in (*used.values(), *enclosed, *given):
        yield from _parts(inner, seen)


def _class(value: type, seen: dict[int, Any]) -> Iterator[str]:
    for base in value.__bases__:
        yield from _parts(base, seen)
    if not _is_users(value.__module__):
        return
    content = {n: v for n, v in vars(value).items() if n not in _NO_CODE}
    for f in vars(value).get("__dataclass_fields__", {}).values():
        for given in (f.default, f.default_factory):
            if given is not MISSING:
                content[f"field {f.name}"] = given
    yield f"class {value.__qualname__}: {[(n, _plain(v)) for n, v in sorted(content.items())]}"
    for inner in content.values():
        for part in (inner, *(getattr(inner, n, None) for n in ("__func__", "fget", "fset"))):
            yield from _parts(part, seen)


def _content(cell: Any) -> Any:
    try:
        return cell.cell_contents
    except ValueError:  # not assigned yet
        return None


def _plain(value: Any) -> str:
    """The content of a value that is no code, else only its kind."""
    if isinstance(value, np.ndarray | str | bytes | int | float | tuple | list | Mapping):
        return fingerprint(value) if not _holds_code(value) else type(value).__name__
    if is_dataclass(value) and not isinstance(value, type):
        return fingerprint(value) if not _holds_code(value) else type(value).__name__
    return type(value).__name__ if value is not None else "None"


def _holds_code(value: Any) -> bool:
    """Whether functions or classes stand among the values, whose text holds an address."""
    if callable(value) or isinstance(value, ModuleType):
        return True
    if isinstance(value, Mapping):
        return any(map(_holds_code, value.values()))
    if isinstance(value, tuple | list | set | frozenset):
        return any(map(_holds_code, value))
    if is_dataclass(value):
        return any(_holds_code(getattr(value, f.name)) for f in fields(value))
    return False


def _text(code: CodeType) -> str:
    """What a code object does, without where it stands."""
    inner = [_text(c) if isinstance(c, CodeType) else _constant(c) for c in code.co_consts]
    return f"{code.co_code.hex()} {code.co_names} {code.co_varnames} {inner}"


def _constant(value: Any) -> str:
    return repr(sorted(map(repr, value))) if isinstance(value, frozenset) else repr(value)


def _names(code: CodeType) -> Iterator[str]:
    """Names that a code object and those in it read."""
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)
