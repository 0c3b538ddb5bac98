"""Tendons: threads along rods with a given tension. Values are of shooting with independent code, to 11 digits."""

import numpy as np
import pytest

import cosserat_fenicsx as cf

pytestmark = pytest.mark.serial
EI, GJ, EA, GA, LENGTH, T = 0.02, 0.016, 5000.0, 3000.0, 0.3, 4.0
SECTION = cf.Stiffness((GA, GA), EA, (EI, EI), GJ, mass=0.3, inertia=(1e-5, 1e-5, 2e-5))
ROD = cf.Rod(cf.Line((0, 0, 0), (0, 0, LENGTH)), SECTION, name="arm")
HELIX = cf.Tendon(ROD, cf.Helical(0.01, LENGTH), T)
FORCE = cf.Force(ROD.end, (0.05, -0.03, -0.1))
TWO = cf.Tendon(ROD, (0.01, 0), 4.0), cf.Tendon(ROD, (0, 0.01), 2.0)


def arm(*loads, rod=ROD):
    return cf.Scene([rod], [cf.Clamp(rod.start)], loads)


def at_angle(radius):
    """The offset of `Helical` as a function of the user's own."""
    return cf.signals.Along(
        lambda s: (radius * np.cos(2 * np.pi * s / LENGTH), radius * np.sin(2 * np.pi * s / LENGTH), 0)
    )


@pytest.mark.parametrize(
    ("loads", "tip", "lengths", "reaction"),
    [
        ([HELIX], (3.62541620686e-05, 0.0290382844773, 0.296974818222), [0.300199905207], np.zeros(6)),
        ([cf.Tendon(ROD, at_angle(0.01), T), FORCE], (0.0259697064642, 0.0185265807549, 0.297088762302),
         [0.300319388743], (0.05, -0.03, -0.1, 0.00706000479356, 0.0174514087615, -0.00170542023167)),
        ([*TWO, cf.LineForce(ROD, (0, 0, -0.3))], (0.0904653029162, 0.0452326510359, 0.275696550185),
         [0.293431662397, 0.29653453624], (0, 0, -0.09, -0.0013882631192, 0.00277652625594, 0)),
    ],
    ids=["helical", "helical with a force", "two and weight"],
)  # fmt: skip
@pytest.mark.parametrize("how", [{}, {"formulation": "multiplier"}], ids=["mixed", "multiplier"])
def test_it_bends_and_twists(loads, tip, lengths, reaction, how, truth, request):
    path = cf.solve(arm(*loads), [1.0], tol=1e-7, **how)
    truth(f"tendons: {request.node.callspec.id}, end (m)", path.position(ROD.end)[-1], tip, 1e-8, of=1.0, most=1e-9)
    found = [path.tendon(load) for load in loads if isinstance(load, cf.Tendon)]
    assert [state.length[-1] for state in found] == pytest.approx(lengths, abs=1e-9)
    force, moment = path.reaction(path.scene.supports[0])
    assert np.concatenate([force[-1], moment[-1]]) == pytest.approx(-np.array(reaction), abs=1e-8)


def test_beside_the_axis_of_a_straight_rod(truth):
    """An arc of the curvature e T/EI, shorter by T/EA; the rod is pressed by -T d3, and its plane is (d1, d3)."""
    straight = cf.Tendon(ROD, (0.01, 0), T)
    path = cf.solve(arm(straight), [0.5, 1.0], tol=1e-7)
    assert path.model == "planar" and (path.negative_modes == 0).all() and path.conservative
    tip = 0.08726232679112465, 0, 0.2820953797081596
    truth("tendons: beside the axis, end (m)", path.position(ROD.end)[-1], tip, 1e-8, of=1.0, most=1e-9)
    fields = path.fields(-1)
    assert fields["force"] == pytest.approx(-T * fields["d3"], abs=1e-7 * T)
    assert fields["curvature"][:, 1] == pytest.approx(0.01 * T / EI, rel=1e-7)
    assert fields["strain"][:, 2] == pytest.approx(-T / EA, rel=1e-6)
    state = path.tendon(straight)
    assert state.tension == pytest.approx([T / 2, T])
    assert state.length[-1] == pytest.approx((1 - T / EA - 1e-4 * T / EI) * LENGTH, rel=1e-10)


def test_in_the_axis_it_does_not_make_a_rod_buckle(truth):
    """At three times Euler's load. Modes are those of a rod that is shorter by T/EA, and a force finds it as weak."""
    euler = np.pi**2 * EI / (4 * LENGTH**2)
    pulled = cf.Tendon(ROD, (0, 0), 3 * euler)
    path = cf.solve(arm(pulled), (0, 1))
    assert not path.events
    tip = 0, 0, (1 - 3 * euler / EA) * LENGTH
    truth("tendons: in the axis at three Euler's loads, end (m)", path.position(ROD.end)[-1], tip, 1e-8, of=1.0,
          most=1e-12)  # fmt: skip
    frequencies = [cf.modes(arm(pulled), 3, load_factor=eta).frequencies for eta in (0.0, 1.0)]
    assert frequencies[1] == pytest.approx(frequencies[0] * (1 + 3 * euler / EA), rel=1e-5)
    loads = [cf.Tendon(ROD, (0, 0), euler, permanent=True), cf.Force(ROD.end, (0, 0, -euler))]
    buckling = [cf.buckling(arm(*some), 1).load_factors[0] for some in (loads, loads[1:])]
    assert buckling[0] == pytest.approx(buckling[1], rel=2e-3)  # EA changes its length


