"""Measurements made anew: exact readings leave nothing, noise is what is declared."""

import importlib
import pkgutil
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from experiments.multimode.stress_observation import StressObservation
from experiments.stylus_phantom.touched_landmarks import TouchedLandmarks
from experiments.ultrasound_disk.round_outlines import RoundOutlines
from validate import register
from validate.arrays import Floats, Ints, rms
from validate.errors import RegistrationError
from validate.fem.assembly.locate import Rows
from validate.recording.types import Contours, Markers
from validate.register.markers import displacements as from_rest_module
from validate.register.markers.displacements import DisplacementObservation
from validate.register.markers.markers import MarkerObservation, Together
from validate.register.observation import (
    EVERYTHING,
    Draw,
    Exact,
    Observation,
    Selection,
    field_at,
    from_rest,
    shifted,
)
from validate.register.outlines.outlines import (
    OutlineObservation,
    normals,
    polar_angles,
    ray_points,
)
from validate.register.outlines.sections import section
from validate.register.signals import SignalObservation
from validate.register.tools.landmarks import Digitised, Dwell, Match
from validate.scene.geometries.box import box
from validate.solve.types import Trace

T = np.array([0.0, 1.0, 2.0])
RUN_T = np.array([0.5, 1.0, 1.5, 2.0])
MESH = box((0.01, 0.01, 0.01), (1, 1, 1))


@dataclass(frozen=True)
class Simulated:
    """A run of four half seconds from rest, its fields at the second and the last."""

    traces: dict[str, Trace] = field(default_factory=dict)
    method: str = "run"
    t: Floats = field(default_factory=lambda: RUN_T)
    at: Ints = field(default_factory=lambda: np.array([1, 3]))
    u: Floats = field(default_factory=lambda: np.stack([np.full((8, 3), x) for x in (1e-3, 4e-3)]))


RUN = Simulated(
    {"stage.force": Trace(RUN_T**2, "N")}
    | {f"a.{c}": Trace(k * RUN_T, "m") for k, c in zip((1e-3, 2e-3, 3e-3), "xyz", strict=True)}
)


def drawn(seed: int = 1, **more: float) -> Draw:
    return Draw(np.random.default_rng(seed), **more)


def signal(**changes: object) -> SignalObservation:
    y = np.array([[0.3], [0.2], [0.1]])
    plain = SignalObservation("cell", "validates", T, y, "N", 0.1, "force", "stage.force")
    return replace(plain, **changes)  # type: ignore[arg-type]


def markers(together: tuple[Together, ...] = ()) -> MarkerObservation:
    names = ("a", "b", "c", "d")
    layout = {n: MESH.nodes[i] for n, i in zip(names, (0, 1, 2, 4), strict=True)}
    x = np.repeat(np.array(list(layout.values()))[None], 3, axis=0)
    seen = Markers(T, names, x, 1e-4, "camera")
    return MarkerObservation.of(seen, layout, MESH, together=together)


ALL = (Together("moved", (0, 1, 2), "all"),)


def test_a_signal_read_exactly_leaves_nothing() -> None:
    anew = signal().anew(signal().left(RUN), Exact())
    assert anew.y[:, 0] == pytest.approx([0.0, 1.0, 4.0])
    (found,) = anew.deviations(RUN, Selection("at 1 s", np.array([1.0])))
    assert found.values == pytest.approx(np.zeros((1, 1)))


def test_a_signal_without_its_trace_stays_as_it_was_measured() -> None:
    other = signal(trace="none")
    assert other.anew(other.left(RUN), Exact()).y == pytest.approx(other.y)


@pytest.mark.parametrize("together", [(), ALL])
def test_markers_read_exactly_leave_nothing(together: tuple[Together, ...]) -> None:
    seen = markers(together)
    anew = seen.anew(seen.left(RUN), Exact())
    where = Selection("at 2 s", np.array([2.0]))
    for found in anew.deviations(RUN, where):
        assert found.values == pytest.approx(np.zeros_like(found.values), abs=1e-15)
    if not together:
        assert anew.x[1, 0] - anew.rest[0] == pytest.approx([1e-3, 2e-3, 3e-3])


