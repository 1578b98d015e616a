"""Statics under prescribed displacements, where the modulus only scales the forces.

One solution at E = 1 Pa, with the law's coefficients in proportion, therefore serves all moduli of
a body: an identification of its modulus then costs one run.
"""

from collections import OrderedDict
from dataclasses import dataclass, replace
from hashlib import sha256
from time import perf_counter
from typing import ClassVar

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.system import build
from validate.parameters import part
from validate.scene.material import Material
from validate.scene.scene import Scene
from validate.solve.handles import LARGE, Handles
from validate.solve.march import march
from validate.solve.static.quasi_static import QuasiStatic
from validate.solve.types import Run, Scheme

_KEPT = 32  # solutions at unit modulus
_solved: OrderedDict[str, Run] = OrderedDict()


@dataclass(frozen=True)
class Proportional:
    """Settings: the static scheme `inner`, run once for every body, law and load path."""

    handles: ClassVar[Handles] = Handles(
        ("linear", *LARGE), inertia=False, cavities=False, loads=False, contact=()
    )

    inner: Scheme = part(QuasiStatic(), "the static scheme, for drives only")

    def solve(self, scene: Scene, t: Floats, inputs: Floats) -> Run:
        """Raise `SceneError` for a scene with more than one material or anything that pushes back
        by itself, and what the inner scheme does not handle."""
        more = (scene.loads, scene.cavities, scene.foundations, scene.membranes, scene.regions)
        if any(more) or scene.tracked:
            raise SceneError(
                "forces are proportional to the modulus only if one body is moved by drives "
                "alone; remove loads, cavities, foundations, membranes, regions and tracked "
                "sets, or run the inner scheme"
            )
        E = scene.material.E
        unit = replace(scene, material=in_proportion(scene.material, 1 / E))
        key = _key(self.inner, unit, t, inputs)
        if key not in _solved:
            start = perf_counter()
            stepper = self.inner.prepare(build(unit))
            setup = perf_counter() - start
            _solved[key] = march("", stepper, t, inputs, np.arange(len(t)), setup)
            while len(_solved) > _KEPT:
                _solved.popitem(last=False)
        _solved.move_to_end(key)
        run = _solved[key]
        traces = {n: replace(x, y=E * x.y) if x.unit == scene.force_unit and ".force" in n else x
                  for n, x in run.traces.items()}  # fmt: skip
        return replace(run, traces=traces)


def in_proportion(m: Material, factor: float) -> Material:
    """Return the material with its modulus and all coefficients in Pa times a factor."""
    c = m.coefficients
    coefficients = replace(
        c, C01=factor * c.C01, C20=factor * c.C20, C30=factor * c.C30,
        ogden_mu=tuple(factor * mu for mu in c.ogden_mu),
    )  # fmt: skip
    return replace(m, E=factor * m.E, coefficients=coefficients)


def _key(inner: Scheme, scene: Scene, t: Floats, inputs: Floats) -> str:
    """Of the scheme and all that a scene has but its modulus; coefficients over that to the digits
    that a product keeps."""
    mesh, m, c = scene.mesh, scene.material, scene.material.coefficients
    found = sha256()
    for array in (mesh.nodes, mesh.cells, *mesh.facets.values(), t, inputs):
        found.update(np.ascontiguousarray(array).tobytes())
    law = (m.law, m.nu, m.prony, c.volumetric, c.stretches, c.ogden_alpha)
    numbers = [f"{x:.12g}" for x in (c.C01, c.C20, c.C30, *c.ogden_mu)]
    parts = (inner, law, numbers, scene.supports, scene.pins, scene.drives, scene.probes,
             scene.dilatation, scene.plane, scene.thickness, scene.copies,
             scene.force_unit)  # fmt: skip
    found.update(repr(parts).encode())
    return found.hexdigest()
