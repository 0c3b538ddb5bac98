"""The exact rod in its hole: a string of several sections, at rest against the hole's wall or slipping along it."""

import contextlib
import numbers

import numpy as np
from mpi4py import MPI

from cosserat_fenicsx.checks import number, refuse
from cosserat_fenicsx.errors import NotConverged
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.progress import Progress
from cosserat_fenicsx.quaternions import product_conjugate
from cosserat_fenicsx.results.accuracy import on_mesh
from cosserat_fenicsx.results.path import Path
from cosserat_fenicsx.statics.circulatory import conservative_along
from cosserat_fenicsx.statics.path.recorder import record_of
from cosserat_fenicsx.statics.settling import BACK, LAST, LAST_TWO, settle, stages_from
from cosserat_fenicsx.statics.solvers import solvers_of
from cosserat_fenicsx.well.in_hole import InHole
from cosserat_fenicsx.well.string_scene import string_in

# Degree of the elements where none is asked for: lift-off forces limit the regularity, higher degrees gain nothing.
_DEGREE = 3
# Elements of the first mesh and the most, where none are asked for; factor from one mesh to the next. Where a number is
# asked for, the mesh before it has this part of it.
_FIRST, _MOST, _FINER, _BEFORE = 256, 8192, 2, 4
# A finer mesh has shorter elements where the pressure changes: bounds of their number, over that of equal ones.
_FEWEST, _DENSEST = 0.3, 2.4
# An error below this times that by the wall's stiffness is hardly one of the mesh.
_BY_WALL = 1.25
# Part of the accuracy asked for below which the effect of the wall's stiffness is not found again on a finer mesh.
_KNOWN = 0.1
# Starts in turn, see `stages_from`.
_STARTS = ("fast", "gentle", "relaxed")
# More negative modes than there ever are, in place of -1 where the second variation is singular.
_SINGULAR = 1 << 30
# Rounding of the residual of a node, over that of its position times the stiffness of its piece of wall, or ring.
_ROUNDED = 20.0
# Largest difference between the reaction and the balance of all forces, over the sum of the wall's forces.
_UNBALANCED = 1e-5


def solve_in_hole(
    path,
    lengths,
    stiffness,
    weight,
    contact_radius,
    *,
    radius,
    friction=0.0,
    slip=(0.0, 0.0),
    bottom_tension=0.0,
    bottom_torque=0.0,
    rings=(),
    wall_stiffness=1e9,
    hinge=None,
    extensible=False,
    has_arm=True,
    tol=1e-4,
    elements=None,
    degree=_DEGREE,
    progress=None,
    comm=None,
):
    """The equilibrium of a string in a hole, as an exact rod in contact with the hole's wall.

    The string hangs from a clamp at the start of the path, on its axis, and ends at the sum of its lengths. Its weight
    acts along the third axis (down); its own axis is straight when free of stress. Where it slips, friction acts in the
    known direction of slip. All lengths are those under load, in the hole: the string does not stretch (the answer has
    the `stretch` that the tension causes) unless it is `extensible`.

    The rod is solved on two meshes, the second with short elements where the pressure changes, and on finer ones until
    the estimated error of the hook load and of the torque is below `tol`.

    Args:
        path: a `WellPath`, m.
        lengths: (n,) of the string's sections from the top down, m.
        stiffness: n `Stiffness`, or one for all.
        weight: (n,) or one, N/m, in the fluid (> 0).
        contact_radius: (n,) or one, radius of the surface that touches, m.
        radius: of the hole, m; or pieces [(md_end, radius)].
        friction: coefficient; or pieces [(md_end, coefficient)].
        slip: (c_a, c_r), unit direction of slip of the string's surface: (1, 0) up the hole, (-1, 0) down, (0, 1)
            turning (clockwise seen from above); (0, 0) for no friction; or one for each section, (n, 2).
        bottom_tension: N, along the hole at the string's end; negative: weight on bit.
        bottom_torque: torque on bit, N m, against the rotation.
        rings: [(s, clearance, radius)] of stabilisers and bits: stations (m from the top) that stay within a clearance
            (m) of the hole's axis; 0 centres the string there.
        wall_stiffness: N/m^2; of rings N/m.
        hinge: None; or the direction about which the top turns freely, in place of a clamp.
        extensible: whether the axial stiffness counts in the equilibrium; the lengths are then those of the
            unstretched string.
        has_arm: whether friction acts on the surface; False: on the centreline.
        tol: relative accuracy of hook load and torque.
        elements: their number, which fixes the mesh; the estimate is then that of a mesh of a quarter of them.
        degree: of the elements, 2 to 4.
        progress, comm: as `solve` takes them.

    Returns:
        `InHole`.

    Raises:
        SceneError: numbers that are not what was expected.
        NotConverged: no equilibrium was found, or, as a `NotAccurate`, not as accurately as asked.
    """
    string = string_in(path, lengths, stiffness, weight, contact_radius, radius, friction, slip, bottom_tension,
                       bottom_torque, rings, wall_stiffness, hinge, extensible, has_arm)  # fmt: skip
    tol = number("solve_in_hole", "tol", tol, "a number from 1e-12 to below 1", lambda x: 1e-12 <= x < 1)
    comm, counts = comm or MPI.COMM_WORLD, _counts(elements)
    with Progress([float(len(stages_from(string.spring)))], progress, comm, "stage") as bar:
        answer = None
        for count in counts:
            answer = _finer(string, count, degree, answer, tol, bar, comm)
            # finer meshes change nothing of what the wall's stiffness does
            if elements is None and answer.error <= max(tol, _BY_WALL * answer.of_stiffness):
                break
    if elements is None and answer.error > tol:
        raise NotAccurate(answer, tol)
    return answer


