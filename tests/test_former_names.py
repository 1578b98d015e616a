"""Former names of modules, classes and functions work for one version, with a warning."""

import sys
import warnings
from importlib import import_module

import pytest

from validate.former_names import FORMER, FORMER_MEMBERS, new_name


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
        found = import_module(f"validate.{former}")
    if hasattr(now, "__path__"):
        name = next(n for n in dir(now) if not n.startswith("_"))
        assert getattr(found, name) is getattr(now, name)
    else:
        assert found is now
    assert now.__spec__ is spec
    assert now.__name__ == f"validate.{FORMER[former]}"


def test_an_old_import_hides_no_folder_of_today() -> None:
    """`replay.ladder` is a module of the folder `pipeline.ladder` today."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import_module("validate.replay.ladder")
    assert hasattr(import_module("validate.pipeline").ladder, "__path__")


def test_a_name_that_never_was_is_not_found() -> None:
    with pytest.raises(ModuleNotFoundError):
        import_module("validate.nowhere")


@pytest.mark.parametrize(
    ("module", "former"), [(m, name) for m, names in FORMER_MEMBERS.items() for name in names]
)
def test_a_former_class_is_the_class_of_today(module: str, former: str) -> None:
    found, now = import_module(f"validate.{module}"), FORMER_MEMBERS[module][former]
    with pytest.warns(
        DeprecationWarning, match=rf"validate\.{module}\.{former} is called {now} now"
    ):
        assert getattr(found, former) is getattr(found, now)
    assert former not in vars(found)
    assert former not in dir(found)
    assert new_name(former) == now
    assert new_name(now) == now


def test_a_module_with_former_names_has_no_other_attribute() -> None:
    for module in FORMER_MEMBERS:
        found = import_module(f"validate.{module}")
        with pytest.raises(AttributeError, match=rf"{module}' has no attribute"):
            _ = found.no_such_name
