"""A string of components, laid into a hole down to a measured depth."""

from dataclasses import dataclass

from cosserat_fenicsx.checks import refuse, store
from cosserat_fenicsx.errors import SceneError

_ORDERS = ("bit up", "top down")


@dataclass(frozen=True)
class Laid:
    """A component in its place: measured depths (m) of its upper and lower end."""

    top: float
    bottom: float
    component: object


@dataclass(frozen=True)
class DrillString:
    """A string of components.

    Args:
        components: `DrillPipe`, `Component` ... from the bit up. The uppermost one fills up to the surface: its length
            is None. With a length, the string hangs from the surface only at the depth that is the sum of lengths.
        order: "bit up", or "top down": `components` from the surface down.

    Attributes:
        components: from the bit up, whatever the order was.

    Raises:
        SceneError: no components, an unknown order, or a length that is missing below the uppermost component.
    """

    components: tuple
    order: str = "bit up"

    def __post_init__(self):
        given = tuple(self.components) if isinstance(self.components, list | tuple) else (self.components,)
        if self.order not in _ORDERS:
            refuse(self, "order", self.order, "'bit up' or 'top down'")
        for part in given:
            if not all(hasattr(part, name) for name in ("length", "contact_radius", "stiffness", "weight", "name")):
                refuse(self, "components", part, "components: DrillPipe, HeavyWeight, Collar, ..., or Component")
            if not isinstance(part.name, str):
                refuse(part, "name", part.name, "a text")
        if not given:
            refuse(self, "components", given, "at least one component")
        other = _ORDERS[1 - _ORDERS.index(self.order)]
        given = given if self.order == "bit up" else given[::-1]
        store(self, components=given, order="bit up")
        for part in given[:-1]:
            if part.length is None:
                expected = f"a length (m): only the uppermost component, {given[-1].name}, fills up"
                if part is given[0]:
                    expected += f"; where the list runs the other way, say order='{other}'"
                refuse(part, "length", None, expected)

    def laid(self, depth):
        """The components in their places with the lower end at a measured depth (m), from the bit up.

        Raises:
            SceneError: the string is longer or shorter than the depth.
        """
        places, bottom = [], depth
        for part in self.components:
            top = 0.0 if part.length is None else bottom - part.length
            if abs(top) < 1e-9 * depth:
                top = 0.0
            if top < 0 or bottom <= 0:
                raise SceneError(
                    f"DrillString: {part.name} reaches {-top:.6g} m above the surface at the depth {depth:.6g} m: "
                    "expected a string that is no longer; the uppermost component fills up where it has no length"
                )
            places.append(Laid(top, bottom, part))
            bottom = top
        if places[-1].top > 0:
            raise SceneError(
                f"DrillString: it ends {places[-1].top:.6g} m below the surface at the depth {depth:.6g} m: expected "
                "an uppermost component without a length, which fills up"
            )
        return places
