"""`simulate`: the motion of a scene in time."""

import cosserat_fenicsx.compat  # noqa: F401, I001  first: it says in words what of dolfinx is missing

import functools
import itertools
import math
import numbers

from mpi4py import MPI

from cosserat_fenicsx.checks import instance, number, refuse
from cosserat_fenicsx.errors import Interrupted, NotConverged, SceneError, nearest
from cosserat_fenicsx.history import History, Instant, Ledger
from cosserat_fenicsx.interrupts import obey
from cosserat_fenicsx.models.conserving import ConservingSpatial
from cosserat_fenicsx.models.moving import MovingSpatial
from cosserat_fenicsx.models.moving_planar import MovingPlanar
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.models.shape import Shape
from cosserat_fenicsx.pace import Adaptive, Fixed
from cosserat_fenicsx.progress import Progress
from cosserat_fenicsx.scene import Scene
from cosserat_fenicsx.signals import signals_of
from cosserat_fenicsx.standing import equilibrium
from cosserat_fenicsx.start import put_start, starts_in
from cosserat_fenicsx.steppers import SCHEMES

_MODELS = {
    ("momentum", "spatial"): MovingSpatial,
    ("momentum", "planar"): MovingPlanar,
    ("energy", "spatial"): ConservingSpatial,
}
#: Elements a rod, degree and tolerance where none are asked for.
ELEMENTS, DEGREE, TOL = 8, 3, 1e-3
# A step that fails is halved so often before the motion is given up.
_HALVINGS = 12


def simulate(
    scene,
    duration,
    *,
    tol=None,
    dt=None,
    model="auto",
    scheme="momentum",
    save_every=None,
    start=None,
    load_factor=None,
    elements=ELEMENTS,
    degree=DEGREE,
    progress=None,
    comm=None,
):
    """Motion of a scene from the time 0 on.

    Loads and prescribed motions are those of the scene at every time (`signals`), times `load_factor`; the velocities
    at the start are the scene's. A scene without supports flies freely.

    Args:
        scene: a `Scene`; every rod needs a mass and inertia.
        duration: s.
        tol: what the errors of single steps may add up to over the whole duration, of positions over the longest rod's
            length and of a tenth of rotations (rad); steps adapt to it. Default 1e-3, unless `dt` is given. The mesh
            does not adapt: compare with more `elements`.
        dt: fixed step, s; shorter where it would step over a jump or a saved time. A step that fails is halved.
        model: "spatial"; "planar" for a scene that moves in a plane; or "auto", the cheaper one that will do.
        scheme: "momentum" (exact linear and angular momentum, order 2); "triple-jump" (three steps of it, one back in
            time: order 4, for smooth motions without damping, fixed dt); "energy" (exact energy and linear momentum,
            order 2, in space alone).
        save_every: s between saved states, landed on exactly; None saves every step.
        start: None for the reference, a `Path` for its last equilibrium, or (Path, k); rods must be the same objects. A
            number is the load factor of an equilibrium of the scene as it is just before t = 0 (`standing.before`).
        load_factor: multiplies all loads and prescribed motions, as in `solve`; None for that of the start where this is
            a number, otherwise 1.
        elements: elements per rod.
        degree: 1 to 4, of r and q.
        progress: True, False, or None for a bar on long runs in a terminal.
        comm: MPI communicator; default all ranks. Every rank calls, every rank gets the same History.

    Returns:
        History.

    Raises:
        SceneError: an argument outside its range, a rod without inertia, or a start that supports contradict.
        NotConverged: a step fails however short it is; `.path` holds the History up to there.
        Interrupted: Ctrl-C; `.path` holds the History up to there.
    """
    comm = comm or MPI.COMM_WORLD
    instance("simulate", "scene", scene, Scene, "a Scene")
    pace = pace_of(duration, tol=tol, dt=dt, scheme=scheme, save_every=save_every, elements=elements)
    if load_factor is None:
        load_factor = start if isinstance(start, numbers.Real) else 1.0
    number("simulate", "load_factor", load_factor, "a finite number", math.isfinite)
    scene = scene.over(duration)
    cautions = []
    if isinstance(start, numbers.Real):
        start = equilibrium(scene, start, model=model, elements=elements, degree=degree, comm=comm)
        if not start.stable[-1]:
            cautions = ["the equilibrium that it starts from is unstable: rounding decides where it goes"]
    model, why = chosen_model(scene, model, scheme, start)
    problem, stepper = _solvers(scene, Layout.of(scene, elements), degree, scheme, load_factor, comm, model)
    put_start(problem.model, start)
    problem.begin()
    run = _Run(problem, stepper, pace, scheme, [why, *cautions])
    with Progress([duration], progress, comm, "t (s) =") as bar:
        bar.start(f"{problem.model.name}, {problem.model.unknowns} unknowns")
        try:
            run.over(_marks(scene, duration, save_every), save_every is None, bar)
        except KeyboardInterrupt:
            raise Interrupted(run.history) from None
    return run.history


