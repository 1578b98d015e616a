"""The needle of paper 000, section 5.2, on its body: settings, recording and registration."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.parameters import Ranges, quantity
from validate.pipeline.experiment.tree import Built, Tree, beside
from validate.recording.types import Recording
from validate.register.observation import Selection
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.scene.contact import Needle
from validate.scene.scene import Scene

from .recording import walkable
from .scene import POCKET

TOOL, AXES = "needle", "xyz"
_BUILT = Built()
_DOWN: Mapping[int, tuple[float, ...]] = {2: (0.0, -1.0), 3: (0.0, -1.0, 0.0)}


@dataclass(frozen=True)
class PocketRanges(Ranges):
    E: float = quantity(0.02, "1", "relative, of the modulus")
    nu: float = quantity(0.005, "1", "of the Poisson ratio")


@dataclass(frozen=True)
class HandCard:
    """None: in the plane 20 and 500 N per metre, in 3-D 0.1 and 5 N."""

    grip: float | None = quantity(
        None, "N", "pulling force at which contact ends; none: depends on the dimension"
    )
    limit: float | None = quantity(
        None, "N", "largest force on the hand; none: depends on the dimension"
    )


@dataclass(frozen=True)
class PocketTwin:
    """What made the recording: quadratic elements on a finer mesh, the exact pressure."""

    plane: int = quantity(80, "1", "squares across its plane block")
    solid: int = quantity(10, "1", "cells along an edge of its cube")
    depth: float = quantity(0.006, "m", "how deep the hand goes")
    tremor: float = quantity(2e-5, "m", "of the hand, rms along every axis")
    rate: float = quantity(512.0, "1/s", "samples a second, as in section 5.2")
    seed: int = quantity(5, "1", "seed of tremor and noise")
    sd_tip: float = quantity(1e-6, "m", "noise of the needle's encoders")
    sd_force: float | None = quantity(None, "N", "noise; none: .2 N/m in the plane, 1 mN in 3-D")
    sd_pressure: float = quantity(5.0, "Pa", "pressure transducer noise")


@dataclass(frozen=True)
class NeedlePocket:
    """What no scene holds; `twin` is what made the recording."""

    hand: HandCard = HandCard()
    ranges: PocketRanges = PocketRanges()
    twin: PocketTwin = PocketTwin()


def under(scene: Scene, tip: Floats) -> Scene:
    """The body and a needle whose tip stands at `tip` (d,) m."""
    needle = Needle(TOOL, "top", tuple(tip.tolist()), _DOWN[scene.mesh.dimension])
    return replace(scene, tools=(needle,))


def load(tree: Tree, folder: Path) -> tuple[Recording, ...]:
    """The recording that is named, else the shipped one of that space."""
    name = "needle_pocket" if tree.scene.body.space == "plane" else "needle_pocket_solid"
    return beside(
        replace(tree, recording=tree.recording or f"../../recordings/{name}.mcap"), folder
    )


def build(recording: Recording, tree: Tree, changes: Mapping[str, Any] | None = None) -> Scene:
    scene = _BUILT(None, tree, changes)
    return under(scene, walkable(recording, scene.mesh).x[0])


def place(recording: Recording, tree: Tree, scene: Scene) -> Registered:
    """The tip drives; what was recorded of force and pressure is compared at every sample."""
    path = walkable(recording, scene.mesh)
    moved = path.x - np.array(scene.tools[0].tip)
    drives = tuple(
        SignalObservation(f"tip.{a}", "drives", path.t, moved[:, [c]], "m", path.sd)
        for c, a in enumerate(AXES[: scene.mesh.dimension])
    )
    seen = tuple(
        SignalObservation.validating(recording, topic, unit, quantity=topic, trace=trace)
        for topic, unit, trace in compared(scene.mesh.dimension)
        if topic in recording.signals
    )
    return Registered((*drives, *seen), (Selection("all"),), findings=path.findings)


def compared(d: int) -> tuple[tuple[str, str, str], ...]:
    """Topic, unit and trace of what a recording may hold: measured, or given by the live loop."""
    axes = AXES[:d]
    return (
        *((f"force.{a}", "N", f"{TOOL}.force.{a}") for a in axes),
        ("pressure", "Pa", f"{POCKET}.pressure"),
        *((f"given.{a}", "N", f"{TOOL}.force.{a}") for a in axes),
    )


def grip_of(tree: Tree) -> float:
    """The pulling force N at which contact ends."""
    own: float | None = tree.settings.hand.grip
    return {"plane": 20.0, "solid": 0.1}[tree.scene.body.space] if own is None else own


def sets(tree: Tree, seen: Registered) -> Mapping[str, Any]:
    own: float | None = tree.settings.hand.limit
    limit = {"plane": 500.0, "solid": 5.0}[tree.scene.body.space] if own is None else own
    return {"grip": grip_of(tree), "limit": limit}
