"""Every scheme and filter of the registries can be chosen for some body in motion, or a reason says
why it cannot."""

from typing import get_args

import pytest

from validate.commands.questions.motion import _ORDER, _USUAL, NOT_OFFERED
from validate.estimate.filters import FILTERS
from validate.pipeline.bodies.body_dynamics import METHODS, MovingName, fits_motion
from validate.scene.material import LawName
from validate.solve.schemes import SCHEMES

# private: _ORDER, _USUAL: must name every method that a user may choose.

KINDS = ("moves", "follows", "pulls", "weighs", "releases")


@pytest.mark.parametrize("kind", [*SCHEMES, *FILTERS], ids=lambda kind: kind.__name__)
def test_a_registered_method_is_offered_or_has_a_reason(kind: type) -> None:
    names = [name for name, (settings, _) in METHODS.items() if type(settings) is kind]
    offered = [
        name
        for name in names
        for law in get_args(LawName)
        for drive in KINDS
        if fits_motion(name, law, drive, preloaded=False, measured=True)
    ]
    assert bool(offered) != (kind.__name__ in NOT_OFFERED)


def test_every_name_has_its_place_in_a_file() -> None:
    assert set(_ORDER) == set(METHODS) == set(get_args(MovingName))
    assert set(_USUAL) <= set(_ORDER)


def test_filters_need_measurements_and_their_kind_of_load() -> None:
    for name in ("roukf", "filterpy", "load_scale"):
        assert fits_motion(name, "linear", "pulls", preloaded=False, measured=True)
        assert not fits_motion(name, "linear", "pulls", preloaded=False, measured=False)
        assert not fits_motion(name, "linear", "moves", preloaded=False, measured=True)
    assert fits_motion("reduced_ekf", "neo_hooke", "pulls", preloaded=False, measured=True)
    assert not fits_motion("reduced_ekf", "neo_hooke", "releases", preloaded=True, measured=True)