class _Run:
    """The motion of a problem, booked and saved."""

    def __init__(self, problem, stepper, pace, scheme, why):
        self.problem, self.model, self._stepper, self._pace = problem, problem.model, stepper, pace
        self.history = History.of(self.model, scheme, why)
        self._steps = self._iterations = 0

    def over(self, marks, save_all, bar):
        """Go over the marks (time, whether something jumps there, whether it is saved), the first of them the start."""
        self._stepper.begin()
        self._save(0.0)
        for (t, jump, _), (end, _, saved) in itertools.pairwise(marks):
            if jump:
                self._stepper.jump()
                self._pace.jump()
            nothing, first, count, h = 1e-9 * (end - t), t, 0, 0.0
            while t < end:
                obey()
                wanted = self._pace.length(end - t)
                if abs(wanted - h) > 1e-9 * wanted:  # equal steps are counted, so that times do not gather rounding
                    first, count, h = t, 0, wanted
                if not self._advance(t, h):
                    continue
                count += 1
                t = first + count * h
                t = end if end - t <= nothing else t
                bar.reached(t)
                if save_all or (saved and t == end):
                    self._save(t)

    def _advance(self, t, h, halvings=0):
        """Step from t by h, in shorter steps where that fails; False where a shorter step is to be tried."""
        solved = self._stepper.step(t, h)
        self._iterations += solved.iterations
        if solved.converged:
            if not halvings and not self._pace.accepts(self._stepper, h):
                self._stepper.undo()
                return False
            self._steps += 1
            return True
        if halvings == _HALVINGS:
            if self.history[-1].time < t:
                self._save(t)
            raise NotConverged(
                f"the motion was lost at t = {t:.6g} s, where a step of {h:.3g} s still fails: {solved.reason}. "
                "Try a smaller dt or tol, more elements, or damping.",
                self.history,
            )
        self._advance(t, h / 2, halvings + 1)
        self._advance(t + h / 2, h / 2, halvings + 1)
        self._pace.failed(h)
        return True

    def _save(self, t):
        model, problem, stepper = self.model, self.problem, self._stepper
        scales = model.scales
        momentum, energy = scales.force * model.time, scales.force * scales.length
        nodal, gauss = model.snapshot()
        linear, angular = problem.momenta()
        ledger = Ledger(
            *(energy * x for x in (*problem.energies(), stepper.work, stepper.dissipated)),
            momentum * linear,
            momentum * scales.length * angular,
        )
        rates = model.rates()(nodal, model.snapshot_of_rates())
        iterations, self._iterations = self._iterations, 0
        self.history.append(Instant(problem.load_factor, nodal, gauss, 0, iterations, problem.multipliers(), time=t, rates=rates,
                                    steps=self._steps, ledger=ledger))  # fmt: skip


