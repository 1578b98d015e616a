"""What `needle_block` shows of paper 002, figures 5 to 8 and 11, and what it leaves out."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Literal, cast

import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import Chart, Entry, Exhibit, NumberTable, Series
from validate.compare.shapes.two_fields import FieldScores
from validate.fem.assembly.volume_constraints import mixed_static
from validate.fem.system import System
from validate.fem.system import build as build_system
from validate.pipeline.experiment.experiment import Progress, ReportAdditions
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.run.method_run import Cases, MethodRun
from validate.scene.material import Material
from validate.scene.scene import Scene
from validate.solve.march import march, output_frames
from validate.solve.types import Run

from .benchmark import FIVE, FRAMES, IMPLICIT, SWITCHES
from .body import (
    MP1,
    MP2,
    Plane,
    needle_block,
    needle_depth,
    needle_from_above,
    pressed_block,
)
from .errors import (
    LIMIT_HEADS,
    RIVALS,
    TABLED,
    Errors,
    at_instants,
    errors_exhibit,
    errors_of,
    errors_on,
    instants_table,
    limit_row,
    mesh_words,
    ordered_share,
    read_off,
    shape_maps,
    stable_of,
    static_exhibit,
    sum_ratio,
    switches_exhibit,
)
from .further_exhibits import BLOCK, beyond
from .integration_rules import rules_exhibit

MATERIALS: Mapping[str, Material] = {"MP1": MP1, "MP2": MP2}
PLANES: tuple[Plane, ...] = ("strain", "stress")
_FIGURES = {
    "E_n": "As figure 5 of the paper.",
    "E_s": "As figure 6: its peaks after 5 s are swings about the steady state.",
    "E_i": "As figures 7 and 8, one logarithmic axis for all.",
    "E_i_linear": "As figure 8: quasi-static against explicit with lumped masses.",
}
_MOVING = 5.0  # s: until here the block follows the needle, then it swings out
_LONG = 900  # steps: 30 s, for the way to the static solution
_SETTLING = {**FIVE, "implicit_lumped_full": SWITCHES["implicit_lumped_full"]}
_SWEPT = (10, 20, 30)  # cells a side


def tell(parameters: Any, cases: Cases, progress: Progress) -> ReportAdditions:
    """All exhibits of the needle's block, and the numbers of its printed figures."""
    p, main = cast(Tree, parameters), cases[""]
    progress("errors over time")
    errors = errors_on(main, TABLED, RIVALS)
    shown = errors_exhibit(errors, 2, _FIGURES, _words(errors))
    switches, ratio = switches_exhibit(main, 2)
    progress("materials")
    prostate, ends = _materials(p, cases)
    progress("static solution")
    system = build_system(main["implicit"].body)
    t: Floats = p.settings.clock.dt * np.arange(1, _LONG + 1, dtype=np.float64)
    still, end = static_exhibit(system, _SETTLING, p.settings.clock.dt, _LONG, needle_depth(t))
    progress("critical steps")
    limits = _limits()
    progress("Gauss-Seidel")
    swept, counts = _iterations()
    progress("meshes")
    mesh, mesh_numbers = _meshes(cases, errors)
    rules, rule_numbers = rules_exhibit()
    more, found = beyond(BLOCK, progress)
    numbers = {
        "ordered": ordered_share(errors, until=_MOVING),
        "ordered.all": ordered_share(errors),
        "sum": sum_ratio(errors)[0],
        "explicit.over.lumped": sum_ratio(errors)[1],
        "restriction.over.lumping": ratio,
        "static.end": end,
        **read_off(errors),
        "peaks": float(_peaks(errors["quasi_static"].line("E_s"))),
        "limit.printed": stable_of(_block(30, "MP2", "strain"), "consistent", "printed"),
        "limit.lagged": stable_of(_block(30, "MP2", "strain"), "consistent", "lagged"),
        **counts, **ends, **mesh_numbers, **rule_numbers, **found,
    }  # fmt: skip
    return ReportAdditions(
        (shown, _shapes(main), switches, prostate, still, limits, swept, mesh, rules, *more),
        numbers,
    )


