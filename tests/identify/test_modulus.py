"""The modulus from force-displacement logs: exact on synthetic ones, published on real ones."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from validate.arrays import Floats, rms
from validate.errors import RecordingError, UsageError
from validate.identify import modulus
from validate.identify.modulus import CylinderSize, ModulusFit, cylinder_of, load_noise, loading
from validate.recording.tables.testing_machine import read_instron
from validate.recording.types import Recording, Signal, Source

# private: _fit, _parabola_start: called alone, case by case.

DISC = CylinderSize(0.05, 0.03)
E = 60e3  # Pa
SPEED = 10e-3 / 60  # m/s, sampled at 10 Hz as the real logs are


def log(d: Floats, force: Floats, name: str = "synthetic") -> Recording:
    t = np.arange(len(d)) * 0.1
    return Recording(
        name=name,
        source=Source("none", "", 0, "made in a test"),
        t0_ns=0,
        signals={
            "displacement": Signal(t, d[:, None], "m", 0.0, "machine"),
            "force": Signal(t, force[:, None], "N", 0.0, "machine"),
        },
        metadata={"specimen": {"diameter_m": "0.05", "height_m": "0.03"}},
    )


def linear(slack: float = 0.0, offset: float = 0.0, modulus: float = E) -> tuple[Floats, Floats]:
    """Displacement (m) and force (N) of an ideal disc; the plate meets it at `slack` m."""
    d = np.arange(200) * SPEED * 0.1
    return d, modulus * DISC.area / DISC.height * np.maximum(d - slack, 0.0) + offset


def on_its_clock(t: Floats, record: Recording) -> Recording:
    """The log with its force sampled at other times t (n,) s of the same clock."""
    d, force = record.signals["displacement"], record.signals["force"]
    at_t = np.interp(t, force.t, force.y[:, 0])
    return replace(
        record, signals={"displacement": d, "force": replace(force, t=t, y=at_t[:, None])}
    )


@pytest.mark.parametrize("t", [np.arange(0, 19.9, 0.37), np.arange(2.05, 19.9, 0.1)])
def test_force_is_read_at_the_time_of_the_displacement(t: Floats) -> None:
    """Other rates, and a force that begins later: sample by sample it would be another one."""
    moved = on_its_clock(t, log(*linear()))
    window = (0.02, 0.05)
    assert ModulusFit.of(moved, window=window).E_apparent == pytest.approx(E, rel=1e-9)
    seen = loading(moved)
    assert seen.t[0] == pytest.approx(np.ceil(10 * t[0]) / 10)
    assert seen.force == pytest.approx(E * DISC.area / DISC.height * seen.d)
    assert seen.error < 1e-9


def test_a_force_of_another_time_is_refused() -> None:
    with pytest.raises(RecordingError, match="covers 5 of the displacement's samples"):
        ModulusFit.of(on_its_clock(np.arange(19.5, 30.0, 0.1), log(*linear())))


def test_what_interpolation_leaves_is_counted() -> None:
    """A parabola through samples 1 s apart: at the middle f''/8 of a s^2 is missing."""
    d = np.linspace(0, 1e-3, 201)
    record = log(d, np.arange(201.0) ** 2 * 0.01)  # N, so f = t^2
    found = loading(on_its_clock(np.arange(0.0, 20.5, 1.0), record))
    missing = np.arange(201) * 0.1 % 1.0
    assert found.error == pytest.approx(rms(missing * (1 - missing)), rel=0.02)


def test_a_linear_log_gives_its_modulus_exactly() -> None:
    fit = ModulusFit.of(log(*linear()))
    assert fit.E_apparent == pytest.approx(E, rel=1e-12)
    assert fit.sd == pytest.approx(0.0, abs=1e-6 * E)
    assert fit.offset == pytest.approx(0.0, abs=1e-12)
    assert fit.contact == 0.0
    assert fit.residual_rms < 1e-12
    assert fit.r_squared == pytest.approx(1.0, abs=1e-12)
    assert (fit.name, fit.window) == ("synthetic", (0.005, 0.05))
    inside = ModulusFit.of(log(*linear()), window=(0.0051, 0.0499))
    assert inside.count == 80  # 0.153 to 1.497 mm at 1/60 mm a sample: 9.18 to 89.82, so 10..89


@pytest.mark.parametrize("offset", [-0.7, 0.04, 12.0])
def test_the_cell_offset_is_removed_and_reported(offset: float) -> None:
    fit = ModulusFit.of(log(*linear(offset=offset)))
    assert fit.E_apparent == pytest.approx(E, rel=1e-11)
    assert fit.offset == pytest.approx(offset, rel=1e-9)


def test_a_toe_is_where_the_fitted_line_reaches_zero_force() -> None:
    d, force = linear()
    assert ModulusFit.of(log(d, force)).toe == pytest.approx(0.0, abs=1e-9)
    soft = 0.0002  # m of seating with a third of the stiffness, then the full one
    k = E * DISC.area / DISC.height
    seated = np.where(d < soft, k / 3 * d, k * (d - soft) + k / 3 * soft)
    fit = ModulusFit.of(log(d, seated), window=(0.01, 0.05))
    assert fit.toe * DISC.height == pytest.approx(2 / 3 * soft, rel=0.1)


def test_a_force_that_falls_is_refused() -> None:
    d, force = linear()
    with pytest.raises(RecordingError, match="force falls with strain"):
        ModulusFit.of(log(d, -force))


def test_noise_alone_is_no_contact() -> None:
    d, _ = linear()
    force = np.random.default_rng(1).normal(0, 0.02, len(d))
    with pytest.raises(RecordingError, match="no contact in 200 samples"):
        ModulusFit.of(log(d, force))


def test_an_approach_before_contact_is_found() -> None:
    slack = 40.5 * SPEED * 0.1
    fit = ModulusFit.of(log(*linear(slack=slack, offset=0.3)))
    assert fit.contact == pytest.approx(slack, rel=1e-9)
    assert fit.offset == pytest.approx(0.3, rel=1e-12)
    assert fit.E_apparent == pytest.approx(E, rel=1e-11)


def test_an_approach_is_found_in_noise() -> None:
    d, force = linear(slack=40.5 * SPEED * 0.1, offset=0.3)
    noisy = force + np.random.default_rng(3).normal(0, 0.02, len(force))
    fit = ModulusFit.of(log(d, noisy))
    assert fit.contact == pytest.approx(40.5 * SPEED * 0.1, abs=3 * 0.02 * 0.03 / (E * DISC.area))
    assert fit.offset == pytest.approx(0.3, abs=3 * 0.02 / math.sqrt(35))


def test_noise_is_within_three_standard_errors_and_the_standard_error_is_right() -> None:
    d, force = linear(offset=-0.03)
    rng = np.random.default_rng(11)
    fits = [ModulusFit.of(log(d, force + rng.normal(0, 0.02, len(d)))) for _ in range(200)]
    off = np.array([(fit.E_apparent - E) / fit.sd for fit in fits])
    assert np.mean(np.abs(off) < 3) > 0.98  # 0.9963 expected with 79 degrees of freedom
    assert off.std() == pytest.approx(1.0, abs=0.15)  # sd of an sd over 200: 0.05
    assert abs(off.mean()) < 3 / math.sqrt(200)
    assert np.mean([fit.noise for fit in fits]) == pytest.approx(0.02, rel=0.03)
    assert np.mean([fit.residual_rms for fit in fits]) == pytest.approx(0.02, rel=0.03)


def test_the_standard_error_is_that_of_a_straight_line_fit() -> None:
    d, force = linear()
    noisy = force + np.random.default_rng(2).normal(0, 0.02, len(force))
    fit = ModulusFit.of(log(d, noisy), window=(0.0051, 0.0499))
    inside = slice(10, 90)
    (slope, _), cov = np.polyfit(d[inside] / DISC.height, noisy[inside] / DISC.area, 1, cov=True)
    assert fit.E_apparent == pytest.approx(slope, rel=1e-10)
    assert fit.sd == pytest.approx(math.sqrt(cov[0, 0]), rel=1e-8)


def test_unloading_is_not_fitted() -> None:
    d, force = linear()
    softer = log(np.append(d, d[::-1]), np.append(force, 0.5 * force[::-1]))
    assert ModulusFit.of(softer).E_apparent == pytest.approx(E, rel=1e-12)
    assert ModulusFit.of(softer).count == ModulusFit.of(log(d, force)).count


def test_the_window_holds_its_ends() -> None:
    """Strains of 1/64 are exact in binary: 16 + 1 of them from 0 to a quarter."""
    d = np.arange(33) / 64 * DISC.height
    cylinder = CylinderSize(DISC.diameter, 1.0)
    fit = ModulusFit.of(log(np.arange(33) / 64, 10.0 * d), cylinder, window=(0.0, 0.25))
    assert fit.count == 17


def test_definition_is_the_mean_slope_with_free_intercept() -> None:
    """F = A0 (a e + b e^2) densely sampled: slope a + b (low + high), by hand."""
    e = np.linspace(0, 0.06, 60001)
    force = DISC.area * (50e3 * e + 400e3 * e**2)
    fit = ModulusFit.of(log(e * DISC.height, force), window=(0.01, 0.05))
    assert fit.E_apparent == pytest.approx(50e3 + 400e3 * 0.06, rel=1e-6)


@given(
    stiff=st.floats(1e3, 1e6),
    size=st.floats(0.5, 3.0),
    offset=st.floats(-5, 5),
)
@settings(max_examples=40)
def test_scale_invariance(stiff: float, size: float, offset: float) -> None:
    """Geometrically similar discs of one material have one modulus."""
    d, force = linear(modulus=stiff)
    disc = CylinderSize(DISC.diameter * size, DISC.height * size)
    fit = ModulusFit.of(log(d * size, force * size**2 + offset), disc)
    assert fit.E_apparent == pytest.approx(stiff, rel=1e-8)


def test_noise_of_a_known_series() -> None:
    rng = np.random.default_rng(0)
    smooth = np.linspace(0, 10, 4000) ** 2
    assert load_noise(smooth + rng.normal(0, 0.02, 4000)) == pytest.approx(0.02, rel=0.05)
    assert load_noise(np.arange(20) * 1.5) == 0.0
    with pytest.raises(RecordingError, match="9 forces for a noise estimate"):
        load_noise(np.zeros(9))


def test_refusals_hold_the_numbers() -> None:
    d, force = linear()
    with pytest.raises(RecordingError, match=r"from 0.0000 to 0.0272 with 41 samples"):
        ModulusFit.of(log(d[:50], force[:50]))
    with pytest.raises(RecordingError, match="with 9 samples in the window"):
        ModulusFit.of(log(d, force), window=(0.005, 0.0099))
    with pytest.raises(UsageError, match="expected 0 <= low < high"):
        ModulusFit.of(log(d, force), window=(0.05, 0.005))
    with pytest.raises(RecordingError, match="expected a size above 0"):
        CylinderSize(0.05, -0.03)
    unknown = Recording("bare", Source("none", "", 0, ""), 0, metadata={"specimen": {}})
    with pytest.raises(RecordingError, match="no number 'diameter_m'"):
        cylinder_of(unknown)


def real(folder: Path, name: str) -> Recording:
    return read_instron(folder / "force" / "ecoflex-compression" / f"{name}.csv")


@pytest.mark.slow
def test_ecoflex_00_30_five_repeats(shared_data: Path) -> None:
    """Data README: E over 0.5-5 % 107.7 kPa, sd 1.1 kPa; noise 0.017-0.021 N, offset 0.04 N."""
    fits = [ModulusFit.of(real(shared_data, f"EF30_0T_A{i}")) for i in range(1, 6)]
    moduli = [fit.E_apparent for fit in fits]
    assert np.mean(moduli) == pytest.approx(107.7e3, abs=50)  # printed with one decimal of kPa
    assert np.std(moduli, ddof=1) == pytest.approx(1.1e3, abs=50)
    for fit in fits:
        assert 0.0165 <= fit.noise < 0.0215  # the README's range, to its last digit
        assert abs(fit.offset) <= 0.045
        assert fit.contact == 0.0
        assert fit.count == 81  # counted in the five files
        assert fit.residual_rms > 2 * fit.noise  # curvature, in spite of
        assert fit.r_squared > 0.998


def test_modulus_does_not_depend_on_how_the_file_is_written(
    shared_data: Path, tmp_path: Path
) -> None:
    """The same log with decimal commas, kN and negative compression: the same modulus."""
    source = shared_data / "force" / "ecoflex-compression" / "EF30_0T_A1.csv"
    rows = [line.split(",")[:3] for line in source.read_text().splitlines()[8:]]
    flipped = [[float(t), -float(d), -float(f) / 1e3] for t, d, f in rows]
    lines = [";".join(f"{x:.9f}".replace(".", ",") for x in row) for row in flipped]
    head = [
        "Durchmesser: 50mm",
        "Diameter: 5,0 cm",
        "Height: 30mm",
        "Time;Extension;Load",
        "s;mm;kN",
    ]
    path = tmp_path / "same.csv"
    path.write_text("\r\n".join(head + lines), encoding="utf-16")
    here, there = (
        ModulusFit.of(real(shared_data, "EF30_0T_A1")),
        ModulusFit.of(read_instron(path, {"test": "compression"})),
    )
    assert there.E_apparent == pytest.approx(here.E_apparent, rel=1e-7)
    assert there.noise == pytest.approx(here.noise, rel=1e-4)


def test_a_log_that_begins_in_contact_begins_on_a_parabola() -> None:
    """Of x^3 on 0..1 the best parabola is 3/2 x^2 - 3/5 x + 1/20."""
    x = np.linspace(0.0, 1.0, 2001)
    assert modulus._parabola_start(1e-3 * x, x**3, 0.999e-3) == pytest.approx(1 / 20, rel=0.01)
    parabola = 2.0 + 3.0 * x + 4.0 * x**2
    assert modulus._parabola_start(1e-3 * x, parabola, 0.999e-3) == pytest.approx(2.0, rel=1e-9)


def test_a_signal_of_two_columns_and_one_strain_are_refused() -> None:
    d, force = linear()
    two = log(d, force)
    wide = Signal(two.signals["force"].t, np.column_stack([force, force]), "N", 0.0, "machine")
    with pytest.raises(RecordingError, match="'force' has 2 columns, expected 1"):
        ModulusFit.of(replace(two, signals={**two.signals, "force": wide}))
    with pytest.raises(RecordingError, match=r"synthetic: 12 samples.*strain 0\.031250"):
        modulus._fit("synthetic", np.full(12, 0.03125), np.arange(12.0), 1.0, 0.0, 0.0, (0.0, 0.1))


def test_a_plate_that_stands_has_its_contact_where_it_stands() -> None:
    """The force rises while the displacement stays at 1 mm: no line through the toe has a slope."""
    approach, count = np.linspace(0.0, 1e-3, 60), 60
    d = np.append(approach, np.full(count, 1e-3))
    force = np.append(np.full(60, 0.25), 0.25 + np.arange(1.0, count + 1))
    assert modulus.zero_of(d, force, 0.0, 1e-4) == pytest.approx((0.25, 1e-3), abs=1e-12)
    first = np.full(count, 2e-3)  # in contact from the first sample on: the mean of the toe
    assert (
        modulus._parabola_start(first, np.arange(60.0), 1e-4)
        == np.arange(float(modulus.PLATEAU)).mean()
    )
