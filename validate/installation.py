"""Installation of the package, and the command that installs missing dependencies."""

import json
import shlex
import sys
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import unquote, urlsplit

NAME = "validate-tissue"
_ROOT = Path(__file__).resolve().parents[1]


def install_command(extra: str = "") -> str:
    """Return the command that installs what this package, or one of its extras, needs.

    It is for this interpreter and for the place that the package was installed from. Where that is
    no folder, the libraries are named: the package's own name is never asked of an index.
    """
    try:
        found = distribution(NAME)
    except PackageNotFoundError:  # run from a clone that nobody installed
        return f"{_installer()} -e {_argument(_ROOT, extra)}"
    origin = json.loads(found.read_text("direct_url.json") or "{}")
    url = urlsplit(str(origin.get("url", "")))
    if url.scheme != "file" or "dir_info" not in origin:
        return f"{_installer()} {_libraries(found, extra)}"
    edit = "-e " if origin["dir_info"].get("editable") else ""
    return f"{_installer()} {edit}{_argument(Path(unquote(url.path)), extra)}"


def _installer() -> str:
    """Pip of this interpreter, or uv where it has none."""
    python = Path(sys.executable)
    if find_spec("pip") is None:
        return f"uv pip install --python {_short(python)}"
    pip = python.with_name("pip")
    return f"{_short(pip)} install" if pip.is_file() else f"{_short(python)} -m pip install"


def _short(path: Path) -> str:
    """The path from the current folder where it lies below."""
    here = Path.cwd()
    return shlex.quote(str(path.relative_to(here) if path.is_relative_to(here) else path))


def _argument(folder: Path, extra: str) -> str:
    place = "." if folder == Path.cwd() else str(folder)
    return f'"{place}[{extra}]"' if extra else shlex.quote(place)


def _libraries(found: Distribution, extra: str) -> str:
    """The requirements of an extra, or those that are always needed."""
    wanted = f"extra == '{extra}'" if extra else ""
    stated = (line.partition(";") for line in found.requires or ())
    return " ".join(
        f'"{name.strip()}"'
        for name, _, marker in stated
        if marker.strip().replace('"', "'") == wanted
    )
