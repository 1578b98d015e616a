"""`validate new` of bodies under their weight at large strain, against exact answers."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from command_line import called
from scipy.integrate import cumulative_simpson, solve_bvp
from scipy.optimize import brentq

from validate.arrays import Floats
from validate.pipeline import run_in_memory
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.find import load_file
from validate.pipeline.experiment.options import folder_of
from validate.pipeline.run.case_solution import solve
from validate.recording.mcap.write import write_recording
from validate.recording.types import Markers, Recording, Signal, Source

G, RHO, NOISE = 9.80665, 1000.0, 1e-6
LENGTH, SIDE, E = 0.05, 0.01, 2000.0  # a soft bar that hangs from its top
PLACES = {"tip": 0.0, "middle": 0.025}  # heights m, on the side x = 10 mm

BAR = f"""
body = {{shape = "block", block = "10mm,10mm,50mm"}}
held.slides = "zmax"
material = {{E = {E}, nu = 0, rho = {RHO}}}
law = "LAW"
seen = {{layout = "as seen"STILL}}
accept = {{marker = "0.2mm"}}
why = {{marker = "of a test"}}
"""


def svk(stretch: float) -> float:
    """Nominal stress over E of a bar without Poisson's effect: S = E (l^2 - 1) / 2, P = l S."""
    return stretch * (stretch**2 - 1) / 2


def neo_hooke(stretch: float) -> float:
    """Of W = mu/2 (J^(-2/3) I1 - 3) + kappa/4 (J^2 - 1 - 2 ln J) with nu = 0, stress-free across:
    mu = E / 2, kappa = E / 3."""

    def energy(along: float, across: float) -> float:
        J = along * across**2
        isochoric = J ** (-2 / 3) * (along**2 + 2 * across**2) - 3
        return isochoric / 4 + (J**2 - 1 - 2 * np.log(J)) / 12

    h = 1e-5

    def slope(across: float) -> float:
        return energy(stretch, across + h) - energy(stretch, across - h)

    across = brentq(slope, 0.5, 1.5)
    return (energy(stretch + h, across) - energy(stretch - h, across)) / (2 * h)


def hung(law: Callable[[float], float], z: Floats, pull: float) -> Floats:
    """Displacements (k,) m downward at heights z (k,) m under weight and an end force in N: P(z) =
    rho g z + F / A, integrated from the top."""
    heights = np.linspace(LENGTH, 0.0, 401)
    nominal = RHO * G * heights + pull / SIDE**2
    stretch = np.array([brentq(lambda s, P=P: E * law(s) - P, 0.5, 3.0) for P in nominal])
    u = cumulative_simpson(stretch - 1, x=LENGTH - heights, initial=0.0)
    return np.interp(z, heights[::-1], u[::-1])


def markers(t: Floats, down: Floats) -> Markers:
    """On the bar's side at rest, then lower by `down` (nt, k) m."""
    x = np.array([(SIDE, SIDE / 2, z) for z in PLACES.values()])
    moved = np.zeros((len(t), len(x), 3))
    moved[:, :, 2] = -down
    noise = np.random.default_rng(5).normal(0, NOISE, moved.shape)
    return Markers(t, tuple(PLACES), x + moved + noise, NOISE, "body")


def written(folder: Path, answers: str, **streams: object) -> Experiment:
    """The recording, the command, and the file that it writes."""
    source = Source("x", "", 0, "x")
    write_recording(Recording("log", source, 0, **streams), folder / "log.mcap")  # type: ignore[arg-type]
    (folder / "a.toml").write_text(answers, "utf-8")
    code, said = called("new", "mine", "--from", "log.mcap", "--answers", "a.toml")
    assert code == 0, said
    return load_file(folder / "experiments" / "mine.py")


@pytest.mark.slow
@pytest.mark.parametrize(("name", "law"), [("svk", svk), ("neo_hooke", neo_hooke)])
def test_a_bar_stretches_by_its_weight_as_the_closed_form_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, law: Callable[[float], float]
) -> None:
    """By an eighth of its length: of St. Venant-Kirchhoff without Poisson's effect it is exact; a
    neo-Hooke bar thins by height, which one dimension has within 0.5 %."""
    monkeypatch.chdir(tmp_path)
    z = np.array(list(PLACES.values()))
    down = hung(law, z, 0.0)
    assert down[0] > 0.1 * LENGTH
    t = np.linspace(0, 1, 21)
    answers = (
        BAR.replace("LAW", name).replace("STILL", "")
        + """
moved = {by = "gravity", along = "-z"}
motion.how = "static"
ranges = {E = "0.1%", nu = 0.001, load = "0.1%"}
"""
    )
    result = run_in_memory(
        written(tmp_path, answers, markers={"m": markers(t, np.outer(t > 0, down))})
    )
    (check,) = result.checks
    assert check.acceptance == "good enough"
    if name == "svk":
        assert check.validation == "not distinguishable"
    assert abs(check.value) < (0.001 if name == "svk" else 0.005) * down[0]


