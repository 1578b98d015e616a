"""Experiment of a block with a fluid-filled inclusion between plates (outlines, markers, stage).

Frame: x from the fixed plate (0) to the moving one, y up, z lateral; metres.

The mesh follows from the recording. Stream "sweep" holds outlines (or images to outline) of the
phantom at rest, with the pose of its image plane at position 0; signal "sweep_position" says how
far the plane then lay along its normal, m (paper 000, section 4.4).
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from validate.compare.result import Kind
from validate.compare.verdict import Accept
from validate.errors import ComparisonError, RegistrationError, UsageError
from validate.parameters import Ranges, known, quantity, take_units, with_given
from validate.pipeline.experiment.experiment import Experiment, Input, Uncertainty, vary
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.tree import Tree, beside, changed_by
from validate.recording.types import Contours, Recording, Signal
from validate.register.clocks import clock_sd
from validate.register.markers.markers import MarkerObservation, Sampling, Together
from validate.register.markers.quality import MarkerFit
from validate.register.observation import nearest_sample
from validate.register.outlines.outlines import Corner, OutlineObservation
from validate.register.outlines.sections import SurfaceSampler, outlined_capsule
from validate.register.outlines.sweep import Stack, stacked, surface_of, sweep_outlines
from validate.register.registration import Registered
from validate.register.signals import SignalObservation, holds_at, instant, require_rising
from validate.scene.geometries.box import member
from validate.scene.geometries.inclusion import Block, Capsule, InclusionShape, SlicedShape
from validate.scene.mesh import Mesh
from validate.scene.scene import Contact as Contact
from validate.scene.scene import Scene

SWEEP, POSITION = "sweep", "sweep_position"
_STILL = 0.1e-3  # m the stage may stand off its rest while the sweep is taken
_BEHIND = 0.02  # of the outermost gap: how near the outermost slice an end may be moved


def outlined_sweep(recording: Recording) -> Recording:
    """Return the recording with images of a sweep replaced by the outlines found in them."""
    if SWEEP not in recording.frames:
        return recording
    frames = {k: f for k, f in recording.frames.items() if k != SWEEP}
    outlines = sweep_outlines(recording.frame(SWEEP))
    return replace(recording, frames=frames, contours={**recording.contours, SWEEP: outlines})


def stack_of(recording: Recording, sweep: Contours, stage: Signal) -> Stack:
    """Return the stack of the `sweep`, taken while the stage was at rest.

    Raises `RegistrationError` for a stage that had moved, and what `stacked` raises.
    """
    during = (sweep.t >= stage.t[0]) & (sweep.t <= stage.t[-1])
    moved = np.abs(np.interp(sweep.t[during], stage.t, stage.y[:, 0]) - stage.y[0, 0])
    if moved.size and moved.max() > _STILL:
        raise RegistrationError(
            f"the stage stood {1e3 * moved.max():.2f} mm away from rest during the sweep; "
            "record the sweep with the stage at rest"
        )
    position = recording.signal(POSITION, "m")
    return stacked(sweep, position.t, position.y[:, 0])


def swept(stack: Stack, free: float = 0.0, wider: float = 0.0, longer: float = 0.0) -> SlicedShape:
    """Return the surface of `free` sections, radii and length changed by m; ends stay behind
    slices."""
    at, ends = stack.positions, stack.ends + longer / 2 * np.array([-1.0, 1.0])
    least = _BEHIND * float(np.diff(at).min())
    ends = np.array([min(ends[0], at[0] - least), max(ends[1], at[-1] + least)])
    return surface_of(replace(stack, radii=stack.radii + wider, ends=ends), free)


def off_circles(stack: Stack) -> str:
    """Return the distance of the outlines from their circles, in a sentence."""
    worst = int(stack.off_round.argmax())
    every = float(np.sqrt((stack.off_round**2).mean()))
    return (
        f"The inclusion is meshed from {len(stack.positions)} slices of a sweep: their outlines "
        f"lie {1e3 * every:.3f} mm rms off circles, at most {1e3 * stack.off_round[worst]:.3f} mm "
        f"({1e3 * stack.positions[worst]:+.1f} mm along it), with noise of {1e3 * stack.sd:.3f} mm."
    )


WITHIN = 0.1e-3  # m: the stage stood at a load


@dataclass(frozen=True)
class MeshedInclusion:
    """None: centre x, z and radius from the rest outline, the rest from the declared sweep."""

    shape: Literal["capsule", "sweep"] = quantity(
        "capsule", "1", "capsule through the rest outline, or meshed from the outlines of a sweep"
    )
    free: float = quantity(
        0.0, "1", "sections of a sweep: circles of equal area (0) to the outlines themselves (1)"
    )
    centre_x: float | None = quantity(None, "m", "centre along the stage; none: from the outline")
    centre_y: float | None = quantity(None, "m", "height of the centre; none: from the sweep")
    centre_z: float | None = quantity(None, "m", "lateral centre; none: from the outline")
    radius: float | None = quantity(None, "m", "radius; none: from the outline")
    length: float | None = quantity(None, "m", "length along y; none: from the sweep")
    wider: float = quantity(0.0, "m", "added to the radius that is meshed")
    longer: float = quantity(0.0, "m", "added to the length that is meshed")

    def __post_init__(self) -> None:
        take_units(self)
        own = ("centre_x", "centre_y", "centre_z", "radius", "length")
        given = [name for name in own if getattr(self, name) is not None]
        if self.shape == "sweep" and given:
            raise UsageError(
                f"body.inclusion.{given[0]} applies to a capsule; a sweep contains the place "
                "of its inclusion: set body.inclusion.wider or body.inclusion.longer"
            )


@dataclass(frozen=True)
class BlockWithInclusion:
    """A block from the origin with an inclusion that the recording shows; sets x0 to z1, cavity.

    Sizes may stay open (None) until they are measured.
    """

    x: float | None = quantity(None, "m", "distance from the fixed to the moving plate", asked=True)
    y: float | None = quantity(None, "m", "height", asked=True)
    z: float | None = quantity(None, "m", "lateral size", asked=True)
    cells: tuple[int, ...] = quantity(
        (8, 9, 14), "1", "cells along x, y, z (8 x 9 x 14 has the 1328 nodes of paper 000)"
    )
    element: Literal["linear", "quadratic"] = quantity("linear", "1", "element order")
    inclusion: MeshedInclusion = MeshedInclusion()

    def __post_init__(self) -> None:
        take_units(self)
        if len(self.cells) != 3:
            raise UsageError(f"body.cells = {self.cells}: expected three numbers of cells")

    @property
    def block(self) -> Block:
        """Raises `UsageError` while a size is open."""
        return Block(known(self.x, "body.x"), known(self.y, "body.y"), known(self.z, "body.z"))

    @property
    def cell_size(self) -> float:
        """The edge m of a cube as large as a mean cell of the block without its inclusion."""
        return float(np.cbrt(self.block.sizes.prod() / np.prod(self.cells)))

    def scaled(self, share: float) -> "BlockWithInclusion":
        return replace(self, cells=member(self.cells, share))

    def __call__(self, recording: Recording, tree: Tree) -> Mesh:
        x, y, z = self.cells
        grid = (x + 1, y + 1, z + 1)
        mesh = self.block.around(grid, inclusion(recording, tree))
        return mesh.quadratic() if self.element == "quadratic" else mesh


def inclusion(recording: Recording, tree: Tree) -> InclusionShape:
    """Return the inclusion that is meshed: what the user set, else what was measured."""
    mine: MeshedInclusion = tree.scene.body.inclusion
    if mine.shape == "sweep":
        return swept(sweep_stack(recording, tree), mine.free, mine.wider, mine.longer)
    measured = _outlined(recording, tree)
    own = (mine.centre_x, mine.centre_y, mine.centre_z)
    x, y, z = (m if o is None else o for o, m in zip(own, measured.centre, strict=True))
    return Capsule(
        (x, y, z),
        (measured.radius if mine.radius is None else mine.radius) + mine.wider,
        (measured.length if mine.length is None else mine.length) + mine.longer,
    )


def measured_inclusion(recording: Recording, tree: Tree) -> InclusionShape:
    """Return the inclusion as measured: by the rest outline and the declared sweep, or by the
    sweep."""
    capsule = _outlined(recording, tree)  # which refuses a mirrored image
    if tree.scene.body.inclusion.shape == "capsule":
        return capsule
    return swept(sweep_stack(recording, tree), tree.scene.body.inclusion.free)


def sweep_stack(recording: Recording, tree: Tree) -> Stack:
    """Return the slices of the recorded sweep, as the image is placed."""
    sweep = shifted(recording.contour(SWEEP), tree)
    return stack_of(recording, sweep, recording.signal(tree.settings.streams.stage, "m"))


def shifted(contours: Contours, tree: Tree) -> Contours:
    """Outlines with the correction of their image's pose."""
    pose, how = contours.pose.copy(), tree.settings.registration
    pose[[0, 2], 3] += how.image_shift_x, how.image_shift_z
    return replace(contours, pose=pose)


