"""A small synthetic result: a cube between plates, two recordings of force, nothing optional."""

import os
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from validate.compare.effects import Change, Declared, Effect, Joint
from validate.compare.exhibit import Exhibit
from validate.compare.published import Published
from validate.compare.residual import Residual
from validate.compare.result import MethodResult, Result
from validate.compare.score import Score, run_scores, scores_of
from validate.compare.verdict import Check
from validate.parameters import Parameter
from validate.recording.types import Clock, Recording, Signal, Source
from validate.register.observation import Selection
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.report.long_table import LongTable
from validate.report.scenes import gl
from validate.report.sections.sections import Begun, parts
from validate.report.stored.store import document
from validate.report.write import table_of
from validate.scene.material import Material
from validate.scene.mesh import Mesh, boundary_facets, kuhn_cells
from validate.scene.scene import Drive, Scene, Support
from validate.solve.types import Outcome, Run, StepTimes, Trace

SIDE, PRESS = 0.02, 0.002  # m
TIMES = np.linspace(0.0, 1.0, 21)
CHECK = Check(
    "force.plate@2mm",
    0.01,
    0.5,
    0.02,
    0.015,
    0.01,
    0.005,
    "N",
    1,
    "not distinguishable",
    "good enough",
    "|E| is 0.5 u_val",
    0.25,
    "ours: a half",
    0.012,
    0.008,
)
EFFECT = Effect(
    "modulus",
    "E 10 % higher",
    (Change("force.plate@2mm", 0.4, 0.4, "N", 7.0),),
    ("force.plate@2mm",),
    ("load cell (0.02 N)",),
)
BLIND = Effect(
    "nu", "nu 0.45", (Change("force.plate@2mm", 1e-3, 1e-3, "N", 0.1),), (), ("a better cell",)
)
PRINTED = Published("soft: force", 4.0, 4.1, 0.2, "N", "reproduced", "same cube", "table 1")


def cube(parts: int = 2) -> Mesh:
    """A cube of side 20 mm with its faces across x named."""
    line = np.linspace(0, SIDE, parts + 1)
    nodes = np.stack(np.meshgrid(line, line, line, indexing="ij"), axis=-1).reshape(-1, 3)
    cells = kuhn_cells((parts + 1,) * 3)
    outside = boundary_facets(cells, 3)
    on = {"low": nodes[:, 0] == 0, "high": nodes[:, 0] == SIDE}
    return Mesh(nodes, cells, "tet4", {k: outside[v[outside].all(axis=1)] for k, v in on.items()})


def scene() -> Scene:
    return Scene(
        cube(),
        Material(1e4, 0.4),
        supports=(Support("low", (0,)),),
        drives=(Drive("stage", "high", (-1.0, 0.0, 0.0)),),
    )


def run(name: str, stiffness: float, press: float = PRESS) -> Run:
    """Uniform compression; force = stiffness (N/m) x displacement."""
    q = press * TIMES
    u = -np.array([0.0, press])[:, None, None] * np.eye(3)[0] * (cube().nodes[:, :1] / SIDE)
    traces = {
        "stage.displacement": Trace(q, "m"),
        "stage.force": Trace(stiffness * q, "N"),
        "updates": Trace(0 * q, "1"),
    }
    at = np.array([0, len(TIMES) - 1])
    times = StepTimes(2e-5, 3e-5, 9e-5, len(TIMES))
    return Run(name, TIMES, at, u, traces, Outcome("finished", len(TIMES)), 0.25, times)


def method(name: str, stiffness: float, *, accepted: bool = False) -> MethodResult:
    runs = (run(name, stiffness), run(name, stiffness))
    seen = (recording("cube_a", 1)[1], recording("cube_b", 2)[1])
    force = stiffness * PRESS
    residual = Residual(
        "force.plate", "2mm", np.array([[force - 4.0]]), 0.02, 0.0, "N", "plate force", force, 4.0
    )
    scores = (*scores_of(residual, "measured recording"), *run_scores(runs[0]))
    return MethodResult(
        name, f"{name} <cube>", accepted, scene(), seen, runs, {residual.name: residual}, scores,
        (CHECK,) if accepted else (),
    )  # fmt: skip


