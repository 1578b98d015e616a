"""The page of public names: exactly what `__all__` of every package lists, with its docstrings."""

import inspect
import re
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from importlib import import_module
from pkgutil import iter_modules
from types import ModuleType
from typing import Any, get_args

import validate

INTRO = """# Reference

The public names of every package, from the code itself: `from validate.PACKAGE import NAME`.
Other modules may change without a word.
"""


def on_files(files: Any, config: Any) -> Any:
    """mkdocs calls this once the files are known."""
    from mkdocs.structure.files import File

    files.append(File.generated(config, "reference.md", content=page()))
    return files


def page() -> str:
    """The whole page as Markdown."""
    return INTRO + "".join(_package(package) for package in packages())


def packages() -> list[ModuleType]:
    """Every package of the floors, by name."""
    found = [m.name for m in iter_modules(validate.__path__) if m.ispkg]
    return [import_module(f"validate.{name}") for name in sorted(found)]


def public(package: ModuleType) -> Iterator[tuple[str, Any]]:
    """The names of `__all__` with what they stand for; names of modules stand for those."""
    for name in package.__all__:
        is_module = not hasattr(package, name) or inspect.ismodule(getattr(package, name))
        path = f"{package.__name__}.{name}"
        yield name, import_module(path) if is_module else getattr(package, name)


def _package(package: ModuleType) -> str:
    entries = "".join(_entry(name, thing) for name, thing in public(package))
    return f"\n## {package.__name__}\n{_block(package.__doc__)}{entries}"


def _entry(name: str, thing: Any) -> str:
    return f"\n### {name}\n{_block(_signature(name, thing), 'python')}{_block(_doc(thing))}"


def _signature(name: str, thing: Any) -> str:
    if is_dataclass(thing):
        lines = [f"    {f.name}: {_type(f.type)}" for f in fields(thing)]
        return "\n".join([f"class {name}:", *lines])
    if inspect.isclass(thing):
        return f"class {name}"
    if inspect.isfunction(thing):
        return f"def {name}{_plain(str(inspect.signature(thing)))}"
    return f"{name}  # {type(thing).__name__}"


def _type(annotation: Any) -> str:
    plain_class = inspect.isclass(annotation) and not get_args(annotation)
    return annotation.__name__ if plain_class else _plain(str(annotation))


def _plain(text: str) -> str:
    """Types as the code writes them: Floats for an array of float64, no paths of modules."""
    for name, dtype in (("Floats", "float64"), ("Ints", "int64")):
        text = re.sub(rf"numpy\.ndarray\[[^\]]*\], numpy\.dtype\[numpy\.{dtype}\]\]", name, text)
    return re.sub(r"\b(?:[a-z_]\w*\.)+(?=[A-Za-z_])", "", text)


def _doc(thing: Any) -> str:
    """Its own docstring; tuples list what they hold."""
    if isinstance(thing, tuple):
        return ", ".join(getattr(t, "__name__", None) or t.name for t in thing)
    return inspect.getdoc(thing) or ""


def _block(text: str | None, language: str = "text") -> str:
    return f"\n```{language}\n{text.strip()}\n```\n" if text else ""
