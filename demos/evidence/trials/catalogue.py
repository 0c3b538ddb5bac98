"""The trials: the problem, the criterion, and the cell for a method's answers."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from trials import problems, ways
from trials.cells import NO_ROTATION, RIGHT, SAID, SILENT, STOPPED, Cell, NotForIt, Stopped, judged

_RELATIVE = "relative error"
_OF_LENGTH = "error / length"
#: Beck's column (Beck, Z. angew. Math. Phys. 3 (1952) 225), EI/L^2.
_FLUTTER = 20.05095


@dataclass(frozen=True)
class Trial:
    """A row of the table: its name, in short and for the reader; the problem and the criterion, in a sentence or two;
    and a function from a method to a `Cell`, which raises what the method raises."""

    key: str
    title: str
    tried: str
    run: object


def _column(etas, judged_from, limit=1e-2, jump=False, **more):
    """delta of the column, whose error counts from a load factor on."""

    def run(method):
        problem = problems.column(etas, **more)
        answer = method.solve(problem, jump=jump)
        late = np.array(etas) >= judged_from
        return judged(_delta_error(problem, answer)[late[-len(answer.tip) :]].max(), limit, answer, _RELATIVE)

    return run


def _delta_error(problem, answer):
    """The error at the load factors of the answer: all of them, or the last."""
    error = np.abs(answer.tip[:, 1] / problems.column_truth(problem)[-len(answer.tip) :, 1] - 1)
    return np.where(np.isnan(error), np.inf, error)


def _tips(answer, truth, problem):
    """Largest error of the tips' positions over the length."""
    both = min(len(answer.tip), len(truth))
    error = np.linalg.norm(answer.tip[-both:] - truth[-both:], axis=1) / problem["length"]
    return float(np.where(np.isnan(error), np.inf, error).max())


def _rolled(turns, steps, limit, **more):
    def run(method):
        problem = {**problems.roll_up(turns, steps), **more}
        answer = method.solve(problem)
        return judged(_tips(answer, problems.roll_up_truth(problem), problem), limit, answer, _OF_LENGTH)

    return run


def _twisted(method):
    problem = problems.twisted()
    answer = method.solve(problem)
    return judged(_tips(answer, _shot(problems.twisted), problem), 1e-2, answer, _OF_LENGTH)


@cache
def _shot(make):
    return problems.shot(make())


def _limit_point(method):
    top = problems.arch_limit()
    unit = "limit load"
    try:
        answer = method.solve(problems.arch(1.3 * top))
    except Stopped as stop:
        return Cell(STOPPED, stop.reached / top, unit, f"the limit load is {top:.6g}; {stop}")
    if answer.events:
        value = answer.events[0] / top
        return Cell(RIGHT if abs(value - 1) < 1e-2 else SAID, value, unit, "reported, and followed by arc length")
    if answer.said:
        return Cell(SAID, 1.3, unit, answer.said)
    return Cell(SILENT, 1.3, unit, "went on beyond the limit load to another part of the path without a word")


def _locking(method):
    """Locking: few elements on a straight rod and on an arc, a thousand times longer than thick."""
    straight = {**problems.column([0.5], 1e3), "coarse": True}
    answer = method.solve(straight)
    errors, notes = [_delta_error(straight, answer).max()], []
    arc = {**problems.thin_arc(), "coarse": True}
    try:
        answer, truth = method.solve(arc), _shot(problems.thin_arc)
        errors.append(float(np.linalg.norm(answer.tip[-1] - truth[0]) / np.linalg.norm(truth)))
    except NotForIt as missing:
        notes.append(f"the straight rod alone: {missing}")
    return judged(max(errors), 0.1, answer, _RELATIVE, "; ".join(notes))


def _slender(method):
    errors, notes = [], []
    for slenderness in (1e2, 1e3, 1e4, 1e5):
        problem = problems.column([0.5, 0.9], slenderness)
        try:
            answer = method.solve(problem)
        except Stopped as stop:
            raise Stopped(f"at L/d = {slenderness:.0e}: {stop}", stop.reached) from None
        errors.append(_delta_error(problem, answer).max())
        if errors[-1] > 1e-2 and not answer.said:
            break
    notes.append("errors " + ", ".join(f"{e:.1g}" for e in errors) + " at L/d = 1e2, 1e3, ...")
    return judged(max(errors), 1e-2, answer, _RELATIVE, "; ".join(notes))


