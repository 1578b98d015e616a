"""`python -P -m validate`: the command, without the current folder on Python's path.

`python -m validate` puts the current folder first on the path, so that a `json.py` that lies beside
a recording would be run. It is refused where a file of the current folder would be imported.
"""

import sys
from importlib.machinery import PathFinder, all_suffixes
from pathlib import Path


def shadowing(folder: Path, path: list[str]) -> list[str]:
    """Return the names in `folder` that would be imported in place of modules found on `path`."""
    found = []
    for entry in sorted(folder.iterdir()):
        name = entry.name.split(".")[0]
        if entry.is_dir() and not (entry / "__init__.py").is_file():
            continue  # a folder without it never hides a module
        if entry.is_file() and not entry.name.endswith(tuple(all_suffixes())):
            continue
        if name in sys.builtin_module_names:
            continue
        other = PathFinder.find_spec(name, path)
        if name in sys.stdlib_module_names or (
            other is not None and other.origin and Path(other.origin).parent not in (folder, entry)
        ):
            found.append(entry.name)
    return found


if __name__ == "__main__":
    here = Path.cwd()
    if not sys.flags.safe_path:
        rest = [p for p in sys.path if p and Path(p).resolve() != here.resolve()]
        if hidden := shadowing(here, rest):
            names = ", ".join(hidden[:3])
            print(
                f"validate: {names} in {here} would be imported in place of Python's or a "
                "library's own; run 'validate', or 'python -P -m validate'",
                file=sys.stderr,
            )
            raise SystemExit(2)
    from validate.cli.main import main

    main()
