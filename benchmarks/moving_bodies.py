"""Recordings of bodies that move, by another code with known constants.

    python benchmarks/moving_bodies.py swinging -o DIR    # a cantilever, held bent and let go
    python benchmarks/moving_bodies.py pushed -o DIR      # the same, under a step of force
    python benchmarks/moving_bodies.py filmed -o DIR      # the pushed one: an outline, one marker
    python benchmarks/moving_bodies.py chamber -o DIR     # a thick-walled tube, a step of pressure

Each writes DIR/NAME.mcap and DIR/NAME.toml, the answers for `validate new`, and for the chamber
DIR/chamber.npz, its mesh. Nothing of it is computed by the package: beams are tri-quadratic bricks
of scikit-fem in small strain, their motion the exact sum of 40 damped modes, and the tube is a
radial line of quadratic elements (plane strain). Constants are those of the files of answers.
"""

import argparse
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import skfem
from scipy.signal import lfilter
from scipy.sparse.linalg import eigsh, spsolve
from skfem.helpers import ddot, dot, eye, sym_grad, trace

from validate.arrays import Floats
from validate.recording.mcap.write import write_recording
from validate.recording.types import Contours, Markers, Recording, Signal, Source
from validate.scene.geometries.box import grid
from validate.scene.mesh import Mesh
from validate.scene.mesh_files.mesh_file import write_mesh

NAMES = ("swinging", "pushed", "filmed", "chamber")
NOISE = 2e-5  # m
FINER = 10  # times of the other code in an interval of the recording
MODES = 40


@dataclass(frozen=True)
class Beam:
    """Clamped at x = 0; 2.8 Hz is its first natural frequency."""

    E: float = 165_000.0
    nu: float = 0.4
    rho: float = 1050.0
    damping: float = 3e-3  # s, C = damping K
    size: tuple[float, float, float] = (0.12, 0.02, 0.02)
    force: float = 15e-3  # N at the free end, along -z


BEAM = Beam()
MARKERS = {"tip": (0.12, 0.01, 0.02), "middle": (0.06, 0.01, 0.02), "side": (0.09, 0.0, 0.01)}


@dataclass(frozen=True)
class Tube:
    """Inner and outer radius, plane strain."""

    E: float = 20_000.0
    nu: float = 0.45
    rho: float = 1050.0
    damping: float = 5e-4
    inner: float = 0.01
    outer: float = 0.02
    height: float = 0.01
    pressure: float = 500.0  # Pa, risen within 4 ms


TUBE = Tube()


# --- the other code -------------------------------------------------------------------------------


def modal(K: Any, M: Any, f: Floats, load: Floats, t: Floats, beta: float, rows: Floats) -> Floats:
    """Readings (nt, m) = rows (m, n) u of K u + beta K u' + M u'' = f load(t), at rest at t[0]:
    each mode exactly for a load that is linear between the times, the others static."""
    count = min(MODES, K.shape[0] - 2)
    squares, V = eigsh(K.tocsc(), k=count, M=M.tocsc(), sigma=0.0)
    whole = spsolve(K.tocsc(), f)
    found = np.outer(load, rows @ (whole - V @ ((V.T @ f) / squares)))
    for w2, v in zip(squares, V.T, strict=True):
        q = _oscillator(float(w2), beta * float(w2), float(v @ f), load, t)
        found += np.outer(q, rows @ v)
    found[0] = 0.0
    return np.asarray(found)


def _oscillator(w2: float, c: float, f: float, load: Floats, t: Floats) -> Floats:
    """q'' + c q' + w2 q = f load(t), exactly between evenly spaced times."""
    h, w = t[1] - t[0], np.sqrt(complex(w2 - c * c / 4))
    E = np.exp(-c * h / 2)
    C, S = np.cos(w * h).real, (np.sin(w * h) / w).real
    A = E * np.array([[C + c / 2 * S, S], [-w2 * S, C - c / 2 * S]])
    slope = f * np.diff(load) / h
    before, after = ((f * y - c * slope / w2) / w2 for y in (load[:-1], load[1:]))
    steps = np.array([after, slope / w2]) - A @ np.array([before, slope / w2])
    # x[i] = A x[i-1] + steps[i], along the eigenvectors of A
    decay, V = np.linalg.eig(A)
    parts = zip(decay, np.linalg.solve(V, steps), strict=True)
    x = V @ np.array([lfilter([1.0], [1.0, -a], part) for a, part in parts])
    return np.append(0.0, x[0].real)


