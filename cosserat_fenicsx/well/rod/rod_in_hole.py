"""The exact rod in its hole: a string of several sections, at rest against the hole's wall or slipping along it."""

import contextlib
import math
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from mpi4py import MPI

from cosserat_fenicsx.checks import refuse, tolerance, whole
from cosserat_fenicsx.errors import NotConverged
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.progress import Progress
from cosserat_fenicsx.ranks import communicator
from cosserat_fenicsx.results.accuracy import on_mesh
from cosserat_fenicsx.results.path import Path
from cosserat_fenicsx.statics.problem import record_of, solvers_of
from cosserat_fenicsx.statics.settling import DECADES, LAST, LAST_TWO, settle, stages_back, stages_from
from cosserat_fenicsx.statics.small_motions import conservative_along
from cosserat_fenicsx.well.rod.in_hole import NAMES, UNKNOWN, UNSEEN, InHole
from cosserat_fenicsx.well.rod.string_scene import in_helix, on_axis, string_in


@dataclass(frozen=True)
class _Meshes:
    """Settings of the meshes."""

    degree: int = 3  # of the elements by default; lift-off forces limit the regularity, so higher degrees gain nothing
    first: int = 256  # elements of the first mesh
    most: int = 8192  # elements of the last mesh
    finer: int = 2  # factor from one mesh to the next
    before: int = 4  # a requested number of elements over that of the mesh before
    per_piece: float = 1.5  # least number of elements of the first mesh over the pieces of the string
    # density of elements of the first mesh beside a place where the pressure may jump, over that far from all; and the
    # length along which it decays, over that in which the rod's typical load bends it by the clearance
    beside: float = 5.0
    within: float = 3.5
    places: int = 4096  # elements of equal length whose density is said so
    # least number of elements on a finer mesh for one on the mesh before: all errors change; and for twice as many on a
    # mesh that is asked for, whose fields along the string count too
    parts: float = 1.25
    asked: float = 1.5
    # root of the change of pressure over the usual one, below which an element gets no others; cap on what is above
    equal: float = 0.3
    densest: float = 2.1
    by_wall: float = 1.25  # below this multiple of the wall-stiffness error, the mesh error is taken as resolved
    fine: int = 1024  # the first mesh that must have a solution: snakes and helices need more elements than others


@dataclass(frozen=True)
class _Walls:
    """Settings of the walls that approach a rigid one, and of the equilibrium in them."""

    first: float = 1e9  # stiffness of the first wall, N/m^2
    stiffest: float = 1e3  # stiffness of the last wall over the first
    regular: float = 0.3  # ratio of changes above which the effect of the stiffness is found again on a finer mesh
    # share of the tolerance above which the wall is made ten times stiffer, and below which its effect is not found
    # again on a finer mesh: of 60 operations none has more than 1.6 times as much there, which the caution covers
    too_soft: float = 0.25
    # factor from which on Newton's method mostly fails on a finer mesh, or takes many steps; and from which on the wall
    # is made no stiffer to see its effect again
    stiff: float = 100.0
    hold: float = 1e-10  # springs that hold a helix, see `settle`
    rounding: float = 20.0  # residual of a node over the rounding of its position times its wall or ring stiffness
    astray: int = 8  # too long Newton steps in a stage from the mesh before, see `settle`
    # largest imbalance of the reaction and all other forces, over the wall's forces, which counts as an error;
    # rounding of positions makes it 1e-5 in a wall of 1e11 N/m^2
    unbalanced: float = 3e-5


_MESHES, _WALLS = _Meshes(), _Walls()
# Starts on the axis in turn, see `stages_from`; and the start from a helix, which begins as in a viscous fluid.
_STARTS, _FROM_HELIX = ("fast", "gentle", "relaxed"), ("helix",)
# Stands for an unknown number of negative modes in comparisons, instead of -1 where the second variation is singular.
_SINGULAR = 1 << 30
# Elements times Newton steps in a second of a busy machine; an idle one does half as many more.
_STEPS = 2.5e4


