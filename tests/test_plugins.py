"""Plug-ins: a package that is installed adds its parts; a broken one costs a line, no command."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, make_dataclass, replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from command_line import here

from validate.errors import SceneError, UsageError
from validate.fem.laws.law import NeoHooke, stiffened
from validate.fem.system import build
from validate.parameters import quantity, with_values
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.options import laws_of
from validate.plugins import KINDS, PlugIn, Registry
from validate.recording.readers import READERS
from validate.scene import laws
from validate.scene.laws import LAWS, Coefficients, LawKind
from validate.scene.material import Material
from validate.solve import schemes
from validate.solve.dynamic.newmark import Newmark
from validate.solve.explicit.central import CentralDifference
from validate.solve.external.program import SIMULATORS, simulator_of, words
from validate.solve.static.newton import StaticNewton
from validate.solve.study_entries import Stepping
from validate.testing import refusal
from validate.testing.schemes import block

# private: _added: plug-ins of the test are taken out again.

VERSION = "0.3.1"
LOG = "# gauge\n" + "".join(f"{i / 10} {i / 5} {1000 * i}\n" for i in range(30))

POINTS = "time (s),tip_x (mm),tip_y (mm),tip_z (mm)\n0,1,2,3\n1,2,3,4\n"


PLATES = """
experiment = "plates"
body = {diameter = "30mm", height = "20mm"}
accept = {force = "0.1N"}
why = {force = "felt"}
"""
BODY = """
experiment = "body"
body = {shape = "block", block = "30mm,30mm,20mm"}
material.E = "20kPa"
material.nu = 0.3
moved = {by = "displacement", along = "-z", place = "zmax", sideways = false}
held = {x = "xmin", y = "ymin", z = "zmin"}
accept = {force = "50mN"}
why = {force = "felt"}
ranges = {E = "2%", nu = 0.01, load = 0.01}
"""


@pytest.fixture(scope="module")
def site(project_root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder that the demonstration package is installed into, without any download."""
    folder = tmp_path_factory.mktemp("site")
    python = Path(sys.executable)
    uv = ["uv", "pip", "install", "--python", str(python)]
    install = [str(python), "-m", "pip", "install"] if find_spec("pip") else uv
    subprocess.run(
        [*install, "--quiet", "--no-index", "--no-deps", "--no-build-isolation", "--target",
         str(folder), str(project_root / "tests" / "demonstration_plugin")],
        check=True, timeout=120,
    )  # fmt: skip
    return folder


def python(
    *arguments: str, site: Path, cwd: Path, safe: bool = True
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *(["-P"] if safe else []), *arguments],
        capture_output=True, text=True, cwd=cwd, timeout=200,
        env={**os.environ, "PYTHONPATH": str(site)},
    )  # fmt: skip


def called(*arguments: str, site: Path, cwd: Path) -> tuple[int, str, str]:
    done = python("-m", "validate", *arguments, site=site, cwd=cwd)
    return done.returncode, done.stdout, done.stderr


EACH = """
import contextlib, io, json, sys
from validate.commands.main import run
def one(words):
    with contextlib.redirect_stdout(io.StringIO()) as out:
        with contextlib.redirect_stderr(io.StringIO()) as err:
            code = run(words.split())
    return code, out.getvalue(), err.getvalue()
print(json.dumps([one(words) for words in sys.argv[1:]]))
"""


def each(
    *commands: str, site: Path, cwd: Path, then: str = "pass"
) -> tuple[list[tuple[int, str, str]], str]:
    """Commands by one process after each other, and what a script prints there at last."""
    done = python("-c", EACH + then, *commands, site=site, cwd=cwd)
    assert done.returncode == 0, done.stderr
    told, _, printed = done.stdout.partition("\n")
    return [tuple(one) for one in json.loads(told)], printed


def package(folder: Path, name: str, points: str, module: str = "") -> None:
    """An installed package as pip leaves it: metadata, entry points, one module."""
    info = folder / f"{name}-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(points)
    (folder / f"{name}.py").write_text(module)


