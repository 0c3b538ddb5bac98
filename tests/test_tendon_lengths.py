"""Tendons of given length: closed forms of an arm that they bend, slacken along, and hold against buckling."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

import cosserat_fenicsx as cf

EI, GJ, EA, GA, LENGTH, E = 0.02, 0.016, 5000.0, 3000.0, 0.3, 0.01
ROD = cf.Rod(cf.Line((0, 0, 0), (0, 0, LENGTH)), cf.Stiffness((GA, GA), EA, (EI, EI), GJ), name="arm")
COMPLIANCE = 1 / EA + E**2 / EI  # of the arm, per length, against a tendon at the offset E


def arm(*loads):
    return cf.Scene([ROD], [cf.Clamp(ROD.start)], loads)


@pytest.mark.parametrize("axial", [None, 300.0])
@pytest.mark.parametrize("model", ["planar", "spatial"])
def test_it_bends_an_arm(axial, model, truth, request):
    """An arc, whose tendon has T L (1/EA + e^2/EI) + (L - d) T/axial = d; without stretch T is that of the truths."""
    tendon = cf.Tendon(ROD, (E, 0), shortening=0.006, axial=axial)
    path = cf.solve(arm(tendon), [0.5, 1.0], elements=4, model=model)
    short = 0.006 * path.load_factors
    tension = short / (LENGTH * COMPLIANCE + (LENGTH - short) / (axial or np.inf))
    state, name = path.tendon(tendon), f"tendons: by length, {request.node.callspec.id}, tension over its own"
    if axial is None:
        assert tension[-1] == pytest.approx(3.8461538461538463, rel=1e-15)
    truth(name, state.tension[-1] / tension[-1], 1.0, 1e-8, of=1.0, most=1e-10)
    assert state.tension == pytest.approx(tension, rel=1e-10)
    assert state.length == pytest.approx((LENGTH - short) * (1 + tension / (axial or np.inf)), rel=1e-13)
    angle, stretch = E * tension / EI * LENGTH, 1 - tension / EA
    tip = np.outer(stretch * LENGTH / angle, (1, 1)) * np.column_stack([1 - np.cos(angle), np.sin(angle)])
    assert path.position(ROD.end)[:, [0, 2]] == pytest.approx(tip, abs=1e-10)
    assert path.stable.all() and not path.events


def test_the_tension_of_a_length_gives_that_length():
    """Around the arm, by tension and by the shortening that this gave; `tol` holds for the tension of that path."""
    pulled = cf.solve(arm(cf.Tendon(ROD, cf.Helical(E, LENGTH), 4.0)), [0.0, 1.0], tol=1e-7)
    length = pulled.tendon(pulled.scene.loads[0]).length
    wound = cf.Tendon(ROD, cf.Helical(E, LENGTH), shortening=length[0] - length[1])
    path = cf.solve(arm(wound), [1.0], tol=1e-7)
    assert path.tendon(wound).tension == pytest.approx([4.0], rel=1e-9)
    assert path.position(ROD.end)[-1] == pytest.approx(pulled.position(ROD.end)[-1], abs=1e-8)
    assert path.error[-1] < 1e-7


@pytest.mark.serial
def test_it_does_not_push():
    """A moment bends the arm towards the tendon, which is slack until its shortening exceeds what the moment gives."""
    tendon, moment = cf.Tendon(ROD, (E, 0), shortening=0.006), 0.02
    scene = arm(tendon, cf.Moment(ROD.end, (0, moment, 0), permanent=True))
    path = cf.solve(scene, [0.0, 0.25, 0.5, 0.7, 1.0], elements=4)
    tension = np.maximum((0.006 / LENGTH * path.load_factors - E * moment / EI) / COMPLIANCE, 0)
    state = path.tendon(tendon)
    assert state.tension == pytest.approx(tension, abs=1e-8) and (tension > 0).sum() == 2
    assert (state.slack == (tension == 0)).all() and "slack in 3 of 5 states" in str(state)
    length = LENGTH * (1 - tension * COMPLIANCE - E * moment / EI)
    assert state.length == pytest.approx(length, rel=1e-11)
    back = cf.solve(scene, [1.0, 0.25], elements=4)
    assert back.tendon(tendon).tension == pytest.approx(tension[[4, 1]], abs=1e-8)


@pytest.mark.serial
def test_two_of_them_hold_a_column(truth):
    """Two tendons on both sides keep the end of a column from turning in their plane, where it buckles as between two
    guides that move aside: P l + P^2/(GA + T/l) = pi^2 EI/L^2, with the stretch l and the sum T of the tensions. Across
    their plane they hold nothing, and it buckles as a cantilever."""
    pair, share = [cf.Tendon(ROD, (side * E, 0), shortening=1e-3 * LENGTH) for side in (1, -1)], 1e-3
    path = cf.solve(arm(*pair, cf.Force(ROD.end, (0, 0, -1.0))), (0, 2.5), model="spatial", elements=8)

    def load(turns):
        def excess(eta):
            stretch, tension = 1 - share * eta, (EA * share - 1) * eta
            return eta * stretch + eta**2 / (GA + tension / stretch) - (turns * np.pi / LENGTH) ** 2 * EI

        return brentq(excess, 0.1, 4, xtol=1e-14)

    found = [event.load_factor for event in path.events]
    assert [event.kind for event in path.events] == ["bifurcation"] * 2
    truth("tendons: two hold a column, load factors", found, [load(0.5), load(1)], 1e-6, of=1.0)
    assert path.negative_modes[-1] == 2
    assert path.tendon(pair[0]).tension == pytest.approx((EA * share - 1) / 2 * path.load_factors, rel=1e-9)
    bent, across = (np.abs(event.mode[-1]) for event in path.events)
    assert bent.argmax() == 1 and across.argmax() == 0


@pytest.mark.serial
def test_shortenings_that_reach_a_point(truth):
    """Derivatives by shortenings, a stiffness and an offset are those of differences, and lead to given shortenings."""
    names = ["loads[0].shortening", "loads[1].shortening", "loads[0].axial", "loads[1].offset[1]"]

    def tip(path):
        return path.position(ROD.end)[-1]

    def wound(first, second, axial=300.0, offset=E):
        slack = cf.Tendon(ROD, (-E, 0), shortening=-1e-2)
        pair = cf.Tendon(ROD, (E, 0), shortening=first, axial=axial), cf.Tendon(ROD, (0, offset), shortening=second)
        return cf.solve(arm(*pair, slack, cf.Force(ROD.end, (0, 0.02, 0))), [0.5, 1.0], elements=2)

    at = np.array([0.006, 0.004, 300.0, E])
    path = wound(*at)
    found = path.sensitivity(tip, names)
    slopes = np.column_stack([found[name] for name in names])
    steps = 1e-4 * np.diag(at)
    sides = [[tip(wound(*(at + sign * step))) for sign in (1, -1)] for step in steps]
    differences = [(a - b) / (2 * step.max()) for (a, b), step in zip(sides, steps, strict=True)]
    sizes = np.abs(slopes).max(axis=0)
    truth("tendons: by length, derivatives of the tip", slopes / sizes, np.transpose(differences) / sizes, 1e-6, of=1.0)
    assert path.tendon(path.scene.loads[2]).slack.all()
    tension = path.sensitivity(lambda path: path.tendon(path.scene.loads[0]).tension[-1], names[:1])[names[0]]
    more, less = (x.tendon(x.scene.loads[0]).tension[-1] for x in (wound(0.0061, 0.004), wound(0.0059, 0.004)))
    assert tension == pytest.approx((more - less) / 2e-4, rel=1e-3)
    wanted, short = tip(path)[:2], np.array([0.003, 0.003])
    for _ in range(4):
        path = wound(*short)
        found = path.sensitivity(lambda path: tip(path)[:2], names[:2])
        short = short + np.linalg.solve(np.column_stack([found[x] for x in names[:2]]), wanted - tip(path)[:2])
    assert short == pytest.approx(at[:2], rel=1e-6)


@pytest.mark.serial
def test_derivatives_beside_a_point_without():
    """At the load factor 0 the tendon is neither taut nor slack: a shortening changes nothing there, and a moment that
    tightens it one way and slackens it the other way has no derivative."""

    def pushed(moment):
        loads = [cf.Tendon(ROD, (E, 0), shortening=0.006), cf.Force(ROD.end, (0, 0.02, 0))]
        return arm(*loads, cf.Moment(ROD.end, (0, moment, 0), permanent=True))

    path, moment = cf.solve(pushed(0.0), [0.0, 1.0], elements=4), cf.Parameter("moment", 0.0, pushed, scale=1e-3)
    alone = cf.solve(pushed(0.0), [1.0], elements=4)
    for parameter in ("loads[0].shortening", moment):
        found = path.sensitivity(lambda path: path.position(ROD.end)[-1], parameter)
        assert next(iter(found.values())) == pytest.approx(
            next(iter(alone.sensitivity(lambda path: path.position(ROD.end)[0], parameter).values())), rel=1e-9
        )
    found = path.sensitivity(lambda path: path.position(ROD.end), "loads[0].shortening")
    assert np.abs(found["loads[0].shortening"][0]).max() < 1e-9
    with pytest.raises(cf.SceneError, match="neither taut nor slack at the load factor 0.*a query of other points"):
        path.sensitivity(lambda path: path.position(ROD.end), moment)


@pytest.mark.serial
@pytest.mark.parametrize("axial", [None, 300.0])
def test_in_stages(axial, truth):
    """A tendon that holds while a force comes is one that comes with it; one that comes in with a stage is shortened
    from its length there; what is released leaves what was there before."""
    pull, push = cf.Tendon(ROD, (E, 0), shortening=0.006, axial=axial), cf.Force(ROD.end, (0, 0.05, -0.02))

    def staged(first, *stages):
        return cf.solve(cf.Scene([ROD], [cf.Clamp(ROD.start)], [first], stages=stages), [1.0], elements=4)

    held, both = staged(pull, cf.Stage([push], load_factors=[0.0, 1.0])), cf.solve(arm(pull, push), [1.0], elements=4)
    ends = held.position(ROD.end)
    truth(f"tendons: by length in stages, axial {axial}, end (m)", ends[-1], both.position(ROD.end)[-1], 1e-8, of=1.0)
    state, tension = held.tendon(pull), both.tendon(pull).tension
    assert state.tension[-1] == pytest.approx(tension[-1], rel=1e-9)
    alone = cf.solve(arm(pull), [1.0], elements=4)
    assert ends[:2] == pytest.approx(np.tile(alone.position(ROD.end)[-1], (2, 1)), abs=1e-10)
    part, name = held.part(0), "loads[0].shortening"
    slopes = part.sensitivity(lambda path: path.position(ROD.end), name)[name]
    expected = [x.sensitivity(lambda path: path.position(ROD.end)[-1], name)[name] for x in (alone, both)]
    assert slopes == pytest.approx(np.array(expected), rel=1e-6, abs=1e-8)

    steps = dict(load_factors=[0.5, 1.0])
    came = staged(push, cf.Stage([pull], **steps), cf.Stage(release=[pull], **steps))
    bent = cf.solve(arm(push), [1.0], elements=4)
    short = LENGTH - came.tendon(pull).length[0] + 0.006
    whole = cf.solve(arm(cf.Tendon(ROD, (E, 0), shortening=short, axial=axial), push), [1.0], elements=4)
    assert came.position(ROD.end)[2] == pytest.approx(whole.position(ROD.end)[-1], abs=1e-10)
    assert came.position(ROD.end)[-1] == pytest.approx(bent.position(ROD.end)[-1], abs=1e-10)
    tension = came.tendon(pull).tension
    assert tension[0] == 0 and tension[3:] == pytest.approx(tension[2] * np.array([0.5, 0.0]), rel=1e-9, abs=1e-12)


MASS, J = 0.5, 1e-5  # per length: kg/m, kg m
HEAVY = cf.Rod(ROD.curve, cf.Stiffness((GA, GA), EA, (EI, EI), GJ, mass=MASS, inertia=(J, J, 2 * J)), name="arm")


def dense(*loads):
    return cf.Scene([HEAVY], [cf.Clamp(HEAVY.start)], loads)


@pytest.mark.parametrize("axial", [None, 300.0])
def test_it_holds_small_vibrations(axial, truth):
    """About the straight arm, a Timoshenko beam of transfer matrices: in the plane of a straight tendon a force T at
    the end and its moment e T move what lengthens the tendon by as much as T stretches it."""

    def tip(omega):
        """Determinant of the free end's condition in bending, and the same times the rotation by a unit moment."""
        rates = [[0, 1, 1 / GA, 0], [0, 0, 0, 1 / EI], [-MASS * omega**2, 0, 0, 0], [0, -J * omega**2, -1, 0]]
        P = expm(LENGTH * np.array(rates))
        return np.linalg.det(P[2:, 2:]), P[1, 3] * P[2, 2] - P[1, 2] * P[2, 3]

    def held(omega):
        wave = omega * np.sqrt(MASS / EA)
        still, turn = tip(omega)
        return (LENGTH / (axial or np.inf) + np.tan(wave * LENGTH) / (EA * wave)) * still + E**2 * turn

    def roots(f):
        grid = np.linspace(1.0, 100.0, 400)
        values = [f(x) for x in grid]
        return [brentq(f, *grid[k : k + 2], xtol=1e-13) for k in range(399) if values[k] * values[k + 1] < 0]

    expected = np.sort([*roots(lambda omega: tip(omega)[0]), *roots(held)])[:3]
    tendon = cf.Tendon(HEAVY, (E, 0), shortening=0.006, axial=axial)
    found = cf.modes(dense(tendon), 3, load_factor=1e-7, elements=8)
    name = f"tendons: by length, frequencies over their own, axial {axial}"
    truth(name, found.frequencies * 2 * np.pi / expected, np.ones(3), 1e-6, of=1.0)
    complex_too = cf.modes(dense(tendon), 3, load_factor=1e-7, elements=8, damped=True)
    assert complex_too.eigenvalues.imag == pytest.approx(found.frequencies * 2 * np.pi, rel=1e-8)
    slack = cf.Tendon(HEAVY, (E, 0), shortening=-0.006, axial=axial)
    alone = cf.modes(dense(cf.Tendon(HEAVY, (E, 0), tension=0.0)), 3, elements=8)
    assert cf.modes(dense(slack), 3, load_factor=1.0, elements=8).squares == pytest.approx(alone.squares, rel=1e-9)


