"""Reactions by global balance: with all loads, forces and moments sum to zero or to the rate of momentum."""

import numpy as np
import pytest

import cosserat_fenicsx as cf
from cosserat_fenicsx.numerics import directors
from cosserat_fenicsx.results.queries import reactions_in_words

SECTION = cf.Stiffness((2e3, 3e3), 4e3, (10.0, 20.0), 8.0, mass=2.0, inertia=(0.1, 0.2, 0.3))
RIGID = cf.Stiffness((np.inf, np.inf), np.inf, (10.0, 20.0), 8.0, mass=2.0, inertia=(0.1, 0.2, 0.3))


def wrench(place, force, moment=0.0):
    """Force and moment about the origin."""
    return np.concatenate([force, np.cross(place, force) + moment])


def of_load(result, load, k, eta=1.0):
    """Force and moment about the origin of a load in state k, times the load factor."""
    if load.station is None:
        gauss, weights = np.polynomial.legendre.leggauss(8)
        breaks = result.layout.breaks[result.scene.rods.index(load.rod)]
        x = (breaks[:-1, None] + np.diff(breaks)[:, None] * (gauss + 1) / 2).ravel()
        w = (np.diff(breaks)[:, None] * weights / 2).ravel() * load.rod.length
        places, _ = result.sample(k, load.rod, x)
        force = np.array(getattr(load, "force", (0, 0, 0)))
        moment = np.array(getattr(load, "moment", (0, 0, 0)))
        return eta * np.einsum("g,gi->i", w, [wrench(place, force, moment) for place in places])
    place, R = result.position(load.station)[k], directors(result.rotation(load.station)[k : k + 1])[0]
    T = R @ load.station.rod.curve.frame(load.station.s)
    none = np.zeros(3)
    if isinstance(load, cf.EccentricForce):
        return eta * wrench(place + T @ [*load.offset, 0.0], np.array(load.force))
    if isinstance(load, cf.FollowerForce):
        return eta * wrench(place, T @ load.force)
    if isinstance(load, cf.FollowerMoment):
        return eta * wrench(place, none, T @ load.moment)
    if isinstance(load, cf.Spring):
        q = result.rotation(load.station)[k]
        turn = 2 * np.arctan2(np.linalg.norm(q[1:]), q[0]) * q[1:] / (np.linalg.norm(q[1:]) or 1.0)
        return wrench(place, -load.stiffness * result.displacement(load.station)[k], -load.rotational * turn)
    given = getattr(load, "force", none), getattr(load, "moment", none)
    return (1.0 if load.permanent else eta) * wrench(place, *map(np.array, given))


def off_balance(path):
    """Sums of reactions and loads over the sums of their sizes; the largest of all points."""
    worst = 0.0
    for k, eta in enumerate(path.load_factors):
        held = [
            wrench(path.position(x.station)[k], *(part[k] for part in path.reaction(x))) for x in path.scene.supports
        ]
        everything = np.array([*held, *(of_load(path, x, k, eta) for x in path.scene.loads)])
        force, moment = np.split(everything, 2, axis=1)
        for part in (force, moment):
            worst = max(worst, np.abs(part.sum(axis=0)).max() / max(np.abs(part).sum(), 1e-3 * np.abs(force).sum()))
    return worst