DECLARED = """
import json
from pathlib import Path
from validate.pipeline.experiment.declaration import classes, from_json, to_json
from validate.pipeline.experiment.find import find, load_file
from validate.pipeline.run.cached_runs import plug_ins_used
experiment = find("nudged_block", Path.cwd())
methods = json.loads(to_json(experiment))["experiment"]["methods"]["items"]
print(methods["nudged"]["settings"], methods["gent"]["scene"]["items"])
again = from_json(to_json(experiment), experiment.path, experiment)
assert again.methods["nudged"] == experiment.methods["nudged"]
assert {"Nudging", "GentCoefficients", "KfFem"} <= classes().keys()
assert [len(plug_ins_used(m)) for m in experiment.methods.values()] == [0, 1, 1]
print(*plug_ins_used({"law": "gent"}, {"law": "neo_hooke"}))
for name in ("plates", "body"):
    material = load_file(Path(f"experiments/{name}.py")).parameters.scene.material
    print(type(material.coefficients).__name__, material.coefficients.J_m)
"""
Told = tuple[list[tuple[int, str, str]], str]


@pytest.fixture(scope="module")
def told(site: Path, tmp_path_factory: pytest.TempPathFactory) -> Told:
    """What the installed package changes, asked of one process."""
    folder = tmp_path_factory.mktemp("installed")
    (folder / "pull.gauge").write_text(LOG)
    t = np.arange(200) / 10
    log = [f"{a:g},{8e-2 * a:.5g},{0.056 * a:.5g}" for a in t]
    (folder / "log.csv").write_text("\n".join(["Time (s),Position (mm),Load (N)", *log]))
    imported = ("import", "log.csv", "--map", "test=compression", "-o", "log.mcap")
    code, _, err = here(*imported, cwd=folder)
    assert code == 0, err
    kinds = {"plates": PLATES, "body": BODY}
    for kind, answers in kinds.items():
        text = f'law = "gent"\nmaterial.J_m = "2.5"\n{answers}'
        (folder / f"{kind}.toml").write_text(text, "utf-8")
    commands = (
        "list --plugins --json", "list --plugins", "list", "inspect pull.gauge --map unit=mN",
        "inspect pull.gauge --map unti=mN",
        *(f"new {kind} --from log.mcap --answers {kind}.toml" for kind in kinds),
    )  # fmt: skip
    return each(*commands, site=site, cwd=folder, then=DECLARED)


def test_an_installed_package_is_listed_with_its_version(told: Told) -> None:
    (code, out, err), table, experiments = told[0][:3]
    assert (code, err) == (0, "")
    listed = [(p["kind"], p["name"], p["package"], p["version"], p["left_out"])
              for p in json.loads(out)]  # fmt: skip
    ours = ("validate-demonstration", VERSION, "")
    assert listed == [
        ("experiments", "demonstration", *ours), ("filters", "nudging", *ours),
        ("laws", "gent", *ours), ("readers", "gauge", *ours),
    ]  # fmt: skip
    assert table[1].count(f"validate-demonstration  {VERSION}    used") == 4
    assert "nudged_block" in experiments[1]


def test_its_format_is_read(told: Told) -> None:
    (code, out, err), (wrong, _, why) = told[0][3:5]
    assert (code, err) == (0, "")
    assert "read as gauge (log of a force gauge), because its first line is '# gauge'" in out
    assert "'force' changes most, 29.0 N peak to peak" in out
    whose = f"plug-in 'gauge' of validate-demonstration {VERSION} (validate.readers)"
    assert f"read by: {whose}" in " ".join(out.split())
    assert wrong == 2
    assert why == "validate: --map unti=...: no such key; did you mean 'unit'? known: unit\n"


def test_a_declaration_names_its_law_and_filter(told: Told) -> None:
    first, second, *_ = told[1].splitlines()
    assert "{'type': 'Nudging'}" in first
    assert "{'type': 'GentCoefficients', 'J_m': 30.0}" in first
    assert second == f"validate-demonstration {VERSION}"


