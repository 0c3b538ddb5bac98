"""A formulation: the representation of the contact force, and how |q| = 1 is imposed."""

from dataclasses import dataclass, replace

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.models.formulations.contact_force import KNOWN, ContactForce
from cosserat_fenicsx.models.formulations.unit_length import AT_NODES, UnitLength


@dataclass(frozen=True)
class Formulation:
    """A formulation of eq. (1). Other code uses these attributes, and never tests the name.

    Attributes:
        name: as `solve` takes it.
        default_degree: polynomial degree of r and q.
        force: the representation of the contact force n.
        rigid_force: the same where a stiffness is infinite, or so large that rounding requires it; None if not
            supported.
        unit_length: how |q| = 1 is imposed in the spatial model.
        models: names of the models that have it.
        advice: what else to try if it does not converge.
        says: text for `Path.why` in front of how n is represented.
    """

    name: str
    default_degree: int
    force: ContactForce
    rigid_force: ContactForce | None = None
    unit_length: UnitLength = AT_NODES
    models: tuple = ("spatial",)
    advice: str = "the formulation 'mixed'"
    says: str = ""

    def for_stiffness(self, infinite, rounding):
        """The formulation for a mesh.

        Args:
            infinite: whether a stiffness is infinite.
            rounding: rounding error of the tangent's largest entries over the bending stiffness.

        Raises:
            SceneError: an infinite stiffness where there is no `rigid_force`.
        """
        if infinite and self.rigid_force is None:
            raise SceneError(
                f"formulation = '{self.name}' cannot take an infinite stiffness: expected 'mixed', "
                "which carries the contact force as an unknown"
            )
        return replace(self, force=self.rigid_force) if self.rigid_force and (infinite or rounding > 1.0) else self

    def with_known_force(self):
        """The formulation where statics gives n."""
        return replace(self, force=KNOWN)

    @property
    def words(self):
        """How n is represented and |q| = 1 imposed, as text."""
        return f"{self.says}{self.force.words} (formulation '{self.name}')"
