"""Python library for scripts and notebooks, on the same functions as the commands.

`run` and `open_run` give a `RunResult`, `study` a `StudyResult`: both read the folder that the
command would have written. `docs/how-to/python.md` is the manual; `public_names.toml` lists what is
promised.
"""

from validate.exports import lazily, names

_HOMES = {
    "single_run": ("load", "open_recording", "run"),
    "run_result": ("RunCheck", "RunResult", "open_run"),
    "named_study": ("study",),
    "study_result": ("StudyResult",),
    "comparison": ("RunComparison", "compare"),
}

__all__ = names(_HOMES)
__getattr__ = lazily(__name__, _HOMES)
