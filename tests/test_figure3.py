"""Figure 3: each comparison model against a reference solution, and the whole figure in its quick mode."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.polynomial import Legendre
from scipy.optimize import least_squares

import cosserat_fenicsx as cf
from cosserat_fenicsx import analytic
from cosserat_fenicsx.forms import truncated

pytestmark = pytest.mark.serial
sys.path.append(str(Path(__file__).parent.parent / "demos" / "evidence"))

from comparison import bar_mesh, corotational, curves, mcre
from comparison.column import Column
from comparison.follow import follow
from comparison.mcre_limit import TruncatedColumn
from comparison.solid_bar import SolidBar

ETAS = (0.5, 0.9, 1.0, 1.5)


def difference(function, x, direction, step):
    """Central difference of a function along a direction."""
    return (function(x + step * direction) - function(x - step * direction)) / (2 * step)


@pytest.mark.parametrize("arm", [False, True])
def test_the_corotational_beam_tends_to_the_rod_with_second_order(arm):
    """Order 2 at every load factor, and the extrapolated limit is Reissner's rod to 1e-6."""
    column, truth = Column(arm=arm), curves.exact(ETAS, arm)
    delta = np.array([corotational.solve(ETAS, n, column=column).delta for n in (32, 64, 128)])
    errors = np.abs(delta / truth - 1)
    assert np.log2(errors[:-1] / errors[1:]) == pytest.approx(2.0, abs=0.01)
    assert (4 * delta[2] - delta[1]) / 3 == pytest.approx(truth, rel=3e-6)


def test_one_jump_of_the_corotational_beam_is_not_the_path():
    """From the unloaded state Newton's method finds an unstable equilibrium at eta = 1.5, with its negative modes."""
    jumped = corotational.solve([1.5], 32, adaptive=False)
    followed = corotational.solve([1.5], 32)
    assert jumped.negative_modes[0] > 0 and jumped.delta[0] < 0
    assert followed.negative_modes[0] == 0 and followed.delta[0] == pytest.approx(curves.exact([1.5])[0], rel=1e-3)


@pytest.mark.parametrize(
    "law",
    [lambda q: corotational.beam(q, 0.7, 400.0, 150.0), lambda q: mcre.derivatives(mcre.energy(0.7, 400.0, 150.0), q)],
    ids=["co-rotational", "MCRE"],
)
def test_elements_have_consistent_tangents(law):
    q = 0.3 * np.random.default_rng(0).normal(size=(3, 6))
    hessian = law(q)[1]
    by_difference = np.stack([difference(lambda x: law(x)[0], q, unit, 1e-6) for unit in np.eye(6)], axis=-1)
    assert hessian == pytest.approx(by_difference, abs=1e-7 * np.abs(hessian).max())


def test_the_truncated_energy_is_the_rods_to_fourth_order():
    """Its difference from the exact energy is of fifth order; that of a pure rotation by phi is -EA phi^6/8."""
    EA, GA, EI = 300.0, 120.0, 1.7

    def error(size):
        u_s, w_s, phi, phi_s = size * np.array([0.3, -0.5, 0.8, 0.4])
        stretch = (1 + u_s) * np.cos(phi) + w_s * np.sin(phi) - 1
        shear = w_s * np.cos(phi) - (1 + u_s) * np.sin(phi)
        return (
            truncated.energy(u_s, w_s, phi, phi_s, EA, GA, EI) - (EA * stretch**2 + GA * shear**2 + EI * phi_s**2) / 2
        )

    assert np.log2(error(0.02) / error(0.01)) == pytest.approx(5.0, abs=0.05)
    phi = 0.01
    left = truncated.energy(np.cos(phi) - 1, np.sin(phi), phi, 0.0, EA, 0.0, EI)
    assert left == pytest.approx(-EA * phi**6 / 8, rel=1e-3)