def frame(section=SECTION, planar=False):
    """Three rods: a is clamped and carries b; c is connected to the clamped point by a ball joint. All kinds of
    supports and loads, also at the clamp and at other supports."""
    z = 0.0 if planar else 1.0
    a = cf.Rod(cf.Line((1, 2, 0), (3, 2, z)), section, name="a")
    b = cf.Rod(cf.Line((3, 2, z), (4, 4, z)), section, name="b")
    c = cf.Rod(cf.Line((1, 2, 0), (1, 4, -z)), section, name="c")
    normal = (0, 1, 0) if planar else (0, 0.6, 0.8)
    axis = (0, 0, 1)
    supports = [
        cf.Roller(b.end, normal),
        cf.Clamp(a.start),
        cf.Prescribed(c.end, displacement=None if section is RIGID else (0.02, 0.01, 0.03 * z), rotation=(0, 0, 0.1)),
        cf.Hinge(b.at(1.0), axis),
    ]
    loads = [
        cf.EccentricForce(b.end, (1.0, -2.0, 1.0 * z), (0.1, 0.0) if planar else (0.1, 0.2)),
        cf.FollowerMoment(b.end, (0, 0.4, 0.0) if planar else (0.2, 0.1, 0.4)),
        cf.Force(a.start, (3.0, 1.0, 2.0 * z), permanent=True),
        cf.FollowerForce(a.start, (0.0, 0, 2.0) if planar else (0.5, 0, 2.0)),
        cf.EccentricForce(a.start, (0.0, 2.0, 1.0 * z), (0.1, 0.0) if planar else (0.3, 0.1)),
        cf.Moment(c.start, (0, 0, 0.5)),
        cf.LineForce(b, (0, -1.0, 0.5 * z)),
        cf.LineMoment(a, (0, 0, 0.3)),
        cf.Force(c.at(0.7), (0.5, 0.2, 0.1 * z)),
        cf.Spring(a.end, 5.0, rotational=0.5),
    ]
    joints = [cf.Joint(a.end, b.start), cf.Joint(a.start, c.start, "all")]
    return cf.Scene([a, b, c], supports, loads, joints)


def tree():
    """A rod that is clamped between its ends and carries another one; statics gives the contact force."""
    a = cf.Rod(cf.Line((0, 0, 0), (2, 0, 1)), SECTION, name="a")
    b = cf.Rod(cf.Line((2, 0, 1), (2, 0, 3)), SECTION, name="b")
    loads = [
        cf.EccentricForce(b.end, (0.3, 0, -0.2), (0.1, 0.0)),
        cf.Force(a.start, (0.2, 0, 0.1)),
        cf.Moment(a.at(0.8), (0, 0.3, 0)),
        cf.Force(a.at(0.8), (1.0, 0, 2.0), permanent=True),
        cf.LineForce(b, (0, 0, -0.2)),
    ]
    return a, b, loads, [cf.Joint(a.end, b.start)]


@pytest.mark.slow
@pytest.mark.parametrize("formulation", ["mixed", "displacement", "multiplier", "infinite stiffness"])
def test_balance_in_space(formulation):
    rigid = formulation == "infinite stiffness"
    asked = {} if rigid else {"formulation": formulation}
    path = cf.solve(frame(RIGID if rigid else SECTION), [0.3, 1.0], elements=3, model="spatial", **asked)
    assert off_balance(path) < 1e-11


@pytest.mark.serial
@pytest.mark.parametrize("model", ["planar", "spatial"])
def test_balance_in_a_plane(model):
    path = cf.solve(frame(planar=True), [0.3, 1.0], elements=3, model=model)
    assert path.model == model and off_balance(path) < 1e-11


@pytest.mark.parametrize("model", ["determinate", "planar", "spatial"])
@pytest.mark.parametrize("flat", [True, False])
def test_balance_of_a_tree(model, flat):
    a, b, loads, joints = tree()
    loads += [] if flat else [cf.Force(b.end, (0, 0.1, 0))]
    scene = cf.Scene([a, b], [cf.Clamp(a.at(0.8))], loads, joints)
    if model == "planar" and not flat:
        return
    path = cf.solve(scene, [-0.5, 1.0], elements=4, model=model)
    assert path.model == model and off_balance(path) < 1e-11


@pytest.mark.serial
def test_tables_tell_reactions():
    path = cf.solve(frame(), [1.0], elements=3, model="spatial")
    told = list(reactions_in_words(path))
    assert [sentence.split(" exerts")[0] for sentence in told] == [
        "Roller at b.end", "Clamp at a.start", "Prescribed at c.end", "Hinge at b@1"
    ]  # fmt: skip
    assert told[0].endswith("and (0, 0, 0) N m at the load factor 1.")
    with pytest.raises(cf.SceneError, match="no support of this scene"):
        path.reaction(cf.Clamp(path.scene.rods[0].start))