@pytest.mark.serial
@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: cf.Tendon(ROD, (E, 0)), "either tension (N) or shortening (m)"),
        (lambda: cf.Tendon(ROD, (E, 0), 1.0, shortening=0.1), "either tension (N) or shortening (m)"),
        (lambda: cf.Tendon(ROD, (E, 0), 1.0, axial=1.0), "the tension is given"),
        (lambda: cf.Tendon(ROD, (E, 0), shortening=0.1, axial=0.0), "Tendon.axial"),
        (lambda: cf.Tendon(ROD, (E, 0), shortening=0.1, permanent=True), "Tendon.permanent"),
        (lambda: cf.solve(arm(cf.Tendon(ROD, (E, 0), shortening=0.3)), [1.0], elements=4), "less than the length"),
        (lambda: cf.buckling(arm(cf.Tendon(ROD, (E, 0), shortening=0.1))), "only `solve`, `modes`, `simulate` and"),
        (lambda: cf.modes(dense(cf.Tendon(HEAVY, (E, 0), shortening=0.01))), "neither taut nor slack"),
    ],
)  # fmt: skip
def test_what_is_refused(make, says):
    with pytest.raises(cf.SceneError) as found:
        make()
    assert says in str(found.value)


@pytest.mark.serial
def test_a_way_that_does_not_get_shorter():
    """Between two clamps a tendon along a straight rod is the shortest way, whatever its tension."""
    scene = cf.Scene([ROD], [cf.Clamp(ROD.start), cf.Clamp(ROD.end)], [cf.Tendon(ROD, (E, 0), shortening=0.01)])
    with pytest.raises(cf.NotConverged, match="hardly gets shorter than its way along the rod there, 0.3 m"):
        cf.solve(scene, [1.0], elements=4)


@pytest.mark.serial
def test_tendons_that_determine_each_other_are_refused():
    """Four that do not stretch have the same sum on both diagonals; elastic ones share the load."""
    sides = [(E, 0), (-E, 0), (0, E), (0, -E)]

    def four(axial):
        return arm(*(cf.Tendon(ROD, side, shortening=1e-3 * LENGTH, axial=axial) for side in sides))

    with pytest.raises(cf.NotConverged, match="axial="):
        cf.solve(four(None), [1.0], elements=4)
    path = cf.solve(four(1e5), [1.0], elements=4)
    tension = 1e-3 / (4 / EA + (1 - 1e-3) / 1e5)
    assert [path.tendon(x).tension[-1] for x in path.scene.loads] == pytest.approx([tension] * 4, rel=1e-9)
