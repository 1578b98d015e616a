"""What an experiment gives its methods, and what a wider specimen means."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from machine_logs import machine_log, pressed_cylinder

from validate.compare.verdict import Accept
from validate.errors import ComparisonError, SceneError, UsageError
from validate.parameters import with_values
from validate.pipeline.calibration import calibrated
from validate.pipeline.checks import checks
from validate.pipeline.experiment.experiment import Variant
from validate.pipeline.experiment.find import _executed, load_file
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.options import folder_of
from validate.pipeline.ladder import default as ladder_default
from validate.pipeline.ladder.ladder import Turned
from validate.pipeline.live import prepared as prepared_live
from validate.pipeline.live.live_recording import as_given
from validate.pipeline.plates import inclusion
from validate.pipeline.plates import outline as pressed_outline
from validate.pipeline.plates.compression import compression
from validate.pipeline.plates.outline import PressedOutline
from validate.pipeline.plates.scene import Compression, CompressionRanges
from validate.pipeline.run import twin_record
from validate.pipeline.run.method_run import MethodRun
from validate.recording.types import Recording, Source
from validate.scene.laws import Coefficients
from validate.scene.material import Material
from validate.scene.meshless import Meshless
from validate.solve.dynamic.newmark import Newmark
from validate.solve.fluid.cavities import NoFluid
from validate.solve.static.load_table import Tabulated
from validate.solve.static.newton import StaticNewton
from validate.study.identify import study as identify_study

# private: _executed, _instants, _number, _on_all, _size_of, _solved, _touched_levels:
#   called alone, case by case.


@pytest.mark.parametrize("stride", [1, 3])
def test_a_long_step_is_so_many_of_the_recordings(stride: int) -> None:
    assert Method("m", Newmark(), stride=stride).given({"dt": 0.01}).dt == stride * 0.01


def test_a_wider_specimen_is_as_much_stiffer_as_its_area_is_larger() -> None:
    settings = Compression(ranges=CompressionRanges(diameter=0.1))
    card = pressed_cylinder(None, None, 10e3, settings=settings)
    methods = {"slip": Method("slip", NoFluid())}
    made = compression("c", "", "", card, methods, ("slip",), (Accept("force", 1.0, ""),))
    assert made.uncertainty is not None
    inputs = {i.name: i.by(1.0)(card).scene.material.E for i in made.uncertainty.inputs}
    assert inputs["diameter"] == pytest.approx(10e3 * 1.1**2)
    assert inputs["modulus"] == pytest.approx(10e3 * 1.05)


def test_coefficients_reach_the_methods_whose_law_knows_them() -> None:
    bare = pressed_cylinder(0.03, 0.02, 10e3)
    bare = bare.with_scene(material=bare.scene.material.of_law("mooney_rivlin"))
    card = with_values(bare, {"material.C01": "500"})
    table = Tabulated(StaticNewton("none"))
    methods = {
        "slip": Method("slip", NoFluid(), {"material.law": "linear"}),
        "soft": Method("mooney", table),
    }
    made = compression("c", "", "", card, methods, ("slip",), (Accept("force", 1.0, ""),))
    recording = Recording("r", Source("x", "", 0, "x"), 0)
    scenes = {n: made.build(recording, card, m.scene) for n, m in methods.items()}
    assert scenes["soft"].material.coefficients.C01 == 500.0
    assert scenes["slip"].material.coefficients == Coefficients()
    assert made.identify is not None
    assert made.identify((), card, methods).parameters == card
    with pytest.raises(UsageError, match=r"material.C01 = 500.0.* only linear; set"):
        made.identify((), card, {"slip": methods["slip"]})


def test_one_model_of_two_materials_has_no_modulus_of_its_own() -> None:
    card = pressed_cylinder(0.03, 0.02)
    stiff = {"material.nu": 0.4}
    methods = {"slip": Method("slip", NoFluid()), "other": Method("other", NoFluid(), stiff)}
    made = compression("c", "", "", card, methods, ("slip",), (Accept("force", 1.0, ""),))
    t = np.linspace(0.0, 10.0, 101)
    seen = machine_log(t, 2e-4 * t, t)
    assert made.identify is not None
    with pytest.raises(UsageError, match=r"other: another .* set methods\.other"):
        made.identify((seen,), card, methods)


def test_a_setting_that_the_experiment_gives_is_not_the_methods_to_change() -> None:
    """The time step is neither the default nor the one that the experiment gives."""
    plain = Method("m", Newmark())
    with pytest.raises(
        UsageError,
        match=r"dt = 0.5 of 'm': the experiment sets",
    ):
        Method("m", Newmark(dt=0.5)).given({"dt": 0.01})
    assert plain.given({"dt": 0.01, "colour": 3}).dt == 0.01


def test_a_declared_step_gives_way_to_the_clocks() -> None:
    """`needle_block` declares its methods with the paper's step: `clock.dt` was refused."""
    declared = Method("m", Newmark(dt=1 / 30))
    assert declared.given({"dt": 0.02}, declared).dt == 0.02
    own = Method("m", Newmark(dt=0.5))
    with pytest.raises(UsageError, match=r"dt = 0.5 of 'm'.*sets 0.02"):
        own.given({"dt": 0.02}, declared)