def _units(method):
    here = problems.column([0.3, 0.5])
    there = problems.in_other_units(here)
    a, b = method.solve(here), method.solve(there)
    difference = float(np.abs(b.tip[:, 1] / 1e3 / a.tip[:, 1] - 1).max())
    return judged(difference, 1e-6, b, "relative difference")


def _numerics(key, limit=1e-4):
    """Trials of loops on PETSc, which the method defines in `numerics`."""

    def run(method):
        problem, answer, value, unit = method.numerics(key)
        error = float(_delta_error(problem, answer).max())
        if unit == NO_ROTATION:
            error, value = max(error, value), None
        cell = judged(error, max(limit, getattr(method, "tol", 0.0)), answer, _RELATIVE)
        return cell if value is None else Cell(cell.verdict, value, unit, f"error {error:.1e}; {cell.note}".strip("; "))

    return run


def _flutter(method):
    """Its statement on stability at each load factor against Beck's column, which is stable up to flutter."""
    problem = problems.beck()
    answer, unit = method.solve(problem), "flutter load"
    loads = np.array(problem["load_factors"])
    wrong = (loads < _FLUTTER) != answer.stable
    if not wrong.any():
        return Cell(RIGHT, loads[-1] / _FLUTTER, unit, answer.said)
    # a wrong statement must come with a warning of its own
    missed, feared = wrong & answer.stable, wrong & ~answer.stable
    excused = all(
        words in answer.said for words, which in (("flutter", missed), ("may be stable", feared)) if which.any()
    )
    told = "; ".join(
        f"it calls {load:g} EI/L^2 {'stable' if word else 'unstable'}"
        for load, word in zip(loads[wrong], answer.stable[wrong], strict=True)
    )
    return Cell(
        SAID if excused else SILENT, loads[wrong][0] / _FLUTTER, unit, f"{told}; {answer.said or 'and nothing more'}"
    )


