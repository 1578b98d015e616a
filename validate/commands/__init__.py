"""Command line: parse, call, print. Heavy libraries load inside the commands."""

__all__ = ["main"]  # the module: `python -m validate` and the console script call its `main`