@pytest.mark.parametrize(
    ("call", "error", "says"),
    [
        (
            lambda: identify_study.asked(bare(), Newmark()),
            UsageError,
            "x declares no calibration; name parameters with their bounds: --parameters PATH=LOW:",
        ),
        (
            lambda: identify_study._on_all(bare(accept=(), accepted=(), methods={"m": None}), ()),
            UsageError,
            "x has no accepted methods: declare a calibration in its file",
        ),
        (
            lambda: calibrated.problem_of(
                bare(calibrations=(SimpleNamespace(method="fine"),)), 0, (), None, {"m": None}, ()
            ),
            UsageError,
            "calibration by 'fine': unknown method; expected one of m",
        ),
        (
            lambda: _executed(Path("x.unknown")),
            UsageError,
            "x.unknown cannot be loaded as Python",
        ),
        (
            lambda: Turned.of(Material(1.0, 0.3), 4),
            SceneError,
            "a motion needs a density; set the material's rho, kg/m3",
        ),
        (
            lambda: PressedOutline(holds=0),
            UsageError,
            r"outline: holds 0 \(1 to 50\), sd .* \(0 or above\)",
        ),
        (
            lambda: PressedOutline(holds=3, sd=-1e-3),
            UsageError,
            r"outline: holds 3 \(1 to 50\), sd -0.001 \(0 or above\)",
        ),
    ],
)
def test_what_an_experiment_lacks_is_refused(call: object, error: type, says: str) -> None:
    with pytest.raises(error, match=says):
        call()  # type: ignore[operator]


def bare(**parts: object) -> SimpleNamespace:
    return SimpleNamespace(**{"name": "x", "calibrations": (), "methods": {}, **parts})


def test_a_run_without_a_mesh_has_no_body() -> None:
    meshless = Meshless.__new__(Meshless)
    with pytest.raises(SceneError, match="'law' was run on a scene without a mesh"):
        MethodRun.body.__get__(SimpleNamespace(scene=meshless, label="law"))


def test_a_mesh_too_coarse_is_left_out_unless_it_is_the_methods_own() -> None:
    def refuse(variant: object) -> None:
        raise SceneError("a hole without a node")

    runs = SimpleNamespace(varied=refuse)
    own, other = Variant("m"), Variant("m", split=2)
    assert checks._solved(runs, other) is None  # type: ignore[arg-type]
    with pytest.raises(SceneError, match="a hole without a node"):
        checks._solved(runs, own)  # type: ignore[arg-type]


def test_an_inclusion_without_loads_compares_nothing() -> None:
    with pytest.raises(ComparisonError, match="no loads: nothing can be compared; set"):
        inclusion.InclusionTest.place(None, None, None, (), ())  # type: ignore[arg-type]