def test_a_new_experiment_has_its_law_with_its_coefficients(told: Told) -> None:
    assert [code for code, _, _ in told[0][5:]] == [0, 0], told[0][5:]
    assert told[1].splitlines()[2:] == 2 * ["GentCoefficients 2.5"]


def test_a_law_of_a_plug_in_is_solved_or_refused_in_one_line(further_law: LawKind) -> None:
    """By its form at a point; explicit schemes, whose laws are compiled, refuse it."""
    material = Material(1e5, 0.4, further_law.name, rho=1000.0)  # type: ignore[arg-type]
    own = Material(1e5, 0.4, "neo_hooke", rho=1000.0)
    fields = []
    for law in (material, own):
        body = block(StaticNewton())
        system = build(replace(body.scene, material=law))
        stepper = StaticNewton().prepare(system)
        pressed = np.array([1e-3] * len(system.scene.drives) + [0.1] * len(system.scene.loads))
        fields.append(stepper.field(stepper.step(stepper.rest(), pressed)))
    assert np.array_equal(*fields)
    assert np.abs(fields[0]).max() > 9e-4
    assert "no compiled form; choose one of" in refusal(
        lambda: CentralDifference().prepare(build(replace(body.scene, material=material)))
    )
    assert "cannot solve the law 'mine', only linear; use StaticNewton" in refusal(
        lambda: Newmark().prepare(build(replace(body.scene, material=material)))
    )
    assert with_values(own, {"law": "mine"}).law == "mine"
    assert "expected one of linear, svk, neo_hooke, mooney_rivlin, yeoh, ogden, mine" in refusal(
        lambda: with_values(own, {"law": "mien"})
    )
    assert laws_of(Method("", StaticNewton()))[-1] == "mine"
    assert "mine" not in laws_of(Method("", Newmark()))


@dataclass(frozen=True)
class Gripped(Coefficients):
    grip: float = quantity(2.0, "Pa", "a further modulus")


def test_a_law_of_a_plug_in_has_coefficients_of_its_own(
    further_law: LawKind, monkeypatch: pytest.MonkeyPatch
) -> None:
    kind = replace(further_law, name="gripped", coefficients=("grip",), holds=Gripped)
    monkeypatch.setattr(laws, "LAWS", replace(LAWS, _added=[further_law, kind]))
    own = Material(1e5, 0.4, "neo_hooke")
    with pytest.raises(SceneError, match=r"'neo_hooke' does not know grip = 3.0"):
        replace(own, coefficients=Gripped(grip=3.0))
    assert own.of_law("gripped").coefficients == Gripped()  # type: ignore[arg-type]
    held = replace(own, law="gripped", coefficients=Gripped(grip=3.0))  # type: ignore[arg-type]
    assert held.of_law("neo_hooke").coefficients == Coefficients()
    assert with_values(held, {"grip": "4Pa"}).coefficients == Gripped(grip=4.0)
    assert stiffened(held, 2.0).coefficients == Gripped(grip=6.0)
    for wrong, why in (
        (replace(kind, coefficients=("grab",)), "law 'gripped': 'grab' is no field"),
        (replace(kind, at_point=None), "law 'gripped' has no at_point"),
    ):
        with pytest.raises(UsageError, match=why):
            replace(LAWS, _added=[]).add(wrong)


@pytest.fixture
def further_law() -> Iterator[LawKind]:
    """Neo-Hooke under another name, added as a script adds it."""
    kind = LawKind("mine", "neo-Hooke", (), ("split",), ranged=False,
                   at_point=lambda mu, kappa, coefficients: NeoHooke(mu, kappa))  # fmt: skip
    yield LAWS.add(kind)
    LAWS._added.remove(kind)


@pytest.mark.slow
def test_a_run_with_its_law_and_filter_says_so(site: Path, tmp_path: Path) -> None:
    code, out, err = called("run", "nudged_block", "--quick", "--json", site=site, cwd=tmp_path)
    assert code == 0, err
    content = json.loads(out)
    assert content["made"]["plug_ins"] == [f"validate-demonstration {VERSION}"]
    assert {m["name"]: m["outcome"]["state"] for m in content["methods"]} == dict.fromkeys(
        ("fem", "nudged", "gent"), "finished"
    )
    page = next(tmp_path.glob("reports/*/report.html")).read_text("utf-8")
    assert f"validate-demonstration {VERSION}" in page