def test_the_energy_of_an_mcre_is_that_of_the_rod_within_to_fourth_order():
    """Against the energy of the exact strains, minimised over the motions between the nodes."""
    length, EA, GA, EI = 0.7, 400.0, 150.0, 1.3
    tensors = mcre.energy(length, EA, GA, EI)
    x, weights = np.polynomial.legendre.leggauss(24)
    bubbles = [Legendre.basis(k + 2) - Legendre.basis(k) for k in range(8)]
    values = np.array([bubble(x) for bubble in bubbles])
    slopes = np.array([bubble.deriv()(x) for bubble in bubbles]) * 2 / length
    weight = np.sqrt(weights * length / 4)

    def strains(coefficients, start, end):
        (u_s, w_s, phi_s), phi = (end - start)[:, None] / length + coefficients @ slopes, coefficients[2] @ values
        phi = phi + (start[2] * (1 - x) + end[2] * (1 + x)) / 2
        stretch = (1 + u_s) * np.cos(phi) + w_s * np.sin(phi) - 1
        shear = w_s * np.cos(phi) - (1 + u_s) * np.sin(phi)
        return np.concatenate(
            [np.sqrt(EA) * weight * stretch, np.sqrt(GA) * weight * shear, np.sqrt(EI) * weight * phi_s]
        )

    def gap(size):
        q = size * np.array([0.2, 0.3, -0.5, -0.1, 0.9, 0.7])
        found = least_squares(
            lambda c: strains(c.reshape(3, -1), q[:3], q[3:]), np.zeros(24), xtol=1e-15, ftol=1e-15, gtol=1e-15
        )
        second, third, fourth = tensors
        quartic = (
            q @ second @ q + np.einsum("ijk,i,j,k", third, q, q, q) + np.einsum("ijkl,i,j,k,l", fourth, q, q, q, q)
        )
        return quartic - 2 * found.cost

    assert np.log2(gap(0.1) / gap(0.05)) == pytest.approx(5.0, abs=0.2)


@pytest.mark.parametrize(
    ("elements", "eta"), [(1, 0.311), (2, 0.464), (4, 0.584), (8, 0.606), (16, 0.609), (32, 0.611)]
)
def test_limit_points_of_the_mcre(elements, eta):
    """Shear factor 0.9: at a limit point the tangent is singular, and beyond it one mode is unstable."""
    problem = mcre.problem(elements, Column(shear_factor=0.9))
    found = mcre.limit(problem)
    assert found.eta == pytest.approx(eta, abs=6e-4)
    tangent = problem.linearise(found.x, found.eta, found.x)(np.eye(problem.size))
    softest = 1 / np.abs(np.linalg.eigvalsh((tangent + tangent.T) / 2)).max()
    assert softest < 1e-4 * np.pi**2 / 4
    stable = [point.negative_modes == 0 for point in mcre.branch(problem, 1.2 * found.delta)]
    assert stable[0] and not stable[-1] and stable == sorted(stable, reverse=True)


def test_bad_input_is_refused_in_words():
    with pytest.raises(cf.SceneError, match="elements = 0: expected a whole number above zero"):
        mcre.solve([0.1], 0)
    with pytest.raises(cf.SceneError, match="ascending"):
        corotational.solve([0.5, 0.2], 4)
    assert corotational.solve([0.0, 0.5, 0.5], 4).delta[0] == 0.0


def test_the_mcre_before_and_beyond_its_limit_point():
    curve = mcre.solve([0.3, 0.6, 0.7], 32, column=Column(shear_factor=0.9))
    assert curve.delta[1] == pytest.approx(0.4215, abs=1e-4) and curves.exact([0.6])[0] == pytest.approx(
        0.3768, abs=1e-4
    )
    assert len(curve.eta) == 2 and "beyond the load factor 0.61" in curve.stopped


@pytest.mark.slow
def test_ever_more_elements_tend_to_the_truncated_energy():
    """The limit point of forms/truncated.py on two meshes; those of the elements converge to it with second order."""
    limit = mcre.limit(TruncatedColumn())
    assert limit.eta == pytest.approx(mcre.limit(TruncatedColumn(8, 3)).eta, rel=1e-6)
    gaps = [limit.eta - mcre.limit(mcre.problem(n)).eta for n in (256, 512)]
    assert 0 < gaps[1] < gaps[0] / 3 < 1e-3


