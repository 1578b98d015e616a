"""A small synthetic result over time: a box under a load, followed by a filter and its rivals."""

from dataclasses import replace

import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import Chart, Exhibit, NodeMap, NumberTable, Series
from validate.compare.force_error import track_error, track_scores
from validate.compare.residual import Residual
from validate.compare.result import MethodResult, Result
from validate.compare.score import run_scores, scores_of
from validate.compare.verdict import Check
from validate.recording.types import Markers, Recording, Signal, Source
from validate.register.markers.markers import MarkerObservation
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.scene.geometries.box import box
from validate.scene.material import Material
from validate.scene.scene import Load, Probe, Scene, Support
from validate.solve.types import Ending, Outcome, Run, StepTimes, Trace

SIDE, PEAK = 0.1, 0.004  # m
DT, STEPS, FRAMES = 1e-3, 1200, 150
T = DT * np.arange(1, STEPS + 1)
AT = np.unique(np.linspace(0, STEPS - 1, FRAMES).round().astype(np.int64))
NODES = {"node_A": (SIDE, SIDE, SIDE), "node_B": (0.0, SIDE, SIDE), "node_C": (SIDE, 0.0, SIDE),
         "node_D": (0.0, 0.0, SIDE)}  # fmt: skip
WHY = "dt 0.001 s is 4.2 times the critical step 0.00024 s; take a smaller dt"


def body() -> Scene:
    """A box held at its lower side and pushed along x at its upper one."""
    return Scene(
        box((SIDE, SIDE, SIDE), (3, 3, 3)),
        Material(1e4, 0.45, rho=1000.0),
        supports=(Support("z0", (0, 1, 2)),),
        loads=(Load("push", "z1", (1.0, 0.0, 0.0)),),
        probes=tuple(Probe(name, point) for name, point in NODES.items()),
    )


def swing(t: Floats) -> Floats:
    """Displacement along x at the upper side, m: a swing that dies away."""
    return np.asarray(PEAK * np.sin(2 * np.pi * 4 * t) * np.exp(-1.5 * t))


def fields(scale: float) -> Floats:
    """Shear (no, n, 3) m at the output frames."""
    height = body().mesh.nodes[:, 2] / SIDE
    u = np.zeros((len(AT), len(height), 3))
    u[..., 0] = scale * swing(T[AT])[:, None] * height
    return u


def seen() -> tuple[Recording, Registered]:
    """Four markers at 50 Hz with gaps, the load every step."""
    rng, every = np.random.default_rng(4), 20
    rest = np.array(list(NODES.values()))
    t = np.concatenate([[0.0], T[every - 1 :: every]])
    x = rest + swing(t)[:, None, None] * np.eye(3)[0] + 1e-4 * rng.standard_normal((len(t), 4, 3))
    x[20:26, 1] = np.nan
    markers = Markers(t, tuple(NODES), x, 1e-4, "box")
    push = Signal(T, 2.0 * np.sin(2 * np.pi * 4 * T)[:, None], "N", 0.01, "box")
    recording = Recording(
        "box_push", Source("box_push.mcap", "cd" * 32, 4321, "verified"), 0,
        signals={"push": push}, markers={"markers": markers},
    )  # fmt: skip
    layout = {name: np.array(point) for name, point in NODES.items()}
    observed = MarkerObservation.of(markers, layout, body().mesh)
    return recording, Registered((SignalObservation.driving(recording, "push", "N"), observed))


def traces(scale: float, count: int) -> dict[str, Trace]:
    found = {"updates": Trace(np.zeros(count), "1")}
    for name in NODES:
        for c in "xyz":
            moved = scale * swing(T[:count]) if c == "x" else np.zeros(count)
            found[f"{name}.{c}"] = Trace(moved, "m")
    return found


def finished_run(name: str, scale: float, *, sure: bool) -> Run:
    u, extra = fields(scale), dict[str, Trace]()
    if sure:
        extra["nis"] = Trace(np.random.default_rng(1).chisquare(3, STEPS), "1")
        extra["nis.dof"] = Trace(np.full(STEPS, 3.0), "1")
    times = StepTimes(6e-6 if sure else 0.42, 9e-6 if sure else 0.5, 1.0, STEPS)
    sd = np.full(u.shape, 1e-4) if sure else None
    end = Outcome("finished", STEPS)
    return Run(name, T, AT, u, traces(scale, STEPS) | extra, end, 0.8, times, sd)


def ended_run(name: str, ending: Ending, step: int, why: str) -> Run:
    n = len(body().mesh.nodes)
    times = StepTimes(1e-5, 2e-5, 2e-5, step + 1)
    return Run(
        name, T[:step], AT[:0], np.zeros((0, n, 3)), traces(1.0, step), Outcome(ending, step, why),
        0.1, times,
    )  # fmt: skip