BROKEN = {
    "raises": ("raise RuntimeError('a wrong line')", "RuntimeError: a wrong line"),
    "exits": ("raise SystemExit(3)", "SystemExit: 3"),
    "absent": ("", "AttributeError: module 'absent' has no attribute 'READER'"),
    "number": ("READER = 7", "expected a Reader, found an object of the class int"),
    "kind": ("from validate.recording.reader import Reader as READER",
             "expected a Reader, found the class Reader"),
    "taken": ("from validate.recording.motion_capture.c3d import C3D as READER",
              "the name 'c3d' is taken; choose another one"),
}  # fmt: skip


def test_a_broken_plug_in_costs_one_warning(tmp_path: Path) -> None:
    for name, (module, _) in BROKEN.items():
        package(tmp_path / "site", name, f"[validate.readers]\n{name} = {name}:READER\n", module)
    (tmp_path / "log.csv").write_text(POINTS)
    commands = ("inspect log.csv", "list --plugins --json")
    ((code, out, err), listed), _ = each(*commands, site=tmp_path / "site", cwd=tmp_path)
    assert code == 0
    assert "read as points" in out
    assert err.splitlines() == [
        f"validate: plug-in '{name}' of {name} 1.0 (validate.readers) is left out: {why}; "
        f"update or uninstall {name}"
        for name, (_, why) in sorted(BROKEN.items())
    ]
    assert {p["name"]: p["left_out"] for p in json.loads(listed[1])} == {
        name: why for name, (_, why) in BROKEN.items()
    }


def test_an_unknown_group_of_entry_points_costs_one_warning(tmp_path: Path) -> None:
    hints = {"reader": "did you mean validate.readers? ", "zzz": ""}
    for group in hints:
        points = f"[validate.{group}]\ngauge = gauge_{group}:READER\n"
        package(tmp_path / "site", f"gauge_{group}", points)
    (tmp_path / "log.csv").write_text(POINTS)
    code, _, err = called("inspect", "log.csv", site=tmp_path / "site", cwd=tmp_path)
    assert code == 0
    assert err.splitlines() == [
        f"validate: plug-in 'gauge' of gauge_{group} 1.0 (validate.{group}) is left out: no group "
        f"'validate.{group}' of entry points; {hint}known: {', '.join(KINDS)}; update or "
        f"uninstall gauge_{group}"
        for group, hint in hints.items()
    ]


def test_a_reader_that_breaks_its_contract_is_one_line(tmp_path: Path) -> None:
    module = """
from validate.recording.reader import Reader
def fails(*_): return {}["key"]
READER = Reader("odd", "an odd file", fails, fails, "nothing")
"""
    package(tmp_path / "site", "odd", "[validate.readers]\nodd = odd:READER\n", module)
    (tmp_path / "pull.csv").write_text(
        "time (s),tip_x (mm),tip_y (mm),tip_z (mm)\n0,1,2,3\n1,2,3,4"
    )
    code, out, err = called("inspect", "pull.csv", site=tmp_path / "site", cwd=tmp_path)
    assert (code, "read as points" in out) == (0, True)
    assert set(err.splitlines()) == {
        "validate: plug-in 'odd' of odd 1.0 (validate.readers) is not asked further: KeyError: "
        "'key'"
    }
    code, _, err = called(
        "inspect", "pull.csv", "--as", "odd", site=tmp_path / "site", cwd=tmp_path
    )
    assert code == 2
    assert err.splitlines() == [
        "validate: pull.csv: plug-in 'odd' of odd 1.0 (validate.readers) failed (KeyError: 'key'); "
        "ask its authors, or name another format with --as"
    ]