# -- motions: the sum over each step is the rate of momentum -----------------------------------------------------------


def moving_frame(planar=False, damping=None):
    """Two rods between two clamps, with a roller and a prescribed motion, a third
    one on a ball joint; loads that depend on time, also at a clamp."""
    z = 0.0 if planar else 1.0
    a = cf.Rod(cf.Line((1, 2, 0), (3, 2, z)), SECTION, name="a", damping=damping)
    b = cf.Rod(cf.Line((3, 2, z), (4, 4, z)), SECTION, name="b", damping=damping)
    c = cf.Rod(cf.Line((1, 2, 0), (1, 4, -z)), SECTION, name="c")
    supports = [
        cf.Clamp(a.start),
        cf.Clamp(b.end),
        cf.Roller(b.at(1.0), (0, 1, 0) if planar else (0, 0.6, 0.8)),
        cf.Prescribed(
            c.end, displacement=cf.signals.RunUp((0.2, 0.1, 0.3 * z)), rotation=cf.signals.RunUp((0, 0, 0.5))
        ),
    ]
    loads = [
        cf.Force(a.end, cf.signals.Sine((3.0, 5.0, 4.0 * z), 2.0)),
        cf.LineForce(b, (0, -1.0, 0.5 * z)),
        cf.Force(a.start, cf.signals.Ramp((3.0, 1.0, 2.0 * z))),
        cf.FollowerForce(b.end, (0.0, 0, 2.0) if planar else (0.5, 0, 2.0)),
        cf.Moment(c.at(1.0), (0, 0, 0.5)),
    ]
    joints = [cf.Joint(a.end, b.start), cf.Joint(a.start, c.start, "all")]
    return cf.Scene([a, b, c], supports, loads, joints)


def over_step(history, k, at_end=0.5):
    """Sum of loads and reactions over the step that ends at the time k, about the
    origin; positions are those in the middle of the step, or at its end."""

    def place(station):
        before, after = history.position(station)[k - 1 : k + 1]
        return (1 - at_end) * before + at_end * after

    t = (1 - at_end) * history.times[k - 1] + at_end * history.times[k]
    total = np.zeros(6)
    for support in history.scene.supports:
        total += wrench(place(support.station), *(part[k] for part in history.reaction(support)))
    for load in history.scene.loads:
        if load.station is None or isinstance(load, cf.FollowerForce):  # a follower at a clamp
            total += (1 - at_end) * of_load(history, load, k - 1) + at_end * of_load(history, load, k)
            continue
        given = (getattr(load, name, (0, 0, 0)) for name in ("force", "moment"))
        total += wrench(place(load.station), *(np.array(x(t) if callable(x) else x) for x in given))
    return total


def off_rate(history, which, total=over_step):
    """Largest difference of the sums and the rates of momenta, over the largest sum."""
    momenta = np.concatenate([history.linear_momentum, history.angular_momentum], axis=1)
    rates = np.diff(momenta, axis=0) / np.diff(history.times)[:, None]
    sums = np.array([total(history, k) for k in range(1, len(history))])
    return np.abs((sums - rates)[:, which]).max() / np.abs(sums[:, which]).max()


FORCE, BOTH = slice(0, 3), slice(0, 6)
STEPS = {"dt": 0.02, "elements": 3, "degree": 3}


@pytest.mark.serial
@pytest.mark.slow
@pytest.mark.parametrize(
    ("scheme", "model"),
    [("momentum", "planar"), *(pytest.param(x, "spatial", marks=pytest.mark.once) for x in ("momentum", "energy"))],
)
def test_rate_of_momentum(scheme, model):
    """The scheme "energy" conserves angular momentum to second order only."""
    scene = moving_frame(model == "planar", cf.Damping(time=1e-2))
    history = cf.simulate(scene, 0.3, model=model, scheme=scheme, **STEPS)
    assert history.model == model
    assert np.isnan(history.reaction(scene.supports[0])[0][0]).all()
    assert off_rate(history, FORCE if scheme == "energy" else BOTH) < 1e-9