def _block(n: int, material: str, plane: Plane) -> System:
    return build_system(needle_block(n, MATERIALS[material], plane))


def _words(errors: Mapping[str, Errors]) -> tuple[str, ...]:
    ratio, part = sum_ratio(errors)
    return (
        "The paper's order in E_i (explicit, then the lumped methods, then quasi-static) "
        f"holds at {100 * ordered_share(errors, until=_MOVING):.0f} % of the compared times "
        f"after the first step and up to {_MOVING:g} s; later the quasi-static solver, already "
        "at rest, is below the lumped methods when the implicit run swings through rest "
        f"({100 * ordered_share(errors):.0f} % of all times).",
        f"Explicit with lumped masses has {ratio:.2f} times the sum of the two errors it "
        f"combines (median); but the explicit part is {part:.2g} of the lumped one, so this "
        "shows little.",
        "The treatment of the needle matters more than the integrator: here its velocity is the "
        "planned one, its node's coupling terms are kept, and a0 = 0.",
    )


def _peaks(line: Series) -> int:
    """Local maxima of E_s after 5 s: swings about the steady state."""
    y = line.y[line.x > 5]
    return int(((y[1:-1] > y[:-2]) & (y[1:-1] > y[2:])).sum())


# --- shapes --------------------------------------------------------------------------------------


def _shapes(main: Mapping[str, MethodRun]) -> Exhibit:
    maps = shape_maps(main, ("implicit", "quasi_static"), 0.5)
    maps += shape_maps(main, ("implicit", "explicit_lumped"), 2.0)
    return Exhibit("shapes", "Deformed shapes", (), (), (_side(main, 0.5),), tuple(maps))


def _side(main: Mapping[str, MethodRun], t: float) -> Chart:
    """Where the free side is: between two of its lines lies the area that E_s counts."""
    lines = []
    for name in ("implicit", *RIVALS):
        followed = main[name]
        nodes = followed.scene.mesh.nodes
        side = np.flatnonzero(np.isclose(nodes[:, 0], nodes[:, 0].max()))
        side = side[np.argsort(nodes[side, 1])]
        run = followed.run
        u = run.u[int(np.argmin(np.abs(run.t[run.at] - t)))][side]
        y = 1e3 * (nodes[side, 1] + u[:, 1])
        order = np.argsort(y)
        lines.append(Series(followed.label, y[order], 1e3 * u[order, 0]))
    return Chart(
        "free_side", f"The free side at {t:g} s", "y / mm", "u_x / mm", tuple(lines),
        caption="Between a line and the implicit one lies the area that E_s counts (figure 1).",
    )  # fmt: skip


# --- materials: figure 11 ------------------------------------------------------------------------


def _materials(p: Tree, cases: Cases) -> tuple[Exhibit, dict[str, float]]:
    """MP1's answers and MP2's own quasi-statics against the implicit run with MP2."""
    case = cases["prostate"]
    errors = errors_on(case, ("E_n", "E_s", "E_i"), ("implicit", *RIVALS))
    scene = replace(case["implicit"].body, material=MP2)
    run = _run(scene, FIVE["quasi_static"].settings, p)
    truth = case["implicit"].truth.u
    assert truth is not None
    own = errors_of(
        run, scene.mesh, truth, scene, ("E_n", "E_s", "E_i"),
        label="quasi-static, MP2",
    )  # fmt: skip
    named = {k: replace(e, label=f"{e.label}, MP1") for k, e in errors.items()}
    found = {**named, "own": own}
    chart = Chart(
        "materials", "E_s against the implicit run with MP2", "time / s", "E_s / 1",
        tuple(e.line("E_s") for e in found.values()), log="y",
        caption="As figure 11: no solver corrects a wrong material.",
    )  # fmt: skip
    table = instants_table(
        "materials", "The solutions with MP1, and quasi-static MP2, against implicit MP2.", found,
        ("E_n", "E_s", "E_i"), FieldScores.units(2),
    )  # fmt: skip
    wrong = errors["implicit"].at("E_s", 10.0) or 0.0
    share = (own.at("E_s", 10.0) or 0.0) / (wrong or 1.0)
    mean = float(np.nanmean(own.values["E_s"]) / np.nanmean(errors["implicit"].values["E_s"]))
    words = (
        _refusals(p),
        f"Mean E_s: quasi-static with MP2 has {mean:.2g} of implicit with MP1.",
        "'Quasi-static consistently performs worst' is true for MP1. The stiff MP2 follows "
        "the needle at once, and there the lumped methods are worse at most instants.",
    )
    return (
        Exhibit("materials", "The wrong material", words, (table, _by_scene(p)), (chart,)),
        {"material.end": share, "material.mean": mean, "E_s@10s.MP1": wrong},
    )


