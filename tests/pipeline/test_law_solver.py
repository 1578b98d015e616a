"""A method's law decides its solver where a user sets another one."""

from dataclasses import replace

import pytest

from validate.errors import UsageError
from validate.pipeline.bodies.measured import solid
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.options import Options, all_methods, laws_of, with_law
from validate.scene.material import LawName
from validate.solve.fluid.cavities import NoFluid
from validate.solve.fluid.pressure_loop import PressureLoop
from validate.solve.static.load_table import Tabulated
from validate.solve.static.newton import StaticNewton


def pressed(label: str, law: LawName = "linear") -> Method:
    settings = NoFluid() if law == "linear" else Tabulated(StaticNewton("none"))
    return replace(solid(label, law), settings=settings)


def test_a_static_method_takes_the_solver_of_its_law() -> None:
    declared = {"slip": pressed("slip"), "neo": pressed("neo", law="neo_hooke")}
    large = with_law("slip", declared["slip"], "svk", declared)
    assert isinstance(large.settings, Tabulated)
    assert isinstance(with_law("neo", declared["neo"], "linear", declared).settings, NoFluid)


def test_newton_where_no_other_method_solves_the_law() -> None:
    alone = pressed("slip")
    large = with_law("slip", alone, "neo_hooke", {"slip": alone})
    assert isinstance(large.settings, StaticNewton)


def test_a_scheme_of_one_law_lists_and_takes_no_other(phantom: Experiment) -> None:
    loop = replace(pressed("loop"), settings=PressureLoop())
    assert laws_of(loop) == ("linear",)
    with pytest.raises(UsageError, match=r"methods\.loop\.material\.law=svk"):
        with_law("loop", loop, "svk", {"loop": loop})
    refusal = r"methods\.p1_loop\.material\.law=svk: PressureLoop solves linear; "
    with pytest.raises(UsageError, match=refusal):
        all_methods(phantom, Options({"methods.p1_loop.material.law": "svk"}))


def test_a_method_of_a_declared_scene_takes_the_solver_of_its_law(phantom: Experiment) -> None:
    path = "methods.md_fluid.material.law"
    large = all_methods(phantom, Options({path: "neo_hooke"}))["md_fluid"]
    assert large.scene["material.law"] == "neo_hooke"
    assert isinstance(large.settings, StaticNewton)
    same = all_methods(phantom, Options({path: "linear"}))["md_fluid"]
    assert same.settings == phantom.methods["md_fluid"].settings