def test_what_was_not_loaded_or_recorded_by_a_twin_is_refused() -> None:
    with pytest.raises(ComparisonError, match="experiment 'x' was not loaded from"):
        folder_of(bare(path=None))  # type: ignore[arg-type]
    with pytest.raises(ComparisonError, match="experiment 'x' has no twin"):
        as_given(bare(twin=None), SimpleNamespace(metadata={"live": {}}))  # type: ignore[arg-type]
    with pytest.raises(UsageError, match=r"unknown method 'hold'; .*held"):
        prepared_live(bare(methods={"held": None}, accepted=("held",)), None, "hold")  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="--parameters mass"):
        identify_study._number(Newmark(), "mass", "lumped")


def test_parameters_of_a_twin_that_the_recording_does_not_know_are_refused() -> None:
    recording = Recording("r", Source("r", "", 0, ""), 0)
    twin_record.require_known(recording, Newmark(dt=0.5), Newmark(), ("dt",), ("dt",))
    with pytest.raises(UsageError, match=r"r: --set dt=.*would have no effect"):
        twin_record.require_known(recording, Newmark(dt=0.5), Newmark(), ("dt",))


def test_a_ladder_that_cannot_be_refined_is_refused() -> None:
    mesh = SimpleNamespace(nodes=np.zeros((4, 3)))
    own = SimpleNamespace(
        experiment=bare(), scene=SimpleNamespace(mesh=mesh), levels=lambda wanted: (1,)
    )
    with pytest.raises(UsageError, match="'x' has 12 unknowns"):
        ladder_default._touched_levels(own, 100)  # type: ignore[arg-type]


@pytest.mark.parametrize(("sizes", "refused"), [((1.0, 1.0, 1.0), True), ((1.0, 2.0, 4.0), False)])
def test_meshes_differ_in_size(sizes: tuple[float, ...], refused: bool) -> None:
    def change(size: float) -> SimpleNamespace:
        return SimpleNamespace(change=lambda parameters: size)

    mesh = SimpleNamespace(size=lambda size: size)
    own = SimpleNamespace(_uncertainty=SimpleNamespace(mesh=mesh))
    runs = SimpleNamespace(parameters=None)
    found = {"mesh": [change(size) for size in sizes]}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(checks, "variants", lambda *_: found)
        if refused:
            with pytest.raises(ComparisonError, match="mesh: sizes 1, 1, 1; u_num"):
                checks.Refined._size_of(own, "mesh", runs, "fine")  # type: ignore[arg-type]
        else:
            sizes_found = checks.Refined._size_of(own, "mesh", runs, "fine")  # type: ignore[arg-type]
            assert sizes_found == [1.0, 2.0, 4.0]


def test_a_body_that_does_not_move_between_its_outlines_is_refused() -> None:
    t = np.arange(5.0)
    contours = SimpleNamespace(t=t)
    stage = SimpleNamespace(t=t, y=np.zeros((5, 1)), name="stage")
    card = PressedOutline(holds=2)
    with pytest.raises(ComparisonError, match="the body does not move between"):
        pressed_outline._instants(contours, stage, card)  # type: ignore[arg-type]
    rising = SimpleNamespace(t=t, y=t[:, None], name="stage")
    times, moved = pressed_outline._instants(contours, rising, card)  # type: ignore[arg-type]
    assert (times.tolist(), moved.tolist()) == ([0.0, 2.0, 4.0], [0.0, 2.0, 4.0])


def test_an_experiment_is_named_as_its_file(tmp_path: Path) -> None:
    head = "from validate.pipeline.experiment.experiment import Experiment\n"
    (tmp_path / "other.py").write_text(f"{head}EXPERIMENT = Experiment('bar', 'A bar', 'made')\n")
    with pytest.raises(UsageError, match=r"EXPERIMENT.name is 'bar'"):
        load_file(tmp_path / "other.py")
