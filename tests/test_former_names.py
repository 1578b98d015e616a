"""Old imports of public modules work for one version, with a warning that names the new one."""

import sys
import warnings
from importlib import import_module

import pytest

from validate.former_names import FORMER


@pytest.mark.parametrize("former", sorted(FORMER))
def test_a_former_name_is_the_module_of_today(former: str) -> None:
    now = import_module(f"validate.{FORMER[former]}")
    spec = now.__spec__
    for name in [m for m in sys.modules if m == f"validate.{former}"]:
        del sys.modules[name]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the packages above
        for i in range(1, former.count(".") + 1):
            import_module(".".join(["validate", *former.split(".")[:i]]))
    with pytest.warns(DeprecationWarning, match=f" is called {now.__name__} now"):
        assert import_module(f"validate.{former}") is now
    assert now.__spec__ is spec
    assert now.__name__ == f"validate.{FORMER[former]}"


def test_a_name_that_never_was_is_not_found() -> None:
    with pytest.raises(ModuleNotFoundError):
        import_module("validate.nowhere")