def _outlined(recording: Recording, tree: Tree) -> Capsule:
    """Centre x, z and radius of the rest outline; height and length from record 'inclusion'."""
    streams, how = tree.settings.streams, tree.settings.registration
    contours = shifted(recording.contour(streams.outline), tree)
    rest = holds_at(
        SignalObservation.driving(recording, streams.stage, "m"), contours.t, (), within=WITHIN
    )[0]
    index = nearest_sample(contours.t, instant(rest), "outlines")
    moved = abs(how.image_shift_x) + abs(how.image_shift_z)
    return outlined_capsule(contours, index, recording.record("inclusion"), moved)


# --- How much plates rub: a share between slipping and bonded.

_HALF = 4.0  # of E over the plates' distance: the stiffness at a share of one half (ours)


def plates_of_share(share: float, E: float, apart: float) -> tuple[Contact, float]:
    """Contact and tangential stiffness N/m^3 of plates `apart` m that rub by a `share` 0..1.

    0 slips, 1 bonds, between them springs of k = 4 E/apart share/(1 - share): the one definition of
    how much plates rub, for what is identified and for what is uncertain (Pa, m).
    """
    if share in (0.0, 1.0):
        return ("slip" if share == 0 else "bonded"), 0.0
    return "partial", _HALF * E / apart * share / (1 - share)


