"""The silicone beam of srl-ethz/diffPD_sim2real: scene and registration.

30 x 30 x 100 mm, clamped at one end, held straight and let go; a mass may hang at the upper edge of
its free end. Three markers stand 6 mm off that end. What is compared is where they come to rest,
and how they swing until then.

The base is held still. Its own three markers stir by some .1 mm with the swing, and one of them was
knocked by .7 mm in the loaded recording, so that no rotation can be had from them: what they do in
their median is a part of the measurement's uncertainty instead.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from validate.arrays import Floats, rms
from validate.fem.assembly.locate import Rows
from validate.pipeline.experiment.experiment import Identified
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.tree import Built, Tree
from validate.recording.types import Markers, Recording
from validate.register.markers.markers import MarkerObservation, Together
from validate.register.observation import Deviation, Selection, Simulated
from validate.register.registration import Registered
from validate.scene.mesh import Mesh
from validate.scene.scene import Scene

from .expected_frequency import doubted
from .recording import REST, SWING, over
from .settings import (
    BASE,
    LAYOUT,
    TIPS,
    ReleasedBeam,
)
from .swing import LABEL, Swing

SETTLED = "settled"
_STANDS = 0.012  # m: how far off the beam a marker of the layout may stand, and then some
_SPARE = 0.05  # s: of the swing, so that a release that fits later is still within the run
TOGETHER = (
    Together("tip.vertical", (2,), "vertical displacement of the tip's markers, rest to rest"),
    Together("tip.axial", (0,), "displacement along the beam of the tip's markers, rest to rest"),
    Together("tip.lateral", (1,), "sideways displacement of the tip's markers, rest to rest"),
)


# --- the scene ------------------------------------------------------------------------------------


def build(recording: Recording, tree: Tree, changes: Mapping[str, Any] | None) -> Scene:
    """The declared scene. Where a method has Rayleigh's damping, that is in place of the series."""
    scene = Built()(recording, tree, changes)
    material = scene.material
    if material.law in ("linear", "svk") or material.stiffness_damping:
        return scene
    return replace(scene, material=replace(material, prony=tree.settings.relaxation.prony))


# --- the recording in it --------------------------------------------------------------------------


class Resting(MarkerObservation):
    """Markers at rest: they say nothing of the swing."""

    def deviations(self, run: Simulated, selection: Selection) -> tuple[Deviation, ...]:
        return super().deviations(run, selection) if selection.label == SETTLED else ()


def place(recording: Recording, tree: Tree, scene: Scene) -> Registered:
    """Six markers fitted to the layout, once, at rest; those of the tip are compared from where
    they were seen to stand, so that the layout's own errors do not enter displacements. Models of
    the linear law are filters', which are given the swing sample by sample."""
    p: ReleasedBeam = tree.settings
    still, moving = recording.marker(REST), recording.marker(SWING)
    layout = {name: np.array(at) for name, at in LAYOUT.items()}
    whole = MarkerObservation.of(still, layout, scene.mesh, how=p.registration, stands=_STANDS)
    if scene.material.law == "linear":
        return _tracked(whole, moving, p, scene)
    tips = _from_where_they_stand(whole, scene.mesh, p.ranges.repeats)
    end = float(still.t[-1])
    until = min(p.swing.length, float(moving.t[-1]))
    steps = int(np.ceil((until + _SPARE) / p.swing.dt - 1e-9))
    t = np.append(p.swing.dt * np.arange(1, steps + 1), end)
    seen = _swing(whole, moving, p, until)
    selections = (
        Selection(SETTLED, np.array([end]), "means over a second of rest"),
        Selection(LABEL, seen.t[seen.compared], "every sample of the swing"),
    )
    return Registered((*Registered.given_inputs(scene, t), Resting(**vars(tips)), seen), selections)


def _swing(whole: MarkerObservation, moving: Markers, p: ReleasedBeam, until: float) -> Swing:
    """The tips' displacements in the beam's frame, from where they stood before the release."""
    moved = _moved(whole, moving)
    base = base_moved(moved[moving.t <= until])
    shared = np.full(len(TIPS), np.hypot(p.ranges.repeats, base) / np.sqrt(3))
    tips = moved[:, [whole.names.index(name) for name in TIPS]]
    return Swing(moving.t, TIPS, tips, until, p.swing.ringing, _noise(moved), shared)