def method(name: str, label: str, run: Run, *, accepted: bool = False) -> MethodResult:
    found = {}
    scores = run_scores(run)
    if run.finished:
        errors = [track_error(p, "x", run.traces[f"{p}.x"].y, swing(T)) for p in NODES]
        scores += tuple(s for e in errors for s in track_scores(e, "truth of the twin"))
        off = (run.traces["node_B.x"].y - swing(T))[19::20, None]
        held = Residual("node_B", "all", off + 1e-5, 1e-4, 0.0, "m", "held-out marker along x")
        found = {held.name: held}
        scores += scores_of(held, "measured recording")
    check = Check("node_B.rms@all", 2e-5, 5e-4, 3e-5, 2e-5, 1e-5, 1e-5, "m", 60,
                  "not distinguishable", "good enough", "small")  # fmt: skip
    checks = (check,) if accepted else ()
    return MethodResult(name, label, accepted, body(), (seen()[1],), (run,), found, scores, checks)


def shown() -> tuple[Exhibit, ...]:
    """Every kind of part, with what makes a figure hard to read."""
    every = slice(19, None, 20)
    noisy = swing(T[every]) + 1e-4 * np.random.default_rng(2).standard_normal(len(T[every]))
    mm = 1e3
    track = Chart(
        "displacement_node_A", "Displacement at node_A", "time / s", "u_x / mm",
        (
            Series("estimate ± 2 sd", T, mm * (0.98 * swing(T) - 2e-4), "band",
                   mm * (0.98 * swing(T) + 2e-4)),
            Series("measured", T[every], mm * noisy, "points"),
            Series("reference (twin)", T, mm * swing(T)),
            Series("Kalman filter", T, mm * 0.98 * swing(T)),
            Series("open loop, half as stiff", T, mm * 0.7 * swing(T)),
        ),
    )  # fmt: skip
    rate = np.array([2.0, 30.0, 400.0, 5e3, 2e5])
    sweep = Chart(
        "rate_error", "Error against rate", "rate / Hz", "rmse / mm",
        tuple(Series(f"mesh {n}", rate, 1e-3 * n * rate**0.2) for n in range(2, 12)),
        (("30 Hz camera error", 5e-3), ("1 kHz haptics error", 5.2e-3), ("limit", 0.05)), "xy",
        "Made up.",
    )  # fmt: skip
    nis = Chart(
        "nis", "Consistency", "time / s", "NIS / 1",
        (Series("NIS", T, np.random.default_rng(1).chisquare(3, STEPS), "points"),
         Series("running mean", T, np.full(STEPS, 3.1))),
        (("95 % band, lower", 0.22), ("95 % band, upper", 9.35)), "y",
    )  # fmt: skip
    table = NumberTable(
        "errors_by_node", "Errors against the twin's truth",
        ("method", "node", "RMSE / mm", "rate / Hz", "times"),
        (("Kalman filter", "node_A", 0.0123456, 166666.7, 1200),
         ("explicit Euler", "node_A", None, None, 0)),
        note="explicit Euler: refused, so no error.",
    )  # fmt: skip
    mesh = body().mesh
    error = 0.01 * mesh.nodes[:, 2] / SIDE
    return (
        Exhibit("displacements", "Displacements over time",
                ("The reference is the twin's own.", "No method sees it."), (table,),
                (track, sweep, nis)),
        Exhibit("maps", "Where the errors are",
                maps=(NodeMap("error_kf", "Kalman filter: rms error", mesh, error, "mm", "error"),
                      NodeMap("bias", "Mean error along x", mesh, 1e-5 - 2e-2 * error / 10, "m"))),
    )  # fmt: skip


def tracking_result() -> Result:
    """A filter that finished with sd, an open loop, one refused, one diverged at step 12."""
    recording, _ = seen()
    methods = (
        method("kf", "Kalman filter", finished_run("kf", 0.98, sure=True), accepted=True),
        method("loop", "open loop", finished_run("loop", 0.7, sure=False)),
        method("euler", "explicit Euler", ended_run("euler", "refused", 0, WHY)),
        method("large", "large steps", ended_run("large", "diverged", 12, "u beyond 1e3 m")),
    )
    return Result(
        name="box_push", title="A box pushed to and fro", source="A made-up source",
        sentence="Kalman filter predicts what was held out: 1 of 1 checks agree.",
        parameters=(), methods=methods, recordings=(recording,), rest=(), effects=(), published=(),
        notes=("nothing odd",), kind="same model", exhibits=shown(),
    )  # fmt: skip


def failed_result() -> Result:
    """Only what did not finish."""
    result = tracking_result()
    return replace(result, methods=result.methods[2:], exhibits=result.exhibits[:1])
