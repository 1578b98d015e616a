"""A method's law decides its solver where a user sets another one."""

import pytest

from validate.cli.listing import parameters_of
from validate.errors import UsageError
from validate.replay.compression import pressed
from validate.replay.experiment import Experiment
from validate.replay.law_solver import with_laws
from validate.replay.options import Options, all_methods
from validate.solve.fluid import NoFluid
from validate.solve.newton import StaticNewton
from validate.solve.tabulated import Tabulated


def test_a_static_method_takes_the_solver_of_its_law() -> None:
    declared = {"slip": pressed("slip"), "neo": pressed("neo", law="neo_hooke")}
    methods, rest = with_laws(declared, {"slip.law": "svk", "neo.law": "linear", "neo.order": "1"})
    assert methods["slip"].scene.law == "svk"
    assert isinstance(methods["slip"].settings, Tabulated)
    assert isinstance(methods["neo"].settings, NoFluid)
    assert rest == {"neo.order": "1"}


def test_newton_where_no_other_method_solves_the_law() -> None:
    methods, _ = with_laws({"slip": pressed("slip")}, {"slip.law": "neo_hooke"})
    assert isinstance(methods["slip"].settings, StaticNewton)


def test_a_scheme_of_one_law_lists_and_takes_no_other(phantom: Experiment) -> None:
    listed = {p.path: p.type for p in parameters_of(phantom)}
    assert listed["methods.p1_loop.law"] == "linear"
    refusal = r"methods\.p1_loop\.law=svk: PressureLoop solves linear; "
    with pytest.raises(UsageError, match=refusal):
        all_methods(phantom, Options({"methods.p1_loop.law": "svk"}))
