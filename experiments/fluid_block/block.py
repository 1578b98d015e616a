"""What presses the block of paper 000, section 3.3, its registration and its twin.

Cavity size, boundary, plane state and tool are not printed, so that each is a parameter. Forces are
per metre of depth.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from validate.errors import ComparisonError, SceneError, UsageError
from validate.fem.system import build as build_system
from validate.parameters import Ranges, quantity, with_given
from validate.pipeline.experiment.experiment import Progress
from validate.pipeline.experiment.tree import Built, Tree
from validate.recording.types import Recording, Source
from validate.register.observation import Selection
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.scene.scene import Drive, Pin, Scene, Support
from validate.solve.fluid.cavities import ElasticPressure, ExactPressure, PulsePressure
from validate.solve.march import march
from validate.twin.sensors import signal, streams

ToolName = Literal["needle", "patch", "plate"]
FRAME = "block"
_BUILT = Built()
_SENSORS = ("tool", "force", "pressure")
_LONG = 10.0  # s: how far apart the states of the twin are; a sample is no match beyond a second


@dataclass(frozen=True)
class SlabRanges(Ranges):
    E: float = quantity(0.02, "1", "relative, of the modulus")
    nu: float = quantity(0.005, "1", "of the Poisson ratio")


@dataclass(frozen=True)
class SlabTwin:
    """What made the recording: quadratic triangles on a finer mesh, exact volumes."""

    squares: int = quantity(80, "1", "squares across the twin's mesh")
    E: float = quantity(34_000.0, "Pa", "its modulus")
    nu: float = quantity(0.35, "1", "its Poisson ratio")
    seed: int = quantity(3, "1", "seed of the sensors' noise")
    sd_force: float = quantity(0.2, "N", "load cell noise, per metre")
    sd_pressure: float = quantity(10.0, "Pa", "pressure transducer noise")
    sd_tool: float = quantity(2e-6, "m", "noise of the tool's encoder")


@dataclass(frozen=True)
class FluidLaws:
    """The other laws that the report shows, under the plate; the pulse without a tool."""

    preset: float = quantity(0.0, "Pa", "Pe of a reservoir, P = Pe - B (V/V0 - 1)")
    stiffness: float = quantity(5e3, "Pa", "B of the reservoir")
    bulk_modulus: float = quantity(2.2e9, "Pa", "of a compressible fluid")
    pulse_low: float = quantity(PulsePressure.low, "Pa", "least pressure of the pulse")
    pulse_high: float = quantity(PulsePressure.high, "Pa", "largest pressure of the pulse")
    pulse_rate: float = quantity(70 / 60, "1/s", "pulses a second")

    def __post_init__(self) -> None:
        ElasticPressure(self.preset, self.stiffness)  # which refuse what has no sense
        ExactPressure(1.0, self.bulk_modulus)
        PulsePressure(self.pulse_low, self.pulse_high, self.pulse_rate)


@dataclass(frozen=True)
class PressedBlock:
    """What presses the block, and how far; `strains` are tool displacements over its height."""

    tool: ToolName = quantity("plate", "1", "what presses the upper side: one node, a patch, all")
    plates: Literal["slip", "bonded"] = quantity("slip", "1", "what the tool does sideways")
    strains: tuple[float, ...] = quantity(
        (0.003, 0.01, 0.03, 0.05, 0.08, 0.10, 0.12, 0.15), "1", "displacement over height"
    )
    ranges: SlabRanges = SlabRanges()
    twin: SlabTwin = SlabTwin()
    laws: FluidLaws = FluidLaws()

    def __post_init__(self) -> None:
        odd = [s for s in self.strains if not 0 < s < 0.5]
        if not self.strains or odd or list(self.strains) != sorted(set(self.strains)):
            raise UsageError(
                f"strains = {','.join(f'{s:g}' for s in self.strains)}: rising numbers between 0 "
                "and .5"
            )


# --- scene and registration -----------------------------------------------------------------------


def slab(tree: Tree, tool: ToolName | None, changes: Mapping[str, Any] | None = None) -> Scene:
    """Return the block, with changes by path, pressed by a tool (none: nothing drives it)."""
    made = with_given(tree, changes or {})
    scene, bonded = _BUILT(None, made), made.settings.plates == "bonded"
    if tool is None:
        return scene
    place = "patch" if tool == "patch" else "top"
    down = Drive("tool", place, (0.0, -1.0), (0.0, 0.0) if tool == "needle" else None)
    if bonded and tool == "needle":
        return replace(scene, drives=(down,), pins=(Pin((0.0, 0.0), (0,)),))
    held = (Support(place, (0,)),) if bonded else ()
    return replace(scene, drives=(down,), supports=(*scene.supports, *held))


def build(recording: Recording, tree: Tree, changes: Mapping[str, Any] | None = None) -> Scene:
    return slab(tree, tree.settings.tool, changes)


def place(recording: Recording, tree: Tree, scene: Scene) -> Registered:
    """The tool drives; its force and every cavity's pressure are compared, all states together."""
    tool = SignalObservation.driving(recording, "tool", "m")
    seen = [
        SignalObservation.validating(recording, "force", "N", quantity="force", trace="tool.force")
    ]
    for cavity in scene.cavities:
        topic = cavity.name.replace("cavity", "pressure")
        if topic not in recording.signals:
            raise ComparisonError(
                f"{recording.name}: no signal '{topic}' for cavity {cavity.name[6:]} of "
                f"{len(scene.cavities)}; it has {sorted(recording.signals)}"
            )
        seen.append(
            SignalObservation.validating(
                recording, topic, "Pa", quantity=topic, trace=f"{cavity.name}.pressure"
            )
        )
    pressed = Selection("pressed", tool.t[1:], "every state under the tool")
    return Registered((tool, *seen), (pressed,))


