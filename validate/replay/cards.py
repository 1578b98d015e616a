"""What the parameters of several experiments have in common: cards, and changes of them."""

from dataclasses import dataclass, fields, replace
from math import sqrt

from validate.errors import UsageError
from validate.parameters import quantity
from validate.scene.laws import Coefficients
from validate.scene.material import LawName, Material
from validate.twin.tracked import Camera, require_noise


@dataclass(frozen=True)
class TimeSteps:
    dt: float = quantity(1e-3, "s", "time step")
    steps: int = quantity(1000, "1", "steps")


@dataclass(frozen=True)
class Meshes:
    """Meshes in addition to that of the body, for u_num."""

    finer: float = quantity(1.5, "1", "of a grid: how many times finer the finest mesh is")
    budget: bool = quantity(
        True, "1", "keep a first answer to about 30 s by fewer meshes; false: as --refine"
    )


@dataclass(frozen=True)
class TrackedTwin:
    """What made a tracked recording; the models do not know it."""

    seed: int = quantity(1, "1", "seed of the noise")
    noise: float = quantity(1e-9, "m2", "variance of the white noise per component (.001 mm2)")
    stiffness: float = quantity(1.0, "1", "ratio of its modulus to that of the models")
    nu: float | None = quantity(None, "1", "its Poisson ratio; none: that of the models")
    every: int = quantity(1, "1", "steps between two samples of the tracker")
    missing: float = quantity(0.0, "1", "share of samples at which a marker is missing")

    def __post_init__(self) -> None:
        require_noise(self.noise)

    @property
    def camera(self) -> Camera:
        """The tracker; its registration rests on 10 000 looks at rest."""
        return Camera(sqrt(self.noise), self.every, self.missing, still=10_000)

    def true(self, material: Material) -> Material:
        """The models' material as the twin has it."""
        nu = material.nu if self.nu is None else self.nu
        return replace(material, E=self.stiffness * material.E, nu=nu)


def require_used(given: Coefficients, laws: set[LawName]) -> None:
    """Raises `UsageError` for coefficients of the material that the law of no method knows."""
    for f in fields(given):
        value = getattr(given, f.name)
        if value != f.default and all(getattr(given.known_to(w), f.name) != value for w in laws):
            raise UsageError(
                f"material.{f.name} = {value}: no method has a law with this parameter, only "
                f"{', '.join(sorted(laws))}; set methods.NAME.law"
            )