def recording(name: str, seed: int) -> tuple[Recording, Registered]:
    noise = 0.02 * np.random.default_rng(seed).standard_normal(len(TIMES))
    force = 2000 * PRESS * TIMES + noise
    stage = Signal(TIMES, PRESS * TIMES[:, None], "m", 1e-6, "cube")
    cell = Signal(TIMES, force[:, None], "N", 0.02, "cube")
    clock = Clock("load_cell", len(TIMES), 1.0, 20.0, 0, 0.05, 0, 0, None, 0.0)
    made = Recording(
        name,
        Source(f"/somewhere/private/{name}.mcap", "ab" * 32, 1234, "verified"),
        0,
        signals={"stage": stage, "load_cell": cell},
        clock={"load_cell": clock},
        metadata={"specimen": {"height_m": "0.02", "origin": "/srv/private/file.csv"}},
    )
    seen = SignalObservation(
        "load_cell", "validates", TIMES, force[:, None], "N", 0.02, "force.plate", "stage.force"
    )
    rest, loaded = (Selection(f"{q}mm", np.array([t])) for q, t in ((0, 0.0), (2, 1.0)))
    return made, Registered((SignalObservation.driving(made, "stage", "m"), seen), (loaded,), rest)


def small_result() -> Result:
    """Two methods on two recordings, no markers, outline or cavity."""
    pairs = [recording("cube_a", 1), recording("cube_b", 2)]
    return Result(
        name="cube",
        title="A cube <between> plates",
        source="A made-up source",
        sentence="soft <cube> predicts what was measured: 1 of 1 checks agree.",
        parameters=(
            Parameter("material.E", "float", "Pa", 1e4, "modulus"),
            Parameter("recording", "str", "1", "/somewhere/private/cube_a.mcap", "file"),
        ),
        methods=(method("soft", 2000.0, accepted=True), method("stiff", 2600.0)),
        recordings=tuple(p[0] for p in pairs),
        rest=(),
        effects=(EFFECT, BLIND),
        published=(PRINTED,),
        identified=(Score("modulus.E", 1e4, "Pa", 42, "stress and strain", "slope"),),
        notes=("cube_a: nothing odd",),
        seed=7,
        inputs=(Declared("modulus", "within 5 %", "assumed"),),
        joint=(Joint("force@3mm", "N", 0.02, 0.03, 12),),
    )


def bare_result() -> Result:
    """One method that did not finish and nothing to compare it with."""
    result = small_result()
    failed = method("soft", 2000.0)
    ended = replace(
        failed.run, at=np.zeros(0, int), u=np.zeros((0, 27, 3)), step_s=None,
        outcome=Outcome("not_converged", 3, "1 update allowed"),
    )  # fmt: skip
    failed = replace(failed, registered=(), runs=(ended,), residuals={}, scores=())
    return replace(
        result, methods=(failed,), recordings=(), effects=(), published=(),
        identified=(), notes=(), inputs=(), parameters=(), sentence="Nothing was decided.",
    )  # fmt: skip


def table(result: Result) -> LongTable:
    """The long table of a result."""
    return table_of(result, document(result, "2026-11-21T04:00:00Z"), result.name)


def no_gl() -> None:
    """Skip what draws bodies; a failure where OpenGL is meant to be."""
    assert os.environ.get("VALIDATE_REQUIRE_GL") != "1", gl.HOW_TO_GET
    pytest.skip("no OpenGL library (VALIDATE_REQUIRE_GL=1 makes this a failure)")


def parts_of(result: Result) -> list[tuple[int, Begun | Exhibit]]:
    """The parts of its report, with their places."""
    return list(parts(result, cache(lambda: table(result))))


def sections_of(result: Result) -> list[Exhibit]:
    """What the report of a result shows, not drawn."""
    found = [part for _, part in sorted(parts_of(result), key=lambda at: at[0])]
    made = [part if isinstance(part, Exhibit) else part(result) for part in found]
    return [exhibit for exhibit in made if exhibit is not None]


def section(result: Result, anchor: str) -> Exhibit:
    """One section of it; the others are not made."""
    found = [part for _, part in parts_of(result) if part.anchor == anchor]
    made = [part if isinstance(part, Exhibit) else part(result) for part in found]
    return next(exhibit for exhibit in made if exhibit is not None)