def bricks(beam: Beam) -> tuple[Any, Any, Any, Any]:
    """The basis, K and M over the free unknowns, and which these are."""
    lines = [np.linspace(0, size, n) for size, n in zip(beam.size, (13, 3, 3), strict=True)]
    mesh = skfem.MeshHex.init_tensor(*lines)
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementHex2()), intorder=4)
    lam = beam.E * beam.nu / ((1 + beam.nu) * (1 - 2 * beam.nu))
    mu = beam.E / (2 * (1 + beam.nu))

    @skfem.BilinearForm
    def stiffness(u: Any, v: Any, w: Any) -> Any:
        e = sym_grad(u)
        return ddot(2 * mu * e + lam * eye(trace(e), 3), sym_grad(v))

    @skfem.BilinearForm
    def mass(u: Any, v: Any, w: Any) -> Any:
        return beam.rho * dot(u, v)

    free = np.setdiff1d(np.arange(basis.N), basis.get_dofs(lambda x: np.isclose(x[0], 0.0)).all())
    K, M = stiffness.assemble(basis), mass.assemble(basis)
    return basis, K[free][:, free], M[free][:, free], free


def end_force(beam: Beam, basis: Any) -> Floats:
    """f (n,) N of one newton along -z, uniform over the free end."""
    facets = basis.mesh.facets_satisfying(lambda x: np.isclose(x[0], beam.size[0]))
    side = skfem.FacetBasis(basis.mesh, basis.elem, facets=facets, intorder=4)

    @skfem.LinearForm
    def pushed(v: Any, w: Any) -> Any:
        return -v[2] / (beam.size[1] * beam.size[2])

    return np.asarray(pushed.assemble(side))


def beam_markers(
    load: Floats, t: Floats, beam: Beam = BEAM, places: Floats | None = None
) -> Floats:
    """Displacements (nt, k, 3) m of the markers, or of other places (k, 3) m, under a force (nt,) N
    at the end, along -z."""
    if places is None:
        places = np.array(list(MARKERS.values()))
    basis, K, M, free = bricks(beam)
    f = end_force(beam, basis)[free]
    rows = basis.probes(places.T).tocsr()[:, free].toarray()
    moved = modal(K, M, f, load, t, beam.damping, rows)
    return moved.reshape(len(t), 3, len(places)).transpose(0, 2, 1)


def tube_wall(pressure: Floats, t: Floats, at: Floats, tube: Tube = TUBE) -> Floats:
    """Radial displacements (nt, m) m at the radii `at`, under an inner pressure (nt,) Pa."""
    mesh = skfem.MeshLine(np.linspace(tube.inner, tube.outer, 41))
    basis = skfem.Basis(mesh, skfem.ElementLineP2(), intorder=6)
    lam = tube.E * tube.nu / ((1 + tube.nu) * (1 - 2 * tube.nu))
    mu = tube.E / (2 * (1 + tube.nu))

    @skfem.BilinearForm
    def stiffness(u: Any, v: Any, w: Any) -> Any:
        r, er, ev = w.x[0], u.grad[0], v.grad[0]
        sr = (lam + 2 * mu) * er + lam * u / r
        st = lam * er + (lam + 2 * mu) * u / r
        return r * (sr * ev + st * v / r)

    @skfem.BilinearForm
    def mass(u: Any, v: Any, w: Any) -> Any:
        return w.x[0] * tube.rho * u * v

    f = np.zeros(basis.N)
    f[int(np.argmin(np.abs(basis.doflocs[0] - tube.inner)))] = tube.inner  # per radian
    rows = basis.probes(at[None]).toarray()
    return modal(
        stiffness.assemble(basis), mass.assemble(basis), f, pressure, t, tube.damping, rows
    )