def test_its_work_in_motion():
    """The energy-conserving scheme closes the balance; that of second order does so within its error."""
    pulled = cf.Tendon(ROD, cf.Helical(0.01, LENGTH), cf.signals.Ramp(T, 0, 0.05))
    for scheme, exact in (("energy", 1e-11), ("momentum", 1e-3)):
        history = cf.simulate(arm(pulled), 0.1, dt=2e-3, scheme=scheme, elements=2)
        assert np.abs(history.balance).max() < exact * history.work.max()
    assert history.tendon(pulled).tension[-1] == pytest.approx(T)


@pytest.mark.slow
def test_the_tensions_that_bring_the_tip_to_a_point():
    """The derivatives by the tensions are those of differences, and lead to given tensions within four steps."""
    tensions, names = np.array([1.0, 1.0]), ["loads[0].tension", "loads[1].tension"]

    def tip(path):
        return path.position(ROD.end)[-1, :2]

    def pulled(tensions):
        tendons = (cf.Tendon(ROD, a, x) for a, x in zip([(0.01, 0), (0, 0.01)], tensions, strict=True))
        return cf.solve(arm(*tendons), [1.0], tol=1e-8)

    wanted = tip(pulled((4.0, 2.0)))
    for _ in range(4):
        path = pulled(tensions)
        found = path.sensitivity(tip, names)
        slopes = np.column_stack([found[name] for name in names])
        tensions = tensions + np.linalg.solve(slopes, wanted - tip(path))
    assert tensions == pytest.approx([4.0, 2.0], rel=1e-6)
    by_offset = path.sensitivity(lambda path: path.moment(ROD.start)[-1], ["loads[0].offset[0]"])["loads[0].offset[0]"]
    assert by_offset == pytest.approx((0, path.scene.loads[0].tension, 0), abs=1e-7)


def test_stored_states_and_kinks(tmp_path):
    """A tendon through three rings, polygonal: its length at rest by hand."""
    places = cf.signals.AlongTable((0, 0.1, 0.3), [(0.01, 0, 0), (0, 0.01, 0), (0, 0.01, 0)])
    path = cf.solve(arm(HELIX, cf.Tendon(ROD, places, 1.0)), [0.0, 1.0])
    path.save(tmp_path / "arm.h5")
    read = cf.read_result(tmp_path / "arm.h5")
    length = read.tendon(read.scene.loads[1]).length
    assert length[0] == pytest.approx(np.hypot(0.1, 0.01 * np.sqrt(2)) + 0.2, rel=1e-12)
    assert length == pytest.approx(path.tendon(path.scene.loads[1]).length, rel=1e-12)
    assert read.force("arm.start") == pytest.approx(path.force("arm.start"), abs=1e-12)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: cf.Tendon(ROD, (0.01, 0), -1.0), "a tension"),
        (lambda: cf.Tendon(ROD, (0.01, 0, 0), 1.0), "Tendon.offset"),
        (lambda: cf.Tendon(ROD, cf.signals.AlongPieces([(0.1, (0.01, 0, 0))]), 1.0), "without jumps"),
        (lambda: cf.Helical(0.0, 1.0), "Helical.radius"),
        (lambda: cf.Helical(0.1, 0.0), "not zero"),
        (lambda: cf.solve(arm(HELIX), [1.0], elements=2).tendon(TWO[0]), "no tendon of the scene"),
        (lambda: cf.simulate(arm(cf.Tendon(ROD, (0.01, 0), lambda t: 1 - 1e3 * t)), 0.01, dt=1e-3, elements=2),
         "a tension (N), not negative, at the time t ="),
        (lambda: cf.solve(arm(HELIX), [-1.0]), "load factor -1: the tension of Tendon on arm would be -1 times"),
        (lambda: cf.modes(arm(HELIX), load_factor=-1.0), "expected load factors at which no tendon is pressed"),
        (lambda: cf.solve(arm(HELIX), model="planar"), "planar"),
        (lambda: cf.solve(arm(TWO[0]), model="determinate"), "determinate"),
    ],
)  # fmt: skip
def test_what_is_refused(make, says):
    with pytest.raises(cf.SceneError) as found:
        make()
    assert says in str(found.value)


@pytest.mark.slow
def test_in_stages():
    """Tightened one after the other in one place, then one is released: the end is that of the other alone."""
    one, other = TWO[0], cf.Tendon(ROD, TWO[0].offset, 2.0)
    stages = [cf.Stage(loads=[other], load_factors=[1.0]), cf.Stage(release=one, load_factors=[0.5, 1.0])]
    path = cf.solve(cf.Scene([ROD], [cf.Clamp(ROD.start)], [one], stages=stages), [1.0], tol=1e-7)
    assert path.tendon(one).tension == pytest.approx([4.0, 4.0, 2.0, 0.0])
    assert path.tendon(other).tension == pytest.approx([0.0, 2.0, 2.0, 2.0])
    alone = cf.solve(arm(other), [1.0], tol=1e-7)
    assert path.position(ROD.end)[-1] == pytest.approx(alone.position(ROD.end)[-1], abs=1e-9)
    assert path.force(ROD.start)[-1] == pytest.approx(alone.force(ROD.start)[-1], abs=1e-7)
    pressed = [cf.Stage(release=one, load_factors=[1.5])]
    with pytest.raises(
        cf.SceneError, match=r"stages\[0\]: load factor 1.5: the tension of Tendon on arm would be -0.5"
    ):
        cf.solve(cf.Scene([ROD], [cf.Clamp(ROD.start)], [one], stages=pressed), [1.0])
