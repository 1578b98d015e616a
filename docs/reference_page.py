"""The public API of docs/reference/api.md: exactly what validate/library/public_names.toml lists.

`python docs/reference_page.py --write` stores the signatures after a change of the API.
"""

import inspect
import re
import sys
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, get_args

from numpy.typing import ArrayLike

from validate.plugins import Registry

ROOT = Path(__file__).resolve().parents[1]
NAMES = ROOT / "validate" / "library" / "public_names.toml"
BAR = "\\|"  # in a cell of a table
SIGNATURES = ROOT / "tests" / "docs" / "public_signatures.txt"


@cache
def _listed() -> Mapping[str, Any]:
    return tomllib.loads(NAMES.read_text("utf-8"))


def version() -> int:
    """The version of the public API."""
    return int(_listed()["version"])


def sections() -> dict[str, dict[str, list[str]]]:
    """Names by section and module."""
    return {title: part for title, part in _listed().items() if isinstance(part, dict)}


def public() -> Iterator[tuple[str, str]]:
    """Module and name of every public thing."""
    for part in sections().values():
        for module, names in part.items():
            yield from ((module, name) for name in names)


def thing(module: str, name: str) -> Any:
    """What a listed name stands for; of a package that is also a function, the function."""
    if module == "validate":
        return getattr(import_module("validate.library"), name)
    return getattr(import_module(module), name)


def page() -> str:
    """Return all names as Markdown."""
    text = f"The public API, version {version()}: {len(list(public()))} names.\n"
    for title, part in sections().items():
        text += f"\n## {title}\n"
        for module, names_ in part.items():
            text += f"\n### {module}\n"
            text += "".join(_entry(name, thing(module, name)) for name in names_)
    return text


def _entry(name: str, what: Any) -> str:
    members = "".join(f"\n- `.{member}`: {_first(doc)}" for member, _, doc in _members(what) if doc)
    return (
        f"\n#### {name}\n{_block(_signature(name, what), 'python')}\n{prose(_doc(what))}\n"
        f"{members}{chr(10) if members else ''}"
    )


def _signature(name: str, what: Any) -> str:
    if is_dataclass(what) and inspect.isclass(what):
        lines = [f"    {f.name}: {type_text(f.type)}" for f in fields(what)]
        return "\n".join([f"class {name}:", *lines])
    if inspect.isclass(what):
        return f"class {name}"
    if inspect.isfunction(what):
        return f"def {name}{_plain(str(inspect.signature(what)))}"
    return f"{name}  # {type(what).__name__}"


def _members(what: Any) -> Iterator[tuple[str, Any, str]]:
    """Public methods and properties that a class itself defines, with their docstrings."""
    for name, member in sorted(vars(what).items()) if inspect.isclass(what) else ():
        if not name.startswith("_") and isinstance(member, property | classmethod | staticmethod):
            inner = member.fget if isinstance(member, property) else member.__func__
            yield name, member, inspect.getdoc(inner) or ""
        elif not name.startswith("_") and inspect.isfunction(member):
            yield name, member, inspect.getdoc(member) or ""


# --- signatures -----------------------------------------------------------------------------------


def signatures() -> str:
    """One line a name, then one a public member: what a caller may rely on."""
    lines = [f"version {version()}"]
    for module, name in sorted(public()):
        what = thing(module, name)
        lines.append(f"{module}.{name}{_call(what)}")
        for member, value, _ in _members(what):
            lines.append(f"{module}.{name}.{member}{_call(value)}")
    return "\n".join(lines) + "\n"


def _call(what: Any) -> str:
    """Names, types and order of what is given; a value that may be left out has " = ..."."""
    if isinstance(what, property):
        return f": {_returned(what.fget)}"
    function = what.__func__ if isinstance(what, classmethod | staticmethod) else what
    if inspect.isclass(what) and not is_dataclass(what):
        return ": class"
    if not (inspect.isclass(what) or inspect.isroutine(function)):
        return f": {type(what).__name__}"
    marks = {"KEYWORD_ONLY": "", "VAR_POSITIONAL": "*", "VAR_KEYWORD": "**"}
    parts, starred = [], False
    for p in inspect.signature(function).parameters.values():
        if p.kind.name == "KEYWORD_ONLY" and not starred:
            parts.append("*")
        starred |= p.kind.name in ("KEYWORD_ONLY", "VAR_POSITIONAL")
        given = "" if p.annotation is p.empty else f": {type_text(p.annotation)}"
        default = "" if p.default is p.empty else " = ..."
        parts.append(f"{marks.get(p.kind.name, '')}{p.name}{given}{default}")
    ends = "" if inspect.isclass(what) else f" -> {_returned(function)}"
    return f"({', '.join(parts)}){ends}"


def _returned(function: Any) -> str:
    found = inspect.signature(function).return_annotation
    return "None" if found is None else type_text(found)


def type_text(annotation: Any) -> str:
    """Return a type as the code writes it, without modules."""
    plain_class = inspect.isclass(annotation) and not get_args(annotation)
    return annotation.__name__ if plain_class else _plain(str(annotation)).replace("'", "")


def _plain(text: str) -> str:
    """Types as the code writes them: Floats for an array of float64, no paths of modules."""
    for name, dtype in (("Floats", "float64"), ("Ints", "int64")):
        text = re.sub(rf"numpy\.ndarray\[[^\]]*\], numpy\.dtype\[numpy\.{dtype}\]\]", name, text)
    text = re.sub(r" at 0x[0-9a-f]+", "", text)
    text = re.sub(r"\*<class '([\w.]+)'>", r"Unpack[\1]", text)
    text = re.sub(r"<class '([\w.]+)'>", r"\1", text).replace(str(ArrayLike), "ArrayLike")
    return re.sub(r"\b(?:[a-z_]\w*\.)+(?=[A-Za-z_])", "", text)


# --- docstrings -----------------------------------------------------------------------------------


def _doc(what: Any) -> str:
    """Its own docstring; tuples and registries list what they hold."""
    if isinstance(what, tuple | Registry):
        return ", ".join(getattr(t, "__name__", None) or t.name for t in what)
    return inspect.getdoc(what) or ""


def prose(doc: str) -> str:
    """Return a docstring as Markdown: paragraphs, and blocks of what it indents or lists."""
    parts = []
    for part in doc.split("\n\n"):
        if re.search(r"^(?:\s|[-*] |\w+  )", part, re.MULTILINE):
            parts.append(f"```text\n{part}\n```")
        else:
            pieces = re.split(r"(`[^`]*`)", " ".join(part.split()))
            plain = (re.sub(r"([\\*_<>\[\]$#|])", r"\\\1", piece) for piece in pieces[::2])
            pieces[::2] = plain
            parts.append("".join(pieces))
    return "\n\n".join(parts)


def _first(doc: str) -> str:
    """The first sentence."""
    return " ".join(doc.split("\n\n")[0].split()).replace("|", BAR)


def _block(text: str | None, language: str = "text") -> str:
    return f"\n```{language}\n{text.strip()}\n```\n" if text else ""


if __name__ == "__main__" and sys.argv[1:] == ["--write"]:
    SIGNATURES.write_text(signatures(), "utf-8")
