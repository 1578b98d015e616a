"""Bodies of paper 004: its bar, and blocks in 2-D and 3-D of the same tissue, touched by a probe.

The bar is one row of cells of a material without lateral contraction, so every cross-section
moves as one and the equations are those of the paper's 1-D elements: 40 free nodes, 0.1 m, 40 cm2.
"""

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats
from validate.errors import SceneError
from validate.scene.box import box, grid
from validate.scene.material import Material
from validate.scene.scene import Probe, Scene, Support
from validate.scene.tool import Needle

LENGTH = 0.1  # m, of the bar and of the blocks' sides
AREA = 40e-4  # m^2
DENSITY = 1000.0  # kg/m^3
DAMPING = 6.5  # 1/s: the paper's 6.5 has no unit; as C = 6.5 M it gives its whole-model peaks
PROBE = "probe"


def pad_of(cells: int) -> float:
    """Distance m within which the bar's end is one contact: its two nodes."""
    return 1.01 * _height(cells)


def _height(cells: int) -> float:
    """Of the bar's row of cells, m: square ones, on finer meshes than the paper's as high as its
    own, so that all of them are one body."""
    return LENGTH / min(cells, 40)


def bar(E: float, cells: int, damping: float = DAMPING) -> Scene:
    """The bar with x = 0 held and the probe "probe" at its free end, pushing along -x."""
    if cells < 2:
        raise SceneError(f"bar of {cells} cells: at least 2")
    height = _height(cells)
    return Scene(
        grid((LENGTH, height), (cells, 1)),
        Material(E, 0.0, "linear", DENSITY, damping),
        (Support("x0", (0, 1)), Support("y0", (1,)), Support("y1", (1,))),
        plane="stress",
        thickness=AREA / height,
        tools=(Needle(PROBE, "x1", (LENGTH, 0.0), (-1.0, 0.0)),),
        probes=(Probe("end", (LENGTH, 0.0)),),
    )


def block(E: float, cells: int, dimension: int, nu: float = 0.45) -> Scene:
    """A block of `cells` a side, x = 0 held, touched in the middle of x = 0.1 m."""
    if dimension not in (2, 3) or cells < 2:
        raise SceneError(f"block of {cells} cells in {dimension} dimensions: at least 2, in 2 or 3")
    size, split = (LENGTH,) * dimension, (cells,) * dimension
    middle = LENGTH * (cells // 2) / cells
    at = (LENGTH, *(middle,) * (dimension - 1))
    axis = (-1.0, *(0.0,) * (dimension - 1))
    return Scene(
        box(size, split),
        Material(E, nu, "linear", DENSITY, DAMPING),
        (Support("x0", tuple(range(dimension))),),
        thickness=LENGTH if dimension == 2 else 1.0,
        tools=(Needle(PROBE, "x1", at, axis),),
        probes=(Probe("end", at),),
    )


def transfer(
    E: float, spring: float, hz: Floats, damping: float = DAMPING
) -> NDArray[np.complex128]:
    """Force on the hand, N per m of the probe, at frequencies (k,) Hz: the continuous bar behind
    the spring. No mesh, no step and no region is in it.

    k(w) = (EA/L) q cot q with q^2 = L^2 (w^2 - i c w) rho/E; F = k ks / (k + ks).
    """
    w = 2 * np.pi * np.asarray(hz, dtype=np.float64)
    static = np.full(w.shape, E * AREA / LENGTH, dtype=np.complex128)
    q = LENGTH * np.sqrt((w**2 - 1j * damping * w) * DENSITY / E + 0j)
    moving = np.abs(q) > 0
    static[moving] *= q[moving] / np.tan(q[moving])
    return np.asarray(static * spring / (static + spring))


def impedance(E: float, spring: float, hz: Floats) -> Floats:
    """Peak force N of a probe that swings by a metre, at frequencies (k,) Hz."""
    return np.abs(transfer(E, spring, hz))


def exact_force(E: float, spring: float, t: Floats, depth: Floats, damping: float) -> Floats:
    """Force (nt,) N of the continuous bar under a probe's `depth` (nt,) m at even times t (nt,) s,
    by the frequency domain; 20 s of rest after the end let it die down."""
    h = float(t[1] - t[0])
    n = len(t) + round(20.0 / h)
    hz: Floats = np.arange(n // 2 + 1, dtype=np.float64) / (n * h)
    F = transfer(E, spring, hz, damping) * np.fft.rfft(depth, n)
    return np.asarray(np.fft.irfft(F, n)[: len(t)])


def chirp(t: Floats, amplitude: float, lowest: float, highest: float) -> Floats:
    """A sine of rising frequency, lowest to highest Hz over t (nt,) s."""
    rise = (highest - lowest) / (2 * t[-1])
    return np.asarray(amplitude * np.sin(2 * np.pi * (lowest * t + rise * t**2)))


def growing(t: Floats, amplitude: float, hz: float) -> Floats:
    """A sine of rising amplitude over t (nt,) s."""
    return np.asarray(amplitude * t / t[-1] * np.sin(2 * np.pi * hz * t))
