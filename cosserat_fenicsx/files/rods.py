"""Scene files of rods.

[[rods]]
name = "column"
curve = { type = "Line", start = [0, 0, 0], end = [0, 0, 20] }
section = { type = "Circle", diameter = 0.2 }
material = { E = "210 GPa", nu = 0.3 }
# a section that jumps: section = [{ to = 5.0, type = "Circle", diameter = 0.2 }, { type = "Circle", diameter = 0.1 }]
# mass off the axis: eccentricity = [0.01, 0.0], or [{ to = 5.0, offset = [0.01, 0.0] }, { offset = [0.0, 0.0] }]
# a curve from a file beside this one: curve = { type = "Spline", points = "survey.csv" }

[[supports]]
type = "Clamp"
station = "column.start"          # or "column.end", or "column@5.0" for s = 5 m

[[loads]]
type = "Force"
station = "column.end"
force = [0, 0, "-100 kN"]

# in a motion: force = { type = "Triangle", value = [0, 0, 50], peak = 1.0, end = 2.0 }, or Step, Ramp, RunUp, Sine,
# Table

[[velocities]]                    # optional, initial velocities of a motion
rod = "column"
angular = [0, 0, 6.28]

[[joints]]                        # optional, between rods that touch
first = "column.end"
second = "beam.start"

[[stages]]                        # optional, after the loads above: ramped one after another, each stays
name = "wind"
loads = [{ type = "LineForce", rod = "column", force = [30, 0, 0] }]
# supports = [...], release = ["column.end", "loads[0]"], load_factors = "0:1"

[solve]                           # optional: arguments of `solve`
load_factors = [0.5, 1.0]

[simulate]                        # a motion, instead of an equilibrium path; arguments of `simulate`
duration = 10.0                   # s
tol = 1e-3                        # or dt = 0.01
start = 0.9                       # optional: begin at the equilibrium of the loads just before t = 0 at this factor
"""

import dataclasses
import numbers
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from cosserat_fenicsx.checks import refuse, store
from cosserat_fenicsx.parts import Items, Object, Part, Time, positive
from cosserat_fenicsx.scene.action import Action
from cosserat_fenicsx.scene.rod import Rod
from cosserat_fenicsx.scene.scene import Scene
from cosserat_fenicsx.scene.stages import Stage, load_factors_in
from cosserat_fenicsx.scene.supports import InitialVelocity, Joint, Support


class _Settings(Part):
    """Base of tables of arguments of a function; None for its own defaults."""

    def given(self) -> dict[str, Any]:
        """The arguments that are given."""
        return {name: value for name, value in self.arguments().items() if value is not None}


@dataclass(frozen=True)
class Solve(_Settings):
    """Arguments of `solve` in a scene file, see there.

    Args:
        load_factors: a number or a list, reached exactly; or "A:B", where the solver chooses its steps.
        model, formulation, tol, bound, elements, degree, control, branch: as for `solve`.
    """

    load_factors: Any = None
    model: str | None = None
    formulation: str | None = None
    tol: float | None = None
    bound: Sequence[str] | None = None
    elements: int | None = None
    degree: int | None = None
    control: str | None = None
    branch: int | None = None

    called = "solve"

    def validate(self):
        if isinstance(self.load_factors, str):
            store(self, load_factors=load_factors_in(self.load_factors))
        elif self.load_factors is not None:
            given = self.load_factors if isinstance(self.load_factors, list | tuple) else [self.load_factors]
            if any(isinstance(x, bool) or not isinstance(x, numbers.Real) for x in given):
                refuse(self, "load_factors", self.load_factors, "a number, a list of numbers, or a text such as '0:1'")
        if self.bound is not None:
            store(self, bound=list(self.bound))


@dataclass(frozen=True)
class Simulate(_Settings):
    """Arguments of `simulate` in a scene file, see there.

    Args:
        duration: s. tol, dt, model, scheme, save_every, start, load_factor, elements, degree: as for `simulate`.
    """

    duration: Annotated[Time, positive()]
    tol: float | None = None
    dt: Time | None = None
    model: str | None = None
    scheme: str | None = None
    save_every: Time | None = None
    start: float | None = None
    load_factor: float | None = None
    elements: int | None = None
    degree: int | None = None

    called = "simulate"


@dataclass(frozen=True, eq=False)
class RodScene(Part):
    """A scene of rods and what is to be computed of it, from `read`.

    Args:
        rods, supports, loads, joints, velocities, stages, title: those of the `Scene`.
        solve: arguments of `solve`; None for its defaults.
        simulate: arguments of `simulate`, for a motion; None for an equilibrium path.

    Attributes:
        scene: the `Scene`.

    Raises:
        SceneError: see `Scene`.
    """

    rods: Annotated[Sequence[Rod], Items(Object((Rod,)))]
    supports: Sequence[Support] = ()
    loads: Sequence[Action] = ()
    joints: Sequence[Joint] = ()
    title: str = ""
    velocities: Sequence[InitialVelocity] = ()
    stages: Sequence[Stage] = ()
    solve: Solve | None = None
    simulate: Simulate | None = None

    def __repr__(self):
        return f"<RodScene of {self.scene!r}>"

    def validate(self):
        names = [field.name for field in dataclasses.fields(Scene)]
        store(self, scene=Scene(**{name: getattr(self, name) for name in names}))

    @property
    def settings(self) -> dict[str, Any]:
        """Arguments of `solve`."""
        return self.solve.given() if self.solve else {}

    @property
    def motion(self) -> dict[str, Any]:
        """Arguments of `simulate`; empty where the file asks for no motion."""
        return self.simulate.given() if self.simulate else {}

    def run(self, **changed):
        """The motion by `simulate` where the file has a duration, else the equilibrium path by `solve`.

        Args:
            changed: arguments other than in the file.

        Returns:
            A `History` or a `Path`.

        Raises:
            SceneError, NotConverged: see `simulate` and `solve`.
        """
        if self.simulate or "duration" in changed:
            from cosserat_fenicsx.dynamics.simulate import simulate

            return simulate(self.scene, **{**self.motion, **changed})
        from cosserat_fenicsx.statics.solve import solve

        return solve(self.scene, **{**self.settings, **changed})
