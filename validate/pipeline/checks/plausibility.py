"""Plausibility of the inputs: sizes, image scales, strain, stress, modulus of soft tissue."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from validate.parameters import Parameter
from validate.pipeline.run.method_run import MethodRun
from validate.recording.scales import odd_scales
from validate.recording.types import Recording
from validate.register.signals import SignalObservation
from validate.scene.scene import Drive, Scene

LENGTH = 1.0  # m: no specimen of soft tissue is as long
MODULUS = (100.0, 10e6)  # Pa: from brain to tendon's toe
STRESS = (1.0, 10e6)  # Pa: a hundredth of the softest, the stiffest at its own modulus
LINEAR = 0.25  # strain: the linear law is then off by about as much
ENTERED = 0.05  # relative: two measurements of one size differ by less


def doubts(
    parameters: Sequence[Parameter],
    stated: Mapping[str, float],
    recordings: Sequence[Recording],
    first: MethodRun,
) -> tuple[str, ...]:
    """Return a sentence with the factor for everything implausible; `first` is any method that was
    run."""
    found = [w for p in parameters for w in _of_value(p, stated)]
    found += [f"{r.name}: {line}" for r in recordings for line in odd_scales(r)]
    if isinstance(first.scene, Scene) and first.scene.mesh.dimension == 3:
        for drive in (d for d in first.scene.drives[:1] if d.point is None):
            found += _of_compression(first.scene, drive, recordings[0], first)
    return tuple(dict.fromkeys(found))


def _of_value(p: Parameter, stated: Mapping[str, float]) -> Iterator[str]:
    value = p.default
    if isinstance(value, bool) or not isinstance(value, int | float):
        return
    # A plane body's thickness is no length of a specimen: 1 m stands for forces per metre.
    if p.unit == "m" and p.path != "thickness" and p.origin != "default" and abs(value) >= LENGTH:
        yield f"{p.path} = {value:g} m is 1000 times {value:g} mm: check its unit"
    if p.unit == "Pa" and p.path.split(".")[-1].startswith("E"):
        yield from _outside(f"{p.path} ({p.origin})", value, MODULUS, "modulus")
    said = stated.get(p.path)
    if said and value and not 1 / (1 + ENTERED) < value / said < 1 + ENTERED:
        yield (
            f"{p.path} = {value:g} {p.unit} was {p.origin}; the recording has {said:g} {p.unit}, "
            f"{_times_of(value, said)}"
        )


def _of_compression(
    scene: Scene, drive: Drive, recording: Recording, followed: MethodRun
) -> Iterator[str]:
    """Strain and stress between the driven plate and the other end, from the whole recording."""
    along = np.ptp(scene.mesh.nodes @ np.asarray(drive.direction))
    moved = recording.signals.get(followed.seen.drives[0].name)
    if moved is None:
        return
    strain = float(np.ptp(moved.y[:, 0])) / along
    if strain > 1:
        yield (
            f"{drive.name}: the recording moves by {1e3 * strain * along:.3g} mm, {strain:.3g} "
            f"times the body's {1e3 * along:.3g} mm: check the height"
        )
    compared = float(np.ptp(followed.seen.inputs[:, 0])) / along
    if scene.material.law == "linear" and compared > LINEAR:
        yield f"strain of {compared:.3g} by a linear law, which is valid to about 0.1"
    area = float(np.abs(scene.mesh.cell_volumes()).sum()) * scene.copies / along
    for force in followed.seen.of(SignalObservation):
        if force.unit == "N":
            stress = float(np.abs(force.y).max()) / area
            name = f"{force.quantity}: the largest over {1e6 * area:.3g} mm2"
            yield from _outside(name, stress, STRESS, "stress")


def _outside(name: str, value: float, within: tuple[float, float], what: str) -> Iterator[str]:
    low, high = within
    if not low <= value <= high:
        end = low if value < low else high
        yield (
            f"{name} is a {what} of {value:.3g} Pa, {_times_of(value, end)} {end:g} Pa, the "
            f"{'least' if value < low else 'largest'} of soft tissue: check sizes and units"
        )


def _times_of(value: float, other: float) -> str:
    """How many times one is the other."""
    return f"1/{other / value:.3g} of" if 0 < value < other else f"{value / other:.3g} times"