def chosen_model(scene, model, scheme, start=None):
    """The model's name, and why it is that one.

    Args:
        scene, model, scheme: as `simulate` takes them; start: None, a Path or (Path, k).

    Raises:
        SceneError: an unknown model, or one that the scene does not fit.
    """
    flat = ("momentum" if scheme not in SCHEMES else SCHEMES[scheme].forms, "planar") in _MODELS
    if model not in ("auto", "planar", "spatial"):
        raise SceneError(f"model = {model!r}: {nearest(model, ('auto', 'planar', 'spatial'))}")
    if model == "spatial":
        return model, "the spatial model was asked for"
    plane, reason = scene.flatness
    if plane is not None and not starts_in(scene, plane, start):
        plane, reason = None, "the start leaves the plane of the rods"
    if plane is not None and not flat:
        plane, reason = None, f"the scheme '{scheme}' knows space alone"
    if plane is not None:
        return "planar", f"everything keeps to {plane.words}"
    if model == "planar":
        raise SceneError(f"model = 'planar': {reason}; expected 'spatial' or 'auto'")
    return "spatial", reason


def _solvers(scene, layout, degree, scheme, load_factor, comm, model):
    """The loaded problem and stepper of a scene on a mesh."""
    shape = Shape.of(scene, layout, formulation="displacement", degree=degree, model=model)
    if comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        problem, stepper = _kept(comm == MPI.COMM_SELF, shape, scheme)
    else:  # a user's communicator may be freed, and its handle given to another
        problem, stepper = _make(comm, shape, scheme)
    problem.load(scene, layout, load_factor)
    return problem, stepper


def _make(comm, shape, scheme):
    stepper = SCHEMES[scheme]
    problem = stepper.problem_class(_MODELS[stepper.forms, shape.model](comm, shape))
    return problem, stepper(problem)


@functools.lru_cache(maxsize=8)
def _kept(alone, shape, scheme):
    """Compiled once, used for every scene of that shape."""
    return _make(MPI.COMM_SELF if alone else MPI.COMM_WORLD, shape, scheme)


def pace_of(duration, *, tol=None, dt=None, scheme="momentum", save_every=None, elements=ELEMENTS):
    """What chooses the steps of `simulate`.

    Args: as `simulate` takes them.

    Raises:
        SceneError: one of them is outside its range.
    """
    duration = _positive("duration", duration)
    if scheme not in SCHEMES:
        raise SceneError(f"scheme = {scheme!r}: {nearest(scheme, SCHEMES)}")
    if save_every is not None:
        _positive("save_every", save_every)
    if isinstance(elements, bool) or not isinstance(elements, numbers.Integral) or elements < 1:
        refuse("simulate", "elements", elements, "a whole number above zero")
    if dt is not None:
        if tol is not None:
            raise SceneError(
                f"simulate: dt = {dt!r} and tol = {tol!r}: expected one of them, a fixed or an adaptive step"
            )
        return Fixed(min(_positive("dt", dt), duration))
    if not SCHEMES[scheme].adapts:
        raise SceneError(f"scheme = '{scheme}' knows no error of its steps: expected dt, a fixed step (s)")
    tol = TOL if tol is None else tol
    return Adaptive(
        number("simulate", "tol", tol, "a number from 1e-10 to below 1", lambda x: 1e-10 <= x < 1), duration
    )


def _positive(name, value):
    return number("simulate", name, value, "a positive number (s)", lambda x: 0 < x < math.inf)


def _marks(scene, duration, save_every):
    """[(time, whether something jumps there, whether it is saved)], the first at 0, the last the end."""
    jumps = {
        t for item in scene.moving for signal in signals_of(item).values() for t in signal.jumps if 0 < t < duration
    }
    saved = set()
    if save_every is not None:
        count = math.ceil(duration / save_every - 1e-9)
        saved = {k * save_every for k in range(1, count)}
    marks = [(0.0, False, True)]
    for t in sorted(jumps | saved):
        if t - marks[-1][0] > 1e-9 * duration:
            marks.append((t, t in jumps, t in saved))
        else:  # two of them that differ by rounding are one
            before, jump, save = marks[-1]
            marks[-1] = (t if t in jumps else before, jump or t in jumps, save or t in saved)
    return [*marks, (duration, False, True)]
