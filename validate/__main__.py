"""Entry point of `python -P -m validate`, without the current folder on Python's path.

`python -m validate` puts the current folder first on the path, so that a `json.py` that lies beside
a recording would be run. It is refused where a file of the current folder would be imported.
"""

# Only what Python has loaded by itself is imported before the check: the rest may be shadowed.
import os
import sys
from importlib.machinery import PathFinder, all_suffixes


def shadowing(folder: str, path: list[str]) -> list[str]:
    """Return the names in `folder` that would be imported in place of modules found on `path`."""
    found = []
    for entry in sorted(os.scandir(folder), key=lambda e: e.name):
        name = entry.name.partition(".")[0]
        module = entry.name.endswith(tuple(all_suffixes()))
        package = entry.is_dir() and os.path.exists(os.path.join(entry.path, "__init__.py"))  # noqa: PTH110, PTH118
        if not (module or package) or name in sys.builtin_module_names:
            continue
        other = PathFinder.find_spec(name, path)
        theirs = os.path.realpath(other.origin) if other is not None and other.origin else ""
        if theirs and not theirs.startswith(os.path.join(os.path.realpath(folder), "")):  # noqa: PTH118
            found.append(entry.name)
    return found


def _require_plain_folder() -> None:
    here = os.getcwd()  # noqa: PTH109
    rest = [p for p in sys.path if p and os.path.realpath(p) != os.path.realpath(here)]
    if not sys.flags.safe_path and (hidden := shadowing(here, rest)):
        print(
            f"validate: {', '.join(hidden[:3])} in {here} would replace modules of Python or of a "
            f"library; run 'validate', or 'python -P -m validate'",
            file=sys.stderr,
        )
        raise SystemExit(2)


if __name__ == "__main__":
    _require_plain_folder()
    from validate.commands.main import main

    main()
