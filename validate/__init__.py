"""Validation of real-time soft-tissue simulation against recordings of experiments.

    import validate

    result = validate.run("kf_cube", {"material.E": "14 kPa"}, quick=True)
    result.plot.limits()

Conventions, one page:

- One pipeline: recording -> scene -> registration -> system -> run -> comparison -> report. Lower
  layers never import upper ones; everything that flows is a frozen dataclass.
- SI inside; reports show mm, kPa, N. Every field, column and axis has a unit.
- Unknowns are node-major: x0 y0 z0 x1 ... Quadratic meshes list vertices first, then edge nodes.
- Compression, plate force and closing displacement are positive. Pressure is gauge. A pressure's
  load is f_p = dV/dx, the normal pointing from the fluid into the solid.
- Transforms are named T_target_from_source and act on column vectors.
- Letters of the equations inside formula files, words at interfaces. K stiffness, E modulus
  (error in `compare.verdict`), nu Poisson ratio, u displacement, P pressure, V volume, R rotation
  in `register`.
- *measured* is a recording; *reference* is a finer or more exact model; never one for the other.
"""

import sys
from types import ModuleType

TYPE_CHECKING = False  # as typing has it, which is not loaded here: every command imports this
if TYPE_CHECKING:
    from validate.library.comparison import compare
    from validate.library.named_study import study
    from validate.library.run_result import open_run
    from validate.library.single_run import load, open_recording, run

__version__ = "0.1.0"
__all__ = ["compare", "load", "open_recording", "open_run", "run", "study"]

_LIBRARY = "validate.library"
_PACKAGES = ("compare", "study")  # names of functions and of packages


class _CallablePackage(ModuleType):
    """A package that is also the function of its name: `validate.compare(a, b)`."""

    def __call__(self, *given: object, **named: object) -> object:
        return _function(self)(*given, **named)  # type: ignore[operator]

    @property
    def __signature__(self) -> object:
        from inspect import signature

        return signature(_function(self))  # type: ignore[arg-type]


class _Validate(ModuleType):
    """This package; the import of `validate.compare` or `validate.study` makes it callable."""

    def __setattr__(self, name: str, value: object) -> None:
        if name in _PACKAGES and type(value) is ModuleType:
            value.__class__ = _CallablePackage
        super().__setattr__(name, value)


def _function(package: ModuleType) -> object:
    return getattr(_module(_LIBRARY), package.__name__.rpartition(".")[2])


def _module(name: str) -> ModuleType:
    from importlib import import_module

    return import_module(name)


def __getattr__(name: str) -> object:
    """The functions of the library, loaded when they are first asked for."""
    if name in _PACKAGES:
        return _module(f"{__name__}.{name}")
    if name in __all__:
        return getattr(_module(_LIBRARY), name)
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def _former_names() -> None:
    """Old imports of public modules work for one version."""
    from validate.former_names import install

    install()


sys.modules[__name__].__class__ = _Validate
_former_names()