def test_the_mesh_of_the_bar():
    """Second moment of area (exactly) and area (to 1e-6) are those of
    the circle; no node of the surface is off it by 4e-4."""
    points, cells = bar_mesh.half_disc(0.1, 1)
    area, second = bar_mesh.moments(points, cells)
    assert second == pytest.approx(np.pi * 0.1**4 / 8, rel=1e-12) and area == pytest.approx(
        np.pi * 0.1**2 / 2, rel=1e-6
    )
    assert np.linalg.norm(points, axis=1).max() == pytest.approx(0.1, rel=4e-4)


@pytest.mark.slow
def test_the_solid_bar():
    """Its tangent is the derivative of its residual; a small load bends it as it bends the rod."""
    bar = SolidBar(Column(arm=True), along=8, refinement=1)
    rng = np.random.default_rng(1)
    x, direction = 1e-3 * rng.normal(size=(2, bar.size))
    for vector in (x, direction):
        vector[bar._fixed] = 0.0
    slope = difference(lambda y: bar.residual(y, 0.3), x, direction, 1e-4)
    assert bar.linearise(x, 0.3, x)(slope) == pytest.approx(direction, abs=1e-7)
    (point,) = follow(bar, [0.01], tolerance=1e-8)
    truth = analytic.reissner(
        0.01, 0.2, 20.0, bending=bar.column.bending, axial=bar.column.axial, shear=bar.column.shear, arm=True
    )
    delta, shortening, _ = bar.tip(point.x)
    assert delta == pytest.approx(truth.delta, rel=1e-3) and shortening == pytest.approx(truth.shortening, rel=1e-3)


@pytest.mark.slow
def test_figure3_is_broken_off_and_goes_on(tmp_path, monkeypatch, capsys):
    import figure3

    def broken(self, name, curve, points):
        keep(self, name, curve, points)
        if name == "solid" and len(curve["eta"]) == 2:
            raise KeyboardInterrupt

    keep = figure3.Store.keep_part
    monkeypatch.setattr(figure3.Store, "keep_part", broken)
    with pytest.raises(KeyboardInterrupt):
        figure3.main(tmp_path, quick=True)
    half = json.loads((tmp_path / "figure3.json").read_text(encoding="utf-8"))
    assert len(half["curves"]["solid"]["eta"]) == 2 and not half["complete"]

    monkeypatch.setattr(figure3.Store, "keep_part", keep)
    data = figure3.main(tmp_path, quick=True)
    assert "goes on from" in capsys.readouterr().err
    found = data["curves"]
    assert data["complete"] and data["machine"]["dolfinx"] and not list(tmp_path.glob("*.npz"))
    assert found["mixed"] == half["curves"]["mixed"] and found["solid"]["delta"][:2] == half["curves"]["solid"]["delta"]
    assert found["mixed"]["error"] < 1e-9 and found["displacement"]["error"] < 1e-6 and found["arm"]["error"] < 1e-9
    solid = np.array(found["solid"]["delta"])
    assert found["solid"]["eta"] == list(curves.QUICK.coarse_etas)
    assert solid == pytest.approx(curves.exact(found["solid"]["eta"], arm=True), rel=0.04)
    finer = found["solid"]["finer"]
    assert finer["eta"] == list(curves.QUICK.finer_etas) and finer["along"] == curves.QUICK.finer
    model = np.abs(np.array(finer["delta"]) / curves.exact(finer["eta"], arm=True) - 1)
    coarse = [found["solid"]["delta"][found["solid"]["eta"].index(eta)] for eta in finer["eta"]]
    assert (model < 0.7 * np.abs(np.array(coarse) / curves.exact(finer["eta"], arm=True) - 1)).all()
    table = (tmp_path / "figure3.md").read_text(encoding="utf-8")
    assert "24 hexahedra of second order along the bar" in table and "by the mesh alone" in table
    assert "+3.8 % at 0.9" in table and "0.311 with 1, 0.464 with 2, 0.611 with 32 elements" in table
    assert (tmp_path / "figure3.png").stat().st_size > 50000