class NotAccurate(NotConverged):
    """An equilibrium whose error is above the one asked for.

    Attributes:
        answer: the `InHole`.
    """

    def __init__(self, answer, tol):
        super().__init__(
            f"solve_in_hole: the estimated error is {answer.error:.1e} on {answer.path.elements[0]} elements, of which "
            f"the wall's stiffness makes {answer.of_stiffness:.1e}: expected a tol above it, not {tol:g}, or a stiffer "
            "wall"
        )
        self.answer = answer


def _counts(elements):
    """Elements of the meshes in turn."""
    if elements is None:
        return [_FIRST * _FINER**k for k in range(1 + int(np.log2(_MOST / _FIRST)))]
    if isinstance(elements, bool) or not isinstance(elements, numbers.Integral) or elements < 1:
        refuse("solve_in_hole", "elements", elements, "a whole number above zero")
    return [max(1, int(elements) // _BEFORE), int(elements)]


def _finer(string, count, degree, before, tol, bar, comm):
    """The `InHole` on a mesh of so many elements, from that on the mesh before, or from the start in stages."""
    if before is not None:
        layout = _divided(string, before.path.layout, _wanted(before), count)
        for stages in (LAST if before.of_stiffness <= _KNOWN * tol else LAST_TWO, BACK):
            with contextlib.suppress(NotConverged):  # the contact on the coarse mesh may be too far off
                return _on_mesh(string, layout, degree, stages, before, before, bar, comm)
    pieces = Layout.of(string.scene, 1)
    layout = _divided(string, pieces, np.diff(pieces.breaks[0]), count)
    found = []
    for way in _STARTS:
        try:
            stages = stages_from(string.spring, way)
            found.append(_on_mesh(string, layout, degree, stages, None, before, bar, comm))
        except NotConverged as failed:
            reason = failed
        if found and not found[-1].negative_modes:
            break
    if found:  # the one in which the string would buckle in the fewest ways
        return min(found, key=lambda answer: answer.negative_modes % _SINGULAR)
    raise NotConverged(
        f"solve_in_hole: no equilibrium was found on {count} elements: {reason}. A string that is compressed beyond "
        "its buckling load may have many: expected more elements, a softer wall, or less compression"
    )


def _wanted(answer):
    """(elements,) density of elements on a finer mesh: larger where the pressure changes."""
    h, p = np.diff(answer.path.layout.breaks[0]), answer.element_pressures
    change = p.max(axis=1) - p.min(axis=1)
    change = np.maximum(change, np.maximum(np.append(change[1:], 0.0), np.append(0.0, change[:-1])))
    usual = np.median(p[p > 0]) if (p > 0).any() else 1.0
    return h * np.clip(np.sqrt(change / usual), _FEWEST, _DENSEST)


def _divided(string, layout, wanted, count):
    """The layout of exactly `count` elements, or one a piece, with the density `wanted` on the elements of another.

    The number does not depend on the string, so that strings of any length share compiled problems.
    """
    breaks, pieces = layout.breaks[0], layout.pieces(string.scene)[0]
    shares = np.array([wanted[piece].sum() for piece in pieces])
    shares *= max(count - len(pieces), 0) / shares.sum()
    counts = 1 + shares.astype(int)
    counts[np.argsort(counts - shares)[: max(count - counts.sum(), 0)]] += 1
    found = []
    for piece, parts in zip(pieces, counts, strict=True):
        so_far = np.append(0.0, np.cumsum(wanted[piece]))
        ends = np.interp(np.linspace(0.0, so_far[-1], parts + 1), so_far, breaks[piece.start : piece.stop + 1])
        found.append(ends[:-1])
    return Layout((np.append(np.concatenate(found), 1.0),))


def _on_mesh(string, layout, degree, stages, start, before, bar, comm):
    """The `InHole` on one mesh, from that on another mesh or from the axis, with errors by that on the mesh before."""
    scene = string.scene
    with solvers_of(scene, layout, degree=degree, comm=comm) as (problem, _, stability):
        model, scales = problem.model, problem.model.scales
        problem.set_load_factor(1.0)
        _begin(problem, string, layout, start)
        bar.start(f"rod in its hole, {model.unknowns} unknowns")
        softer = []

        def on_stage(k):
            bar.reached(float(k + 1))
            if k == len(stages) - 2:
                softer.append(record_of(problem, 1.0, 0, 0, 0))

        of_wall = string.wall.stiffness * float(layout.sizes(scene).max())
        stiffest = max([of_wall, *(ring.stiffness for ring in string.rings)])
        rounding = _ROUNDED * np.finfo(float).eps * stiffest * scales.length / scales.force
        steps = settle(problem, string.stages, string.clearance / scales.length, rounding, stages,
                       careful=[len(stages) - 2], on_stage=on_stage)  # fmt: skip
        answers = []
        last = record_of(problem, 1.0, _negative_modes(string, problem, stability), steps, steps)
        for record in (*softer, last):
            why = [f"{string.words}; {model.signature.formulation.words}"]
            path = Path.of(model, why, conservative_along)
            path.append(record)
            answers.append(InHole(string, path))
    answer = answers[-1]
    if not answer.balance <= _UNBALANCED * answer.scale:
        raise NotConverged(
            f"the contact alternates: the reaction and all other forces differ by {answer.balance:.3g} N"
        )
    answer.compare(before, answers[0] if softer else None)
    return answer


def _negative_modes(string, problem, stability):
    """The number of negative eigenvalues of the second variation without friction, which has no potential."""
    for friction in (0.0, 1.0):
        for stage in string.stages:
            stage.friction = friction
        problem.model.actions.refresh()
        if not friction:
            found = stability.count()
    return found


def _begin(problem, string, layout, before):
    """Set the state: that of another mesh, or on the axis without contact force."""
    model = problem.model
    if before is not None:
        rq, n = on_mesh(before.path, layout)
        problem.begin_at(model.unknowns_of(rq[0]), n[0], before.path._records[0].reactions)
        return
    rod = string.rod
    rq = on_axis(rod, string.path, layout.node_s(model.nodes)[0] * rod.length)
    rq[:, :3] = (rq[:, :3] - string.scene.origin(rod)) / model.scales.length
    n = np.zeros((sum(layout.counts), len(model.forms.gauss), 3))
    problem.begin_at(model.unknowns_of(rq), n, np.zeros_like(problem.multipliers()))


def on_axis(rod, path, s):
    """(r, q) (n, 7) of a rod that lies on the axis without twist, at ascending arc lengths s (n,), from the path's
    start; q is the rotation from the rod's straight reference, without a jump of sign."""
    near = path.nearest(None, s)
    before = np.concatenate([rod.curve.frame(np.zeros(1))[:, :, 2], near.tangent[:-1]])
    cos = np.einsum("ni,ni->n", before, near.tangent)
    q = np.column_stack([1 + cos, np.cross(before, near.tangent)])
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    done = 1  # products of the small rotations of 1, 2, 4, .. nodes
    while done < len(q):
        q[done:] = product_conjugate(q[done:], q[:-done] * (1.0, -1.0, -1.0, -1.0))
        done *= 2
    return np.column_stack([near.position, q / np.linalg.norm(q, axis=1, keepdims=True)])
