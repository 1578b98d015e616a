"""What a contact tells at every step: force, friction, area, penetration, nodes, work."""

from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats, Ints
from validate.scene.scene import Scene
from validate.solve.touching import OPEN, SLIP, Candidates

_EACH = {"force": "N", "friction": "N", "area": "m^2", "penetration": "m", "touching": "1",
         "slipping": "1", "work": "J"}  # fmt: skip


@dataclass(frozen=True)
class Touched:
    """Places x (n, d) m of all nodes under the inputs, forces (c, d) N on the candidates, whose
    `status` (c,) is; `work` (contacts,) J of the rigid bodies' motion so far."""

    x: Floats
    inputs: Floats
    forces: Floats
    status: Ints
    work: Floats


def contact_units(scene: Scene) -> dict[str, str]:
    """`<contact>.force` against the motion (of one that stands, along its normals), `.friction`,
    `.area` that touches, `.penetration` of the deepest node, nodes `.touching` and `.slipping`,
    `.work` that the rigid body has done. In 2-D an area is per metre of thickness."""
    return {f"{c.name}.{name}": unit for c in scene.contacts for name, unit in _EACH.items()}


def contact_numbers(parts: Candidates, scene: Scene, now: Touched) -> dict[str, float]:
    """The numbers of `contact_units`, on the whole body; what presses is positive."""
    numbers: dict[str, float] = {}
    for k, part in enumerate(scene.contacts):
        found = _numbers(parts, scene.copies, k, now)
        numbers |= {f"{part.name}.{name}": float(x) for name, x in found.items()}
    return numbers


def _numbers(parts: Candidates, copies: int, k: int, now: Touched) -> dict[str, float]:
    of, part = parts.owner == k, parts.contacts[k]
    offset = parts.offset(k, now.inputs)
    normals = part.shape.outward(now.x[parts.nodes[of]] - offset)
    forces, status = now.forces[of], now.status[of]
    normal = (forces * normals).sum(axis=1)
    rubbing = (forces - normal[:, None] * normals).sum(axis=0)
    along = normal.sum() if part.direction is None else forces.sum(axis=0) @ part.direction
    least = float(part.shape.gap(now.x[parts.facets[k]] - offset).min())
    return {
        "force": copies * along,
        "friction": copies * float(np.linalg.norm(rubbing)),
        "area": copies * parts.areas[of][status != OPEN].sum(),
        "penetration": max(0.0, -least),
        "touching": float((status != OPEN).sum()),
        "slipping": float((status == SLIP).sum()),
        "work": copies * now.work[k],
    }
