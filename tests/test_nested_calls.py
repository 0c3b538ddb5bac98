"""Nested calls: `solve` and `simulate` called from `until`, from a force as a
function of time and from threads, each with a problem of its own."""

import threading

import numpy as np
import pytest
from conftest import COMM, column
from moving_scenes import SPAGHETTI
from mpi4py import MPI

import cosserat_fenicsx as cf
from cosserat_fenicsx.algebra.pool import PROBLEMS, ProblemPool

HOPELESS = cf.StepControl(adaptive=False, max_iterations=5)
MOTION = {"dt": 0.05, "elements": 4, "degree": 2, "progress": False}


def pulled(force):
    """A clamped rod with a force, a function of time, at its end."""
    rod = cf.Rod(cf.Line((0, 0, 0), (10, 0, 0)), SPAGHETTI, name="rod")
    return rod, cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, force)])


def rising(t):
    return (0.0, 0.0, 50.0 * min(t, 0.2))


def and_nothing_more(*calls):
    """A function of any argument that makes the calls and returns False."""
    return lambda *_: bool([call() for call in calls] and False)


def tip_of_motion(force):
    rod, scene = pulled(force)
    return cf.simulate(scene, 0.4, **MOTION).displacement(rod.end)


def another_motion():
    rod, scene = pulled(lambda t: (0.0, 0.0, -80.0 * min(1.0, 20 * t)))
    return cf.simulate(scene, 0.1, **MOTION)


def test_solve_within_until():
    """The same signature with twice the eccentricity: sharing one problem gave 15.8724713 m."""
    rod, scene = column(eccentricity=0.2)
    _, other = column(eccentricity=0.4)
    inner = and_nothing_more(lambda: cf.solve(other, [0.3], elements=8))
    path = cf.solve(scene, (0.0, 1.5), elements=8, until=inner)
    assert path.displacement(rod.end)[-1, 0] == pytest.approx(15.8283154, abs=1e-6)
    plain = cf.solve(scene, (0.0, 1.5), elements=8)
    np.testing.assert_allclose(path.load_factors, plain.load_factors, rtol=1e-12)
    np.testing.assert_allclose(path.displacement(rod.end), plain.displacement(rod.end), atol=1e-10)


def test_calls_within_a_force():
    """A motion, an equilibrium, and both of them three deep, in a force as a function of time."""
    plain = tip_of_motion(rising)
    _, held = column(eccentricity=0.4)

    made = []

    def with_inner(call):
        def force(t):
            if abs(t - 0.075) < 1e-9:  # in the middle of the second step, since the function is sampled before too
                made.append(call())
            return rising(t)

        return force

    def deep():
        rod, scene = pulled(with_inner(another_motion))
        until = and_nothing_more(lambda: cf.simulate(scene, 0.1, **MOTION))
        return cf.solve(held, (0.0, 0.2), elements=4, until=until)

    def solved():
        return cf.solve(held, [0.3], elements=4)

    for inner in (another_motion, solved, deep):
        made.clear()
        np.testing.assert_allclose(tip_of_motion(with_inner(inner)), plain, atol=1e-12)
        assert made


def test_simulate_within_until():
    rod, scene = column()
    plain = cf.solve(scene, (0.0, 0.5), elements=4, model="spatial")
    path = cf.solve(scene, (0.0, 0.5), elements=4, model="spatial", until=and_nothing_more(another_motion))
    np.testing.assert_allclose(path.displacement(rod.end), plain.displacement(rod.end), atol=1e-12)


