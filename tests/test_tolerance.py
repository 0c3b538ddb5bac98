"""The tolerance decides the work: the result is as accurate as asked for, and coarse meshes hide no event."""

import numpy as np
import pytest
from conftest import column

import cosserat_fenicsx as cf
from cosserat_fenicsx import analytic

pytestmark = pytest.mark.serial
TOLERANCES = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9]
_PLACES = np.linspace(0, 1, 101)
_STIFFNESS = cf.Stiffness((1e6, 1e6), 1e6, (1.0, 1.3), 1.0)


def eccentric(etas):
    """The paper's column; (rod, scene, its `Tip`s)."""
    rod, scene = column()
    k = rod.stiffness
    return rod, scene, analytic.reissner(etas, 0.2, rod.length, bending=k.bending[0], axial=k.axial, shear=k.shear[0])


def elastica(etas):
    """An inextensible cantilever under a transverse force of ten times EI/L^2."""
    rigid = cf.Stiffness((np.inf, np.inf), np.inf, (1.0, 1.0), 1.0)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1)), rigid, name="rod")
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (10.0, 0, 0))])
    return rod, scene, analytic.transverse_tip_force(10 * etas)


@pytest.mark.parametrize(("case", "last"), [(eccentric, 1.5), (elastica, 1.0)])
def test_as_accurate_as_asked_for(case, last):
    etas = np.linspace(0.1, last, 12)
    rod, scene, tip = case(etas)
    tip = np.column_stack([tip.delta, -tip.shortening])
    paths = [cf.solve(scene, etas.tolist(), tol=tol, bound=["position"]) for tol in TOLERANCES]
    truth = cf.solve(scene, etas.tolist(), elements=48).motion(rod, _PLACES)[:, :, :3]
    sizes = np.linalg.norm(truth, axis=2).max(axis=1)
    for tol, path in zip(TOLERANCES, paths, strict=True):
        off = np.linalg.norm(path.motion(rod, _PLACES)[:, :, :3] - truth, axis=2).max(axis=1) / sizes
        told = path.errors.position
        assert (off <= np.maximum(told, 1e-11)).all() and told.max() <= min(tol, 30 * off.max())
        assert path.error.max() <= tol
        found = path.displacement(rod.end)[:, [0, 2]]
        assert (np.linalg.norm(found - tip, axis=1) <= tol * np.linalg.norm(tip, axis=1)).all()
    counts = [path.elements[0] for path in paths]
    assert counts[0] <= 2 and counts == sorted(counts) and all(path.degree == 4 for path in paths)
    assert cf.solve(scene, etas.tolist(), tol=1e-3, degree=2).degree == 2


@pytest.mark.parametrize("model", ["auto", "spatial"])
def test_a_looser_tolerance_costs_less(model, monkeypatch):
    _, scene = column()
    etas, work = np.linspace(0.05, 1.5, 31).tolist(), []
    append, extend = cf.Path.append, cf.Path.extend

    def counted(path, more, add):
        work[-1] += path.unknowns * np.size(more.load_factor)
        return add(path, more)

    monkeypatch.setattr(cf.Path, "append", lambda path, record: counted(path, record, append))
    monkeypatch.setattr(cf.Path, "extend", lambda path, records: counted(path, records, extend))
    for tol in TOLERANCES[::2]:
        work.append(0)
        path = cf.solve(scene, etas, tol=tol, model=model)
        assert work[-1] <= 2.2 * len(etas) * path.unknowns  # of all points on the last mesh
    assert work == sorted(work) and work[-1] > 10 * work[0]


@pytest.mark.parametrize(
    ("held", "load"), [("free", np.pi**2 / 4), ("pinned", 20.19073), ("guided", 4 * np.pi**2), ("founded", 218.0)]
)
def test_columns_buckle_on_coarse_meshes_too(held, load, tol=1e-2):
    """Straight columns, whose positions any mesh represents exactly."""
    rod = cf.Rod(cf.Line((0, 0, 0), (1, 0, 0)), _STIFFNESS, name="rod")
    supports, loads = [cf.Clamp(rod.start)], [cf.Force(rod.end, (-load, 0, 0))]
    if held != "free":
        supports += [cf.Roller(rod.end, (0, 1, 0)), cf.Roller(rod.end, (0, 0, 1))]
    if held == "guided":
        supports.append(cf.Prescribed(rod.end, rotation=(0, 0, 0)))
    if held == "founded":  # half-waves of a fifth of the length
        loads.append(cf.Foundation(rod, 1e4))
    scene, etas = cf.Scene([rod], supports, loads), [0.5, 0.99, 1.01, 1.2]
    path, fine = cf.solve(scene, etas, tol=tol), cf.solve(scene, etas, elements=32, model="spatial")
    assert path.negative_modes.tolist() == fine.negative_modes.tolist() and path.negative_modes[-1] > 0
    found, exact = ([event.load_factor for event in p.events] for p in (path, fine))
    assert found == pytest.approx(exact, rel=max(tol, 1e-6))
    assert path.model == "spatial" and max(path.elements) >= 8


def twisted_rod():
    """Between clamps, one of which is free to approach; buckles under a torque of 8.98682 EI/L (tan x/2 = x/2)."""
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1)), cf.Stiffness((6e4, 6e4), 1.6e5, (1.0, 1.0), 2.5), name="rod")
    supports = [cf.Roller(rod.end, (1, 0, 0)), cf.Roller(rod.end, (0, 1, 0))]
    turned = cf.Prescribed(rod.end, rotation=(0, 0, 8.98682 / 2.5))
    return cf.Scene([rod], [cf.Clamp(rod.start), *supports, turned])


def deep_beam():
    """Thin, bent about its stiff axis, its end held against rotation: tilts at 0.7805 of its load (64 elements)."""
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1), d1=(1, 0, 0)), cf.Stiffness((6e5, 6e5), 1.6e6, (1e3, 1.0), 0.05))
    supports = [cf.Clamp(rod.start), cf.Roller(rod.end, (1, 0, 0)), cf.Prescribed(rod.end, rotation=(0, 0, 0))]
    return cf.Scene([rod], supports, [cf.Force(rod.end, (0, 8.0 * 0.7805, 0))])


@pytest.mark.parametrize("scene", [twisted_rod(), deep_beam()], ids=["twisted", "deep"])
def test_rods_buckle_under_moments_on_coarse_meshes_too(scene, tol=1e-3):
    for load, unstable in ((0.998, False), (1.002, True)):
        assert (cf.solve(scene, [0.5 * load, load], tol=tol).negative_modes[-1] > 0) == unstable