_JUMP = (
    "The whole load at once, in one Newton solution from the straight rod; the default is asked for that load factor"
    " alone and steps as it likes. Right: the stable equilibrium that a growing load leads to, delta within 1 %."
)
TRIALS = (
    Trial("truncated", "truncated rotations\n(column, eta = 0.6)",
          "The paper's column at 0.6 of its critical load, where the tip turns by 0.03 rad: rotations that are "
          "truncated already show. Right: delta "
          "within 1 % of the exact rod.", _column([0.2, 0.4, 0.6], 0.6)),
    Trial("pole", "eq. (8) at its pole\n(column, eta = 0.95 and 1)",
          "The column close to and at its critical load, where the secant formula of second order has a pole and the "
          "rod has none: delta = 3.89 m and "
          "6.70 m. Right: delta within 1 % at both.", _column([0.5, 0.8, 0.9, 0.95, 1.0], 0.95)),
    Trial("jump_1.1", "one jump to eta = 1.1", _JUMP, _column([1.1], 0, jump=True)),
    Trial("jump_1.5", "one jump to eta = 1.5", _JUMP, _column([1.5], 0, jump=True)),
    Trial("jump_4", "one jump to eta = 4", _JUMP, _column([4.0], 0, jump=True)),
    Trial("limit", "limit point under load control\n(shallow clamped arch)",
          "A shallow clamped arch is loaded to 1.3 times its limit load in 13 steps of the load. Right: the limit "
          "point is reported, its load "
          "within 1 %; a method that stops there and says so has stopped; one that snaps through without a word is "
          "silently wrong.", _limit_point),
    Trial("roll", "roll-up past one turn\n(2 turns, 16 steps)",
          "An end moment of 2 * 2 pi EI/L in 16 steps closes two circles. Right: the tip within 1 % of the length at "
          "every step.", _rolled(2, 16, 1e-2)),
    Trial("ten", "ten turns\n(80 steps)",
          "The same with ten turns in 80 steps. Right: the tip within 1 % of the length at every step.",
          _rolled(10, 80, 1e-2)),
    Trial("through", "rotation through 2 pi\n(twist of 1.25 turns)",
          "A rod of small torsional stiffness, twisted by 1.25 turns by a tip moment while a force bends it, in 20 "
          "steps. Right: the tip within 1 % "
          "of the length.", _twisted),
    Trial("steps", "path dependence\n(8, 10 and 160 steps)",
          "The rod twisted by 1.25 turns and bent (for methods in a plane: the column at eta = 0.5) in 8, 10 and 160 "
          "equal steps. Right: one "
          f"and the same tip {ways.SAME}.", ways.steps),
    Trial("order", "path dependence\n(force then moment)",
          "A force and a moment on the tip, in space where the method knows it: together, the force first, the moment "
          "first. Right: one and the same "
          f"tip {ways.SAME}.", ways.order),
    Trial("objectivity", "objectivity\n(all turned)",
          "A loaded rod, and the same with its clamp turned and its loads turned with it: by 1.33 rad about an odd "
          "axis, 1.2 rad in a plane, for programs "
          "whose runner cannot turn a clamp the loads alone, by 0.7 rad about the axis of a rod that is alike in all "
          "directions. Right: the answer "
          f"turns with them, {ways.SAME}.", ways.objective),
    Trial("locking", "shear and membrane locking\n(L/d = 1000, few elements)",
          "Two thin rods, a straight one in compression at eta = 0.5 and a quarter of a circle bent in its plane, with "
          "few elements: 4 of second order, 8 "
          "of first. Right: within 10 %, what few elements may cost; locking costs ten times more.", _locking),
    Trial("slender", "slenderness to 1e5\n(column, eta = 0.9)",
          "The column with L/d = 1e2, 1e3, 1e4, 1e5, at eta = 0.5 and 0.9. Right: delta within 1 % for all.", _slender),
    Trial("inextensible", "inextensible limit\n(EA = GA = infinity)",
          "The column with infinite EA and GA, eta = 0.9; where a method needs a number, 1e10 EI/L^2. Right: delta "
          "within 1 % of the elastica.",
          _column([0.3, 0.6, 0.9], 0.9, infinite=True)),
    Trial("units", "unit systems\n(N m and MN mm)",
          "The same column in N and m and in MN and mm. Right: the same delta to 1e-6.", _units),
    Trial("residual", "false convergence of\nresidual norms (L/d = 1000)",
          "The column at eta = 0.9, L/d = 1000. This package and Figure 3's beams by their own test, which asks for a "
          "small increment as well; the bare loop and the "
          "programs stop on the norm of the residual in N and N m alone, as many codes do. Right: delta within 1e-4 of "
          "what the same mesh converges to.",
          _numerics("residual")),
    Trial("line_search", "PETSc's default line search\n(column, eta = 0.9)",
          "The column at eta = 0.9 from the straight rod in one Newton solution on 8 elements; this package's columns "
          "take Newton's full steps, as its "
          "solver does, and the bare loop, on the form and mesh of the column `displacement`, has PETSc's default line "
          "search, `bt`. The default takes full "
          "steps too, but goes to the load in steps of its own. The number is Newton iterations. Right: delta within "
          "1e-4 of what the same mesh gives in steps.", _numerics("line_search")),
    Trial("clamp", "a clamp that fixes three of\nfour quaternion components",
          "The column at eta = 0.9; the bare loop fixes (q_b, q_c, q_d) at the clamp and leaves q_a to |q| = 1, where "
          "this package fixes all four. Right: delta within 1e-4, and |q| = 1 at the clamp to 1e-4. The number is the "
          "larger error.", _numerics("clamp")),
    Trial("lu", "LU without pivoting\n(inextensible column)",
          "The inextensible column at eta = 0.9, whose contact force is a field of unknowns: a saddle point; the bare "
          "loop factors it with PETSc's own LU, "
          "which does not pivot, where this package takes one that does. Right: delta within 1e-4.", _numerics("lu")),
    Trial("quadrature", "more Gauss points than the\ndegree (column, eta = 0.9)",
          "The column at eta = 0.9 with p + 1 Gauss points an element of degree p: 4 elements of degree 2 in the bare "
          "loop, which locks; this package "
          "is asked for tol = 1e-4 and refines. Right: delta within 1e-3.", _numerics("quadrature", 1e-3)),
    Trial("flutter", "follower load\n(Beck's column to 25 EI/L^2)",
          "A compressive force that turns with the tip, in steps of 5 EI/L^2: stable up to 20.05, where it flutters, "
          "which statics has no way to see. "
          "Right: stable and unstable as they are; said so: the method itself says of what it gets wrong that it may "
          "be otherwise. The number is where it is wrong first.", _flutter),
)  # fmt: skip
BY_KEY = {trial.key: trial for trial in TRIALS}


def _quick(trial):
    """The same trial with fewer steps, for quick runs and tests."""
    less = {"ten": _rolled(4, 8, 1e-2, mesh=16)}
    return replace(trial, run=less[trial.key]) if trial.key in less else trial


#: The trials of the quick table, without "roll", since the quick "ten" is as short as that.
QUICK = tuple(_quick(trial) for trial in TRIALS if trial.key != "roll")