@pytest.mark.serial
def test_threads():
    """Four threads at once with the same signature."""
    columns = [column(eccentricity=e) for e in (0.1, 0.2, 0.3, 0.4)]

    def tip(k):
        rod, scene = columns[k]
        return cf.solve(scene, [0.4, 0.8], elements=8, model="spatial").displacement(rod.end)

    expected, found = [tip(k) for k in range(4)], {}
    threads = [threading.Thread(target=lambda k=k: found.update({k: tip(k)})) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for k in range(4):
        np.testing.assert_allclose(found[k], expected[k], atol=1e-10)


def test_results_outlive_their_problem():
    """Also the partial result of an error: results do not change when the problem is used for another scene."""
    rod, scene = column()
    _, other = column(eccentricity=1.0, length=13.0)
    for model in ("determinate", "planar", "spatial"):
        arguments = {"elements": 4, "model": model}
        looked_at = cf.solve(scene, [0.4], **arguments).fields(0)
        path = cf.solve(scene, [0.4], **arguments)
        until = and_nothing_more(lambda arguments=arguments: cf.solve(other, [0.7], **arguments))
        cf.solve(other, (0.0, 0.7), until=until, **arguments)
        for name, values in path.fields(0).items():
            np.testing.assert_array_equal(values, looked_at[name], err_msg=f"{model} {name}")
    expected = cf.solve(scene, [0.2], elements=4, model="planar", steps=HOPELESS).displacement(rod.end)
    with pytest.raises(cf.NotConverged) as failure:
        cf.solve(scene, [0.2, 30.0], elements=4, model="planar", steps=HOPELESS)
    cf.solve(other, [0.7], elements=4, model="planar")
    np.testing.assert_array_equal(failure.value.path.displacement(rod.end), expected)


def test_warm_calls_make_nothing():
    """Nor do calls that end with a solver's error, or that change to another model."""
    rod, scene = column(eccentricity=0.0)
    _, motion = pulled(rising)
    calls = (
        lambda: cf.solve(scene, [0.5, 1.05], elements=4),
        lambda: cf.simulate(motion, 0.1, **MOTION),
        lambda: cf.buckling(scene),
        lambda: cf.modes(scene, 2),
        lambda: pytest.raises(
            cf.NotConverged, cf.solve, column()[1], [30.0], elements=4, model="spatial", steps=HOPELESS
        ),
    )  # fmt: skip
    for call in calls:
        call()
    made = PROBLEMS.made
    for call in calls:
        call()
    assert PROBLEMS.made == made


# -- the pool itself ---------------------------------------------------------------------------------------------------


def used(pool, key, comm=MPI.COMM_WORLD, error=None):
    """Borrow and return a problem; an error may be raised in between."""
    try:
        with pool.lend(key, comm, object, KeyError) as problem:
            if error:
                raise error
    except type(error) if error else ():
        pass
    return problem


@pytest.mark.ranks
def test_a_busy_problem_is_not_lent():
    pool = ProblemPool()
    with pool.lend("a", COMM, object) as one, pool.lend("a", COMM, object) as other:
        assert one is not other
    assert used(pool, "a") is one and pool.made == 2  # the one given back last


@pytest.mark.ranks
def test_what_is_idle_is_bounded():
    """The work of one rank alone does not influence what all ranks create together."""
    pool = ProblemPool(most_idle=2)
    a = used(pool, "a")
    for key in range(10):
        used(pool, key, MPI.COMM_SELF)
    used(pool, "b")
    assert used(pool, "a") is a
    used(pool, "c")  # b was idle for the longest time
    made = pool.made
    assert used(pool, "a") is a and pool.made == made
    used(pool, "b")
    assert pool.made == made + 1


def test_what_may_be_half_way_is_not_kept():
    pool = ProblemPool()
    a = used(pool, "a")
    assert used(pool, "a", error=KeyError()) is a and used(pool, "a") is a
    assert used(pool, "a", error=KeyboardInterrupt()) is a and used(pool, "a") is not a


@pytest.mark.ranks
def test_on_a_communicator_of_the_users_own_nothing_is_kept():
    pool, comm = ProblemPool(), COMM.Dup()
    assert used(pool, "a", comm) is not used(pool, "a", comm)
    comm.Free()
