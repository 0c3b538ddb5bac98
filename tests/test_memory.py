"""Ever new meshes: compiled problems that leave the cache are freed, with what PETSc holds of them."""

import gc
import weakref

import pytest
from conftest import column

import cosserat_fenicsx as cf
from cosserat_fenicsx.algebra.pool import ProblemPool
from cosserat_fenicsx.dynamics import simulate as of_motions
from cosserat_fenicsx.models.rodmesh import RodMesh
from cosserat_fenicsx.statics import circulatory
from cosserat_fenicsx.statics import problem as of_equilibria

KEPT = 2
WORK = {
    "solve": lambda scene, n: cf.solve(scene, [0.1], elements=n, degree=2, model="spatial"),
    "arc length": lambda scene, n: cf.solve(scene, (0, 0.1), elements=n, degree=2, model="spatial", control="arc"),
    "simulate": lambda scene, n: cf.simulate(scene, 0.002, dt=0.001, elements=n, degree=2),
    "buckling": lambda scene, n: cf.buckling(scene, 1, elements=n, degree=2),
    "modes": lambda scene, n: cf.modes(scene, 1, elements=n, degree=2),
}


def resident():
    """The memory of this process, MB."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * 4096 / 1e6


@pytest.fixture
def small_cache(monkeypatch):
    pool = ProblemPool(most_idle=KEPT)
    for module in (of_equilibria, of_motions, circulatory):
        monkeypatch.setattr(module, "PROBLEMS", pool)


@pytest.fixture
def meshes(monkeypatch):
    """The meshes that are alive; the garbage collector sleeps."""
    alive, begin = weakref.WeakSet(), RodMesh.__init__
    monkeypatch.setattr(RodMesh, "__init__", lambda self, *given: alive.add(self) or begin(self, *given))
    gc.collect()
    gc.disable()
    yield alive
    gc.enable()


@pytest.mark.parametrize("work", WORK)
def test_what_leaves_the_cache_is_freed_at_once(work, small_cache, meshes):
    _, scene = column()
    for n in range(2, 6):
        WORK[work](scene, n)
    assert len(meshes) <= KEPT


@pytest.mark.serial
def test_memory_does_not_grow(small_cache):
    """A solve that is not freed leaves about 1 MB."""
    _, scene = column()
    for n in range(32, 36):
        WORK["arc length"](scene, n)
    before = resident()
    for n in range(20, 32):
        WORK["arc length"](scene, n)
    assert resident() - before < 3


@pytest.mark.serial
def test_a_users_error_leaves_nothing(small_cache, meshes):
    """What was half way is not kept, and not left behind either."""
    _, scene = column()
    for n in range(2, 5):
        with pytest.raises(ZeroDivisionError):
            cf.solve(scene, (0, 0.1), elements=n, degree=2, until=lambda path: 1 / 0)
    assert not meshes