def _by_scene(p: Tree) -> NumberTable:
    """E_n of the rivals for both materials in both plane states, each against its own truth."""
    rows: list[tuple[Entry, ...]] = []
    for material, properties in MATERIALS.items():
        for plane in PLANES:
            scene = needle_block(p.scene.body.cells[0], properties, plane)
            truth = _run(scene, FIVE["implicit"].settings, p)
            frames = at_instants(truth)
            for name in RIVALS:
                run = _run(scene, FIVE[name].settings, p)
                ended = run.outcome.state
                gaps: list[Entry] = [None] * len(frames)
                found = [_e_n(run, truth, k) for k in frames] if run.finished else gaps
                rows.append((f"{material}, plane {plane}", FIVE[name].label, *found, ended))
    t = truth.t[truth.at[frames]]
    return NumberTable(
        "scenes", "E_n of every method against the implicit run of the same scene.",
        ("scene", "method", *(f"at {x:g} s" for x in t), "ended"), tuple(rows),
        "Refused: the step of 1/30 s is above the critical one.",
    )  # fmt: skip


def _e_n(run: Run, truth: Run, k: int) -> float:
    return float(np.linalg.norm(run.u[k] - truth.u[k]) / np.linalg.norm(truth.u[k]))


def _refusals(p: Tree) -> str:
    scene = needle_block(p.scene.body.cells[0], MP2, p.scene.plane)
    run = _run(scene, FIVE["explicit"].settings, p)
    return f"The explicit method with MP2 is {run.outcome.state}: {run.outcome.why}."


def _run(scene: Scene, settings: Any, p: Tree) -> Run:
    steps = p.settings.clock.steps
    t: Floats = p.settings.clock.dt * np.arange(1, steps + 1, dtype=np.float64)
    stepper = replace(settings, **({"dt": p.settings.clock.dt} if hasattr(settings, "dt") else {}))
    prepared = stepper.prepare(build_system(scene))
    return march("own", prepared, t, needle_depth(t), output_frames(steps, FRAMES), 0.0)


# --- limits and iterations -----------------------------------------------------------------------


def _limits() -> Exhibit:
    rows = [
        limit_row(f"{material}, plane {plane}, n = {n}", _block(n, material, plane), 1 / 30)
        for material in MATERIALS
        for plane in PLANES
        for n in _SWEPT
    ]
    table = NumberTable(
        "limits", "Critical steps of the explicit schemes with full C, exact: 2/w_max with C in "
        "the matrix, (sqrt(c^2 + 4 w^2) - c)/w^2 with lagged C, c = alpha + beta w^2.",
        LIMIT_HEADS, tuple(rows),
    )  # fmt: skip
    words = (
        "The paper's limit of 1e-6 s for MP2 is that of lagged damping in plane strain with "
        "consistent mass from n = 30 on; the scheme it prints allows 400 times as much.",
        "MP1 leaves the printed scheme unstable at 33.3 ms from n = 30 on in plane strain.",
    )
    return Exhibit("limits", "Critical steps", words, (table,))