def test_what_was_not_seen_stays_so() -> None:
    seen = markers()
    x = seen.x.copy()
    x[1, 2] = np.nan
    hidden = replace(seen, x=x)
    assert np.isnan(hidden.anew(hidden.left(RUN), drawn()).x[1, 2]).all()


def test_an_outline_read_exactly_lies_on_the_section() -> None:
    turn = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    circle = 0.005 + 0.002 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    seen = OutlineObservation.of(
        Contours(T, (circle,) * 3, 1e-4, np.eye(4), "scene"),
        Wall(),
        0.0,  # type: ignore[arg-type]
    )
    run = replace(RUN, at=np.array([0, 1, 3]), u=np.concatenate([np.zeros((1, 8, 3)), RUN.u]))
    anew = seen.anew(seen.left(run), Exact())
    (found,) = (d for d in anew.deviations(run, Selection("x", np.array([2.0])))
                if d.quantity == "contour")  # fmt: skip
    assert rms(found.values) < 1e-15
    noisy = seen.anew(seen.left(run), drawn())
    off = [a - b for a, b in zip(noisy.outlines, anew.outlines, strict=True)]
    along = np.abs(np.einsum("kd,kd->k", off[0], normals(anew.outlines[0])))
    assert along == pytest.approx(np.linalg.norm(off[0], axis=1))
    assert rms(np.concatenate([np.linalg.norm(o, axis=1) for o in off])) == pytest.approx(
        1e-4, rel=0.2
    )
    known = replace(seen, sds=np.array([0.0, 1e-4, 3e-4])).anew(seen.left(run), drawn())
    own = [rms(a - b) for a, b in zip(known.outlines, anew.outlines, strict=True)]
    assert own == pytest.approx(np.array([0.0, 1e-4, 3e-4]) / np.sqrt(2), rel=0.3, abs=1e-15)


def test_rays_end_on_the_straight_edges() -> None:
    square = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    assert ray_points(square, np.array([0.0, 0.3, np.pi / 2])) == pytest.approx(
        np.array([[1.0, 0.0], [1.0, np.tan(0.3)], [0.0, 1.0]]), abs=1e-12
    )
    assert ray_points(square, polar_angles(square)) == pytest.approx(square)


def test_noise_is_the_declared_one_times_what_is_asked_for() -> None:
    plain = signal(t=np.arange(4000.0), y=np.zeros((4000, 1)), trace="")
    for times in (1.0, 2.0):
        off = plain.anew(np.zeros(4000), drawn(noise=times)).y
        assert rms(off) == pytest.approx(0.1 * times, rel=0.05)


def test_the_tre_is_a_length_and_shared_by_all_samples() -> None:
    seen = replace(markers(), sd=0.0, tre=np.full(4, 3e-4))
    still = np.zeros(seen.x.size)
    off = np.array([seen.anew(still, drawn(k)).x - seen.x for k in range(400)])
    assert np.ptp(off, axis=(1, 2)).max() < 1e-15
    assert rms(np.linalg.norm(off[:, 0, 0], axis=1)) == pytest.approx(3e-4, rel=0.05)


def test_the_systematic_part_of_one_marker_is_per_axis() -> None:
    """The same tre, whether markers are compared one by one or together."""
    one = {d.quantity: d.systematic for d in markers().deviations(RUN, EVERYTHING)}
    (all_of_them,) = markers(ALL).deviations(RUN, Selection("x", np.array([2.0])))
    tre = markers().tre
    assert one["a"] == pytest.approx(tre[0] / np.sqrt(3))
    assert all_of_them.systematic == pytest.approx(rms(tre) / np.sqrt(3))


