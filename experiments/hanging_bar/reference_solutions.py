"""Their solutions of the hanging bar, and the drop that is compared.

`drop` is how far the lowest point sinks. Nothing was measured. The reference is what dolfinx's
hexahedra tend to, of 6 x 6 x 16 and of 12 x 12 x 32 of them, extrapolated with every order from 1
to 2: a held corner takes displacements of linear cells somewhere between.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from validate.arrays import Floats, checked
from validate.datasets.home import data_path
from validate.errors import RecordingError
from validate.files import npz_arrays
from validate.parameters import quantity
from validate.pipeline.experiment.tree import Tree
from validate.recording.reader import source_of
from validate.recording.types import Recording, Signal
from validate.register.observation import Deviation, Role, Selection, Simulated
from validate.register.registration import Registered
from validate.scene.mesh import Mesh
from validate.scene.scene import Scene

FOLDER = "simulators/hanging-bar"
SOURCE = "AustrianTradingMachine/Newton 9e5d430 (MIT), run of 2026-06-30"
FINER = 43.82e-3  # m: its 12 x 12 x 32 hexahedra, as printed; the file has the coarser ones
_ORDERS = (1.0, 2.0)
_UP, _UNIT = 2, "m"
_ONCE = np.ones(1)
_MOST = 200_000_000  # bytes of one file, unpacked


@dataclass(frozen=True)
class SolvedByOthers:
    data: str | None = quantity(None, "1", "folder of their solutions; none: VALIDATE_SHARED_DATA")


def load(tree: Tree, folder: Path) -> tuple[Recording, ...]:
    """The drop that their hexahedra tend to, its uncertainty as `sd`; and their tetrahedra's."""
    where = data_path(FOLDER, None, folder, tree.settings.data)
    source = source_of(where / "fem_result_hex.npz", "verified (CRC-32)")
    coarse = drop_of(read_arrays(where / "fem_result_hex.npz", _SHAPES))
    solved = drop_of(read_arrays(where / "fem_result.npz", _SHAPES))
    low, high = sorted(FINER + (FINER - coarse) / (2**p - 1) for p in _ORDERS)
    value = Signal(_ONCE, np.array([[(low + high) / 2]]), _UNIT, (high - low) / 12**0.5, "bar")
    told = {"kind": "reference", "of": SOURCE, "tetrahedra": f"{1e3 * solved:.4f} mm"}
    made = {"provenance": told, "mesh": {"folder": str(where)}}
    return (Recording("dolfinx", source, 0, signals={"drop": value}, metadata=made),)


def tetrahedra(recording: Recording, tree: Tree) -> Mesh:
    """Dolfinx's mesh, which lies beside its solutions."""
    return _tetrahedra(recording.record("mesh")["folder"])


_SHAPES: Mapping[str, tuple[int | None, ...]] = {"rest_q": (None, 3), "final_q": (None, 3)}


def drop_of(solution: Mapping[str, Floats]) -> float:
    """The largest drop m of a solution of theirs."""
    return float((solution["rest_q"] - solution["final_q"])[:, _UP].max())


@lru_cache(maxsize=2)
def _tetrahedra(folder: str) -> Mesh:
    shapes: dict[str, tuple[int | None, ...]] = {"rest_q": (None, 3), "tet_indices": (None, 4)}
    arrays = read_arrays(Path(folder) / "mesh.npz", shapes)
    return Mesh(arrays["rest_q"], arrays["tet_indices"].astype(np.int64), "tet4")


def read_arrays(path: Path, shapes: Mapping[str, tuple[int | None, ...]]) -> dict[str, Floats]:
    """Arrays of these names and shapes; `RecordingError` for a file without them."""
    arrays = npz_arrays(path, _MOST)
    if missing := sorted(n for n in shapes if n not in arrays or arrays[n].dtype.kind not in "fiu"):
        raise RecordingError(f"{path.name}: no numbers {missing}; it has {sorted(arrays)}")
    return {
        name: checked(arrays[name], f"{path.name}: {name}", shape, error=RecordingError)
        for name, shape in shapes.items()
    }


@dataclass(frozen=True)
class Drop:
    """The largest drop m of any node, against `value` m with its standard uncertainty `sd` m."""

    value: float
    sd: float
    t: Floats
    name: str = "drop"
    role: Role = "validates"

    @property
    def units(self) -> Mapping[str, str]:
        return {self.name: _UNIT}

    def rows(self) -> None:
        return None

    def unanswered(self, run: Simulated) -> tuple[str, ...]:
        return ()

    def deviations(self, run: Simulated, selection: Selection) -> tuple[Deviation, ...]:
        if not len(run.u):
            return ()
        ours = sunk(run)
        words = "largest drop of a node less what finer and finer hexahedra of dolfinx tend to"
        off = np.array([[ours - self.value]])
        return (Deviation(self.name, off, _UNIT, self.sd, 0.0, words, ours, self.value,
                          scale=self.value),)  # fmt: skip


def sunk(run: Simulated) -> float:
    """The largest drop m at a run's end."""
    return float(-run.u[-1][:, _UP].min())


def place(recording: Recording, tree: Tree, scene: Scene) -> Registered:
    drop = recording.signal("drop", _UNIT)
    return Registered(
        (*Registered.given_inputs(scene, drop.t), Drop(float(drop.y[0, 0]), drop.sd, drop.t)),
        timed=False,
    )