# --- the twin -------------------------------------------------------------------------------------


def record(tree: Tree, progress: Progress) -> Recording:
    """States under the tool one after the other, rest first; seeded."""
    progress("simulate")
    twin: SlabTwin = tree.settings.twin
    scene = slab(tree, tree.settings.tool, {
        "body.cells": twin.squares, "body.element": "tri6", "material.E": twin.E,
        "material.nu": twin.nu,
    })  # fmt: skip
    down = tree.scene.body.height * np.array([0.0, *tree.settings.strains])
    t = _LONG * np.arange(len(down), dtype=np.float64)
    run = march("twin", ExactPressure().prepare(build_system(scene)), t, down[:, None],
                np.array([len(t) - 1]), 0.0)  # fmt: skip
    if not run.finished:
        raise SceneError(f"the twin: {run.outcome.why}")
    progress("measure")
    rng = streams(twin.seed, _SENSORS)
    signals = {
        "tool": signal(t, down, "m", twin.sd_tool, FRAME, rng["tool"]),
        "force": signal(t, run.traces["tool.force"].y, "N", twin.sd_force, FRAME, rng["force"]),
    }
    for k, cavity in enumerate(scene.cavities):
        y = run.traces[f"{cavity.name}.pressure"].y
        signals[f"pressure{k}"] = signal(t, y, "Pa", twin.sd_pressure, FRAME, rng["pressure"])
    provenance = {
        "kind": "twin", "law": "linear elasticity, small strain", "plane": scene.plane,
        "element": f"P2 triangles, {scene.mesh.nodes.size} unknowns",
        "fluid": "constant volume, exact", "E_Pa": repr(twin.E), "nu": repr(twin.nu),
        "seed": str(twin.seed),
    }  # fmt: skip
    return Recording(
        "fluid_block", Source("fluid_block", "", 0, "made in memory"), 1_080_345_600_000_000_000,
        signals=signals, metadata={"provenance": provenance},
    )  # fmt: skip
