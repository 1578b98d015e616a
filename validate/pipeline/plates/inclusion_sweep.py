"""Inclusion from a sweep of parallel images across its long axis (paper 000, section 4.4).

Stream "sweep" holds the outlines (or the images to outline) of the phantom at rest, with the pose
of its image plane at position 0; signal "sweep_position" says how far the plane then lay along its
normal, m.
"""

from dataclasses import replace

import numpy as np

from validate.errors import RegistrationError
from validate.recording.types import Contours, Recording, Signal
from validate.register.outlines.sweep import Stack, stacked, surface_of, sweep_outlines
from validate.scene.geometries.inclusion import SlicedShape

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
