"""Friction along tendons: closed forms of an arm that they bend, and numbers of shooting with independent code."""

import numpy as np
import pytest
from scipy.integrate import quad

import cosserat_fenicsx as cf
from cosserat_fenicsx.turning import slipped

EI, GJ, EA, GA, LENGTH, E, MU, T = 0.02, 0.016, 5000.0, 3000.0, 0.3, 0.01, 0.5, 8.0
SECTION = cf.Stiffness((GA, GA), EA, (EI, EI), GJ, mass=0.3, inertia=(1e-5, 1e-5, 2e-5))
ROD = cf.Rod(cf.Line((0, 0, 0), (0, 0, LENGTH)), SECTION, name="arm")
BENT = MU * T * E / EI  # of T/T0 = 1/(1 + BENT s) along a tendon at the offset E, since EI u = T e and T' = -mu T u


def arm(*loads, **more):
    return cf.Scene([ROD], [cf.Clamp(ROD.start)], loads, **more)


def beside(**more):
    return cf.Tendon(ROD, (E, 0), T, friction=MU, **more)


@pytest.mark.parametrize("pulled", ["start", "end"])
def test_beside_the_axis(pulled, truth):
    tendon = beside(pulled=pulled)
    path = cf.solve(arm(tendon), [0.0, 1.0], elements=12)

    def turned(s):
        return np.log1p(BENT * s) / MU if pulled == "start" else turned_from_end(LENGTH) - turned_from_end(LENGTH - s)

    def turned_from_end(s):
        return np.log1p(BENT * s) / MU

    def tension(s):
        return T / (1 + BENT * (s if pulled == "start" else LENGTH - s))

    tip = [quad(lambda s: (1 - tension(s) / EA) * f(turned(s)), 0, LENGTH, epsabs=1e-13)[0] for f in (np.sin, np.cos)]
    truth(f"tendons: friction, pulled at its {pulled}, end (m)", path.position(ROD.end)[-1], (tip[0], 0, tip[1]), 1e-8,
          of=1.0, most=1e-9)  # fmt: skip
    state = path.tendon(tendon)
    truth(f"tendons: friction, pulled at its {pulled}, tension along it", state.along[-1], tension(state.s), 1e-8)
    assert state.tension == pytest.approx([0, T]) and state.along.max(axis=1) == pytest.approx(state.tension)
    along_arc = cf.solve(arm(tendon), [1.0], elements=12, control="arc")
    assert along_arc.position(ROD.end)[-1] == pytest.approx(path.position(ROD.end)[-1], abs=1e-10)
    assert path.model == "spatial" and not path.conservative
    assert any("while the tendon slides towards" in line for line in path.why)


HELIX = cf.Helical(E, LENGTH)
FORCE = (0.05, -0.03, -0.1)


@pytest.mark.serial
@pytest.mark.parametrize(
    ("tendon", "force", "tip", "other_end", "length"),
    [
        (cf.Tendon(ROD, HELIX, 4.0, friction=0.3), FORCE,
         (0.0286693394402, 0.0186991247175, 0.2970730785398), 3.1817547020544, 0.3009696256043),
        (cf.Tendon(ROD, HELIX, 4.0, friction=0.3, pulled="end"), FORCE,
         (0.0236257276281, 0.0109666638661, 0.2978576870514), 3.1794767499218, 0.3010017238900),
        (cf.Tendon(ROD, (-E, 0), 8.0, friction=0.5), (0.12, 0, 0.05),
         (-0.0994687614658, 0, 0.2756314380063), 5.5595976512859, 0.2923161742936),
        (cf.Tendon(ROD, (-E, 0), 8.0, friction=0.5), (0.33, 0, 0),
         (-0.0277738565803, 0, 0.2958872794370), 6.4026511174175, 0.2956044595198),
    ],
    ids=["helical", "helical, pulled at its end", "with a force", "a curve that bends back"],
)  # fmt: skip
def test_under_a_force(tendon, force, tip, other_end, length, truth, request):
    path = cf.solve(arm(tendon, cf.Force(ROD.end, force)), [1.0], tol=1e-7)
    name = f"tendons: friction, {request.node.callspec.id}"
    truth(f"{name}, end (m)", path.position(ROD.end)[-1], tip, 1e-8, of=1.0)
    assert path.error[-1] * LENGTH > np.abs(path.position(ROD.end)[-1] - tip).max()
    state = path.tendon(tendon)
    truth(f"{name}, tension at the other end", state.along[-1].min() / T, other_end / T, 1e-7, of=1.0)
    assert state.length[-1] == pytest.approx(length, abs=1e-9)


