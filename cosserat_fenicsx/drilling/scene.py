"""A drill-string in motion: string, hole, drive, hook, bit, mud and friction."""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

from cosserat_fenicsx.checks import refuse
from cosserat_fenicsx.drilling.bit_laws import BitOnRock
from cosserat_fenicsx.drilling.segments import Discs, Segment, segment_of
from cosserat_fenicsx.drilling.top_drive import Hook, TopDrive
from cosserat_fenicsx.drilling.wall_friction import FrictionLaw, ViscousDrag
from cosserat_fenicsx.parts import Depth, Part
from cosserat_fenicsx.well.components import DrillString, weight_in_mud
from cosserat_fenicsx.well.hole import Borehole, Mud


@dataclass(frozen=True)
class Drilling(Part):
    """A drill-string with its drive, hook, bit and friction.

    Args:
        string: a `DrillString`, or `Discs`.
        drive: a `TopDrive`.
        bit: a `BitOnRock`; None where the lower end is free.
        hole: a `Borehole`; None for a string without walls, as in a straight vertical hole.
        hook: a `Hook`; None for a rigid one at rest, or, where the bit has a `Cutting` law and a weight, for one whose
            load stays the same, so that the string follows the bit.
        mud: a `Mud`; None where all components have their weight in mud, or where there is no hole: in air.
        friction: `WallFriction` or another law; None for the friction of the hole, the same at rest and in motion.
        drag: `ViscousDrag`; None for none.
        depth: measured depth of the bit, m; None for the bottom of the hole, or the string's length without one.
        start: "rest": untwisted, hanging in its weight, with the static weight on bit; or "steady": all of it turns at
            the drive's speed and moves at the hook's, twisted by friction, drag and bit.

    Raises:
        SceneError: parts that are missing or do not fit each other.
    """

    string: DrillString | Discs
    drive: TopDrive
    bit: BitOnRock | None = None
    hole: Borehole | None = None
    hook: Hook | None = None
    mud: Mud | None = None
    friction: FrictionLaw | None = None
    drag: ViscousDrag | None = None
    depth: Depth | None = None
    start: Literal["rest", "steady"] = "rest"

    def validate(self):
        if self.discs is not None:
            for field in ("hole", "mud", "friction", "drag", "depth"):
                if getattr(self, field) is not None:
                    refuse(self, field, getattr(self, field), "None for Discs, whose drags are their own")
            if self.hook is not None and self.string.masses is None:
                refuse(self, "hook", self.hook, "None for Discs without masses, which turn alone")
            return
        if self.friction is not None and self.hole is None:
            refuse(self, "hole", None, "a Borehole, where there is friction at its wall")
        if self.depth is None and self.hole is None and self.string.components[-1].length is None:
            refuse(self.string.components[-1], "length", None, "a length (m), where there is neither hole nor depth")
        _ = self.segments

    @property
    def discs(self) -> Discs | None:
        """The string, where it is one of `Discs`."""
        return self.string if isinstance(self.string, Discs) else None

    @cached_property
    def bit_depth(self) -> float:
        """Measured depth of the lower end, m."""
        if self.depth is not None:
            return self.depth
        return self.hole.length if self.hole else math.fsum(part.length for part in self.string.components)

    @cached_property
    def laid(self) -> list:
        """The components in their places, from the bit up."""
        return self.string.laid(self.bit_depth)

    @cached_property
    def segments(self) -> tuple[Segment, ...]:
        """The uniform parts of the string, from the top down."""
        mud = self.mud if self.mud is not None or self.hole is not None else Mud(0.0)
        return tuple(segment_of(place, weight_in_mud(place.component, mud)) for place in reversed(self.laid))

    def with_case(self, speed: float | None = None, weight: float | None = None) -> "Drilling":
        """The same scene at another speed of the drive (rad/s) or another static weight on bit (N).

        Raises:
            SceneError: a weight where there is no bit.
        """
        drive = self.drive if speed is None else replace(self.drive, speed=speed)
        if weight is not None and self.bit is None:
            refuse(self, "bit", None, "a BitOnRock, whose weight is to change")
        bit = self.bit if weight is None else replace(self.bit, weight=weight)
        return replace(self, drive=drive, bit=bit)
