"""Materials of rods."""

from dataclasses import dataclass

from cosserat_fenicsx.checks import number, positive, store


@dataclass(frozen=True)
class Material:
    """A linear elastic, isotropic material.

    Args:
        E: Young's modulus, Pa.
        nu: Poisson's ratio, in (-1, 0.5].
        density: kg/m^3; required by `Weight` and by motions.

    Raises:
        SceneError: a value outside its range.
    """

    E: float
    nu: float = 0.3
    density: float | None = None

    def __post_init__(self):
        store(self, E=positive(self, "E", self.E, "Pa"))
        store(self, nu=number(self, "nu", self.nu, "a Poisson's ratio in (-1, 0.5]", lambda nu: -1 < nu <= 0.5))
        if self.density is not None:
            store(self, density=positive(self, "density", self.density, "kg/m^3"))

    @property
    def G(self) -> float:
        """Shear modulus E/(2(1 + nu)), Pa."""
        return self.E / (2 * (1 + self.nu))