@pytest.mark.serial
@pytest.mark.parametrize("force", [(0.12, 0, 0.05), (0.33, 0, 0)], ids=["one arc", "bends back"])
def test_estimates(force):
    """About the error to 30 times it, also of n and m, whose second derivatives jump where the tendon bends back."""
    scene = arm(cf.Tendon(ROD, (-E, 0), 8.0, friction=0.5), cf.Force(ROD.end, force))
    path, fine = cf.solve(scene, [1.0], tol=1e-6), cf.solve(scene, [1.0], elements=160)
    stations = [ROD.at(x) for x in np.linspace(0.001, 0.299, 60)]
    estimates = path.errors.position, path.errors.force, path.errors.moment
    for query, estimate in zip(("displacement", "force", "moment"), estimates, strict=True):
        of_path, exact = (np.array([getattr(x, query)(s)[-1] for s in stations]) for x in (path, fine))
        error = np.linalg.norm(of_path - exact, axis=1).max() / np.linalg.norm(exact, axis=1).max()
        assert 0.8 * error < estimate[-1] < 30 * error


@pytest.mark.serial
def test_along_a_tendon(tmp_path):
    """The tension along it is a quantity of the path, a table, a file and a chart."""
    loads = (beside(), cf.Tendon(ROD, HELIX, 1.0))
    path = cf.solve(arm(*loads), [0.0, 1.0], elements=4)
    state, along = path.tendon(loads[0]), path.to_dict()["rods"]["arm"]["tendon_tension"]
    assert along.shape == (2, 17, 2) and along[..., 0][:, ::4] == pytest.approx(state.along)
    assert along[1, :, 1] == pytest.approx(1.0)
    table = state.to_dataframe(units={"force": "kN"})
    assert table["tension along the tendon (kN) load factor 1"].to_numpy() == pytest.approx(state.along[-1] / 1e3)
    figure = state.plot_quantity("along")
    assert figure.axes[0].lines[1].get_ydata() == pytest.approx(state.along[-1])
    state.write(tmp_path / "tendon.csv")
    assert (tmp_path / "tendon_states.csv").read_text().startswith("state,tension (N),length (m),slack")


@pytest.mark.serial
def test_at_guides():
    """Through rings of a rod that hardly bends, its tension falls with the angle of each kink (Euler's rope)."""
    stiff = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1)), cf.Stiffness((1e9, 1e9), 1e9, (1e7, 1e7), 1e7), name="beam")
    places = [(0, 0, 0), (0.3, 0, 0), (0.3, 0.2, 0), (0, 0, 0)]
    rings = (0, 0.25, 0.5, 1.0)
    tendon = cf.Tendon(stiff, cf.signals.AlongTable(rings, places), 1.0, friction=0.4)
    path = cf.solve(cf.Scene([stiff], [cf.Clamp(stiff.start)], [tendon]), [1.0], elements=4)
    ways = np.diff([(x, y, s) for (x, y, _), s in zip(places, rings, strict=True)], axis=0)
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    fallen = np.exp(-0.4 * np.arccos((ways[1:] * ways[:-1]).sum(axis=1)).cumsum())
    state = path.tendon(tendon)
    assert state.along[-1, -1] == pytest.approx(fallen[-1], rel=1e-6)
    assert state.along[-1][np.searchsorted(state.s, 0.24)] == pytest.approx(fallen[0], rel=1e-6)