def rubbing_share(contact: str, friction: float, E: float, apart: float) -> float:
    """Return the share 0..1 of that contact with springs of `friction` N/m^3; see
    `plates_of_share`."""
    if contact != "partial":
        return float(contact == "bonded")
    return friction / (friction + _HALF * E / apart)


# -------------------------------------------------------------------------------------------------

_TRACES = {"N": ("force.plate", "stage.force"), "Pa": ("pressure", "inclusion.pressure")}
_PLANE = (
    Together("marker.inplane", (0, 2), "position along the stage and sideways"),
    Together("marker.vertical", (1,), "position along the vertical"),
)


@dataclass(frozen=True)
class InclusionRanges(Ranges):
    """Standard uncertainties of the inputs of an inclusion test."""

    E: float = quantity(0.05, "1", "relative, of the modulus")
    nu: float = quantity(0.005, "1", "of the Poisson ratio")
    friction: float = quantity(0.03, "1", "absolute, of the plates' friction share k/(k + 4 E/x)")


@dataclass(frozen=True)
class Streams:
    """Topics of the recording. `signals` are a force in N or a pressure in Pa."""

    stage: str = quantity("stage", "1", "displacement of the moving plate, m")
    outline: str = quantity("outline", "1", "outlines of the inclusion")
    markers: str = quantity("markers", "1", "markers")
    signals: tuple[str, ...] = quantity((), "1", "force and pressure, where recorded")
    tracker: str = quantity("pen", "1", "record with the upward direction of the markers")


@dataclass(frozen=True)
class InclusionRegistration(MarkerFit):
    """Of markers, and of the image that shows the inclusion."""

    sampling: Sampling = quantity("barycentric", "1", "markers to nodes")
    wall: Literal["measured", "facets", "nearest_node"] = quantity(
        "measured", "1", "wall on the measured circle, on the mesh's facets, or by nearest node"
    )
    image_shift_x: float = quantity(0.0, "m", "correction of the image pose along x")
    image_shift_z: float = quantity(0.0, "m", "correction of the image pose along z")