def test_a_clock_that_is_late_reads_later_values() -> None:
    t = np.arange(5.0)
    y = np.array([[0.0], [1.0], [np.nan], [3.0], [4.0]])
    assert shifted(t, y, 0.5)[[0, 1, 3], 0] == pytest.approx([0.5, 1.5, 3.5])
    assert np.isnan(shifted(t, y, 0.5)[2, 0])
    late = signal(sd=0.0, y=np.array([[0.0], [1.0], [2.0]]), sd_t=0.0)
    assert late.anew(np.zeros(3), drawn(late=0.25)).y[:2, 0] == pytest.approx([0.25, 1.25])


def test_runs_begin_at_rest() -> None:
    assert from_rest(RUN_T, RUN_T[:, None], np.array([0.0, 0.25, 2.0]))[:, 0] == pytest.approx(
        [0.0, 0.25, 2.0]
    )
    assert field_at(RUN, 0.5)[0, 0] == pytest.approx(0.5e-3)
    assert field_at(RUN, 1.5)[0, 0] == pytest.approx(2.5e-3)
    assert field_at(RUN, 9.0)[0, 0] == pytest.approx(4e-3)


@dataclass(frozen=True)
class Wall:
    """A cylinder along z that grows by what its nodes move along x."""

    triangles: Ints = field(default_factory=lambda: _tube()[1])

    def deformed(self, u: Floats) -> Floats:
        nodes = _tube()[0].copy()
        nodes[:, :2] = 0.005 + (nodes[:, :2] - 0.005) * (1 + 50 * u[0, 0])
        return nodes

    def section(self, u: Floats, pose: Floats) -> Floats:
        return section(self.deformed(u), self.triangles, pose)


def _tube() -> tuple[Floats, Ints]:
    turn = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    ring = 0.005 + 0.002 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    nodes = np.vstack([np.column_stack([ring, np.full(24, z)]) for z in (-0.01, 0.01)])
    a = np.arange(24)
    b = (a + 1) % 24
    triangles = np.vstack([np.stack([a, b, a + 24], axis=1), np.stack([b, b + 24, a + 24], axis=1)])
    return nodes, triangles


def test_stresses_read_exactly_leave_nothing_and_their_noise_is_relative() -> None:
    y = np.array([[0.0], [90.0], [210.0]])
    seen = StressObservation("curve", "validates", T, y, 0.0, 0.05, "stress")
    run = Simulated({"nominal_stress": Trace(100 * RUN_T, "Pa")})
    anew = seen.anew(seen.left(run), Exact())
    assert anew.y[:, 0] == pytest.approx([0.0, 100.0, 200.0])
    off = np.array([seen.anew(seen.left(run), drawn(k)).y[:, 0] for k in range(400)]) - anew.y[:, 0]
    assert off[:, 2] == pytest.approx(210 / 90 * off[:, 1])  # one axis of one figure
    assert rms(off[:, 1]) == pytest.approx(4.5, rel=0.1)
    (judged,) = seen.anew(seen.left(run) + [0, 9, 21], Exact()).deviations(run, EVERYTHING)
    assert judged.values == pytest.approx(np.full((2, 1), -0.1))  # of 90 and 210 Pa, as measured
    fallen = seen.anew(seen.left(run) - [0, 99.9, 0], Exact())
    assert fallen.loaded.tolist() == [False, True, True]
    other = Simulated({})
    assert seen.left(other) == pytest.approx(np.zeros(3))