# --- recordings and answers -----------------------------------------------------------------------


@dataclass(frozen=True)
class Clock:
    """Samples a second, seconds of rest before the start, and after it."""

    rate: float
    rest: float
    length: float

    @property
    def fine(self) -> Floats:
        """Times s of the other code, from the start."""
        count = round(self.length * self.rate) * FINER
        return np.arange(count + 1) / (FINER * self.rate)

    @property
    def t(self) -> Floats:
        return np.arange(round((self.rest + self.length) * self.rate) + 1) / self.rate

    def sampled(self, y: Floats) -> Floats:
        """What is recorded of numbers (nt, ...) at the fine times: zero before the start."""
        still = np.zeros((round(self.rest * self.rate), *y.shape[1:]))
        return np.concatenate([still, y[::FINER]])


BEAM_CLOCK, TUBE_CLOCK = Clock(200.0, 0.25, 1.75), Clock(1000.0, 0.1, 0.3)


def recorded(name: str) -> Recording:
    """The recording of one of NAMES."""
    if name == "chamber":
        t = TUBE_CLOCK.fine
        pressure = TUBE.pressure * np.clip(t / 4e-3, 0, 1)
        radii, places = _on_tube()
        u = tube_wall(pressure, t, radii)
        moved = u[:, :, None] * (places * (1, 1, 0) / radii[:, None])
        names = tuple(f"w{i}" for i in range(len(radii)))
        given = {"pressure": _signal(TUBE_CLOCK, pressure, "Pa", 1.0)}
        return _recording(name, TUBE_CLOCK, names, places, moved, given)
    t = BEAM_CLOCK.fine
    force = BEAM.force * np.clip(t / 0.02, 0, 1)
    # Let go, the force that bent it is away from the start on.
    if name == "swinging":
        force = np.full(len(t), -BEAM.force)
    moved = beam_markers(force, t)
    given = {} if name == "swinging" else {"force": _signal(BEAM_CLOCK, force, "N", 1e-5)}
    places = np.array(list(MARKERS.values()))
    if name != "filmed":
        return _recording(name, BEAM_CLOCK, tuple(MARKERS), places, moved, given)
    side = list(MARKERS).index("side")
    film = _recording(name, BEAM_CLOCK, ("side",), places[[side]], moved[:, [side]], given)
    return replace(film, contours={"outline": _outlines(force, t)})


def _outlines(force: Floats, t: Floats) -> Contours:
    """The beam's outline from the side, in the plane y = 10 mm, at every tenth sample."""
    length, _, height = BEAM.size
    x, z = np.linspace(0, length, 49), np.linspace(0, height, 9)
    edge = [*((a, 0.0) for a in x), *((length, a) for a in z[1:]),
            *((a, height) for a in x[-2::-1]), *((0.0, a) for a in z[-2:0:-1])]  # fmt: skip
    places = np.array([(a, 0.01, b) for a, b in edge])
    moved = BEAM_CLOCK.sampled(beam_markers(force, t, places=places))[::10]
    noise = np.random.default_rng(9).normal(0, 2 * NOISE, (len(moved), len(places), 2))
    outlines = tuple((places + u)[:, [0, 2]] + n for u, n in zip(moved, noise, strict=True))
    pose = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0.01], [0, 1, 0, 0], [0, 0, 0, 1]])
    return Contours(BEAM_CLOCK.t[::10], outlines, 2 * NOISE, pose, "body")


def _on_tube() -> tuple[Floats, Floats]:
    """Radii (m,) and places (m, 3) m of markers on a face of the quarter."""
    radii = np.array([TUBE.inner, TUBE.outer, 0.015])
    angles = np.radians([30.0, 60.0, 45.0])
    z = np.full(3, TUBE.height)
    return radii, np.stack([radii * np.cos(angles), radii * np.sin(angles), z], axis=1)


def _signal(clock: Clock, y: Floats, unit: str, sd: float) -> Signal:
    noise = np.random.default_rng(8).normal(0, sd, len(clock.t))
    return Signal(clock.t, (clock.sampled(y) + noise)[:, None], unit, sd, "sensor")