@dataclass(frozen=True)
class InclusionTest:
    """Settings of an inclusion test besides its scene."""

    streams: Streams = Streams()
    registration: InclusionRegistration = InclusionRegistration()
    ranges: InclusionRanges = InclusionRanges()
    loads: tuple[float, ...] = quantity((), "m", "stage positions compared")

    @staticmethod
    def inputs() -> tuple[Input, ...]:
        """Return the inputs that every such experiment has, with the fields of
        `InclusionRanges`."""
        return (
            vary("material.E", "relative ranges.E", "modulus", "E within its declared uncertainty"),
            vary("material.nu", "absolute ranges.nu, below 0.5", "Poisson ratio",
                 "nu within its declared uncertainty"),
            Input("plate friction", rubbed, "share of the way from slipping to bonded plates",
                  "assumed"),
        )  # fmt: skip

    @staticmethod
    def read(recording: Recording, tree: Tree) -> Recording:
        """Return the recording with the outlines in the images of its sweep, where the body is
        meshed from it."""
        swept = tree.scene.body.inclusion.shape == "sweep"
        return outlined_sweep(recording) if swept else recording

    @staticmethod
    def place(
        recording: Recording, tree: Tree, scene: Scene, loads: tuple[float, ...],
        together: tuple[Together, ...], corners: tuple[Corner, ...] = (),
    ) -> Registered:  # fmt: skip
        """Register stage, outlines, markers and signals, compared at rest and at `loads` m.

        Raises `ComparisonError` without loads, `RegistrationError` for a signal that falls as the
        plates close, and what the parts raise.
        """
        if not loads:
            raise ComparisonError("no loads: nothing can be compared; set stage positions in m")
        streams, how = tree.settings.streams, tree.settings.registration
        contours = shifted(recording.contour(streams.outline), tree)
        measured = measured_inclusion(recording, tree)
        shape = None if how.wall == "facets" else measured
        wall = SurfaceSampler.of_cavity(
            scene.mesh, "cavity", shape, nearest=how.wall == "nearest_node"
        )
        stage = SignalObservation.driving(recording, streams.stage, "m")
        signals = []
        for topic in streams.signals:
            # Where the unit is absent or of another kind, the one to be asked for
            found = recording.signals.get(topic)
            unit = found.unit if found is not None and found.unit in _TRACES else "N"
            name, trace = _TRACES[unit]
            signals.append(
                SignalObservation.validating(recording, topic, unit, quantity=name, trace=trace)
            )
            require_rising(stage, signals[-1])
        rest, *holds = holds_at(stage, contours.t, loads, within=WITHIN)
        outline = OutlineObservation.of(
            contours, wall, rest=instant(rest), corners=corners, name=streams.outline,
            sd_t=clock_sd(recording, streams.outline),
        )  # fmt: skip
        markers = MarkerObservation.placed(
            recording, scene.mesh, topic=streams.markers, together=together,
            tracker=streams.tracker, up=(0.0, 1.0, 0.0), how=how, sampling=how.sampling,
        )  # fmt: skip
        swept = tree.scene.body.inclusion.shape == "sweep"
        said = (off_circles(sweep_stack(recording, tree)),) if swept else ()
        # A word where the meshed inclusion is not where the rest outline lies
        meshed = inclusion(recording, tree)
        off = float(np.linalg.norm(np.array(measured.centre) - np.array(meshed.centre)))
        wide = meshed.radius - measured.radius
        if off >= 0.5e-3 or abs(wide) >= 0.5e-3:
            said = (
                *said,
                f"The meshed inclusion's centre is {1e3 * off:.2f} mm from the measured one and "
                f"its radius {1e3 * wide:+.2f} mm off; outlines are drawn on the measured wall and "
                "do not show this.",
            )
        return Registered((stage, outline, markers, *signals), tuple(holds), rest, findings=said)

    @staticmethod
    def rubbing(tree: Tree, share: float) -> Tree:
        """Return the parameters with plates that rub by a share, from 0 (slip) to 1 (bonded)."""
        contact, stiffness = plates_of_share(share, tree.scene.material.E, tree.scene.body.x)
        path = "foundations.plates."
        changed: Tree = with_given(tree, {f"{path}contact": contact, f"{path}stiffness": stiffness})
        return changed


def rubbed(tree: Tree, z: float) -> Tree:
    """Plates that rub by z `ranges.friction` more; what lies beyond slipping or bonded is mirrored
    back."""
    plates = next(f for f in tree.scene.foundations if f.name == "plates")
    share = rubbing_share(
        plates.contact, plates.stiffness, tree.scene.material.E, tree.scene.body.x
    )
    share = abs(share + z * tree.settings.ranges.friction)
    return InclusionTest.rubbing(tree, min(share, 2 - share))


#: More than three meshes: the inclusion is cut from the grids, which scatters. 8 x 9 x 14 cells
#: have no common factor: within 5 % the grids are similar. Order 2: corners at the plates and
#: facets on the wall limit that of quadratic elements.
MESHES = vary("body.cells", "x 0.625 0.75 0.875 1.25, order 2")


def inclusion_test(
    name: str,
    title: str,
    source: str,
    parameters: Tree,
    methods: Mapping[str, Method],
    accepted: tuple[str, ...],
    accept: tuple[Accept, ...],
    kind: Kind = "measured",
) -> Experiment:
    """Return the experiment; inputs are varied with the first method of linear elements (none: the
    last), which is cheap."""
    cheap = [
        n
        for n, m in methods.items()
        if bool(changed_by(parameters, m.scene or {}).scene.body.element == "linear")
    ]
    return Experiment(
        name, title, source, parameters, methods, accepted, accept, load,
        place=_place, kind=kind, variations=(MESHES, *InclusionTest.inputs()),
        uncertainty=Uncertainty(surrogate=(*cheap, *reversed(list(methods)))[0]),
    )  # fmt: skip


def load(tree: Tree, folder: Path) -> tuple[Recording, ...]:
    return tuple(InclusionTest.read(recording, tree) for recording in beside(tree, folder))


def _place(recording: Recording, tree: Tree, scene: Scene) -> Registered:
    return InclusionTest.place(recording, tree, scene, tree.settings.loads, _PLANE)