@pytest.mark.serial
def test_derivatives(truth):
    """Of the angle at the end, log(1 + mu T0 e L/EI)/mu, and of the tension there."""

    def angle(path):
        d3 = path.fields(-1)["d3"][-1]
        return np.arctan2(d3[0], d3[2])

    path, bent = cf.solve(arm(beside()), [1.0], elements=8), BENT * LENGTH
    names = ["loads[0].tension", "loads[0].friction", "loads[0].offset[0]"]
    slope = bent / (1 + bent) / MU
    expected = [slope / T, (slope - np.log1p(bent) / MU) / MU, slope / E]
    found = path.sensitivity(angle, names)
    ratios = [found[name] / value for name, value in zip(names, expected, strict=True)]
    truth("tendons: friction, derivatives of the angle at the end", ratios, np.ones(3), 1e-6, of=1.0)
    by_friction = path.sensitivity(lambda path: path.tendon(path.scene.loads[0]).along[-1, -1], names[1])[names[1]]
    assert by_friction == pytest.approx(-T / (1 + bent) ** 2 * bent / MU, rel=1e-5)


@pytest.mark.serial
@pytest.mark.parametrize("cells", [12, 60])
def test_where_it_sticks(cells):
    """In any state and after any change the cells satisfy the law, no thread is lost, and the derivatives are those of
    differences; in a guide of given shape the tension is Euler's, pulled, and where it is let go."""
    random, sizes, angles, EA = np.random.default_rng(3), np.full(cells, 1.0 / cells), np.full(cells, 1.0 / cells), 50.0
    pulled = slipped(sizes, sizes, angles, 8.0, EA, np.ones(cells, dtype=int))
    let_go = slipped(sizes, pulled.material, angles, 5.0, EA, pulled.ways)
    fallen = np.exp(-np.cumsum(angles))
    assert pulled.tensions == pytest.approx(8.0 * fallen, rel=1e-12)
    assert let_go.tensions == pytest.approx(np.minimum(5.0 / fallen, 8.0 * fallen), rel=1e-12)
    held = let_go
    for pull in (0.0, 6.0, 9.0, 1.0, 3.0):
        size = sizes * random.uniform(0.98, 1.02, cells)
        angle = random.uniform(0, 2, cells) * angles * (random.random(cells) > 0.1)
        before, held = held, slipped(size, held.material, angle, pull, EA, held.ways)
        own = np.maximum(EA * (size / held.material - 1), 0.0)
        assert held.tensions == pytest.approx(own, abs=1e-9)
        ahead, grown = np.concatenate([[pull], own[:-1]]), np.exp(angle) * (1 + 1e-9)
        assert (ahead <= own * grown + 1e-9).all() and (own <= ahead * grown + 1e-9).all()
        passed = np.cumsum((before.material - held.material)[::-1])[::-1]
        moves = (np.abs(passed) > 1e-12) & (angle > 0) & (ahead + own > 1e-9)
        assert (np.sign(passed[moves]) == np.sign(ahead - own)[moves]).all()
        by = 1e-8 * random.normal(size=(2, cells)) * [sizes, angle]
        sides = [slipped(size + sign * by[0], before.material, angle + sign * by[1], pull, EA, held.ways)
                 for sign in (1, -1)]  # fmt: skip
        difference = (sides[0].tensions - sides[1].tensions) / 2
        assert held.change(*by) == pytest.approx(difference, abs=1e-6 * np.abs(difference).max())


