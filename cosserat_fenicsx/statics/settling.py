"""Bring a rod to rest against a wall by Newton's method, from a state without contact, in stages.

Newton's method finds a contact only where it is known which part of the rod touches which side. A soft spring to the
axis in place of the wall gives an approximate state; the wall then replaces the spring, and is made stiffer in factors
of ten, each time with the contact nearly known.
"""

import math

from cosserat_fenicsx.algebra.newton import LimitedNewton
from cosserat_fenicsx.errors import NotConverged
from cosserat_fenicsx.interrupts import obey

#: Stages from a state close to the solution, such as the solution on a coarser mesh; first with a softer wall or not.
LAST = ((1.0, 0.0, 0),)
LAST_TWO = ((0.1, 0.0, 0), *LAST)
#: The last stages of a start, which show how the solution depends on the wall's stiffness.
DECADES = ((1e-2, 0.0, 0), *LAST_TWO)
_TAKES_OVER = 10.0  # stiffness of the first wall over that of the spring
_SOFTEST = 1e-12  # smallest stiffness of the spring, over the wall's
# Powers of ten by which the spring fades before it is removed; factors of its steps and of those of the wall, usual and
# small ones. (A spring that fades by ten at once lets a string with weight on bit buckle.)
_FADED, _STEPS, _SMALL_STEPS = 2, (10.0 ** (2 / 3), 10.0), (2.0, 2.0)
# First viscosity from a state close to the solution, over that spring; walls from there to the last one.
_HOLDS, _BETWEEN = 100.0, (0.05, 0.25)
# Steps of the viscous motion: largest number, intended movement over the clearance, largest factor of the viscosity
# after a step, bounds of the viscosity over the first one; and the least factor of it from a start, where buckling
# grows from rounding, and from a state close to the solution.
_VISCOUS, _WANTED, _RISES, _BOUNDS, _GROWS, _NEAR = 300, 0.3, 4.0, (1e-4, 30.0), 0.5, 0.1
# Newton step limits: displacement over the clearance, displacement over the longest rod, rotation (rad).
_LONGEST, _OF_LENGTH, _WIDEST = 10.0, 1e-4, 0.5
# Step over the clearance at which a stage ends: first stages, stages with full results (`careful`), last stage; and the
# rounding of a step, in the unit of length.
_ROUGH, _CAREFUL, _ENOUGH, _ROUNDING = 0.1, 1e-7, 1e-8, 1e-13
_FREE = 50.0  # factor on these where the rod is free to turn as a whole: rounding turns it
_MOST = 60  # Newton steps of a stage
# Newton's method counts as alternating between two contacts where steps do not shrink by this factor this number of
# times in a row; these shares of steps are then taken.
_SLOW, _STALLED, _SHARES = 0.6, 2, (0.5, 0.35, 0.7)
_BALANCED = 1e-6  # residual force of a node at equilibrium, over the norm of the loads


def stages_from(spring, way="fast"):
    """The stages of a start on the axis: tuples (stiffness of the wall, stiffness of a spring to its axis, both over
    the wall's own; 0, or where the rod moves as in a viscous fluid the least factor of the viscosity, see `_relax`).
    spring: the first one, with which the loads move the rod by about the clearance. way: "fast"; "gentle", by small
    steps; "relaxed", for a rod that is compressed beyond its buckling load; or "helix", for a rod that starts buckled,
    at the wall: as "relaxed", without the spring to the axis."""
    least = DECADES[0][0]
    spring = min(max(spring, _SOFTEST), least / _TAKES_OVER)
    wall, (fades, step) = _TAKES_OVER * spring, _STEPS if way == "fast" else _SMALL_STEPS
    if way == "helix":
        wall = min(_TAKES_OVER * wall, least)
    count = max(0, math.ceil(math.log(least / wall, step) - 1e-9))
    stiffer = [(least * (wall / least) ** (1 - k / count), 0.0, 0) for k in range(1, count)]
    if way in ("relaxed", "helix"):
        fading = [(wall, spring, _GROWS)]
    else:
        fading = [(wall, spring / fades**k, 0) for k in range(1, 1 + math.ceil(_FADED / math.log10(fades) - 1e-9))]
    to_axis = () if way == "helix" else ((0.0, spring, 0),)
    return (*to_axis, *fading, (wall, 0.0, 0), *stiffer, *DECADES)