@pytest.mark.slow
def test_a_hanging_bar_is_pulled_at_its_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From the equilibrium under its weight, slowly: what the force adds is the closed form's."""
    monkeypatch.chdir(tmp_path)
    z = np.array(list(PLACES.values()))
    t = np.linspace(0, 2, 21)
    pull = 0.05 * (1 - np.cos(np.pi * np.clip((t - 0.3) / 1.4, 0, 1))) / 2  # N
    rest = hung(svk, z, 0.0)
    down = np.array([hung(svk, z, F) for F in pull]) - rest
    alone = 0.05 / SIDE**2 * LENGTH / E
    assert abs(down[-1, 0] / alone - 1) > 0.1  # not what a body without weight would do
    answers = (
        BAR.replace("LAW", "svk").replace("STILL", ', still = "0.3s"')
        + """
moved = {by = "force", place = "zmin", along = "-z"}
motion = {how = "dynamic", damping = "2ms", gravity = "-z"}

ranges = {E = "0.1%", nu = 0.001, load = "0.1%", rho = "0.1%", damping = "10%"}
"""
    )
    force = Signal(t, pull[:, None], "N", 1e-6, "cell")
    made = written(tmp_path, answers, markers={"m": markers(t, down)}, signals={"force": force})
    assert made.accepted == ("large",)
    recordings = made.load(made.parameters, folder_of(made))
    found = solve(made, recordings, "large", made.methods["large"], made.parameters).residuals
    for name, most in zip(PLACES, down[-1], strict=True):
        assert np.sqrt(np.mean(found[f"{name}@all"].values ** 2)) < 0.003 * most


def elastica(load: float) -> tuple[float, float]:
    """Tip of an inextensible cantilever of length 1 under its weight q L^3 / E I = `load`: along,
    and down (Bisshopp & Drucker 1945, of a weight that is spread): theta'' = -load (1 - s) cos."""
    s = np.linspace(0, 1, 201)
    found = solve_bvp(
        lambda s, y: np.vstack([y[1], -load * (1 - s) * np.cos(y[0])]),
        lambda a, b: np.array([a[0], b[1]]), s, np.zeros((2, len(s))), tol=1e-8,
    )  # fmt: skip
    theta = found.sol(s)[0]
    return float(np.trapezoid(np.cos(theta), s)), float(np.trapezoid(np.sin(theta), s))


@pytest.mark.slow
def test_a_slender_beam_bends_far_under_its_weight(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Against the elastica, without its shear (0.8 (h / L)^2): within 1.5 %, by half its length."""
    monkeypatch.chdir(tmp_path)
    length, side, load = 0.1, 1e-2, 4.0
    modulus = RHO * G * 12 * length**3 / (load * side**2)
    along, down = elastica(load)
    assert down > 0.4
    places = np.array([(length, side / 2, side / 2)])
    moved = length * np.array([along - 1, 0.0, -down])
    t = np.linspace(0, 1, 21)
    x = places + (t > 0)[:, None, None] * moved
    x += np.random.default_rng(6).normal(0, NOISE, x.shape)
    answers = f"""
body = {{shape = "block", block = "100mm,10mm,10mm"}}
held.all = "xmin"
material = {{E = {modulus:.9g}, nu = 0, rho = {RHO}}}
law = "svk"
moved = {{by = "gravity", along = "-z"}}
motion.how = "static"
seen = {{layout = "as seen"}}
accept = {{marker = "3mm"}}
why = {{marker = "of a test"}}
ranges = {{E = "0.1%", nu = 0.001, load = "0.1%"}}
"""
    result = run_in_memory(
        written(tmp_path, answers, markers={"m": Markers(t, ("tip",), x, NOISE, "body")})
    )
    (check,) = result.checks
    assert abs(check.value) < 0.015 * length * down
