"""Changes of the beam that are no single value: finer cells with their steps, the loss as it is
identified, the recording under gravity alone."""

from dataclasses import replace

from validate.papers.released_beam.cards import HungMass, Relaxation, ReleasedBeam
from validate.replay.variation import Change
from validate.scene.similar_grids import member


def finer(share: float) -> Change:
    """Cells in every direction and steps at once: both errors are of order two."""

    def change(p: ReleasedBeam) -> ReleasedBeam:
        along, across = member((p.mesh.along, p.mesh.across), share)
        finer = replace(p, mesh=replace(p.mesh, along=along, across=across))
        by = edge(finer) / edge(p)
        return replace(finer, swing=replace(p.swing, dt=p.swing.dt * by))

    return change


def edge(p: ReleasedBeam) -> float:
    """The edge m of a cube as large as a cell."""
    volume = p.size.length * p.size.width * p.size.height
    return float((volume / p.mesh.along / p.mesh.across**2) ** (1 / 3))


def hung(p: ReleasedBeam, z: float) -> ReleasedBeam:
    """No mass is none, whatever its uncertainty."""
    mass = p.load.mass and p.load.mass + z * p.ranges.mass
    return replace(p, load=replace(p.load, mass=mass))


def relaxing(p: ReleasedBeam, relaxation: Relaxation) -> ReleasedBeam:
    return replace(p, material=replace(p.material, relaxation=relaxation))


def sooner(p: ReleasedBeam, z: float) -> ReleasedBeam:
    """What is identified is the loss, g tau of a short time: the modulus goes the other way."""
    card, by = p.material.relaxation, 1 + z * p.ranges.fast_time
    return relaxing(p, replace(card, fast_time=card.fast_time and card.fast_time * by,
                            fast=card.fast and card.fast / by))  # fmt: skip


def gravity_alone(p: ReleasedBeam) -> ReleasedBeam:
    """The recording under gravity, on which what stands open is identified."""
    return replace(p, recording=p.calibration, load=HungMass())
