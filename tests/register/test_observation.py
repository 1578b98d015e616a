"""Selections, deviations and what of a recording is compared, on three samples by hand."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from validate.arrays import Floats, Ints, rms
from validate.compare.residual import Residual, _of, _volumes, stacked
from validate.compare.verdict import errors_of
from validate.errors import ComparisonError, RegistrationError
from validate.fem.assembly.locate import nearest_node_rows
from validate.recording.types import Contours, Markers
from validate.register.markers.markers import MarkerObservation, Together, vector
from validate.register.observation import (
    EVERYTHING,
    Deviation,
    Selection,
    frame_at,
    nearest_samples,
)
from validate.register.outlines.outlines import Corner, OutlineObservation, angular_points, merged
from validate.register.registration import Registered
from validate.register.signals import (
    SignalObservation,
    holds_at,
    instant,
    require_rising,
    windows_of,
)
from validate.scene.geometries.box import box
from validate.solve.types import Trace

# private: _volumes: called alone.
# private: _of: the residual of one deviation, drawn 300 times.

T = np.array([0.0, 1.0, 2.0])
RUN_T = np.array([0.0, 0.5, 1.0, 1.5, 2.0])


@dataclass(frozen=True)
class Simulated:
    """A run of five half seconds, with fields at the first, third and last."""

    traces: dict[str, Trace]
    method: str = "run"
    t: Floats = field(default_factory=lambda: RUN_T)
    at: Ints = field(default_factory=lambda: np.array([0, 2, 4]))
    u: Floats = field(default_factory=lambda: np.zeros((3, 8, 3)))


def signal(role: str = "validates", **changes: object) -> SignalObservation:
    y = np.array([[0.0], [2.0], [4.0]])
    plain = SignalObservation("cell", "validates", T, y, "N", 0.1, "force", "stage.force")
    return replace(plain, role=role, **changes)


def ramp(y: tuple[float, ...]) -> Simulated:
    return Simulated({"stage.force": Trace(np.array(y), "N")})


HALVES = ramp((0.0, 1.0, 3.0, 4.0, 5.0))  # N at the run's steps


# --- selections -----------------------------------------------------------------------------------


def test_a_hold_is_one_sample_a_window_many_and_all_is_every_one() -> None:
    hold = Selection("2N", np.array([1.0]))
    window = Selection("late", np.array([1.0, 2.0]))
    assert [s.samples(T, RUN_T, "cell").tolist() for s in (hold, window, EVERYTHING)] == [
        [1], [1, 2], [0, 1, 2],
    ]  # fmt: skip
    assert hold.steps(RUN_T).tolist() == [2]
    assert instant(hold) == 1.0


def test_all_is_no_sample_before_the_first_or_after_the_last_step() -> None:
    assert EVERYTHING.samples(T, np.array([0.5, 1.0]), "cell").tolist() == [1]
    assert EVERYTHING.samples(T, np.array([1.0 + 1e-12, 2.0]), "cell").tolist() == [1, 2]


def test_a_trace_is_read_at_the_nearest_step_of_a_hold_and_between_steps_of_all() -> None:
    y = HALVES.traces["stage.force"].y
    between = np.array([0.25, 1.25])
    assert EVERYTHING.read(RUN_T, y, between).tolist() == [0.5, 3.5]
    assert Selection("h", np.array([1.2])).read(RUN_T, y, between).tolist() == [3.0]


def test_the_nearest_sample_is_the_earlier_of_two_and_within_a_second() -> None:
    assert nearest_samples(T, np.array([0.5, 0.51, 2.9]), "cell").tolist() == [0, 1, 2]
    assert nearest_samples(np.array([1.0]), np.array([0.5]), "cell").tolist() == [0]
    with pytest.raises(ComparisonError, match=r"within 1 s of t = 3\.500 s"):
        nearest_samples(T, np.array([0.0, 3.5]), "cell")


def test_every_instant_of_all_is_a_kept_frame_and_one_that_is_not_kept_is_refused() -> None:
    assert EVERYTHING.instants(HALVES).t == pytest.approx([0.0, 1.0, 2.0])
    hold = Selection("h", np.array([1.0]))
    assert hold.instants(HALVES) is hold
    assert frame_at(HALVES, EVERYTHING.instants(HALVES)).shape == (3, 8, 3)
    with pytest.raises(ComparisonError, match=r"run: 3 output frames, none at '1\.5s'"):
        frame_at(HALVES, Selection("1.5s", np.array([1.5])))


# --- deviations -----------------------------------------------------------------------------------


def test_a_signals_deviation_is_the_trace_less_what_was_measured() -> None:
    """Measured 0, 2, 4 N; the run has 0, 3, 5 N there."""
    (every,) = signal().deviations(HALVES, EVERYTHING)
    assert every.values.tolist() == [[0.0], [1.0], [1.0]]
    assert (every.quantity, every.unit, every.sd, every.systematic) == ("force", "N", 0.1, 0.0)
    assert (every.simulated, every.measured) == (None, None)
    assert every.definition == "force, simulated less measured at every sample"
    (one,) = signal().deviations(HALVES, Selection("2N", np.array([1.0]), "one sample"))
    assert (one.values.tolist(), one.simulated, one.measured) == ([[1.0]], 3.0, 2.0)
    assert one.definition == "force, one sample"
    (late,) = signal().deviations(HALVES, Selection("late", np.array([1.0, 2.0])))
    assert late.values.tolist() == [[1.0], [1.0]]


def test_values_at_several_instants_have_their_times_and_components_their_names() -> None:
    """A hold is one instant, whose load is its condition: its values have no times."""
    hold, two = Selection("1s", np.array([1.0])), Selection("late", np.array([1.0, 2.0]))
    for selection, t in ((hold, None), (two, [1.0, 2.0]), (EVERYTHING, [0.0, 1.0, 2.0])):
        (force,) = signal().deviations(HALVES, selection)
        (a,) = markers().deviations(still("a"), selection)
        assert [None if d.t is None else d.t.tolist() for d in (force, a)] == [t, t]
        assert (force.axes, a.axes) == ((), ("x", "y", "z"))
    seen = markers(Together("across", (1, 2), "along y and z"))
    assert seen.deviations(still(), hold)[0].t is None
    (every,) = seen.deviations(still(), EVERYTHING)
    assert every.t is not None
    assert every.t.tolist() == [0.0, 0.0, 1.0, 1.0, 2.0]  # the second is lost at the end
    assert every.axes == ("y", "z")


def test_a_signal_without_a_trace_says_what_was_not_answered() -> None:
    other = signal(trace="nowhere")
    assert other.deviations(HALVES, EVERYTHING) == ()
    assert other.unanswered(HALVES) == ("cell",)
    assert signal().unanswered(HALVES) == ()
    assert signal().units == {"force": "N"}
    assert signal().rows() is None


MESH = box((1.0, 1.0, 1.0), (1, 1, 1))
TOP = np.array([[0.0, 0.0, 1.0], [1.0, 1.0, 1.0]])


def markers(*groups: Together) -> MarkerObservation:
    """Two corners that were seen to rise by 1, 2 mm a second; the second is lost at the end."""
    x = TOP + np.multiply.outer(T, 1e-3 * np.array([[0, 0, 1], [0, 0, 2]]))
    x[2, 1] = np.nan
    none: object = None
    return MarkerObservation(
        "seen", "validates", T, ("a", "b"), x, TOP, nearest_node_rows(MESH, TOP), 1e-4,
        np.array([3e-4, 4e-4]), none, groups,  # type: ignore[arg-type]
    )  # fmt: skip


@pytest.mark.parametrize(("above", "kept"), [(0.09e-3, 2), (0.11e-3, 1)])
def test_a_marker_belongs_to_the_body_within_a_tenth_of_a_millimetre(
    above: float, kept: int
) -> None:
    """At a part of the body it is left out, of the whole body it is refused."""
    rest = TOP + np.array([[0, 0, above], [0, 0, 0]])
    assert len(replace(markers(), rest=rest).within(MESH).names) == kept
    places = {"a": rest[0], "b": rest[1], "c": np.zeros(3), "d": np.eye(3)[0]}
    seen = Markers(np.zeros(1), tuple(places), np.array([list(places.values())]), 1e-4, "scene")
    if kept == 2:
        MarkerObservation.of(seen, places, MESH)
        return
    with pytest.raises(RegistrationError, match=r"'a' by 0\.11 mm"):
        MarkerObservation.of(seen, places, MESH)


def still(*probes: str) -> Simulated:
    """A run in which nothing moves, with these probes."""
    zero = Trace(np.zeros(5), "m")
    return Simulated({f"{p}.{c}": zero for p in probes for c in "xyz"})


def test_each_marker_is_a_quantity_where_a_probe_has_its_name() -> None:
    (a,) = markers().deviations(still("a"), EVERYTHING)
    assert (a.quantity, a.unit, a.sd, a.systematic) == (
        "a",
        "m",
        1e-4,
        pytest.approx(3e-4 / np.sqrt(3)),
    )
    assert a.values == pytest.approx(-1e-3 * np.array([[0, 0, 0], [0, 0, 1], [0, 0, 2]]))
    _, b = markers().deviations(still("a", "b"), EVERYTHING)
    assert b.values == pytest.approx(-1e-3 * np.array([[0, 0, 0], [0, 0, 2]]))  # lost at the end
    assert markers().deviations(still("b"), Selection("end", np.array([2.0]))) == ()
    assert markers().unanswered(still("a")) == ("b",)
    assert markers().units == {"a": "m", "b": "m"}


def test_markers_together_are_read_from_the_field_along_their_axes() -> None:
    up, across = Together("up", (2,), "along z"), Together("across", (0, 1), "along x and y")
    seen = markers(up, across)
    one, two = seen.deviations(still(), Selection("1s", np.array([1.0])))
    assert (one.quantity, two.quantity) == ("up", "across")
    assert one.values == pytest.approx(np.array([[-1e-3], [-2e-3]]))
    assert two.values == pytest.approx(np.zeros((2, 2)), abs=1e-15)
    assert one.systematic == pytest.approx(np.sqrt((9 + 16) / 2 / 3) * 1e-4)
    end, _ = seen.deviations(still(), Selection("end", np.array([2.0])))
    assert end.values == pytest.approx(np.array([[-2e-3]]))
    every, _ = seen.deviations(still(), EVERYTHING)
    assert len(every.values) == 2 + 2 + 1
    assert seen.unanswered(still()) == ()
    assert set(seen.units) == {"up", "across"}


def looks(t: Floats, z: Floats, *groups: Together) -> MarkerObservation:
    """One corner seen at times t (nt,) s at heights z (nt,) m above its rest."""
    x = TOP[:1] + z[:, None, None] * np.array([0.0, 0.0, 1.0])
    none: object = None
    return MarkerObservation(
        "seen", "validates", t, ("a",), x, TOP[:1], nearest_node_rows(MESH, TOP[:1]), 1e-4,
        np.zeros(1), none, groups,  # type: ignore[arg-type]
    )  # fmt: skip


UP = Together("up", (2,), "along z")


def test_what_was_measured_at_most_is_kept_beside_its_deviation() -> None:
    (every,) = signal().deviations(HALVES, EVERYTHING)
    assert every.scale == 4.0
    (up,) = looks(T, -1e-3 * T, UP).deviations(still(), Selection("1s", T[1:2]))
    assert up.scale == pytest.approx(2e-3)  # of all looks, not of the hold alone
    (a,) = markers().deviations(still("a"), EVERYTHING)
    assert a.scale == pytest.approx(2e-3)


def test_jittered_looks_are_interpolated_onto_the_fields_and_the_error_counts() -> None:
    """Frames at 0, 1 and 2 s; the nearest look to 1 s is 0.3 s off."""
    t = np.array([0.0, 0.7, 1.4, 2.0])
    (steady,) = looks(t, 1e-3 * t, UP).deviations(still(), EVERYTHING)
    assert steady.values[:, 0] == pytest.approx([0.0, -1e-3, -2e-3])
    assert (steady.sd, steady.systematic) == (pytest.approx(1e-4), 0.0)
    (bent,) = looks(t, 1e-3 * t**2, UP).deviations(still(), EVERYTHING)
    off = 1e-3 * (1.0 - 0.7) * (1.4 - 1.0)  # of a line between two points of t^2
    assert bent.values[:, 0] == pytest.approx([0.0, -1e-3 - off, -4e-3])
    assert bent.sd == pytest.approx(np.hypot(1e-4, off / np.sqrt(3)))  # one frame of three
    (late,) = looks(t[:3], 1e-3 * t[:3], UP).deviations(still(), Selection("w", RUN_T[[2, 4]]))
    assert len(late.values) == 1  # nothing was seen beyond the last look


def test_a_look_beside_its_hold_counts_what_moves_in_between() -> None:
    """Between two holds lies no hold: the nearest look is taken, 0.1 s late at 1 mm/s."""
    t = np.array([0.0, 1.1, 2.0])
    hold = Selection("1s", np.array([1.0]))
    (late,) = looks(t, 1e-3 * t, UP).deviations(still(), hold)
    assert late.values[:, 0] == pytest.approx([-1.1e-3])
    assert late.systematic == pytest.approx(1e-4)
    (right,) = looks(T, 1e-3 * T, UP).deviations(still(), hold)
    assert right.systematic == 0.0


# --- outlines -------------------------------------------------------------------------------------

ROUND = 8e-3 * np.stack([f(np.deg2rad(np.arange(0, 360, 10))) for f in (np.cos, np.sin)], axis=1)
DIAGONAL = np.array([-np.cos(np.deg2rad(50)), -np.sin(np.deg2rad(50))])


@dataclass(frozen=True)
class Round(OutlineObservation):
    """A wall that is simulated as a circle that stays."""

    def simulated(self, u: Floats) -> Floats:
        return ROUND


def test_the_sd_of_an_outline_is_the_scatter_of_noisy_ones() -> None:
    """150 draws of noise along the normal at 36 points; the outline moves by 3 mm to its corner."""
    rng, none, sd = np.random.default_rng(3), None, 0.1e-3
    corner = Corner("corner", np.deg2rad(230.0), "")
    found: dict[str, list[Floats]] = {}
    for _ in range(150):
        still, moved = (ROUND * (1 + rng.normal(0, sd, (36, 1)) / 8e-3) for _ in range(2))
        outlines = (still, moved + 3e-3 * DIAGONAL)
        seen = Round("o", "validates", T[:2], outlines, np.eye(4), sd, none, 0.0, (corner,))  # type: ignore[arg-type]
        devs = seen.deviations(ramp(()), Selection("1s", T[1:2]))
        for d in devs:
            found.setdefault(d.quantity, []).append(d.values / d.sd)
    for quantity in ("contour.area", "contour.centroid", "corner"):
        assert np.std(found[quantity], axis=0) == pytest.approx(1.0, rel=0.15), quantity
    stated = np.sqrt(2) * sd  # both outlines have a point near the corner's ray
    assert np.mean(found["corner"]) * stated == pytest.approx(-3e-3, rel=0.03)
    contours = Contours(T[:1], (ROUND,), sd, np.eye(4), "scene")
    assert OutlineObservation.of(contours, none, 0.0).sd_t == 0.0  # type: ignore[arg-type]
    (still_one,) = Round("o", "validates", T[:1], (ROUND,), np.eye(4), sd, none, 0.0).deviations(  # type: ignore[arg-type]
        ramp(()), Selection("rest", T[:1])
    )
    assert (still_one.quantity, still_one.sd) == ("contour", sd)


def test_an_outline_beside_its_instant_counts_what_moves_in_between() -> None:
    """The circle grows by 1 mm a second and is seen 0.1 s after the field."""
    t = np.array([0.0, 1.1, 2.0])
    outlines = tuple((1 + s / 8) * ROUND for s in t)
    none: object = None
    seen = Round("o", "validates", t, outlines, np.eye(4), 1e-4, none, 0.0)  # type: ignore[arg-type]
    late = seen.deviations(ramp(()), Selection("1s", T[1:2]))[0]
    on_time = replace(seen, t=T).deviations(ramp(()), Selection("1s", T[1:2]))[0]
    assert late.systematic == pytest.approx(1e-4, rel=0.02)
    assert on_time.systematic == 0.0


def noisy(k: int, first: float, sd: float, rng: np.random.Generator) -> Floats:
    """A circle of k points, the first at an angle in degrees, with noise along its normal."""
    angle = np.deg2rad(first + 360 * np.arange(k) / k)
    radius = 8e-3 + rng.normal(0, sd, k)
    return radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("k", "first", "freedom"), [(36, 0.0, 36), (36, 5.0, 24), (72, 2.5, 36), (24, 3.0, 20)]
)
def test_the_distance_an_outline_moved_has_the_noise_of_its_normal(
    k: int, first: float, freedom: int
) -> None:
    """Noise lies along the normal: a distance has that of one component, not of two. A perfect
    model is then within 2 u_D in 95 of 100 draws."""
    rng, sd, draws = np.random.default_rng(11), 0.1e-3, 300
    found = []
    for _ in range(draws):
        outlines = (noisy(k, first, sd, rng), noisy(k, first, sd, rng))
        seen = Round("o", "validates", T[:2], outlines, np.eye(4), sd, None, 0.0)  # type: ignore[arg-type]
        found.append(seen.deviations(ramp(()), Selection("1s", T[1:2]))[1])
    stated = [np.sqrt(2) * d.sd for d in found]
    assert found[0].quantity == "contour.material"
    assert rms(np.vstack([d.values for d in found])) == pytest.approx(rms(stated), rel=0.03)
    assert np.mean([d.freedom or 0 for d in found]) == pytest.approx(freedom, abs=1)
    one = Selection("1s", T[1:2])
    errors = [errors_of(_of(d, one, "validates"), "rms") for d in found]
    assert np.mean([2 * e.u_D[0] >= e.E[0] for e in errors]) == pytest.approx(0.95, abs=0.045)


def test_a_corner_that_moves_along_the_wall_has_little_of_its_noise() -> None:
    rng, sd, across = np.random.default_rng(12), 0.1e-3, np.array([np.sin(0.0), np.cos(0.0)])
    corner = Corner("corner", 0.0, "")
    found = []
    for _ in range(300):
        outlines = (noisy(36, 0.0, sd, rng), noisy(36, 0.0, sd, rng) + 3e-3 * across)
        seen = Round("o", "validates", T[:2], outlines, np.eye(4), sd, None, 0.0, (corner,))  # type: ignore[arg-type]
        found.append(seen.deviations(ramp(()), Selection("1s", T[1:2]))[2])
    assert np.std([d.values for d in found]) == pytest.approx(rms([d.sd for d in found]), rel=0.1)
    assert rms([d.sd for d in found]) == pytest.approx(sd * np.sqrt(2) * np.sqrt(2 / 36), rel=0.05)


def test_an_outline_of_three_points_is_seen_from_its_centroid() -> None:
    """The way round closes at the first point, whatever the corners."""
    angles = np.deg2rad([10.0, 130.0, 250.0])
    corners = np.array([2.0, 1.0]) + 3.0 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    for outline in (corners, corners[::-1]):
        assert angular_points(outline, angles) == pytest.approx(corners, rel=1e-12)


def test_deviations_of_several_instants_share_the_rms_of_what_is_systematic() -> None:
    one = Deviation("q", np.ones((2, 1)), "m", 0.1, 3.0, "words")
    found = merged([one, replace(one, systematic=4.0, sd=0.7)])
    assert (found.systematic, len(found.values)) == (pytest.approx(np.sqrt(12.5)), 4)
    assert (found.sd, found.freedom) == (pytest.approx(0.5), None)
    assert merged([replace(one, freedom=3), replace(one, freedom=4)]).freedom == 7


# --- a recording ----------------------------------------------------------------------------------


def stage(**changes: object) -> SignalObservation:
    y = np.array([[0.0], [1e-3], [2e-3]])
    return replace(SignalObservation("stage", "drives", T, y, "m", 0.0), **changes)


def test_inputs_are_the_driving_signals_side_by_side_in_order() -> None:
    load = SignalObservation("pull", "drives", T, np.array([[5.0], [6.0], [7.0]]), "N", 0.0)
    cell = signal()
    seen = Registered((stage(), cell, load))
    assert seen.inputs.tolist() == [[0.0, 5.0], [1e-3, 6.0], [2e-3, 7.0]]
    assert [d.name for d in seen.drives] == ["stage", "pull"]
    assert [id(o) for o in seen.compared] == [id(cell)]
    assert [id(o) for o in seen.of(SignalObservation)] == [id(cell)]  # none that drives
    assert seen.of(MarkerObservation) == ()
    assert seen.stage(1.4) == 1e-3


def test_driving_signals_on_different_times_are_refused() -> None:
    late = stage(name="pull", unit="N", t=T + 0.01)
    with pytest.raises(ComparisonError, match="2 driving signals on different times"):
        Registered((stage(), late))
    with pytest.raises(ComparisonError, match="2 driving signals on different times"):
        Registered((stage(), stage(t=T[:2], y=np.zeros((2, 1)))))
    with pytest.raises(ComparisonError, match="no observation drives the simulation"):
        Registered((signal(),))


def test_frames_are_rest_and_holds_or_else_evenly_many() -> None:
    t = np.arange(11.0)
    drive = stage(t=t, y=1e-3 * t[:, None])
    holds = tuple(Selection(str(at), np.array([at])) for at in (7.0, 2.9))
    rest = Selection("0", np.array([0.0]))
    assert Registered((drive,), holds, rest).frames(np.arange(11.0), 200).tolist() == [0, 3, 7]
    every_third = np.arange(2.0, 11.0, 3.0)  # long steps keep the frames of their own steps
    assert Registered((drive,), holds[:1]).frames(every_third, 2).tolist() == [2]
    assert Registered((drive,), holds[:1]).frames(np.arange(11.0), 2).tolist() == [7]
    assert Registered((drive,)).frames(np.arange(11.0), 200).tolist() == list(range(11))
    assert Registered((drive,)).frames(np.arange(1000.0), 5).tolist() == [0, 250, 500, 749, 999]
    window = (Selection("w", t[3:6]),)
    assert Registered((drive,), window).frames(np.arange(11.0), 2).tolist() == [0, 10]


def test_holds_are_where_the_drive_stood_and_windows_where_it_was() -> None:
    rest, hold = holds_at(stage(), T, (2e-3,), 1e-4)
    assert (rest.label, instant(rest), hold.label, instant(hold)) == ("0mm", 0.0, "2mm", 2.0)
    with pytest.raises(ComparisonError, match=r"1\.5 mm: 0 matched"):
        holds_at(stage(), T, (1.5e-3,), 1e-4)
    (window,) = windows_of(stage(), {"late": (0.5e-3, 2e-3)})
    assert window.t == pytest.approx([1.0, 2.0])
    with pytest.raises(ComparisonError, match="beyond: 0 samples between 3 and 4 mm"):
        windows_of(stage(), {"beyond": (3e-3, 4e-3)})


def test_a_force_that_falls_as_the_drive_closes_has_the_wrong_sign() -> None:
    require_rising(stage(), signal())
    with pytest.raises(RegistrationError, match=r"'force'.*4 N as 'stage'.*2 mm"):
        require_rising(stage(), signal(y=-signal().y))


def test_a_signal_of_which_no_sample_is_selected_is_not_compared() -> None:
    before = replace(HALVES, t=HALVES.t + 10.0)  # the run begins after the last sample
    assert signal().deviations(before, EVERYTHING) == ()


def test_markers_beside_their_layout_are_refused_and_nearest_nodes_read() -> None:
    rest = np.array([[0.0, 0.0, 1.0], [1.0, 1.0, 1.0], [1.0, 0.0, 0.9], [0.0, 1.0, 1.0]])
    found = Markers(np.array([0.0]), ("a", "b", "c", "d"), rest[None], 1e-5, "model")
    layout = dict(zip(found.names, rest, strict=True))
    near = MarkerObservation.of(found, layout, MESH, sampling="nearest_node")
    assert near.positions.apply(MESH.nodes)[2] == pytest.approx([1.0, 0.0, 1.0])
    del layout["b"], layout["d"]
    with pytest.raises(RegistrationError, match=r"2 of 4 markers.*\['b', 'd'\]"):
        MarkerObservation.of(found, layout, MESH)


@pytest.mark.parametrize("text", ["1 2", "1 2 east", "", "1 2 nan", "1 2 3 4"])
def test_a_record_that_is_no_vector_is_refused(text: str) -> None:
    with pytest.raises(RegistrationError, match=f"up is '{text}': expected three numbers"):
        vector(text, "up")
    assert vector("1 -2e-3 0", "up").tolist() == [1.0, -0.002, 0.0]


# --- times ----------------------------------------------------------------------------------------


def test_outlines_at_several_instants_have_the_time_of_each_point() -> None:
    none: object = None
    seen = Round("o", "validates", T, (ROUND,) * 3, np.eye(4), 1e-4, none, 0.0)  # type: ignore[arg-type]
    late = {d.quantity: d for d in seen.deviations(ramp(()), Selection("late", T[1:]))}
    for quantity, count in (("contour", len(ROUND)), ("contour.area", 1)):
        t = late[quantity].t
        assert t is not None
        assert t.tolist() == [1.0] * count + [2.0] * count
    assert all(d.t is None for d in seen.deviations(ramp(()), Selection("1s", T[1:2])))


def test_the_volume_of_a_cavity_has_its_times_and_recordings_are_joined_with_theirs() -> None:
    run = Simulated({"cyst.volume_ratio": Trace(np.array([1.0, 1.1, 1.2, 1.3, 1.4]), "1")})
    (late,) = _volumes(run, Selection("late", np.array([1.0, 2.0])))  # type: ignore[arg-type]
    assert late.t is not None
    assert (late.values[:, 0], late.t) == (pytest.approx([0.2, 0.4]), pytest.approx([1.0, 2.0]))
    (every,) = _volumes(run, EVERYTHING)  # type: ignore[arg-type]
    assert every.t is not None
    assert every.t.tolist() == RUN_T.tolist()
    (hold,) = _volumes(run, Selection("1s", np.array([1.0])))  # type: ignore[arg-type]
    assert (hold.t, hold.simulated, hold.measured) == (None, 1.2, 1.0)
    one = Residual("tip", "all", np.zeros((2, 1)), 0.0, 0.0, "m", "", t=np.array([1.0, 2.0]))
    joined = stacked([one, replace(one, t=np.array([3.0, 4.0]))])["tip@all"].t
    assert joined is not None
    assert joined.tolist() == [1.0, 2.0, 3.0, 4.0]
    assert stacked([one, replace(one, t=None)])["tip@all"].t is None