def _iterations() -> tuple[Exhibit, dict[str, float]]:
    """Sweeps of the first step, the needle along x and along y (across the unknowns' order)."""
    rows: list[tuple[Entry, ...]] = []
    numbers = {}
    for material, properties in MATERIALS.items():
        for plane in PLANES:
            for n in _SWEPT:
                across = needle_from_above(n, properties, plane)
                scenes = (needle_block(n, properties, plane), across)
                swept = [_first_step(s, "gauss_seidel") for s in scenes]
                rows.append(
                    (f"{material}, plane {plane}, n = {n}", *swept, _first_step(across, "cg"))
                )
                numbers[f"sweeps.{material}.{plane}.{n}"] = float(swept[1])
    table = NumberTable(
        "iterations", "Iterations of the implicit step's solve, first step, residual 1e-6 of the "
        "right-hand side, from the last step's displacement; sweeps counted in tens.",
        ("scene", "Gauss-Seidel, needle along x", "Gauss-Seidel, along y", "CG, along y"),
        tuple(rows),
    )  # fmt: skip
    words = (
        "'Several thousand' iterations for MP2 are those of plane strain; in plane stress, "
        "where the thickness is free, a few hundred are enough. A residual of 1e-6 leaves "
        "errors of 1e-5 to 1e-3.",
    )
    return Exhibit("iterations", "Gauss-Seidel iterations", words, (table,)), numbers


def _first_step(scene: Scene, solver: Literal["gauss_seidel", "cg"]) -> int:
    stepper = replace(IMPLICIT, solver=solver).prepare(build_system(scene))
    return stepper.step(stepper.rest(), needle_depth(np.array([IMPLICIT.dt]))[0]).updates


# --- meshes --------------------------------------------------------------------------------------


def _meshes(cases: Cases, errors: Mapping[str, Errors]) -> tuple[Exhibit, dict[str, float]]:
    """The needle's force by mesh against the logarithm it must follow, and the mesh's own error."""
    rows: list[tuple[Entry, ...]] = []
    numbers, last = {}, 0.0
    for n in (10, 20, 40):
        system = _block(n, "MP1", "strain")
        u = FIVE["quasi_static"].settings.prepare(system)
        state = u.step(u.rest(), np.array([0.16]))
        force = float(u.field(state).ravel() @ (system.K @ system.moves)[:, 0])
        compliance = 0.16 / force
        slope = (compliance - last) / np.log(2) if last else None
        rows.append((n, force, compliance, slope))
        last = compliance
        numbers[f"force.{n}"] = force
        numbers["slope"] = float(slope or 0.0)
    exact = 2 * (1 - MP1.nu**2) / (np.pi * MP1.E)
    table = NumberTable(
        "needle_force", "Static force of the needle at 0.16 m, MP1, plane strain.",
        ("n", "force / (N/m)", "u0/F / (m2/N)", "d(u0/F)/d ln n / (m2/N)"), tuple(rows),
        f"A displacement at a point has no limit in the plane; the slope must tend to "
        f"2(1 - nu^2)/(pi E) = {exact:.3e} m2/N.",
    )  # fmt: skip
    numbers["slope.exact"] = exact
    case = cases["finer_mesh"]
    frames = at_instants(case["implicit"].run)
    finer = errors_on(case, ("E_n", "E_i"), ("implicit", *RIVALS), frames)
    own = instants_table(
        "mesh_error", "Against the implicit run on a mesh of twice as many cells a side: E_n, E_i.",
        finer, ("E_n", "E_i"), FieldScores.units(2),
    )  # fmt: skip
    locked = {name: _locking(20, m) for name, m in MATERIALS.items()}
    words = (
        mesh_words(finer, errors),
        "Linear quadrilaterals lock: pressed on a fifth of the free side, n = 20 yields "
        f"{100 * locked['MP1']:.0f} % of a mixed reference's motion with MP1 and "
        f"{100 * locked['MP2']:.0f} % with MP2.",
    )
    numbers |= {f"locking.{k}": v for k, v in locked.items()}
    return Exhibit("mesh-error", "Errors of the mesh", words, (table, own)), numbers


def _locking(n: int, material: Material) -> float:
    """Compliance of the block pressed on a fifth of its free side, over that of mixed elements on a
    mesh twice as fine: the traction ends within the side, where stresses are singular."""
    system = build_system(pressed_block(n, material))
    f = system.loads[system.free, 0]
    reference = mixed_static(pressed_block(2 * n, material)).compliances[0]
    return float(f @ system.factor().solve(f)) / float(reference)