def test_round_outlines_read_exactly_have_the_bodys_diameter() -> None:
    turn = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    circle = 0.01 + 0.004 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    contours = Contours(T, (circle, 1.1 * circle, circle), 1e-5, np.eye(4), "scene")
    frames: Any = None
    seen = RoundOutlines("diameter", "validates", contours, frames, 1.25)
    ends = {f"{end}.{c}": Trace(np.full(4, sign * 0.006 * (c == "x")), "m")
            for end, sign in (("left", -1), ("right", 1)) for c in "xyz"}  # fmt: skip
    run = Simulated(ends)
    anew = seen.anew(seen.left(run), Exact())
    assert anew.diameters == pytest.approx(np.full(3, 0.012))
    off = np.array([seen.anew(seen.left(run), drawn(k)).diameters for k in range(300)]) - 0.012
    assert off.std() == pytest.approx(np.hypot(seen.wall, seen.scatter), rel=0.1)


def test_displacements_read_exactly_leave_nothing_and_each_axis_has_its_noise() -> None:
    points = np.random.default_rng(0).uniform(0.001, 0.009, (3000, 3))
    sd = np.array([1e-5, 2e-5, 4e-5])
    rows = Rows.barycentric(MESH, points)
    u = np.full(points.shape, 2e-3)
    seen = DisplacementObservation("beads", "validates", T[-1:], points, u, rows, sd)
    anew = seen.anew(seen.left(RUN), Exact())
    assert anew.u == pytest.approx(np.full(points.shape, 4e-3))  # the last frame's, not the first's
    for found in anew.deviations(RUN, Selection("at 2 s", np.array([2.0]))):
        assert found.values == pytest.approx(np.zeros((3000, 1)), abs=1e-15)
    off = seen.anew(seen.left(RUN), drawn()).u - anew.u
    assert off.std(axis=0) == pytest.approx(sd, rel=0.05)


LANDMARKS = 0.1 * np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [0, 1, 1]])


def touched(off: Floats, sd: float = 1e-4) -> TouchedLandmarks:
    """Landmarks touched in another order than that of the list, `off` (6, 3) m their places."""
    t, known = np.arange(2.0), np.array([3, 0, 5, 1, 4, 2])
    parts = tuple(Dwell(0, 2, t, np.tile(x, (2, 1))) for x in LANDMARKS[known] + off)
    names = tuple("abcdef")
    match = Match(known, np.arange(6), 0.0)
    seen = Digitised(t, LANDMARKS, parts, parts, names, LANDMARKS, match, sd)
    return TouchedLandmarks(seen, np.linspace(0.5, 2.0, 6))


def predicting(seen: TouchedLandmarks) -> Simulated:
    """A rigid body that has each landmark at its instant where the others say."""
    d = seen.digitised
    x = d.places + d.left_out
    traces = {f"{name}.{axis}": Trace(np.full(6, x[i, c]), "m")
              for i, name in enumerate(d.touched) for c, axis in enumerate("xyz")}  # fmt: skip
    return Simulated(traces, t=seen.t)


def test_landmarks_touched_exactly_lie_where_all_others_say() -> None:
    seen = touched(1e-3 * np.random.default_rng(3).standard_normal((6, 3)))
    run = predicting(seen)
    (found,) = seen.anew(seen.left(run), Exact()).deviations(run, EVERYTHING)
    assert found.values == pytest.approx(np.zeros((6, 3)), abs=1e-9)
    assert found.t is not None
    assert found.t.tolist() == seen.t.tolist()
    assert found.axes == ("x", "y", "z")


@pytest.mark.slow
def test_noise_of_a_landmark_is_its_own_and_that_of_the_poses_it_makes() -> None:
    seen = touched(np.zeros((6, 3)))
    run = predicting(seen)
    off = [seen.anew(seen.left(run), drawn(k)).deviations(run, EVERYTHING)[0].values
           for k in range(300)]  # fmt: skip
    each = float(np.std(off))
    assert each == pytest.approx(rms(seen.digitised.expected), rel=0.05)
    assert each > 1.2 * seen.digitised.sd