def _recording(
    name: str, clock: Clock, names: tuple[str, ...], places: Floats, moved: Floats,
    signals: dict[str, Signal],
) -> Recording:  # fmt: skip
    seen = clock.sampled(moved)
    noise = np.random.default_rng(7).normal(0, NOISE, seen.shape)
    markers = {"markers": Markers(clock.t, names, places + seen + noise, NOISE, "body")}
    source = Source("benchmarks/moving_bodies.py", "", 0, "made by another code")
    return Recording(name, source, 0, markers=markers, signals=signals)


def quarter_tube(tube: Tube = TUBE, cells: tuple[int, int, int] = (4, 12, 1)) -> Mesh:
    """Bricks of a quarter of the tube, about z, with the facet sets inner and outer."""
    unit = grid((1.0, 1.0, 1.0), cells)
    r = tube.inner + (tube.outer - tube.inner) * unit.nodes[:, 0]
    angle = np.pi / 2 * unit.nodes[:, 1]
    nodes = np.stack([r * np.cos(angle), r * np.sin(angle), tube.height * unit.nodes[:, 2]], axis=1)
    facets = {"inner": unit.facets["x0"], "outer": unit.facets["x1"]}
    return replace(unit, nodes=nodes, facets=facets)


BEAM_ANSWERS = f"""\
body = {{shape = "block", block = "120mm,20mm,20mm"}}
material = {{E = {BEAM.E:g}, nu = {BEAM.nu:g}, rho = {BEAM.rho:g}}}
law = "linear"
held.all = "xmin"
seen = {{layout = "as seen", still = "0.2s"}}
motion = {{how = "dynamic", damping = "{BEAM.damping:g}s"}}
accept = {{marker = "0.5mm"}}
why = {{marker = "a fifteenth of the swing, peak to peak"}}
ranges = {{E = "0.2%", nu = 0.001, load = "0.5%", rho = "0.2%", damping = "2%"}}
"""
ANSWERS = {
    "swinging": BEAM_ANSWERS
    + f"""moved = {{by = "release", place = "xmax", along = "-z", held = "{BEAM.force:g}N"}}\n""",
    "pushed": BEAM_ANSWERS + """moved = {by = "force", place = "xmax", along = "-z"}\n""",
    "filmed": BEAM_ANSWERS.replace("accept = {", 'accept = {contour = "0.5mm", ').replace(
        "why = {", 'why = {contour = "a fifteenth of the swing, peak to peak", '
    )
    + """moved = {by = "force", place = "xmax", along = "-z"}\n""",
    "chamber": f"""\
body = {{shape = "file", file = "chamber.npz"}}
material = {{E = {TUBE.E:g}, nu = {TUBE.nu:g}, rho = {TUBE.rho:g}}}
law = "linear"
held = {{x = "xmin", y = "ymin", z = "zmin+zmax"}}
moved = {{by = "pressure", place = "inner"}}
seen = {{layout = "as seen", still = "0.09s"}}
motion = {{how = "dynamic", damping = "{TUBE.damping:g}s"}}
accept = {{marker = "0.05mm"}}
why = {{marker = "a tenth of the step"}}
ranges = {{E = "0.2%", nu = 0.0005, load = "0.5%", rho = "0.2%", damping = "2%"}}
""",
}


def written(name: str, folder: Path) -> None:
    """The recording, the answers, and the mesh that they name."""
    folder.mkdir(parents=True, exist_ok=True)
    write_recording(recorded(name), folder / f"{name}.mcap")
    (folder / f"{name}.toml").write_text(ANSWERS[name], "utf-8")
    if name == "chamber":
        write_mesh(quarter_tube(), folder / "chamber.npz", "a quarter of a thick-walled tube")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("name", choices=NAMES)
    parser.add_argument("-o", "--out", type=Path, default=Path())
    asked = parser.parse_args()
    written(asked.name, asked.out)
    print(f"{asked.out / asked.name}.mcap and .toml")


if __name__ == "__main__":
    main()
