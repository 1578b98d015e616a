"""Outlines in images of a pressed body against the section of its simulated surface.

The images' place in the body's frame (axis z, the resting plate at z = 0) is declared, or stands in
the recording; without either nothing is compared. They rest with that plate.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from validate.arrays import Floats, Ints
from validate.errors import ComparisonError, RegistrationError, UsageError
from validate.parameters import known, quantity, value_at
from validate.pipeline.bodies.mesh import HEIGHT
from validate.pipeline.experiment.experiment import Input, vary
from validate.pipeline.experiment.tree import Tree
from validate.recording.types import Contours, Recording
from validate.register.clocks import clock_sd
from validate.register.observation import Selection, nearest_samples
from validate.register.outlines.outlines import OutlineObservation, enclosed
from validate.register.outlines.sections import SurfaceSampler
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.scene.geometries.specification import Cylinder
from validate.scene.mesh import Mesh
from validate.scene.places import pose_of

WHOLE = "surface"
MODULI = ("material.E", "E_bonded")  # that may be given
_LIKE = 2.0  # times the area at rest within which an outline and a section are of one feature


@dataclass(frozen=True)
class PressedOutline:
    """Outlines of the recording, and which surface of the body they are of."""

    topic: str | None = quantity(None, "1", "outlines' topic; none: not compared")
    surface: str = quantity(WHOLE, "1", "facet set that they show; surface: the body's edge")
    origin: tuple[float, ...] = quantity((), "m", "the images' first pixel; none: recorded pose")
    image_x: str = quantity("+x", "1", "direction of the images' x (columns)")
    image_y: str = quantity("-z", "1", "direction of the images' y (rows)")
    shift: tuple[float, float] = quantity((0.0, 0.0), "m", "shift along the images' x and y")
    sd: float | None = quantity(None, "m", "standard uncertainty of that place, along x and y each")
    holds: int = quantity(4, "1", "further images compared, evenly spaced in displacement")

    def __post_init__(self) -> None:
        if not 1 <= self.holds <= 50 or (self.sd is not None and not 0 <= self.sd < np.inf):
            raise UsageError(f"outline: holds {self.holds} (1 to 50), sd {self.sd} (0 or above)")


def with_outline(
    seen: Registered, recording: Recording, card: PressedOutline, mesh: Mesh
) -> Registered:
    """What is registered of a log, and outlines at the first image and evenly from there.

    Raises `UsageError` where the images' place is not said, `SceneError` for a surface that the
    body does not have, `ComparisonError` for images at other times than the log, and
    `RegistrationError` where the outlines are of something else than the surface.
    """
    contours = _posed(recording.contour(str(card.topic)), card)
    mesh = replace(mesh, facets={WHOLE: mesh.surface, **mesh.facets})
    mesh.facet_nodes(card.surface)
    stage = seen.drives[0]
    at, held = _instants(contours, stage, card)
    found = OutlineObservation.of(
        contours, SurfaceSampler.of_cavity(mesh, card.surface, None, 4), float(at[0]),
        name=str(card.topic), sd_t=clock_sd(recording, str(card.topic)),
    )  # fmt: skip
    # They enclose about as much
    area, _ = enclosed(found.simulated(np.zeros_like(mesh.nodes)))
    shown, _ = enclosed(found.measured(found.rest))
    if not area / _LIKE < shown < _LIKE * area:
        raise RegistrationError(
            f"the outlines '{card.topic}' enclose {1e4 * shown:.3g} cm2, the section of the body's "
            f"'{card.surface}' with the images {1e4 * area:.3g} cm2: they show something else. "
            f"Set outline.surface to a facet set of a mesh file (an inclusion's wall); --set "
            f"outline.topic=none leaves them out"
        )
    others = [o.name for o in seen.compared]
    holds = tuple(
        Selection(f"{1e3 * d:.3g}mm", at[i : i + 1], "the nearest image", of=(found.name,))
        for i, d in enumerate(held) if i > 0
    )  # fmt: skip
    return replace(
        seen,
        observations=(*seen.observations, found),
        selections=(*(replace(s, of=tuple(others)) for s in seen.selections), *holds),
        rest=Selection("start", at[:1], "the first image", of=(found.name,)),
    )


def _posed(contours: Contours, card: PressedOutline) -> Contours:
    if card.sd is None:
        raise UsageError(
            "outline.sd (standard uncertainty of the images' position on the body, as 0.3mm) is "
            "not set; give it with --set outline.sd=VALUE"
        )
    pose = contours.pose
    if card.origin:
        pose = pose_of(card.origin, card.image_x, card.image_y)
    elif np.array_equal(pose, np.eye(4)):
        raise UsageError(
            f"the position of the images '{card.topic}' is not recorded: give outline.origin "
            f"(first pixel), image_x and image_y in the body's frame (z: axis from the resting "
            f"plate), as --set outline.origin=-12mm,0mm,30mm"
        )
    moved_by = np.eye(4)
    moved_by[:2, 3] = card.shift
    return replace(contours, pose=pose @ moved_by)


def _instants(
    contours: Contours, stage: SignalObservation, card: PressedOutline
) -> tuple[Floats, Floats]:
    """Times s of the log nearest to the images compared, and the displacements m there."""
    own = contours.t[(contours.t >= stage.t[0]) & (contours.t <= stage.t[-1])]
    if len(own) < 2:
        raise ComparisonError(
            f"'{card.topic}': {len(own)} of {len(contours.t)} outlines lie within the "
            f"{stage.t[0]:.3f}..{stage.t[-1]:.3f} s of the log up to its limit; 2 are needed: "
            f"put them on one clock (validate align)"
        )
    d = np.interp(own, stage.t, stage.y[:, 0])
    first = int(np.abs(d).argmin())
    goals = np.linspace(d[first], d[first:].max(), card.holds + 1)
    # Of two images equally near, to a nanometre, the first: rounding would choose by the method.
    away = [np.abs(d[first:] - goal).round(9) for goal in goals[1:]]
    picked = [first, *(first + int(distance.argmin()) for distance in away)]
    steps: Ints = np.unique(nearest_samples(stage.t, own[picked], stage.name))
    if len(steps) < 2:
        raise ComparisonError(
            f"'{card.topic}': the body does not move between its outlines; set outline.topic=none"
        )
    return stage.t[steps], stage.y[steps, 0]


# --- what is uncertain ----------------------------------------------------------------------------


def _shifted(axis: int) -> Callable[[Tree, float], Tree]:
    def along(tree: Tree, z: float) -> Tree:
        card = tree.settings.outline
        x, y = card.shift
        by = z * (card.sd or 0.0)
        return tree.given({"outline.shift": (x + by, y) if axis == 0 else (x, y + by)})

    return along


def stiffer(tree: Tree, by: float) -> Tree:
    """Return the body with the given moduli times a factor; those that are identified follow by
    themselves."""
    moduli = {path: value_at(tree, path)[0] for path in MODULI}
    return tree.given({path: by * E for path, E in moduli.items() if E is not None})


def _higher(tree: Tree, z: float) -> Tree:
    """Another height, of the same log: what was measured in m, and the slope, stay.

    A mesh file has its own height: only the slope is then off.
    """
    by, body = 1 + z * tree.settings.ranges.height, tree.scene.body
    if not isinstance(body, Cylinder):
        return stiffer(tree, by)
    strains = ("fit_from", "fit_to", "limit")
    changed = {path: value_at(tree, path)[0] / by for path in strains}
    return stiffer(tree, by).given({HEIGHT: known(body.height, HEIGHT) * by, **changed})


OUTLINE_INPUTS = (
    Input("images along x", _shifted(0), "their place along their x, as declared", "assumed"),
    Input("images along y", _shifted(1), "their place along their y, as declared", "assumed"),
    Input("height", _higher, "height within its declared range", "assumed"),
    vary("material.nu", "absolute ranges.nu, below 0.5", "Poisson ratio",
         "nu within its declared uncertainty"),
)  # fmt: skip
