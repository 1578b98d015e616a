"""What scenes without a mesh have in common: nothing of what a mesh carries."""

import numpy as np

from validate.scene.material import Material, Region
from validate.scene.mesh import Mesh
from validate.scene.scene import Cavity, Drive, Load, Pressure, Probe, Scene, Support, Weight


class Meshless:
    """What a report, a score or a probe asks of any scene, and finds none of here."""

    @property
    def materials(self) -> tuple[Material, ...]:
        return ()

    @property
    def mesh(self) -> Mesh:
        """No nodes and no cells."""
        return _NO_MESH

    @property
    def probes(self) -> tuple[Probe, ...]:
        return ()

    @property
    def drives(self) -> tuple[Drive, ...]:
        return ()

    @property
    def loads(self) -> tuple[Load | Weight | Pressure, ...]:
        return ()

    @property
    def cavities(self) -> tuple[Cavity, ...]:
        return ()

    @property
    def regions(self) -> tuple[Region, ...]:
        return ()

    @property
    def supports(self) -> tuple[Support, ...]:
        return ()

    @property
    def copies(self) -> int:
        return 1


AnyScene = Scene | Meshless
_NO_MESH = Mesh(np.zeros((0, 2)), np.zeros((0, 3), dtype=np.int64), "tri3", {})