def stages_back(spring, last=DECADES):
    """The stages from a state close to the solution where Newton's method fails, such as of a string that only the wall
    keeps from buckling and that leaves it: before the `last` ones it moves as in a viscous fluid. spring: see
    `stages_from`."""
    least = DECADES[0][0]
    stiffer = [(wall, 0.0, 0) for wall in _BETWEEN] if last == LAST else []
    return (least, min(_HOLDS * spring, least), _NEAR), *stiffer, *last


def settle(problem, walls, clearance, rounding, stages, careful=(), on_stage=None, hold=0.0, before_step=None,
           astray=_MOST):  # fmt: skip
    """Bring a problem to equilibrium at its walls, from its state; returns the number of Newton steps. Raises
    NotConverged where a stage was not solved, or the result is no equilibrium.

    walls: the `Stage`s of the scene's walls, left as in the last stage; clearance: smallest distance from the axis at
    which the rod touches, in the model's unit of length; rounding: residual force of a node that rounding may leave, in
    the model's unit; careful: indices of the stages to solve more precisely; on_stage: called with the index of each;
    hold: for a rod that is free, or almost free, to turn as a whole, such as a helix in a straight tube: stiffness,
    over the wall's own, of springs to the last position, which keep the tangent regular and vanish at rest;
    before_step: called before every Newton step; astray: number of steps in a stage too long to be taken whole, after
    which it counts as not solved.
    """
    newton = LimitedNewton(problem, max(_LONGEST * clearance, _OF_LENGTH), _WIDEST, before_step)
    for k, (stiffness, spring, viscous) in enumerate(stages):
        for wall in walls:
            wall.wall, wall.spring, wall.anchor = stiffness, spring, None
        last = k == len(stages) - 1
        share = _ENOUGH if last else _CAREFUL if k in careful else _ROUGH
        name = f"stage {k + 1} of {len(stages)} of the start"
        if viscous:
            _relax(newton, walls, spring, viscous, clearance, name)
        else:
            enough = share * clearance * (_FREE if hold else 1.0)
            _solve_stage(newton, max(enough, _ROUNDING), name, walls, hold, astray)
        if on_stage:
            on_stage(k)
    off = newton.imbalance()
    if not off <= _BALANCED * problem.load_norm + rounding:
        raise NotConverged(
            f"the contact alternates: a force of {off * problem.model.scales.force:.3g} N is left over at a node"
        )
    return newton.iterations


def _solve_stage(newton, enough, name, walls, hold, astray):
    failure = converge(newton, enough, (lambda: _fasten(newton, walls, hold)) if hold else None, astray)
    if failure:
        raise NotConverged(f"{failure} in {name}")


def converge(newton, enough, before=None, astray=_MOST):
    """Take Newton steps, and shares of them where the contact alternates between two states; enough: size of a full
    step that ends it, in the model's unit of length; before: called before every step; astray: see `settle`. Returns
    why it failed, "" where it converged."""
    moved, stalled = math.inf, 0
    for _ in range(_MOST):
        obey()
        if before:
            before()
        share = _SHARES[stalled // _STALLED % len(_SHARES)] if stalled and stalled % _STALLED == 0 else 1.0
        step = newton.step(share)
        if step is None:
            return "the tangent is singular"
        if step.share == 1.0 and step.moved <= enough:
            return ""
        astray -= step.share < share
        if astray < 0:
            return "Newton's steps are too long"
        stalled = stalled + 1 if step.moved > _SLOW * moved else 0
        moved = step.moved
    return f"Newton's method has not converged after {_MOST} steps"


def _fasten(newton, walls, stiffness):
    """Attach springs, of a stiffness over the wall's own, to the rod's position."""
    newton.imbalance()  # with the rod's position
    for wall in walls:
        wall.fasten()
        wall.spring = stiffness


def _relax(newton, walls, spring, falls, clearance, name):
    """Let the rod rest as in a viscous fluid, by implicit steps of one Newton step: the spring follows the rod. falls:
    the least factor of its stiffness from step to step."""
    viscosity = spring
    for _ in range(_VISCOUS):
        obey()
        _fasten(newton, walls, viscosity)
        step = newton.step()
        if step is None:
            raise NotConverged(f"the tangent is singular in {name}")
        if step.moved <= _ROUGH * clearance and viscosity <= _BOUNDS[0] * spring:
            break
        change = min(max(step.moved / (_WANTED * clearance), falls), _RISES)
        viscosity = min(max(change * viscosity, _BOUNDS[0] * spring), _BOUNDS[1] * spring)
    else:
        raise NotConverged(f"the rod has not come to rest in {name}")