def test_a_reader_may_leave_the_clocks_of_its_streams_out(tmp_path: Path) -> None:
    module = """
import numpy as np
from validate.recording.reader import Reader
from validate.recording.types import Recording, Signal, Source
def read(path, given):
    force = Signal(np.arange(5.0), np.zeros((5, 1)), "N", 0.1, "machine")
    source = Source(str(path), "", 0, "made here")
    return Recording("gauge", source, 0, signals={"force": force})
READER = Reader("gauge", "a gauge", lambda p: p.suffix == ".gauge", read, "its ending")
"""
    package(tmp_path / "site", "gauge", "[validate.readers]\ngauge = gauge:READER\n", module)
    (tmp_path / "pull.gauge").write_text("five samples")
    code, out, err = called("inspect", "pull.gauge", site=tmp_path / "site", cwd=tmp_path)
    assert (code, err) == (0, "")
    assert "force" in out


def test_an_experiment_whose_name_is_taken_is_told_of(tmp_path: Path) -> None:
    package(tmp_path / "site", "mine", "[validate.experiments]\nlab = mine_lab.trials\n", "")
    (tmp_path / "site" / "mine_lab" / "trials").mkdir(parents=True)
    (tmp_path / "site" / "mine_lab" / "trials" / "kf_cube.py").write_text("EXPERIMENT = 1\n")
    code, _, err = called("list", site=tmp_path / "site", cwd=tmp_path)
    assert code == 0
    assert err.splitlines() == [
        "validate: plug-in 'lab' of mine 1.0 (validate.experiments) is left out: another "
        "experiment is called 'kf_cube'; update or uninstall mine"
    ]


def test_a_package_adds_a_view(tmp_path: Path) -> None:
    module = "from validate.report import View\nVIEW = View('late', 'Late', {}, x='method')\n"
    package(tmp_path / "site", "seen", "[validate.views]\nlate = seen:VIEW\n", module)
    script = "from validate.report import VIEWS; print(VIEWS.further[0].title)"
    (told,), title = each(
        "list --plugins --json", site=tmp_path / "site", cwd=tmp_path, then=script
    )
    listed = json.loads(told[1])
    assert [(p["kind"], p["name"], p["left_out"]) for p in listed] == [("views", "late", "")]
    assert title.strip() == "Late"


def test_help_and_a_list_of_experiments_run_no_plug_in(tmp_path: Path) -> None:
    for kind in KINDS:
        points = f"[validate.{kind}]\nx = ran_{kind}:PART\n"
        package(tmp_path / "site", f"ran_{kind}", points, "open('ran', 'w').close()")
    there = "import os; print(os.path.exists('ran')); run(['list', '--plugins'])"
    told, printed = each("--help", "list", site=tmp_path / "site", cwd=tmp_path, then=there)
    assert [code for code, _, _ in told] == [0, 0]
    assert printed.startswith("False\n")
    assert (tmp_path / "ran").exists()


def test_nothing_in_the_current_folder_is_a_plug_in(tmp_path: Path) -> None:
    """`python -m` puts the folder of the data on Python's path."""
    module = "open('ran', 'w').close()"
    package(tmp_path, "beside", "[validate.readers]\nx = beside:READER\n", module)
    done = python("-m", "validate", "list", "--plugins", site=Path(), cwd=tmp_path, safe=False)
    assert (done.returncode, done.stdout.split(";")[0]) == (0, "no plug-ins are installed")
    assert not (tmp_path / "ran").exists()