@pytest.mark.serial
def test_modes_of_one_that_sticks(truth):
    """As if it were a part of the section: EA of the tendon times the square of its strain, v_3 + e_2 u_1 - e_1 u_2."""
    axial, (e_1, e_2), row = 300.0, (E, 0.6 * E), np.array([0, 0, 1, 0.6 * E, -E, 0])
    whole = np.diag([GA, GA, EA, EI, EI, GJ]) + axial * np.outer(row, row)
    section = cf.Stiffness(matrix=whole.tolist(), mass=0.3, inertia=(1e-5, 1e-5, 2e-5))
    glued = cf.Rod(ROD.curve, section, name="arm")
    expected = cf.modes(cf.Scene([glued], [cf.Clamp(glued.start)]), 6, elements=4).frequencies
    for pulled in ("start", "end"):
        tendon = cf.Tendon(ROD, (e_1, e_2), 1e-6, friction=MU, axial=axial, pulled=pulled)
        found = cf.modes(arm(tendon), 6, load_factor=1.0, elements=4)
        truth("tendons: friction, frequencies of one that sticks", found.frequencies, expected, 1e-7)
    assert found.left_out == ("the slip of Tendon on arm",) and found.negative_modes == 0
    bent = arm(cf.Tendon(ROD, cf.Helical(E, LENGTH / 2), T, friction=MU, axial=axial))
    plain, damped = (cf.modes(bent, 4, load_factor=1.0, elements=4, damped=x) for x in (False, True))
    assert damped.frequencies == pytest.approx(plain.frequencies, rel=1e-8)
    path = cf.solve(bent, [1.0], elements=4)
    assert path.modes(4).modes[0].frequencies == pytest.approx(plain.frequencies, rel=1e-8)


@pytest.mark.serial
def test_in_stages():
    """What slides in one direction alone does not depend on the order of the loads. A load that comes later bends the
    arm at its foot, so that the tension falls farther up, and the tendon would slide back there."""
    tendon, force = beside(), cf.Force(ROD.end, (0, 0, -0.05))
    path = cf.solve(arm(force, stages=[cf.Stage(loads=[tendon], load_factors=[1.0])]), [1.0], elements=8)
    at_once = cf.solve(arm(tendon, force), [1.0], elements=8)
    assert path.position(ROD.end)[-1] == pytest.approx(at_once.position(ROD.end)[-1], abs=1e-11)
    assert path.tendon(tendon).along[-1] == pytest.approx(at_once.tendon(tendon).along[-1], rel=1e-10)
    with pytest.raises(cf.NotConverged, match=r"stages\[0\]: the Tendon of arm slides back at s = 0.2"):
        cf.solve(arm(tendon, stages=[cf.Stage(loads=[force], load_factors=[1.0])]), [1.0], elements=8)


@pytest.mark.serial
@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: cf.solve(arm(beside()), [1.0, 0.5], elements=4), "slides back at s = 0 m on the way to the load fact"),
        (lambda: cf.solve(arm(beside(permanent=True), cf.Force(ROD.end, (-0.5, 0, 0))), [1.0]), "slides back"),
        (lambda: cf.Tendon(ROD, (E, 0), 1.0, friction=-0.1), "coefficient of friction"),
        (lambda: cf.Tendon(ROD, (E, 0), 1.0, pulled="both"), "pulled"),
        (lambda: cf.Tendon(ROD, (E, 0), shortening=0.01, friction=0.1), "a given tension"),
        (lambda: cf.solve(arm(beside(), cf.Tendon(ROD, (0, E), shortening=1e-3)), [1.0]), "place of lengths"),
        (lambda: cf.solve(arm(beside()), [1.0], model="planar"), "has friction, which only the spatial model knows"),
        (lambda: cf.simulate(arm(beside()), 0.1), "does not stretch, and would stick with a blow"),
        (lambda: cf.simulate(arm(beside(axial=1e3)), 0.1, load_factor=0.0), "the load factor 0 no tension at all"),
        (lambda: cf.modes(arm(beside()), load_factor=1.0), "sticks in small motions: expected its stiffness EA"),
        (lambda: cf.modes(arm(beside(axial=1e3)), elements=2), "has friction and no tension"),
        (lambda: cf.buckling(arm(beside())), "expected friction=0, or paths of `solve`"),
    ],
)  # fmt: skip
def test_what_is_refused(make, says):
    with pytest.raises((cf.SceneError, cf.NotConverged)) as found:
        make()
    assert says in str(found.value)