def test_every_observation_can_be_drawn_anew() -> None:
    """Else an experiment that compares it has no coverage study."""
    names = [m.name for m in pkgutil.walk_packages(register.__path__, f"{register.__name__}.")]
    modules = [importlib.import_module(name) for name in names]
    found = [c for m in modules for c in vars(m).values()
             if isinstance(c, type) and c.__module__ == m.__name__
             and hasattr(c, "deviations") and c is not Observation]  # fmt: skip
    assert MarkerObservation in found
    assert [c.__name__ for c in found if not (hasattr(c, "left") and hasattr(c, "anew"))] == []


def test_a_run_that_begins_at_rest_is_read_as_it_is_and_others_from_zero() -> None:
    y = np.array([[2.0], [4.0]])
    assert from_rest(np.array([0.0, 1.0]), y, np.array([0.0, 0.5]))[:, 0].tolist() == [2.0, 3.0]
    assert from_rest(np.array([1.0, 2.0]), y, np.array([0.0, 0.5]))[:, 0].tolist() == [0.0, 1.0]
    assert from_rest(np.array([1.0]), np.zeros((1, 0)), np.zeros(3)).shape == (3, 0)


def test_a_late_clock_reads_only_tracked_samples() -> None:
    t = np.array([0.0, 1.0, 2.0])
    y = np.array([[0.0, np.nan, 1.0], [10.0, np.nan, np.nan], [20.0, np.nan, 3.0]])
    late = shifted(t, y, 0.5)
    np.testing.assert_array_equal(late[:, 0], [5.0, 15.0, 20.0])
    np.testing.assert_array_equal(late[:, 1], [np.nan] * 3)
    np.testing.assert_array_equal(late[:, 2], [1.5, np.nan, 3.0])
    assert shifted(t, y, 0.0) is y


def test_outlines_of_a_late_clock_move_with_their_speed() -> None:
    """A circle that grows by 1 mm and then by 3 mm a second, read half a second late."""
    angles = np.linspace(0, 2 * np.pi, 90, endpoint=False)
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    outlines = tuple(r * circle for r in (0.010, 0.011, 0.014))
    seen = OutlineObservation("outline", "validates", T, outlines, np.eye(4), 0.0, None, 0.0)  # type: ignore[arg-type]
    late = seen.anew(np.zeros(3 * 180), drawn(late=0.5))
    for found, radius in zip(late.outlines, (0.0105, 0.012, 0.0155), strict=True):
        np.testing.assert_allclose(found, radius * circle, rtol=1e-9, atol=1e-12)
    one = replace(seen, t=T[:1], outlines=outlines[:1]).anew(np.zeros(180), drawn(late=0.5))
    np.testing.assert_allclose(one.outlines[0], outlines[0], atol=1e-15)  # no speed to tell


def test_markers_that_are_missing_at_rest_are_named() -> None:
    x = np.zeros((3, 2, 3))
    x[:2, 1] = np.nan
    seen = Markers(np.array([0.0, 0.1, 1.0]), ("a", "b"), x + [[[1.0, 0, 0]]], 1e-4, "lab")
    rested, unseen, fewest = from_rest_module.rested(seen, 0.5)
    assert (rested.names, unseen, fewest) == (("a",), ("b",), 2)
    late, unseen, fewest = from_rest_module.rested(seen, 2.0)
    assert (late.names, unseen, fewest) == (("a", "b"), (), 1)
    only = replace(seen, names=("b",), x=seen.x[:, 1:])
    with pytest.raises(RegistrationError, match=r"1 markers.*first 0.5 s"):
        from_rest_module.rested(only, 0.5)


def test_markers_off_the_body_ask_how_far_they_stand(monkeypatch: pytest.MonkeyPatch) -> None:
    rest = np.array([[0.5e-2, 0.5e-2, 3e-2]])
    whole = SimpleNamespace(x=rest[None], names=("stalk",))
    with pytest.raises(
        RegistrationError,
        match=r"stalk.*--set seen.stands=15mm",
    ):
        from_rest_module.since_rest(whole, MESH, 1e-4, 1, 1e-3)  # type: ignore[arg-type]