def solve_in_hole(path, lengths, stiffness, weight, contact_radius, *, wall_stiffness=None, helix=False, tol=1e-4,
                  elements=None, degree=_MESHES.degree, progress=None, comm=None, work=None, start=None,
                  **given):  # fmt: skip
    """The equilibrium of a string in a hole, as an exact rod in contact with the hole's wall.

    The string hangs from a clamp at the start of the path, on its axis, and ends at the sum of its lengths. Its weight
    acts along the third axis (down); its own axis is straight when free of stress. Where it slips, friction acts in the
    known direction of slip. All lengths are those under load, in the hole: the string does not stretch (the answer has
    the `stretch` that the tension causes) unless it is `extensible`.

    The rod is solved on two meshes, the second with short elements where the pressure changes, and on finer ones until
    the estimated error of the hook load and of the torque is below `tol`.

    Args:
        path, lengths, stiffness, weight, contact_radius, given: see `string_in`.
        wall_stiffness: N/m^2; None for a rigid wall, which is approached by stiffer ones until the remaining error is
            small beside `tol`. Errors are from a rigid wall in both cases.
        helix: whether to begin as a helix along the wall where the string is compressed beyond its buckling load, see
            `in_helix`; False: on the axis. Where there are several equilibria, the start decides which one is found.
        tol: relative accuracy of hook load and torque.
        elements: their number, which fixes the mesh; the error estimate then comes from a mesh with a quarter of them.
        degree: of the elements, 2 to 4.
        progress, comm: as `solve` takes them.
        work: the `Work` that it may do; None for any.
        start: the `InHole` of the same string under other loads, from which the first mesh begins, if that leads to an
            equilibrium which is stable.

    Returns:
        `InHole`.

    Raises:
        SceneError: numbers outside their range, or of another count.
        NotConverged: no equilibrium was found, or, as a `NotAccurate`, not as accurately as asked.
    """
    work = work or Work(math.inf)
    first = _WALLS.first if wall_stiffness is None else wall_stiffness
    string = string_in(path, lengths, stiffness, weight, contact_radius, first, **given)
    tol = tolerance("solve_in_hole", tol)
    comm, counts = communicator(comm), _counts(elements, len(Layout.of(string.scene, 1).breaks[0]) - 1)
    with Progress([float(len(stages_from(string.spring)))], progress, comm, "stage") as bar:
        stiffest = _WALLS.stiffest if wall_stiffness is None else 1.0
        job = _Job(degree, bool(helix), tol, counts[-1], stiffest, bar, work, comm, start)
        answer = None
        for count in counts:
            try:
                answer = _finer(string, count, answer, job)
            except NotConverged:
                if answer is not None and elements is None and answer.error < np.inf:
                    break  # not as accurately as asked
                if answer is not None or count >= min(_MESHES.fine, counts[-1]):
                    raise
                continue  # too few elements for its turns, or for a snake
            if elements is None and job.accepts(answer):
                break
        if answer.negative_modes is None:
            with solvers_of(string.scene, answer.path.layout, degree=degree, comm=comm) as (problem, _, stability):
                problem.set_load_factor(1.0)
                _count_modes(string, problem, stability, answer)
    string.leave(answer.factor)
    if elements is None and answer.error > tol:
        raise NotAccurate(answer, tol, work.words)
    return answer


class Work:
    """What a search for an equilibrium may cost: `left`, elements times Newton steps, of which a second takes about
    2.5e4. So where it ends does not depend on the machine. seconds: about how long it may take."""

    def __init__(self, seconds):
        self._seconds, self.left = seconds, _STEPS * seconds

    def spend(self, elements):
        """Count a Newton step on a mesh of `elements` elements. Raises NotConverged: it is one too many."""
        self.left -= elements
        if self.left < 0:
            raise NotConverged(self.words)

    @property
    def words(self):
        """Why a search has ended, "" where it has not."""
        return f"the search has ended after about {self._seconds:.0f} s of processor time" if self.left < 0 else ""