def _moved(whole: MarkerObservation, moving: Markers) -> Floats:
    """Displacements (nt, 6, 3) m in the beam's frame."""
    x = np.array([whole.registration.transform.apply(frame) for frame in moving.x])
    return np.asarray(x - whole.x[0])


def base_moved(moved: Floats) -> float:
    """The rms m of what the base's markers (nt, 6, 3) did, in their median, which no single marker
    that was knocked moves."""
    base = over(np.nanmedian, moved[:, [list(LAYOUT).index(name) for name in BASE]], 1)
    seen = base[np.isfinite(base).all(axis=1)]
    return rms(seen) if len(seen) else 0.0


def _noise(moved: Floats) -> float:
    """The markers' noise m per axis, from second differences of the base, which hardly moves."""
    base = moved[:, [list(LAYOUT).index(name) for name in BASE]]
    bend = np.diff(base, n=2, axis=0)
    return float(1.4826 * np.nanmedian(np.abs(bend)) / np.sqrt(6))


def _tracked(
    whole: MarkerObservation, moving: Markers, p: ReleasedBeam, scene: Scene
) -> Registered:
    """Every sample of the tips' markers after the release, on the layout's places."""
    kept = (moving.t > 0) & (moving.t <= p.swing.length)
    moved = _moved(whole, moving)[kept][:, [whole.names.index(name) for name in TIPS]]
    rest = np.array([LAYOUT[name] for name in TIPS])
    tips = replace(
        whole, names=TIPS, t=moving.t[kept], x=rest + moved, rest=rest,
        positions=Rows.standing(scene.mesh, rest), sd=_noise(_moved(whole, moving)), axis_sd=(),
        tre=np.full(len(TIPS), np.sqrt(3) * p.ranges.repeats),
    )  # fmt: skip
    inputs = Registered.given_inputs(scene, tips.t)
    return Registered((*inputs, tips), (Selection("tracked", tips.t, "every sample"),))


def _from_where_they_stand(
    whole: MarkerObservation, mesh: Mesh, repeats: float
) -> MarkerObservation:
    """The tip's markers, their rest as registered.

    What repeats differ by is half each marker's own and half what all share, as squares (assumed:
    repeats of single markers differ by .1 to .8 mm, so that neither is all of it); noise, averaged
    over a second, is nothing beside it. What a wrong rotation does to displacements is shared.
    """
    kept = [whole.names.index(name) for name in TIPS]
    x = whole.x[:, kept]
    rest = x[0]
    centre = np.array([list(at) for at in LAYOUT.values()]).mean(axis=0)
    moved = x[-1] - rest
    turned = np.sqrt(
        whole.registration.tre_at(centre + moved) ** 2
        - whole.registration.tre_at(np.broadcast_to(centre, moved.shape)) ** 2
    )
    return replace(
        whole, names=TIPS, x=x, rest=rest, positions=Rows.standing(mesh, rest),
        sd=repeats / np.sqrt(2), axis_sd=(), tre=np.hypot(turned, np.sqrt(1.5) * repeats),
        together=TOGETHER,
    )  # fmt: skip


def heeded(
    recordings: Sequence[Recording], tree: Tree, methods: Mapping[str, Method]
) -> Identified:
    """Nothing is identified here: what the base did is reported, and a mass that does not ring like
    the recording is doubted."""
    moving = recordings[0].marker(SWING)
    base = base_moved(moving.x - moving.x[0])
    said = (
        f"The base is held still in the models; in the median of its markers it stirred by "
        f"{1e3 * base:.2f} mm rms after the release, which is in u_D."
    )
    return Identified(tree, (), (said,), doubts=doubted(recordings[0], tree))


def sets(tree: Tree, seen: Registered) -> dict[str, Any]:
    """The step of whatever steps through the swing."""
    return {"dt": float(seen.t[0])}