@pytest.mark.slow
@pytest.mark.serial
@pytest.mark.parametrize("model", ["planar", "spatial"])
def test_rate_of_momentum_by_generalised_alpha(model):
    """With rho_inf = 1 the rate of linear momentum is the average of the
    forces at both ends of a step (trapezoidal rule)."""
    history = cf.simulate(
        moving_frame(model == "planar"), 0.3, model=model, scheme="generalised-alpha", rho_inf=1.0, **STEPS
    )
    end = 1 - 1e-6  # loads are evaluated just before the end of a step
    sums = np.array([over_step(history, k, end)[:3] for k in range(1, len(history))])
    rates = np.diff(history.linear_momentum, axis=0)[1:] / STEPS["dt"]
    assert np.abs((sums[1:] + sums[:-1]) / 2 - rates).max() < 1e-9 * np.abs(sums).max()


def push_of_bed(result, k, stiffness):
    """(3,) force of an elastic foundation under the first rod."""
    rod, (breaks,) = result.scene.rods[0], result.layout.breaks
    gauss, weights = np.polynomial.legendre.leggauss(8)
    x = (breaks[:-1, None] + np.diff(breaks)[:, None] * (gauss + 1) / 2).ravel()
    moved = result.sample(k, rod, x)[0] - rod.curve.position(x * rod.length)
    return -stiffness * (np.diff(breaks)[:, None] * weights / 2).ravel() @ moved * rod.length


def push_of_wall(displacements, result, clearance, stiffness):
    """(3,) force of a wall around the z axis on the first rod, from the displacements of its nodes (n, 3)."""
    rod, (breaks,), p = result.scene.rods[0], result.layout.breaks, result.degree
    weights = np.zeros(len(displacements))
    for i, size in enumerate(np.diff(breaks) * rod.length):
        weights[i * p : (i + 1) * p + 1] += size * result.rule.lobatto
    away = displacements * [1, 1, 0]
    rho = np.linalg.norm(away, axis=1)
    pressure = stiffness * np.maximum(rho - clearance, 0)
    return -(weights * pressure / np.where(rho, rho, 1.0)) @ away


@pytest.mark.serial
@pytest.mark.slow
@pytest.mark.parametrize("what", ["bed", "wall"])
def test_what_acts_along_rods_and_sees_the_state(what):
    """A foundation, and a wall, which is integrated at the nodes: with two
    clamps and a line force they balance the rate of momentum."""
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 2)), SECTION, name="rod")
    action = cf.Foundation(rod, 30.0) if what == "bed" else cf.Wall(rod, (0, 0, 0), (0, 0, 1), 0.001, stiffness=1e3)
    line = np.array([4.0, 1.0, 0.5])
    scene = cf.Scene([rod], [cf.Clamp(rod.start), cf.Clamp(rod.end)], [action, cf.LineForce(rod, line)])

    def moved(result, k):
        return result.fields(k)["displacement"]

    def left(result, k, push):
        held = sum(result.reaction(x)[0][k] for x in scene.supports)
        assert np.linalg.norm(push) > 0.03
        return held + push + rod.length * line

    path = cf.solve(scene, [1.0], elements=4, model="spatial")
    push = push_of_bed(path, 0, 30.0) if what == "bed" else push_of_wall(moved(path, 0), path, 0.001, 1e3)
    assert np.abs(left(path, 0, push)).max() < 1e-10
    history = cf.simulate(scene, 0.2, dt=0.05, elements=4, degree=2)
    for k in range(1, len(history)):
        if what == "bed":
            push = (push_of_bed(history, k - 1, 30.0) + push_of_bed(history, k, 30.0)) / 2
        else:
            push = push_of_wall((moved(history, k - 1) + moved(history, k)) / 2, history, 0.001, 1e3)
        rate = np.diff(history.linear_momentum[k - 1 : k + 1], axis=0)[0] / 0.05
        assert np.abs(left(history, k, push) - rate).max() < 1e-8