def test_a_scheme_steps_or_solves_a_whole_scene(tmp_path: Path) -> None:
    module = """
from dataclasses import dataclass
from validate.solve.handles import Handles
@dataclass(frozen=True)
class Steps:
    handles = Handles(("linear",), inertia=False, cavities=False)
    def prepare(self, system): ...
@dataclass(frozen=True)
class Solves:
    handles = Handles(("linear",), inertia=False, cavities=False)
    def solve(self, scene, t, inputs): ...
@dataclass(frozen=True)
class Neither:
    handles = Handles(("linear",), inertia=False, cavities=False)
"""
    names = ("Steps", "Solves", "Neither")
    points = "".join(f"{name} = two:{name}\n" for name in names)
    package(tmp_path / "site", "two", f"[validate.schemes]\n{points}", module)
    script = """
from validate.pipeline.experiment.declaration import classes
from validate.solve.schemes import SCHEMES, SOLVERS
print([s.__name__ for s in (*SCHEMES.further, *SOLVERS.further)], classes()["Solves"])
"""
    asked = "list --plugins --json"
    ((code, out, err),), printed = each(asked, site=tmp_path / "site", cwd=tmp_path, then=script)
    assert code == 0
    assert {p["name"]: p["left_out"] for p in json.loads(out)} == {
        "Steps": "", "Solves": "", "Neither": "Neither has no prepare",
    }  # fmt: skip
    assert len(err.splitlines()) == 1
    assert printed == "['Steps', 'Solves'] <class 'two.Solves'>\n"


def test_damaged_entry_points_and_absent_metadata_cost_a_line(tmp_path: Path) -> None:
    package(tmp_path / "site", "damaged", "[validate.readers\nx = \n= y")
    package(tmp_path / "site", "nameless", "[validate.readers]\nx = nameless:READER\n")
    (tmp_path / "site" / "nameless-1.0.dist-info" / "METADATA").unlink()
    code, out, err = called("list", "--plugins", site=tmp_path / "site", cwd=tmp_path)
    assert code == 0, err
    assert "Traceback" not in err
    assert "left out" in out


def test_a_script_adds_a_part_once() -> None:
    registry = Registry("numbers", (1, 2), str, lambda part: "" if isinstance(part, int) else "no")
    assert registry.add(3) == 3
    assert (list(registry), len(registry), registry[-1], 3 in registry) == ([1, 2, 3], 3, 3, True)
    with pytest.raises(UsageError, match=r"numbers: the name '2' is taken"):
        registry.add(2)
    with pytest.raises(UsageError, match="numbers: no"):
        registry.add("4")  # type: ignore[arg-type]
    assert registry.own == (1, 2)
    assert all(READERS.origin(reader) is None for reader in READERS.own)
    assert np.array_equal(registry.further, [3])


def test_an_external_simulator_has_a_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`--external felupe`; a program of that name on the path is taken first."""
    monkeypatch.setenv("PATH", str(tmp_path))
    for simulator in SIMULATORS.own:
        assert words(simulator.name) == words(simulator.command)
        assert Path(words(simulator.name)[1]).is_file()
    with pytest.raises(UsageError, match="there is no program 'felup'"):
        words("felup")


def test_the_former_path_of_a_shipped_script_is_found() -> None:
    for simulator in SIMULATORS.own:
        former = f"python benchmarks/guests/{simulator.name}_guest.py"
        with pytest.warns(DeprecationWarning, match=f"{simulator.name}_simulator.py now"):
            assert words(former) == words(simulator.command)
        assert simulator_of(former) is simulator
    assert words("python benchmarks/guests/other_guest.py")[1:] == (
        "benchmarks/guests/other_guest.py",
    )


def test_a_scheme_that_fails_where_all_are_asked_is_passed_over(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    @dataclass(frozen=True)
    class Failing(Newmark):
        @staticmethod
        def steppings() -> tuple[Stepping, ...]:
            raise RuntimeError("no step map")

    before = [s.name for s in schemes.steppings()]
    monkeypatch.setattr(schemes, "SCHEMES", replace(schemes.SCHEMES, _added=[]))
    schemes.SCHEMES.add(Failing)
    assert [s.name for s in schemes.steppings()] == before
    assert caplog.messages == [
        "'Failing' (schemes) is not asked further: RuntimeError: no step map"
    ]
    for wrong, why in (
        (Newmark(), "expected a frozen dataclass, found an object of the class Newmark"),
        (PlugIn, "PlugIn has no prepare"),
        (make_dataclass("Bare", (), namespace={"prepare": None}), "Bare.handles: expected Handles"),
    ):
        with pytest.raises(UsageError, match=re.escape(why)):
            schemes.SCHEMES.add(wrong)  # type: ignore[arg-type]
