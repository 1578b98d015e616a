"""Child processes that lack a library, as on a machine where it is not installed."""

from collections.abc import Callable

from validate.child_process import ROOT, python


def lacking(library: str) -> Callable[..., list[str]]:
    """What stands in for `python_module`: the same, without that library."""

    def command(module: str, *arguments: str) -> list[str]:
        start = (
            f"import runpy, sys; sys.modules[{library!r}] = None; sys.path.append({ROOT!r}); "
            f"runpy.run_module({module!r}, run_name='__main__', alter_sys=True)"
        )
        return python("-c", start, *arguments)

    return command