class NotAccurate(NotConverged):
    """An equilibrium whose error is above `tol`. answer: the `InHole`."""

    def __init__(self, answer, tol, ended=""):
        ended = ended and f"{ended}: "
        super().__init__(
            f"{ended}the estimated error of the rod in contact is {answer.error:.1e} on {answer.path.elements[0]} "
            f"elements, of which the wall's softness makes {answer.of_stiffness:.1e}: expected a tol above it, not "
            f"{tol:g}, or a stiffer wall"
        )
        self.answer = answer


def _counts(elements, pieces):
    """Numbers of elements of the meshes in turn, for a string of this many pieces: each has at least one."""
    if elements is None:
        first, finer = _MESHES.first, _MESHES.finer
        first *= finer ** max(0, math.ceil(math.log(_MESHES.per_piece * pieces / first, finer)))
        most = max(_MESHES.most, first * finer**2)
        return [first * finer**k for k in range(1 + int(np.log2(most / first)))]
    whole("solve_in_hole", "elements", elements)
    if elements < pieces:
        refuse("solve_in_hole", "elements", elements, f"at least one for each of the {pieces} pieces of the string")
    return [max(1, int(elements) // _MESHES.before), int(elements)]


class _Job(NamedTuple):
    """Settings that all meshes share: degree, start, tolerance, elements of the last one, stiffest wall over the first,
    progress, work, ranks, `InHole` under other loads."""

    degree: int
    helix: bool
    tol: float
    most: int
    stiffest: float
    bar: Progress
    work: Work
    comm: MPI.Comm
    start: InHole | None = None

    def accepts(self, answer):
        """Whether an `InHole` is accurate enough: finer meshes do not reduce the effect of the wall's softness."""
        return answer.error <= max(self.tol, _MESHES.by_wall * answer.of_stiffness)


def _finer(string, count, before, job):
    """The `InHole` on a mesh of `count` elements, from the `InHole` on the mesh before, or from the start in stages."""
    if before is not None:
        parts = _MESHES.parts if count <= _MESHES.finer * before.path.layout.counts[0] else _MESHES.asked
        layout = _divided(string, before.path.layout, _wanted(before, parts), count)
        near = LAST_TWO if before.estimates.ratio <= _WALLS.regular else DECADES
        near = LAST if max(before.of_stiffness, UNSEEN) <= _WALLS.too_soft * job.tol else near
        # the contact on the coarse mesh may be too far off, or the wall too stiff for this one
        spring, stiffer = string.spring, before.factor
        near = near if stiffer < _WALLS.stiff else stages_back(spring / stiffer, near)
        for stages, factor in ((near, stiffer), (stages_back(spring / stiffer), stiffer), (stages_back(spring), 1.0)):
            with contextlib.suppress(NotConverged):
                return _on_mesh(string, layout, stages, factor, before, before, job)
    if job.start is not None:
        layout = _divided(string, job.start.path.layout, _wanted(job.start, _MESHES.asked), count)
        with contextlib.suppress(NotConverged):
            answer = _on_mesh(string, layout, DECADES, job.start.factor, job.start, None, job)
            if answer.negative_modes == 0:
                return answer
    layout = _divided(string, *_at_first(string), count)
    found = []
    for way in _FROM_HELIX if job.helix else _STARTS:
        try:
            stages = stages_from(string.spring, way)
            found.append(_on_mesh(string, layout, stages, 1.0, None, before, job))
        except NotConverged as failed:
            reason = failed
        if found and not found[-1].negative_modes:
            break
    if found:  # the equilibrium with the fewest negative modes
        return min(found, key=lambda answer: answer.negative_modes % _SINGULAR)
    raise NotConverged(
        f"no equilibrium of the rod in contact was found on {count} elements: {reason}. A string that is compressed "
        "beyond its buckling load may have many, or none where it locks up: expected less compression or friction, or "
        "a softer wall (wall_stiffness)"
    )


def _at_first(string):
    """A `Layout`, and the density of the first mesh on its elements: larger beside ends of the string and of its
    sections, rings, stations of the survey and jumps of the hole."""
    layout, length = Layout.of(string.scene, _MESHES.places), float(string.ends[-1])
    ends = length * layout.breaks[0]
    stations = string.path.md - string.begins
    jumps = [*string.ends, *stations[(stations > 0) & (stations < length)], *string.wall.breaks(string.rod)]
    jumps = np.unique([0.0, *jumps, *(ring.station.s for ring in string.rings)])
    at = (ends[1:] + ends[:-1]) / 2
    beyond = np.searchsorted(jumps, at)
    away = np.minimum(at - jumps[beyond - 1], jumps[beyond] - at)
    within = _MESHES.within * string.bending_length
    return layout, np.diff(ends) * (1.0 + (_MESHES.beside - 1.0) * np.exp(-away / within))


def _wanted(answer, parts):
    """(elements,) numbers of elements for each, `parts` at least, of a mesh with twice as many: more where the pressure
    changes."""
    h, p = np.diff(answer.path.layout.breaks[0]), answer.element_pressures
    change = p.max(axis=1) - p.min(axis=1)
    change = np.maximum(change, np.maximum(np.append(change[1:], 0.0), np.append(0.0, change[:-1])))
    usual = np.median(p[p > 0]) if (p > 0).any() else 1.0
    more = h * np.clip(np.sqrt(change / usual) - _MESHES.equal, 0.0, _MESHES.densest)
    return parts + (_MESHES.finer - parts) * more / max(more.mean(), np.finfo(float).tiny)


def _divided(string, layout, wanted, count):
    """The layout of `count` elements of the density `wanted`: equal for strings of any length, as their problems."""
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


def _on_mesh(string, layout, stages, factor, start, before, job):
    """The `InHole` on one mesh, in a wall stiffer by a factor or more, with errors by the mesh before."""
    job.work.spend(0)
    with solvers_of(string.scene, layout, degree=job.degree, comm=job.comm) as (problem, _, stability):
        problem.set_load_factor(1.0)
        _begin(problem, string, layout, start, job.helix)
        job.bar.start(f"rod in its hole, {problem.model.unknowns} unknowns")
        steps, values, answer = 0, {}, None
        while answer is None or (factor < job.stiffest and _soft(answer, values, before, job)):
            if answer is not None:
                stages, factor = LAST, 10.0 * factor
            try:
                *softer, found = _in_walls(string, problem, stages, factor, steps, job)
            except NotConverged:
                if answer is None:
                    raise
                break  # the answer is in the wall before
            answer, steps = found, found.steps
            values |= {each.factor: {name: getattr(each, name) for name in NAMES} for each in (*softer, answer)}
            answer.estimate(values, before)
        # a mesh that others follow needs no number of modes
        if start is None or job.accepts(answer) or len(layout.breaks[0]) > job.most:
            _count_modes(string, problem, stability, answer)
        return answer


def _soft(answer, values, before, job):
    """Whether an `InHole` asks for a stiffer wall. On the last mesh also where a coarse one has shown what its wall
    changes, and this one has not yet; but rounding in a wall that is much stiffer than the first one is larger than
    that."""
    if before is not None and answer.error <= job.tol:
        return len(values) == 1 and answer.of_stiffness > 1.001 * UNSEEN and answer.factor < _WALLS.stiff
    return answer.of_stiffness > _WALLS.too_soft * job.tol


def _in_walls(string, problem, stages, factor, steps, job):
    """[`InHole`] of the precise stages, in walls of stiffnesses times a factor, after `steps` Newton steps here."""
    model, records = problem.model, {}
    decades = [k for k, stage in enumerate(stages[:-1]) if stage in DECADES]
    # a helix is almost free to turn as a whole, and must be found before the wall is made stiffer
    careful = range(len(stages) - 1) if job.helix else decades

    def on_stage(k):
        job.bar.reached(float(k + 1))
        if k in decades:
            records[factor * stages[k][0]] = record_of(problem, 1.0, 0, 0, 0)

    scaled = [(factor * wall, factor * spring, viscous) for wall, spring, viscous in stages]
    hold, spend = _WALLS.hold if job.helix else 0.0, partial(job.work.spend, len(model.layout.breaks[0]) - 1)
    steps += _settled(string, problem, scaled, factor, careful, on_stage, hold, spend)
    records[factor] = record_of(problem, 1.0, UNKNOWN, steps, steps)
    answers = []
    for stiffness, record in records.items():
        path = Path.of(model, [f"{string.words}; {model.signature.formulation.words}"], conservative_along)
        path.append(record)
        answers.append(InHole(string, path, stiffness))
    if not answers[-1].balance <= _WALLS.unbalanced * answers[-1].scale:
        raise NotConverged(
            f"the contact alternates: the reaction and all other forces differ by {answers[-1].balance:.3g} N"
        )
    return answers


def _settled(string, problem, stages, factor=1.0, careful=(), on_stage=None, hold=0.0, spend=None):
    """`settle` of a string in a wall stiffer by a factor."""
    model = problem.model
    of_wall = string.wall.stiffness * float(model.layout.sizes(model.scene).max())
    stiffest = factor * max([of_wall, *(ring.stiffness for ring in string.rings)])
    rounding = _WALLS.rounding * np.finfo(float).eps * stiffest * model.scales.length / model.scales.force
    from_axis = any(spring or viscous for _, spring, viscous in stages)
    given = {} if from_axis else {"astray": _WALLS.astray}
    return settle(problem, string.stages, string.clearance / model.scales.length, rounding, stages, careful, on_stage,
                  hold, spend, **given)  # fmt: skip


def at_rest(string, elements, degree, comm=None):
    """The `Path` of one equilibrium of a `StringScene`, with its sections and wall as they are, on equal elements.
    elements, degree, comm: as `simulate` takes them, so that it may start there. Raises NotConverged: no equilibrium
    was found."""
    layout, found = Layout.of(string.scene, elements), []
    with solvers_of(string.scene, layout, degree=degree, comm=communicator(comm)) as (problem, _, stability):
        problem.set_load_factor(1.0)
        for way in _STARTS:
            _begin(problem, string, layout, None, False)
            try:
                steps = _settled(string, problem, stages_from(string.spring, way))
            except NotConverged as failed:
                reason = failed
                continue
            found.append(record_of(problem, 1.0, _negative_modes(string, problem, stability), steps, steps))
            if not found[-1].negative_modes:
                break
        string.leave(1.0)
        if not found:
            raise NotConverged(
                f"no equilibrium of the rod at rest in its hole was found on {elements} elements: {reason}. Expected "
                "more elements, less weight on bit, or a softer wall (wall_stiffness)"
            )
        path = Path.of(problem.model, [f"{string.words}; {problem.model.signature.formulation.words}"],
                       conservative_along)  # fmt: skip
        path.append(min(found, key=lambda record: record.negative_modes % _SINGULAR))
    return path


def _negative_modes(string, problem, stability):
    """The number of negative eigenvalues of the second variation without friction, which has no potential."""
    try:
        for stage in string.stages:
            stage.friction = 0.0
        problem.model.actions.refresh()
        return stability.count()
    finally:
        for stage in string.stages:
            stage.friction = 1.0
        problem.model.actions.refresh()


def _count_modes(string, problem, stability, answer):
    """Find the number of negative modes of an `InHole` by a problem on its mesh."""
    _begin(problem, string, answer.path.layout, answer, False)
    string.leave(answer.factor)
    answer.take_modes(_negative_modes(string, problem, stability))


def _begin(problem, string, layout, before, helix):
    """Set the state: from another mesh, or a helix or on the axis, without contact force."""
    model = problem.model
    if before is not None:
        rq, n = on_mesh(before.path, layout)
        problem.begin_at(model.unknowns_of(rq[0]), n[0], before.path._records[0].reactions)
        return
    rod, s = string.rod, layout.node_s(model.nodes)[0] * string.rod.length
    rq = in_helix(string, s) if helix else on_axis(rod, string.path, s, string.begins)
    rq[:, :3] = (rq[:, :3] - string.scene.origin(rod)) / model.scales.length
    n = np.zeros((sum(layout.counts), len(model.forms.gauss), 3))
    problem.begin_at(model.unknowns_of(rq), n, np.zeros_like(problem.multipliers()))
